"""What a training file and a sweep file may say."""

from __future__ import annotations

from armtempo.configs.training._algorithms import NetworkConfig, PPOConfig, SACConfig, TQCConfig
from armtempo.configs.training._base import EnvironmentTraining
from armtempo.configs.training._blend import BlendTraining
from armtempo.configs.training._coordination import BenchmarkFilter, CoordinationTraining, DisturbanceConfig
from armtempo.configs.training._ik import IKTraining
from armtempo.configs.training._sweep import SearchedNumber, SweepConfig, SweepValue
from armtempo.configs.training._train import EvaluationConfig, ImitationConfig, TrainConfig

__all__ = [
    "BenchmarkFilter",
    "BlendTraining",
    "CoordinationTraining",
    "DisturbanceConfig",
    "EnvironmentTraining",
    "EvaluationConfig",
    "IKTraining",
    "ImitationConfig",
    "NetworkConfig",
    "PPOConfig",
    "SACConfig",
    "SearchedNumber",
    "SweepConfig",
    "SweepValue",
    "TQCConfig",
    "TrainConfig",
]

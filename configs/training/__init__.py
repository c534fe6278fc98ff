"""What a training file and a sweep file may say."""

from __future__ import annotations

from armtempo.configs.training._all import (
    BenchmarkFilter,
    BlendTraining,
    CoordinationTraining,
    DisturbanceConfig,
    EvaluationConfig,
    IKTraining,
    NetworkConfig,
    PPOConfig,
    SACConfig,
    TQCConfig,
    TrainConfig,
)
from armtempo.configs.training._sweep import SearchedNumber, SweepConfig, SweepValue

__all__ = [
    "BenchmarkFilter",
    "BlendTraining",
    "CoordinationTraining",
    "DisturbanceConfig",
    "EvaluationConfig",
    "IKTraining",
    "NetworkConfig",
    "PPOConfig",
    "SACConfig",
    "SearchedNumber",
    "SweepConfig",
    "SweepValue",
    "TQCConfig",
    "TrainConfig",
]

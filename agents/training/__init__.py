"""Training by Stable-Baselines3: environments, models, checkpoints, sweeps.

What needs torch loads when it is used, through ``load_training``.
"""

from __future__ import annotations

from armtempo.agents.training._extra import TRAINING, load_training
from armtempo.agents.training._sweep import Objective, SweepTrial, sweep
from armtempo.agents.training._sweep_objective import training_gap
from armtempo.agents.training._tasks import TASKS

__all__ = ["TASKS", "TRAINING", "Objective", "SweepTrial", "load_training", "sweep", "training_gap"]

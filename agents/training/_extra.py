"""What the training side says where its libraries are not installed."""

from __future__ import annotations

from importlib import import_module

from armtempo.errors import InputError

TRAINING = {  # public names that need the extra, and the modules that bring them
    "GraphNetwork": "armtempo.agents.training._graph_module",
    "ParallelVecEnv": "armtempo.agents.training.vec_envs._parallel",
    "VectorVecEnv": "armtempo.agents.training.vec_envs._vector",
    "Training": "armtempo.agents.training._train",
    "train": "armtempo.agents.training._train",
}


def load_training(name: str) -> object:
    """One of the names that need torch and stable-baselines3.

    Raises:
        InputError: They are not installed.
    """
    try:
        return getattr(import_module(TRAINING[name]), name)
    except ModuleNotFoundError as error:
        if error.name is None or error.name.startswith("armtempo"):
            raise
        raise InputError(
            f"{name} needs {error.name}, which is not installed", remedy='pip install "armtempo[rl]"'
        ) from error

"""What the training side says where its libraries are not installed."""

from __future__ import annotations

from importlib import import_module

from armtempo.errors import InputError

TRAINING = {  # public names that need the extra, and the modules that bring them
    "BatchVecEnv": "armtempo.agents._batch_vec_env",
    "ParallelVecEnv": "armtempo.agents._parallel_vec_env",
    "VectorVecEnv": "armtempo.agents._vector_vec_env",
    "Training": "armtempo.agents._train",
    "train": "armtempo.agents._train",
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

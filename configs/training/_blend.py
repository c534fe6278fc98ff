"""What a training in a blend cell says."""

from __future__ import annotations

from typing import Literal

from armtempo.configs.schema import Real
from armtempo.configs.training._base import EnvironmentTraining, File


class BlendTraining(EnvironmentTraining):
    """An arm that overrides the feed rate on a blended path."""

    cell: File = "lee2006"
    """Name of a bundled blend cell, or its file."""
    family: Literal["given", "polyline", "zigzag", "line-arc"] = "given"
    """Paths: the given one, or drawn for every episode."""
    profile: Literal["line-speed", "limit-aware"] = "line-speed"
    """The profile whose rate is overridden."""
    mapping: Literal["exact", "paper"] = "exact"
    """From the profile's length to the path's."""
    physics: Literal["ideal", "bullet", "mujoco"] = "ideal"
    """``ideal`` moves the arm exactly as commanded; ``bullet`` simulates torque control."""
    model_error: Real = 0.0
    """The simulated bodies are heavier by this share than the controller believes."""

"""What a training in an IK cell says."""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from armtempo.configs.schema import Positive, Real
from armtempo.configs.training._base import EnvironmentTraining, Few, File


class IKTraining(EnvironmentTraining):
    """An arm that follows poses."""

    cell: File = "chung"
    """Name of a bundled ik cell, or its file."""
    families: Annotated[
        tuple[Literal["given", "smooth", "near-singular", "partly-unreachable"], ...], Field(min_length=1)
    ] = ("given",)
    """Targets: the given one, or drawn. In ``ideal`` the ``targets`` take them in turn, else the environments do."""
    action_mode: Literal["speeds", "gains"] = "gains"
    """What an action means: joint speeds, or the gains of the paper's law."""
    physics: Literal["ideal", "bullet", "mujoco"] = "ideal"
    """``ideal`` moves the arm exactly as commanded; ``bullet`` simulates torque control."""
    model_error: Real = 0.0
    """The simulated bodies are heavier by this share than the controller believes."""
    reward_scale: Positive = 1.0
    """Multiplies what the algorithm is told, where rewards are too small to learn from; the curve has them unscaled."""
    targets: Few = 96
    """In ``ideal``: how many are drawn before the training, which takes one of them for every episode."""
    hold_periods: Few = 1
    """In ``ideal``: control periods for which the training holds an action, one agent step; the agent decides in each.
    What gains do to an error shows seconds later: a choice of 10 ms is lost in what is drawn."""

    @model_validator(mode="after")
    def _ideal(self) -> Self:
        for key in ("targets", "hold_periods"):
            if self.physics != "ideal" and key in self.model_fields_set:
                raise ValueError(f"{key}: needs physics: ideal")
        if self.targets < len(self.families):
            raise ValueError(f"targets: must be {len(self.families)} at least, one for each of the families")
        return self

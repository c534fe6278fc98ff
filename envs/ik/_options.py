"""What can be asked of episodes of a pose to follow: said once, for environments, evaluations and commands."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, TypedDict, get_args

from armtempo.envs.bodies import Physics
from armtempo.envs.common import check_bodies, check_names, check_time_limit
from armtempo.planners.cells import TARGET_FAMILIES, TargetFamilyName

ActionMode = Literal["speeds", "gains"]
ACTION_MODES: tuple[ActionMode, ...] = get_args(ActionMode)


@dataclass(frozen=True, kw_only=True)
class IKOptions:
    """Options of the episodes of an IK cell.

    Raises:
        UnknownNameError: No such action mode, family or physics.
        InputError: A value that an episode cannot have.
    """

    physics: Physics = "bullet"
    """"bullet", "mujoco": torque control in PyBullet or MuJoCo; "ideal": the arm exactly on its reference."""

    action_mode: ActionMode = "speeds"
    """What an action means: joint "speeds", or the feedback law's "gains"."""

    family: TargetFamilyName = "given"
    """Targets: the "given" one, or random ones: "smooth", "near-singular", "partly-unreachable"."""

    model_error: float = 0.0
    """With physics: by what share the simulated bodies are heavier than the controller believes."""

    max_episode_s: float | None = None
    """Time limit [s], if it is to end before its target."""

    def __post_init__(self) -> None:
        check_names(
            ("action mode", self.action_mode, ACTION_MODES), ("family of targets", self.family, TARGET_FAMILIES)
        )
        check_bodies(self.physics, model_error=self.model_error)
        check_time_limit(self.max_episode_s)


class IKKeywords(TypedDict, total=False):
    """``IKOptions`` as keywords."""

    physics: Physics
    action_mode: ActionMode
    family: TargetFamilyName
    model_error: float
    max_episode_s: float | None

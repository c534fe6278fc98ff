"""What can be asked of episodes on a blended path: said once, for environments, evaluations and commands."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, TypedDict, get_args

from armtempo.envs.bodies import Physics
from armtempo.envs.common import check_bodies, check_names, check_time_limit
from armtempo.planners.cells import PATH_FAMILIES, PROFILES, FamilyName, ProfileName

MappingName = Literal["exact", "paper"]
MAPPINGS: tuple[MappingName, ...] = get_args(MappingName)


@dataclass(frozen=True, kw_only=True)
class BlendOptions:
    """Options of the episodes of a blend cell.

    Raises:
        UnknownNameError: No such profile, mapping, family or physics.
        InputError: A value that an episode cannot have.
    """

    physics: Physics = "bullet"
    """"bullet", "mujoco": torque control in PyBullet or MuJoCo; "ideal": the arm exactly on its reference."""

    profile: ProfileName = "line-speed"
    """Speed along the path at full rate: the paper's "line-speed", or "limit-aware"."""

    mapping: MappingName = "exact"
    """From travelled length to the blend's parameter: "exact", or the "paper"'s predictor-corrector."""

    family: FamilyName = "given"
    """Paths: the "given" one, or random ones: "polyline", "zigzag", "line-arc"."""

    model_error: float = 0.0
    """With physics: by what share the simulated bodies are heavier than the controller believes."""

    max_episode_s: float | None = None
    """Time limit [s] instead of five times the profile's duration."""

    def __post_init__(self) -> None:
        check_names(
            ("profile", self.profile, PROFILES),
            ("mapping", self.mapping, MAPPINGS),
            ("family of paths", self.family, PATH_FAMILIES),
        )
        check_bodies(self.physics, model_error=self.model_error)
        check_time_limit(self.max_episode_s)


class BlendKeywords(TypedDict, total=False):
    """``BlendOptions`` as keywords."""

    physics: Physics
    profile: ProfileName
    mapping: MappingName
    family: FamilyName
    model_error: float
    max_episode_s: float | None

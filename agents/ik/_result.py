"""What a policy did in IK cells."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from armtempo.agents.evaluation import figure, numbers_of
from armtempo.envs import IKTrace


@dataclass(frozen=True, kw_only=True, eq=False)
class IKResult:
    """What a policy did; worst cases over all episodes, rms over all their ticks and the start.

    Attributes:
        position_error_rms_m: Distance of the tip from its target [m]; max and final (at the target's end) likewise.
        orientation_error_rms_rad: Angle of the rotation that is left [rad]; likewise.
        joint_speed_ratio_max: Largest |speed of a joint, from tick to tick| / cap.
        torque_ratio_max: Largest |applied torque| / limit.
        torque_demand_ratio_max: Largest |demanded torque| / limit, before clipping.
        damped_fraction: Share of the ticks nearer to singular than where the cell's law is damped.
        capped_fraction: Share of the ticks in which a cap or limit cut what was asked for.
        reward: Mean reward.
        succeeded: Episodes with rms errors below the cell's scales.
        other_engine_rad: How far another physics engine puts the arms after a tick of the first episode, at most
            [rad, m]; None where it was not asked.
        trace: Of the first episode.
    """

    position_error_rms_m: float = figure("position\nrms [mm]", scale=1e3, form="significant")
    position_error_max_m: float = figure("\nmax", scale=1e3, form="significant")
    position_error_final_m: float = figure("\nfinal", scale=1e3, form="significant")
    orientation_error_rms_rad: float = figure("orient.\nrms [rad]", form="significant")
    orientation_error_max_rad: float = figure("\nmax", form="significant")
    orientation_error_final_rad: float = figure()
    joint_speed_ratio_max: float = figure("speed\n[x cap]")
    torque_ratio_max: float = figure()
    torque_demand_ratio_max: float = figure("torque\n[x limit]", limit=1.0)
    damped_fraction: float = figure("damped\n[%]", digits=1, scale=100.0)
    capped_fraction: float = figure("cut\n[%]", digits=1, scale=100.0)
    reward: float = figure("reward", digits=4)
    succeeded: int = figure("good", form="episodes")
    other_engine_rad: float | None = figure("other\nengine [rad]", form="significant", default=None, known=True)
    trace: IKTrace = field(repr=False)

    def to_dict(self) -> dict[str, Any]:
        """The numbers, by name."""
        return numbers_of(self)

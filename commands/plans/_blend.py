"""Plans of a blend cell: line-speed profiles over its path, what they ask of the arm, and the corners.

``line-speed``         the paper's profile: limits along the path only
``limit-aware``        the profile that also keeps normal acceleration and the jerk vector
``limit-aware-smooth`` the same on corners without a jump of curvature, where it need not stop: quintic blends
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from armtempo.arrays import Floats
from armtempo.commands.console import LIMIT_RESOLVED, new_table, number
from armtempo.commands.plans._motions import instants, joint_motion
from armtempo.commands.plans._plans import CellPlans
from armtempo.planners import BlendCell, LineSpeedProfile
from armtempo.planners.blends import Blend
from armtempo.planners.cells import MotionDemand, motion_demand
from armtempo.planners.exports import RobotMotion
from armtempo.planners.topp import JointTrajectory

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from rich.table import Table

PROFILES: Mapping[str, tuple[str, str | None]] = {  # the profile; the curve of the corners, or None: as given
    "line-speed": ("line-speed", None),
    "limit-aware": ("limit-aware", None),
    "limit-aware-smooth": ("limit-aware", "quintic"),
}
PROFILE_SAMPLES = 16001  # of a profile, besides its knots
BLEND_SAMPLES = 401  # of a blend

HEADS = (
    "duration\n\\[s]",
    "lower\nbound \\[s]",
    "slowest in\na blend \\[mm/s]",
    "acceleration\nalong \\[x]",
    "normal\n\\[x]",
    "jerk\n\\[x]",
    "torque\n\\[x]",
    "joint speed\n\\[x]",
    "planned in\n\\[s]",
)


@dataclass(frozen=True, kw_only=True, eq=False)
class BlendPlan:
    """A profile over the path of a cell.

    Attributes:
        cell: Given, or a variant with other corners.
        profile: Travelled length over time.
    """

    cell: BlendCell
    profile: LineSpeedProfile

    @cached_property
    def time(self) -> Floats:
        """(T,) instants [s]: evenly over the profile, and its knots."""
        return np.union1d(np.linspace(0.0, self.profile.duration, PROFILE_SAMPLES), self.profile.knots)

    @cached_property
    def states(self) -> tuple[Floats, Floats, Floats, Floats]:
        """Length, speed, acceleration and jerk along the path at ``time``, each (T,)."""
        return self.profile.at(self.time)

    @property
    def s(self) -> Floats:
        """(T,) travelled length [m]."""
        return self.states[0]

    @property
    def v(self) -> Floats:
        """(T,) line speed [m/s]."""
        return self.states[1]

    @property
    def a(self) -> Floats:
        """(T,) acceleration along the path [m/s^2]."""
        return self.states[2]

    @property
    def j(self) -> Floats:
        """(T,) jerk along the path [m/s^3]."""
        return self.states[3]

    @property
    def torque(self) -> Floats:
        """(T, n) [N m, N]."""
        return self.joints.torque

    @property
    def joint_speed(self) -> Floats:
        """(T, n) [rad/s, m/s]."""
        return self.joints.qd

    @cached_property
    def joints(self) -> JointTrajectory:
        """What the joints do at ``time``."""
        return joint_motion(self.cell.arm, self.cell.path, self.time, self.s, self.v, self.a)

    @cached_property
    def demand(self) -> MotionDemand:
        """What it asks of the limits and of the arm."""
        return motion_demand(self.cell, *self.states)

    @cached_property
    def slowest(self) -> float | None:
        """Lowest speed inside a blend [m/s]; None without a blend."""
        speeds = []
        for low, high in blend_ranges(self.cell):
            start, end = self.profile.time_at([low, high])
            speeds.append(float(self.profile.at(np.linspace(start, end, BLEND_SAMPLES))[1].min()))
        return min(speeds, default=None)

    def motion(self, period: float) -> JointTrajectory:
        """Joints every ``period`` [s] and exactly at the end."""
        return self.sampled(instants(self.profile.duration, period))

    def sampled(self, time: Floats) -> JointTrajectory:
        """Joints at instants (T,) [s]; at rest behind the end."""
        s, v, a, _ = self.profile.at(time)
        moves = time <= self.profile.duration
        return joint_motion(self.cell.arm, self.cell.path, time, s, v * moves, a * moves)


def blend_ranges(cell: BlendCell) -> list[tuple[float, float]]:
    """Lengths [m] between which the path is in a blend."""
    ends = cell.blended.breakpoints.tolist()
    pieces = zip(cell.blended.pieces, ends[:-1], ends[1:], strict=True)
    return [(low, high) for piece, low, high in pieces if isinstance(piece, Blend)]


def corners(cell: BlendCell) -> list[dict[str, Any]]:
    """The blends of a path in order, units in the keys."""
    blends = [piece for piece in cell.blended.pieces if isinstance(piece, Blend)]
    return [
        {
            "start_m": low,
            "end_m": high,
            "corner_distance_m": piece.deviation,
            "remaining_before_m": piece.start_remaining,
            "remaining_behind_m": piece.end_remaining,
            "continuity_before": piece.continuity[0],
            "continuity_behind": piece.continuity[1],
            "curvature_max_1_m": float(cell.blended.curvature(np.linspace(low, high, BLEND_SAMPLES)[1:-1]).max()),
        }
        for piece, (low, high) in zip(blends, blend_ranges(cell), strict=True)
    ]


class BlendPlans(CellPlans[BlendCell, BlendPlan]):
    METHODS = tuple(PROFILES)

    def plan(self, method: str) -> BlendPlan:
        profile, curve = PROFILES[method]
        cell = self.cell if curve is None else self.cell.variant(curve=curve)
        return BlendPlan(cell=cell, profile=cell.profile(profile))

    def facts(self) -> dict[str, Any]:
        cell, limits = self.cell, self.cell.limits
        return {
            "cell": cell.name,
            "length_m": cell.blended.length,
            "curve": cell.config.blend.curve,
            "line_speed_m_s": limits.speed,
            "acceleration_limit_m_s2": limits.acceleration,
            "normal_acceleration_limit_m_s2": limits.normal,
            "jerk_limit_m_s3": limits.jerk,
        }

    def entries(self) -> dict[str, dict[str, Any]]:
        return {
            name: {
                "duration_s": plan.profile.duration,
                "lower_bound_s": plan.profile.bound.seconds,
                "length_m": plan.cell.blended.length,
                "curve": plan.cell.config.blend.curve,
                "blend_speed_min_m_s": plan.slowest,
                **asdict(plan.demand),
                "certificate": asdict(plan.profile.certificate),
                "corners": corners(plan.cell),
                "planning_time_s": self.seconds[name],
            }
            for name, plan in self.plans.items()
        }

    def tables(self, entries: Mapping[str, Mapping[str, Any]]) -> list[Table]:
        limits = self.cell.limits
        table = new_table(
            f"Plans for {self.cell.name}",
            f"line speed {limits.speed:g} m/s; shares of limits: acceleration along the path "
            f"{limits.acceleration:.4g} m/s^2 and across it {limits.normal:.4g} m/s^2, jerk {limits.jerk:g} m/s^3, "
            "joint torques and speeds",
        )
        table.add_column("method", no_wrap=True)
        for head in HEADS:
            table.add_column(head, justify="right")
        for name, entry in entries.items():
            table.add_row(
                name,
                number(entry["duration_s"], 4),
                number(entry["lower_bound_s"], 4),
                number(entry["blend_speed_min_m_s"], 1, 1e3),
                share(entry["certificate"]["acceleration_ratio_max"]),
                share(entry["normal_ratio_max"]),
                share(entry["jerk_ratio_max"]),
                share(entry["torque_ratio_max"]),
                share(entry["joint_speed_ratio_max"]),
                number(entry["planning_time_s"], 3),
            )
        return [table, _corner_table(entries)]

    def motions(self, period: float | None) -> Iterator[tuple[str, JointTrajectory]]:
        for name, plan in self.plans.items():
            yield f"{name}-{plan.cell.arm.name}", plan.motion(plan.cell.physics_tick if period is None else period)

    def robot_motion(self, name: str, rate_hz: float) -> RobotMotion:
        plan = self.plans[name]
        return RobotMotion.sampled([plan.cell.arm], [plan.sampled], duration=plan.profile.duration, rate_hz=rate_hz)

    def figures(self, method: str) -> dict[str, Figure]:
        from armtempo.commands.figures._blend import blend_plan_figures  # late: matplotlib

        return blend_plan_figures(self.plans)


def share(ratio: float) -> str:
    """A share of a limit, red where it is above."""
    text = number(ratio, 3)
    return f"[red]{text}[/]" if math.isfinite(ratio) and ratio > LIMIT_RESOLVED else text


def _corner_table(entries: Mapping[str, Mapping[str, Any]]) -> Table:
    """The corners of every curve that is planned on."""
    table = new_table("Corners", "continuity: 1 tangent, 2 curvature, 3 its slope; the curvature jumps below 2")
    table.add_column("curve", no_wrap=True)
    for head in (
        "corner",
        "distance from\nthe vertex \\[mm]",
        "remaining \\[mm]\nbefore",
        "\nbehind",
        "continuity\nbefore",
        "\nbehind",
        "curvature\n\\[1/m]",
    ):
        table.add_column(head, justify="right")
    for curve, found in {entry["curve"]: entry["corners"] for entry in entries.values()}.items():
        for k, corner in enumerate(found):
            table.add_row(
                curve if k == 0 else "",
                str(k + 1),
                number(corner["corner_distance_m"], 2, 1e3),
                number(corner["remaining_before_m"], 2, 1e3),
                number(corner["remaining_behind_m"], 2, 1e3),
                str(corner["continuity_before"]),
                str(corner["continuity_behind"]),
                number(corner["curvature_max_1_m"], 2),
            )
    return table

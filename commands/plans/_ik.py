"""Plans of an IK cell: runs of inverse kinematics along its target, tick by tick, without an arm that has to move.

``law``         the cell's law as it stands, damped and within its caps
``feedback``    with its gains, without feed-forward, all but undamped and without caps
``feedback-ff`` that with both feed-forwards
``newton``      one Newton step per tick, all but undamped and without caps
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from armtempo.arrays import Floats
from armtempo.commands.console import LIMIT_RESOLVED, new_table, number, significant
from armtempo.commands.plans._motions import run_for_robots, run_motion
from armtempo.commands.plans._plans import CellPlans
from armtempo.planners import FeedbackIK, IKCell, NewtonIK
from armtempo.planners.exports import RobotMotion
from armtempo.planners.ik import IKRun
from armtempo.planners.topp import JointTrajectory

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from rich.table import Table

UNDAMPED = 1e-6  # damping of a law that damps nothing

HEADS = (
    "position\nrms \\[mm]",
    "\nmax",
    "\nbound",
    "orient.\nmax \\[rad]",
    "\nbound",
    "bounds\nheld",
    "speed\n\\[x cap]",
    "torque\n\\[x limit]",
    "singular\nvalue",
    "damped\n\\[%]",
    "planned\nin \\[s]",
)


@dataclass(frozen=True, kw_only=True, eq=False)
class IKPlan:
    """A run along the target of a cell."""

    cell: IKCell
    run: IKRun

    @cached_property
    def motion(self) -> JointTrajectory:
        """Its joints, tick by tick."""
        return run_motion(self.cell.arm, self.run)

    @cached_property
    def singular_value(self) -> Floats:
        """(T,) smallest singular value of the task's Jacobian."""
        return self.cell.singular_value(self.run.q)

    @cached_property
    def tip(self) -> Floats:
        """(T, 3) where it has the tip [m]."""
        return np.asarray(self.cell.arm.tip_pose(self.run.q)[:, :3, 3])

    @property
    def time(self) -> Floats:
        """(T,) [s]."""
        return self.run.time

    @property
    def position_error(self) -> Floats:
        """(T,) [m]."""
        return self.run.position_error

    @property
    def orientation_error(self) -> Floats:
        """(T,) angle of the whole rotation [rad]."""
        return self.run.orientation_error

    @property
    def joint_speed(self) -> Floats:
        """(T, n) [rad/s, m/s]."""
        return self.run.qd

    @property
    def torque(self) -> Floats:
        """(T, n) if the joints moved so [N m, N]."""
        return self.motion.torque

    @property
    def error_bounds(self) -> tuple[Floats, Floats] | None:
        """Bounds (T,) of the errors of position [m] and orientation [rad, pi: none]; None of what states no bounds."""
        bounds = self.run.bounds
        return (bounds.position, bounds.orientation) if np.isfinite(bounds.position).all() else None


class IKPlans(CellPlans[IKCell, IKPlan]):
    METHODS = ("law", "feedback", "feedback-ff", "newton")

    def plan(self, method: str) -> IKPlan:
        cell = self.cell
        if method == "law":
            run = cell.solver.track(cell.target, cell.start)
        elif method == "newton":
            run = NewtonIK(cell.arm, damping=UNDAMPED, task=cell.solver.task).track(cell.target, cell.start)
        else:
            run = self._undamped(feed_forward=method == "feedback-ff").track(cell.target, cell.start)
        return IKPlan(cell=cell, run=run)

    def _undamped(self, *, feed_forward: bool) -> FeedbackIK:
        """The cell's law without damping and caps."""
        cell = self.cell
        return FeedbackIK(
            cell.arm,
            cell.solver.gains,
            error=cell.law.error,
            feed_forward=feed_forward,
            task=cell.solver.task,
            damping=UNDAMPED,
            joint_speed_max=np.full(cell.arm.dof, np.inf),
        )

    def facts(self) -> dict[str, Any]:
        cell = self.cell
        return {
            "cell": cell.name,
            "duration_s": cell.duration,
            "tick_s": cell.physics_tick,
            "damping": cell.damping,
        }

    def entries(self) -> dict[str, dict[str, Any]]:
        return {name: self._entry(plan, self.seconds[name]) for name, plan in self.plans.items()}

    def _entry(self, plan: IKPlan, seconds: float) -> dict[str, Any]:
        run, bounds, arm = plan.run, plan.run.bounds, self.cell.arm
        return {
            "position_error_rms_m": float(np.sqrt(np.mean(run.position_error**2))),
            "position_error_max_m": float(run.position_error.max()),
            "position_error_final_m": float(run.position_error[-1]),
            "position_bound_max_m": float(bounds.position.max()) if plan.error_bounds else None,
            "position_bound_ultimate_m": bounds.ultimate_position,
            "approach_error_max_rad": float(run.approach_error.max()),
            "approach_bound_max_rad": float(bounds.approach.max()) if plan.error_bounds else None,
            "orientation_error_rms_rad": float(np.sqrt(np.mean(run.orientation_error**2))),
            "orientation_error_max_rad": float(run.orientation_error.max()),
            "orientation_bound_max_rad": float(bounds.orientation.max()) if plan.error_bounds else None,
            "bounds_held": run.held if plan.error_bounds else None,
            "joint_speed_ratio_max": float(np.max(np.abs(run.qd) / arm.speed_max)),
            "torque_ratio_max": float(np.max(np.abs(plan.motion.torque) / arm.torque_max)),
            "singular_value_min": float(plan.singular_value.min()),
            "shares": run.share,
            "planning_time_s": seconds,
        }

    def tables(self, entries: Mapping[str, Mapping[str, Any]]) -> list[Table]:
        cell = self.cell
        table = new_table(
            f"Plans for {cell.name}",
            f"inverse kinematics at ticks of {1e3 * cell.physics_tick:g} ms over {cell.duration:g} s; bound: the "
            "largest that the law itself gives for its error, held: by the errors at all ticks; torque: if the joints "
            f"moved so; damped: share of the time below a singular value of {cell.damping:g}",
        )
        table.add_column("method", no_wrap=True)
        for head in HEADS:
            table.add_column(head, justify="right")
        for name, entry in entries.items():
            held = entry["bounds_held"]
            table.add_row(
                name,
                _digits(entry["position_error_rms_m"], 1e3),
                _digits(entry["position_error_max_m"], 1e3),
                _digits(entry["position_bound_max_m"], 1e3),
                _digits(entry["orientation_error_max_rad"]),
                _bound_of_angle(entry["orientation_bound_max_rad"]),
                "–" if held is None else "yes" if all(held.values()) else "[bold red]no[/]",
                _ratio(entry["joint_speed_ratio_max"]),
                _ratio(entry["torque_ratio_max"]),
                number(entry["singular_value_min"], 3),
                number(entry["shares"]["damped"], 1, 100.0),
                number(entry["planning_time_s"], 3),
            )
        return [table]

    def motions(self, period: float | None) -> Iterator[tuple[str, JointTrajectory]]:
        arm = self.cell.arm
        for name, plan in self.plans.items():
            yield f"{name}-{arm.name}", plan.motion if period is None else run_motion(arm, plan.run, period)

    def robot_motion(self, name: str, rate_hz: float) -> RobotMotion:
        return run_for_robots(self.cell.arm, self.plans[name].run, rate_hz)

    def figures(self, method: str) -> dict[str, Figure]:
        from armtempo.commands.figures._ik import ik_plan_figures  # late: matplotlib

        return ik_plan_figures(self.plans)


def _digits(value: float | None, scale: float = 1.0) -> str:
    """Three digits that count, or a dash."""
    return "–" if value is None else significant(scale * value)


def _bound_of_angle(value: float | None) -> str:
    """A bound of an angle; half a turn bounds nothing."""
    return "–" if value is None or value >= np.pi else _digits(value)


def _ratio(value: float) -> str:
    return f"[red]{_digits(value)}[/]" if value > LIMIT_RESOLVED else _digits(value)

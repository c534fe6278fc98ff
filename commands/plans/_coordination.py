"""Plans of a coordination cell: schedules by every method, with their certificates."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import combinations, permutations
from typing import TYPE_CHECKING, Any, Literal

from armtempo.commands.console import find_bound, new_table, number, shown
from armtempo.commands.plans._plans import CellPlans
from armtempo.planners import METHODS, CoordinationCell, Schedule, schedule
from armtempo.planners.exports import RobotMotion
from armtempo.planners.schedules import SHAPED, SHIFTED
from armtempo.planners.topp import JointTrajectory

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from rich.table import Table

EXPORT_PERIOD = 0.001  # [s] of exported motions

HEADS = (
    "makespan\n\\[s]",
    "saving\n\\[%]",
    "gap\n\\[%]",
    "clearance\n\\[mm]",
    "peak torque\n\\[x limit]",
    "peak speed\n\\[x limit]",
    "free between\nsamples",
    "planned in\n\\[s]",
)
SMOOTH_HEADS = ("peak jerk\n\\[x limit]", "price of\njerk limits\n\\[%]")


class CoordinationPlans(CellPlans[CoordinationCell, Schedule]):
    METHODS = METHODS
    SHOWN = "vci"
    HAS_CONTROL_PERIOD = True
    HAS_SMOOTH = True

    def prepare(self, tell: Callable[[str], object]) -> None:
        cell = self.cell
        _ = cell.fastest, [cell.chart_between(*pair) for pair in combinations(range(len(cell.arms)), 2)]
        find_bound(cell, tell)

    def named(self, methods: Sequence[str]) -> Sequence[str]:
        arms, asked = self.cell.arms, self.orders
        self._asked: dict[str, tuple[str, Sequence[int] | Literal["best", "file"]]] = {}
        for method in methods:
            if asked != "all" or len(arms) < 2 or method not in (*SHIFTED, *SHAPED):
                self._asked[method] = method, "file" if asked == "file" else "best"
                continue
            for order in permutations(range(len(arms))):
                self._asked[f"{method} {','.join(arms[i].name for i in order)}"] = method, order
        return list(self._asked)

    def plan(self, method: str) -> Schedule:
        name, order = self._asked[method]
        period = self.control_period if name == "vci" else None
        return schedule(self.cell, name, order=order, period=period, smooth=self.smooth)

    def facts(self) -> dict[str, Any]:
        cell = self.cell
        return {
            "cell": cell.name,
            "lower_bound_s": cell.lower_bound,
            "lower_bound_complete": cell.timing.joint.complete,
            "sequential_s": cell.sequential_makespan,
            "d_min_m": cell.d_min,
            "clearance_reserve_m": cell.config.clearance_reserve_m,
            "control_period_s": cell.control_period if self.control_period is None else self.control_period,
        }

    def entries(self) -> dict[str, dict[str, Any]]:
        return {name: self._entry(plan, self.seconds[name]) for name, plan in self.plans.items()}

    def _entry(self, plan: Schedule, seconds: float) -> dict[str, Any]:
        cell, certificate = self.cell, plan.certificate
        entry: dict[str, Any] = {
            "makespan_s": plan.makespan,
            "saving_percent": 100.0 * (1.0 - plan.makespan / cell.sequential_makespan),
            "gap_percent": plan.gap_percent,
            "min_clearance_m": certificate.min_clearance,
            "torque_ratio_max": certificate.torque_ratio_max,
            "speed_ratio_max": certificate.speed_ratio_max,
            "jerk_ratio_max": certificate.jerk_ratio_max,
            "smoothing_price_percent": plan.smoothing_price_percent,
            "certified_free": certificate.certified_free,
            "end_error_lambda": certificate.end_error,
            "fallback": plan.fallback,
            "arrival_s": {arm.name: motion.duration for arm, motion in zip(cell.arms, plan.trajectories, strict=True)},
            "order": [cell.arms[i].name for i in plan.order],
            "planning_time_s": seconds,
        }
        if plan.vci is not None:
            entry["corrections"] = plan.vci.corrections
            entry["longest_vci_s"] = plan.vci.longest_interval
        return entry

    def tables(self, entries: Mapping[str, Mapping[str, Any]]) -> list[Table]:
        cell = self.cell
        stopped = "" if cell.timing.joint.complete else " (its search was stopped: it may be higher)"
        reserve = f"d_min {1e3 * cell.d_min:g} mm + {1e3 * cell.config.clearance_reserve_m:g} mm reserve"
        bound, sequential = f"certified lower bound {cell.lower_bound:.4f} s{stopped}", cell.sequential_makespan
        table = new_table(f"Plans for {cell.name}", f"{bound}; one after the other {sequential:.4f} s; {reserve}")
        table.add_column("method", no_wrap=True)
        for head in HEADS:
            table.add_column(head, justify="right")
        for head in SMOOTH_HEADS if self.smooth else ():
            table.add_column(head, justify="right")
        told = len(cell.arms) > 1 and self.orders != "all"  # else the names of the plans tell
        if told:
            table.add_column("priority")
        best = min(entry["makespan_s"] for entry in entries.values())
        for name, entry in entries.items():
            table.add_row(
                name if entry["fallback"] is None else f"{name} (by {entry['fallback']})",
                number(entry["makespan_s"], 4),
                number(entry["saving_percent"], 1),
                number(entry["gap_percent"], 2),
                number(entry["min_clearance_m"], 2, 1e3),
                number(entry["torque_ratio_max"], 4),
                number(entry["speed_ratio_max"], 3),
                "–" if len(cell.arms) == 1 else "yes" if entry["certified_free"] else "[red]no[/]",
                number(entry["planning_time_s"], 3),
                *(
                    [number(entry["jerk_ratio_max"], 3), number(entry["smoothing_price_percent"], 2)]
                    if self.smooth
                    else []
                ),
                *([", ".join(shown(arm) for arm in entry["order"])] if told else []),
                style="bold" if entry["makespan_s"] < best + 1e-4 else None,
            )
        return [table]

    def motions(self, period: float | None) -> Iterator[tuple[str, JointTrajectory]]:
        for name, plan in self.plans.items():
            for arm, motion in zip(self.cell.arms, plan.trajectories, strict=True):
                yield f"{name}-{arm.name}", JointTrajectory.sample(motion, EXPORT_PERIOD if period is None else period)

    def robot_motion(self, name: str, rate_hz: float) -> RobotMotion:
        return RobotMotion.of_schedule(self.plans[name], rate_hz)

    def figures(self, method: str) -> dict[str, Figure]:
        from armtempo.commands.figures._coordination_plans import coordination_plan_figures  # late: matplotlib

        return coordination_plan_figures(self.cell, self.plans, method)

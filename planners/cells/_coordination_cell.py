"""A coordination cell: arms on their given paths in one place, charts and bound, its paths certified."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations
from typing import ClassVar, final

from armtempo.configs import CellConfig, SharedSpaceConfig, TaskCellConfig
from armtempo.errors import CollisionError, InputError
from armtempo.planners.cells._arm_from_config import arm_from, located, obstacle_from, path_from
from armtempo.planners.cells._cell import CellBase, Sweep, sweeps_along
from armtempo.planners.cells._task import TaskEvent, Ways, tasks_from
from armtempo.planners.charts import CoordinationChart, Exclusion, check_path, with_joined_cores
from armtempo.planners.coordination import (
    MakespanBound,
    PassingOrders,
    PriorityClass,
    TimingProblem,
    pairs_to_refine,
)
from armtempo.planners.joint_paths import AbstractJointPath, SequencePath
from armtempo.planners.topp import PathDynamics, PhasePlane, PhaseTrajectory, minimum_time, refined_plane
from armtempo.robots import Arm, Clearance, Shape, share_bases

BOUND_GRID = 8000  # intervals
MOST_HALVINGS = 2  # of the side of a chart's cells, where undecided ones cost time
LAST_HALVINGS = 1  # more, where arms would not get through
CONTROL_SHARE = 0.01
"""Of a torque limit, for what a motion in ticks needs beyond the smooth one: 0.6 % in planar-four."""


def _ways_from(config: CellConfig, arms: Sequence[Arm]) -> Ways:
    """The paths of a file that gives them."""
    found = []
    for i, (arm, given) in enumerate(zip(arms, config.arms, strict=True)):
        with located(f"{config.source}, arms[{i}].path"):
            found.append(path_from(arm, config, given))
    paths, tool_speeds = zip(*found, strict=True)
    return Ways(key="path", paths=paths, tool_speeds=tool_speeds)


def _reserve_of(config: SharedSpaceConfig) -> float:
    return CONTROL_SHARE if config.torque_reserve == "auto" else config.torque_reserve


@dataclass(frozen=True, kw_only=True, eq=False)
@final
class CoordinationCell(CellBase[SharedSpaceConfig]):
    """Arms on given paths in one place. Make one with ``load_cell`` or ``build_cell``.

    Attributes:
        name: The cell's name.
        config: What it was built from.
        arms: The arms in priority order; the first is the master.
        paths: One joint path per arm.
        obstacles: Static bodies.
        dynamics: One per arm, the torque reserve taken off the limits.
        planes: One phase plane per arm.
        clearance: FCL distances between arms and to obstacles.
        exclusions: Rules: parts of two paths in which arms are not to be at once, whatever their distance. Charts hold
            them, so every planner, bound and shield does.
        events: Of tasks: what arms stand still for, and where.
    """

    config_type: ClassVar = SharedSpaceConfig

    arms: tuple[Arm, ...]
    paths: tuple[AbstractJointPath, ...]
    obstacles: tuple[Shape, ...]
    dynamics: tuple[PathDynamics, ...]
    planes: tuple[PhasePlane, ...]
    clearance: Clearance
    exclusions: tuple[Exclusion, ...] = ()
    events: tuple[TaskEvent, ...] = ()

    @classmethod
    def from_config(cls, config: SharedSpaceConfig) -> CoordinationCell:
        """Build the arms, their paths and planes, and certify them; raises as ``load_cell``."""
        arms: list[Arm] = []
        for i, given in enumerate(config.arms):
            with located(f"{config.source}, arms[{i}]"):
                arms.append(arm_from(config, given))
        with located(str(config.source)):
            whole, bases = share_bases(arms)
        assert isinstance(config, CellConfig | TaskCellConfig)
        ways = tasks_from(config, whole) if isinstance(config, TaskCellConfig) else _ways_from(config, whole)
        planes = []
        for i, (arm, path, tool_speed) in enumerate(zip(whole, ways.paths, ways.tool_speeds, strict=True)):
            with located(f"{config.source}, arms[{i}].{ways.key}"):
                dynamics = PathDynamics.from_path(
                    arm, path, intervals=config.stations, torque_reserve=_reserve_of(config),
                    tool_speed_m_s=tool_speed,
                )  # fmt: skip
                planes.append(refined_plane(dynamics, tick=config.physics_tick_s))
        obstacles = (*(obstacle_from(config, obstacle) for obstacle in config.obstacles), *bases)
        cell = cls(
            name=config.name,
            config=config,
            arms=whole,
            paths=ways.paths,
            obstacles=obstacles,
            dynamics=tuple(plane.dynamics for plane in planes),
            planes=tuple(planes),
            clearance=Clearance(whole, obstacles),
            exclusions=ways.exclusions,
            events=ways.events,
        )
        cell.certify()
        return cell

    @property
    def kind(self) -> str:
        """``coordination``, of files of kind ``task``, too: the same environments, policies and reports take both."""
        return self.config.built_as

    def certify(self) -> None:
        """Certify every path, between samples too, and that all arms can start and end together.

        Raises:
            CollisionError: Something comes too close; the message names the place in the cell's file and the bodies.
        """
        for i in range(len(self.arms)):
            key = "task" if isinstance(self.config, TaskCellConfig) else "path"
            with located(f"{self.config.source}, arms[{i}].{key}"):
                self.check_path(i)
        if len(self.arms) > 1:
            with located(str(self.config.source)):
                self.check_ends()

    def sweeps(self, count: int) -> tuple[Sweep, ...]:
        """So many postures of every arm along its path, for pictures."""
        return sweeps_along(self.arms, self.paths, count)

    def __reduce__(self) -> tuple[object, tuple[SharedSpaceConfig]]:
        return type(self).from_config, (self.config,)  # FCL's objects do not travel: another process builds it again

    @property
    def d_min(self) -> float:
        """Smallest allowed distance between two arms, and to obstacles [m]."""
        return self.config.d_min_m

    @property
    def planned_clearance(self) -> float:
        """``d_min`` plus the reserve that plans keep [m]."""
        return self.d_min + self.clearance_reserve

    @property
    def fastest(self) -> tuple[PhaseTrajectory, ...]:
        """The minimum-time motion of every arm."""
        return self.timing.fastest

    @cached_property
    def fastest_smooth(self) -> tuple[PhaseTrajectory, ...]:
        """The same within the jerk limits of the arms.

        Raises:
            InputError: An arm has none.
            InfeasibleError: No motion keeps them.
        """
        return tuple(minimum_time(dynamics, jerk=True) for dynamics in self.dynamics)

    @property
    def sequential_makespan(self) -> float:
        """Minimum times of all arms, one after the other [s]."""
        return sum(motion.duration for motion in self.fastest)

    @cached_property
    def _charts(self) -> dict[tuple[int, int, float, int], CoordinationChart]:
        return {}  # filled as pairs are asked for

    @cached_property
    def _charts_without_rules(self) -> dict[tuple[int, int, float, int], CoordinationChart]:
        return {}  # likewise

    @cached_property
    def _closer_charts(self) -> dict[tuple[int, int, float], CoordinationChart]:
        return {}  # likewise

    def _rules(self, i: int, j: int) -> tuple[Exclusion, ...]:
        """Those between arms i and j, in that order."""
        own = (rule if rule.arms == (i, j) else rule.swapped for rule in self.exclusions if {i, j} == set(rule.arms))
        return tuple(own)

    def _chart(self, i: int, j: int, d_min: float, halvings: int | None = None) -> CoordinationChart:
        """``halvings``: of the side that the file asks for; None: as many as the pair has."""
        if i == j or not (0 <= i < len(self.arms) and 0 <= j < len(self.arms)):
            raise InputError(f"cell {self.name!r} has no pair of arms {(i, j)}; it has {len(self.arms)} arms")
        if i > j:
            return self._chart(j, i, d_min, halvings).swapped
        if halvings is None:
            halvings = self._halvings[i, j]
        if (i, j, d_min, halvings) not in self._charts:
            chart = self._chart_without_rules(i, j, d_min, halvings)
            self._charts[i, j, d_min, halvings] = chart.excluding(self._rules(i, j))
        return self._charts[i, j, d_min, halvings]

    def _chart_without_rules(self, i: int, j: int, d_min: float, halvings: int) -> CoordinationChart:
        """Of distances alone; i < j."""
        if (i, j, d_min, halvings) not in self._charts_without_rules:
            paths = self.paths[i], self.paths[j]
            tolerance = self.config.chart_tolerance(max(path.length for path in paths))
            for path in paths:
                if isinstance(path, SequencePath):  # its borders are those of cells
                    tolerance = min(tolerance, path.length / path.cells * (1.0 + 1e-9))
            self._charts_without_rules[i, j, d_min, halvings] = CoordinationChart.build(
                self.arms[i], paths[0], self.arms[j], paths[1], d_min, tolerance / 2**halvings
            )
        return self._charts_without_rules[i, j, d_min, halvings]

    @cached_property
    def _halvings(self) -> dict[tuple[int, int], int]:
        """Per pair, how often cells of its charts are halved: again and again while undecided cells cost time."""
        halvings = dict.fromkeys(combinations(range(len(self.arms)), 2), 0)
        for done in range(MOST_HALVINGS + LAST_HALVINGS):
            charts = {pair: self._chart(*pair, self.planned_clearance, times) for pair, times in halvings.items()}
            costly = pairs_to_refine(self.fastest, charts, last_resort=done >= MOST_HALVINGS)
            if not costly:
                break
            for pair in costly:
                halvings[pair] += 1
        return halvings

    def chart_as_given(self, i: int, j: int) -> CoordinationChart:
        """The planning chart of arms i and j in cells as large as the file has them, however much is undecided."""
        return self._chart(i, j, self.planned_clearance, 0)

    def chart_between(self, i: int, j: int) -> CoordinationChart:
        """Coordination chart of arms i and j for planning, first index along path i: at ``d_min`` plus the reserve.

        Its cells are those of the cell's file, or up to four times smaller where undecided ones would cost time, eight
        times where arms would not get through.
        """
        return self._chart(i, j, self.planned_clearance)

    def chart_behind(self, i: int, j: int) -> CoordinationChart:
        """``chart_between`` without the rules in which arm i waits for j: what j may have to wait for i in."""
        rules = self._rules(i, j)
        own = tuple(rule for rule in rules if rule.part_a[0] <= 0.0 or rule.part_b[0] > 0.0)
        if len(own) == len(rules):
            return self.chart_between(i, j)
        if i > j:
            chart = self._chart_without_rules(j, i, self.planned_clearance, self._halvings[j, i]).swapped
        else:
            chart = self._chart_without_rules(i, j, self.planned_clearance, self._halvings[i, j])
        return chart.excluding(own)

    def bound_chart_between(self, i: int, j: int) -> CoordinationChart:
        """Coordination chart of arms i and j for bounds, first index along path i: at ``d_min``.

        What is blocked is looked at closer where two parts of it nearly touch: bounds hang on whether arms get through.
        """
        return self._looked_closer(i, j, self.d_min)

    def _looked_closer(self, i: int, j: int, d_min: float) -> CoordinationChart:
        if i > j:
            return self._looked_closer(j, i, d_min).swapped
        if (i, j, d_min) not in self._closer_charts:
            rules, arms, paths = self._rules(i, j), (self.arms[i], self.arms[j]), (self.paths[i], self.paths[j])
            chart = self._chart(i, j, d_min)
            if rules:
                chart = self._chart_without_rules(i, j, d_min, self._halvings[i, j])
            self._closer_charts[i, j, d_min] = with_joined_cores(chart, arms, paths).excluding(rules)
        return self._closer_charts[i, j, d_min]

    def chart_at(self, i: int, j: int, clearance: float) -> CoordinationChart:
        """Coordination chart of arms i and j, first index along path i, at a clearance [m] of your own."""
        return self._chart(i, j, float(clearance))

    @property
    def chart(self) -> CoordinationChart:
        """Coordination chart of the first two arms for planning."""
        return self.chart_between(0, 1)

    @cached_property
    def timing(self) -> TimingProblem:
        """The planes and charts alone: what is left to decide is when."""
        return TimingProblem(
            names=tuple(arm.name for arm in self.arms),
            planes=self.planes,
            chart_between=self.chart_between,
            bound_chart_between=self.bound_chart_between,
            bound_motions=lambda: self.bound_motions,
        )

    @property
    def holdable(self) -> tuple[bool, ...]:
        """Per arm whether it can hold still wherever it is on its path."""
        return self.timing.holdable

    @cached_property
    def bound_motions(self) -> tuple[tuple[PhaseTrajectory, float], ...]:
        """Minimum-time motions from a grid much finer than the plans', and twice what halving it changes.

        A grid overestimates minimum times: bounds take that share off. Where a finer grid finds a longer time (an arm
        that passes a place almost at rest because it cannot hold still there) the plan's own time is the bound.
        """
        motions = []
        for dynamics, planned in zip(self.dynamics, self.fastest, strict=True):
            coarse, fine = (
                PhasePlane(dynamics.with_intervals(intervals)).fastest() for intervals in (BOUND_GRID // 2, BOUND_GRID)
            )
            least = min(fine.duration, planned.duration) - 2.0 * abs(coarse.duration - fine.duration)
            motions.append((fine, 1.0 - least / fine.duration))
        return tuple(motions)

    @property
    def bound(self) -> MakespanBound:
        """Lower bound on the makespan of any timing within the planned torque limits, and the class of every pair."""
        return self.timing.bound

    @property
    def lower_bound(self) -> float:
        """Lower bound on the makespan of any timing within the planned torque limits [s]; or infinite."""
        return self.timing.lower_bound

    @cached_property
    def planned_bound(self) -> float:
        """Likewise on the makespan of timings that keep the reserve above ``d_min``, as all plans do [s]; or infinite.

        What it is above ``lower_bound`` is what the reserve costs, and no method can gain: a passage may be wide enough
        for ``d_min`` alone.
        """
        reserved = replace(
            self.timing, bound_chart_between=lambda i, j: self._looked_closer(i, j, self.planned_clearance)
        )
        return max(self.lower_bound, reserved.lower_bound)

    @property
    def priority_class(self) -> PriorityClass:
        """``free``, ``uniform`` (a start delay is optimal), ``mixed`` (timing must be shaped) or ``infeasible``."""
        return self.bound.priority_class

    def check_ends(self) -> None:
        """Check that the arms are clear of each other where all start and where all end.

        Raises:
            CollisionError: They are not; the message names the links and their distance.
        """
        for where, end in (("start", 0.0), ("end", 1.0)):
            q = [path.evaluate(end * path.length)[0] for path in self.paths]
            nearest = self.clearance.arms(q)
            if not nearest.distance >= self.planned_clearance:
                raise CollisionError(
                    f"the arms collide where they {where}: {nearest.body_a} and {nearest.body_b} are "
                    f"{nearest.distance:.4g} m apart, {self.planned_clearance:.4g} m are required "
                    f"(d_min_m {self.d_min:.4g} and clearance_reserve_m {self.config.clearance_reserve_m:.4g})",
                    remedy=f"lower d_min_m, or move a path's {where}",
                    bodies=(nearest.body_a, nearest.body_b),
                    clearance_m=nearest.distance,
                    required_m=self.planned_clearance,
                )

    def passing_orders(self, extra_clearance: float = 0.0) -> PassingOrders:
        """The collision regions of all pairs, at the planned clearance and so much more [m]."""
        clearance = self.planned_clearance + extra_clearance
        pairs = combinations(range(len(self.paths)), 2)
        return PassingOrders.of_charts(
            [path.length for path in self.paths], {(a, b): self.chart_at(a, b, clearance) for a, b in pairs}
        )

    @property
    def torque_reserve(self) -> float:
        """Share of every torque limit that plans leave to the controller."""
        return _reserve_of(self.config)

    @property
    def clearance_reserve(self) -> float:
        """What plans keep above ``d_min`` [m]."""
        return self.config.clearance_reserve_m

    def check_path(self, i: int) -> None:
        """Certify path i, between samples too, against obstacles and the arm's own links.

        Raises:
            CollisionError: It comes too close; the message names the station and the bodies.
        """
        distance = self.planned_clearance if self.obstacles else None  # plans keep off obstacles by the reserve too
        check_path(self.clearance, i, self.arms[i], self.paths[i], obstacle_distance=distance)

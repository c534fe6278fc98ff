"""A cell: arms on their given paths in one place, its charts and bound, and the certification of its paths."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import final

from armtempo.configs import CellConfig
from armtempo.errors import CollisionError, InputError
from armtempo.planners.charts._coordination_chart import CoordinationChart
from armtempo.planners.charts._path_certificate import check_path
from armtempo.planners.coordination._makespan_bound import MakespanBound, PriorityClass
from armtempo.planners.coordination._timing_problem import TimingProblem
from armtempo.planners.joint_paths._joint_path import JointPath
from armtempo.planners.topp._path_dynamics import PathDynamics
from armtempo.planners.topp._phase_plane import PhasePlane
from armtempo.planners.topp._trajectory import PhaseTrajectory
from armtempo.robots import Arm, Clearance, Shape

BOUND_GRID = 8000  # intervals


@dataclass(frozen=True, kw_only=True, eq=False)
@final
class Cell:
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
    """

    name: str
    config: CellConfig
    arms: tuple[Arm, ...]
    paths: tuple[JointPath, ...]
    obstacles: tuple[Shape, ...]
    dynamics: tuple[PathDynamics, ...]
    planes: tuple[PhasePlane, ...]
    clearance: Clearance

    def __deepcopy__(self, memo: dict[int, object]) -> Cell:
        return self  # nothing in it changes; gymnasium.make copies the arguments of environments

    def __reduce__(self) -> tuple[object, tuple[CellConfig]]:
        from armtempo.planners.cells._load import build_cell

        return build_cell, (self.config,)  # FCL's objects do not travel: another process builds the cell again

    @property
    def d_min(self) -> float:
        """Smallest allowed distance between two arms, and to obstacles [m]."""
        return self.config.d_min_m

    @property
    def planned_clearance(self) -> float:
        """``d_min`` plus the reserve that plans keep [m]."""
        return self.config.d_min_m + self.config.clearance_reserve_m

    @property
    def physics_tick(self) -> float:
        """Step of the simulation [s]."""
        return self.config.physics_tick_s

    @property
    def control_period(self) -> float:
        """Time between two decisions [s]."""
        return self.config.control_period_s

    @property
    def ticks_per_period(self) -> int:
        """Simulation steps between two decisions."""
        return self.config.ticks_per_period

    @property
    def fastest(self) -> tuple[PhaseTrajectory, ...]:
        """The minimum-time motion of every arm."""
        return self.timing.fastest

    @property
    def sequential_makespan(self) -> float:
        """Minimum times of all arms, one after the other [s]."""
        return sum(motion.duration for motion in self.fastest)

    @cached_property
    def _charts(self) -> dict[tuple[int, int, float], CoordinationChart]:
        return {}  # filled as pairs are asked for

    def _chart(self, i: int, j: int, d_min: float) -> CoordinationChart:
        if i == j or not (0 <= i < len(self.arms) and 0 <= j < len(self.arms)):
            raise InputError(f"cell {self.name!r} has no pair of arms {(i, j)}; it has {len(self.arms)} arms")
        if i > j:
            return self._chart(j, i, d_min).swapped
        if (i, j, d_min) not in self._charts:
            self._charts[i, j, d_min] = CoordinationChart.build(
                self.arms[i],
                self.paths[i],
                self.arms[j],
                self.paths[j],
                d_min,
                self.config.chart_tolerance(max(self.paths[k].length for k in (i, j))),
            )
        return self._charts[i, j, d_min]

    def chart_between(self, i: int, j: int) -> CoordinationChart:
        """Coordination chart of arms i and j for planning, first index along path i: at ``d_min`` plus the reserve."""
        return self._chart(i, j, self.planned_clearance)

    def bound_chart_between(self, i: int, j: int) -> CoordinationChart:
        """Coordination chart of arms i and j for bounds, first index along path i: at ``d_min``."""
        return self._chart(i, j, self.d_min)

    def chart_at(self, i: int, j: int, clearance: float) -> CoordinationChart:
        """Coordination chart of arms i and j, first index along path i, at a clearance [m] of your own."""
        return self._chart(i, j, float(clearance))

    @property
    def chart(self) -> CoordinationChart:
        """Coordination chart of the first two arms for planning."""
        return self.chart_between(0, 1)

    @property
    def bound_chart(self) -> CoordinationChart:
        """Coordination chart of the first two arms for bounds."""
        return self.bound_chart_between(0, 1)

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
        for arm, path, planned in zip(self.arms, self.paths, self.fastest, strict=True):
            coarse, fine = (
                PhasePlane(
                    PathDynamics.from_path(arm, path, intervals=intervals, torque_reserve=self.config.torque_reserve)
                ).fastest()
                for intervals in (BOUND_GRID // 2, BOUND_GRID)
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
        return self.bound.time

    @property
    def priority_class(self) -> PriorityClass:
        """``free``, ``uniform`` (a start delay is optimal), ``mixed`` (timing must be shaped) or ``infeasible``."""
        return self.bound.priority_class

    def pair_class(self, i: int, j: int) -> PriorityClass:
        """The class of two arms alone."""
        return self.bound.classes[min(i, j), max(i, j)]

    def check_ends(self) -> None:
        """Check that the arms are clear of each other where all start and where all end.

        Raises:
            CollisionError: They are not; the message names the links and their distance.
        """
        for where, end in (("start", 0.0), ("end", 1.0)):
            q = [path.evaluate(end * path.length)[0] for path in self.paths]
            nearest = self.clearance.arms(q)
            if nearest.distance < self.planned_clearance:
                raise CollisionError(
                    f"the arms collide where they {where}: {nearest.body_a} and {nearest.body_b} are "
                    f"{nearest.distance:.4g} m apart, {self.planned_clearance:.4g} m are required "
                    f"(d_min_m {self.d_min:.4g} and clearance_reserve_m {self.config.clearance_reserve_m:.4g})",
                    remedy=f"lower d_min_m, or move a path's {where}",
                    bodies=(nearest.body_a, nearest.body_b),
                    clearance_m=nearest.distance,
                    required_m=self.planned_clearance,
                )

    def check_path(self, i: int) -> None:
        """Certify path i, between samples too, against obstacles and the arm's own links.

        Raises:
            CollisionError: It comes too close; the message names the station and the bodies.
        """
        distance = self.planned_clearance if self.obstacles else None  # plans keep off obstacles by the reserve too
        check_path(self.clearance, i, self.arms[i], self.paths[i], obstacle_distance=distance)

r"""The coordination chart (Lee1991 section 2.3, Fig. 2): where on their paths two arms come too close.

``d(lambda_a, lambda_b)`` is the smallest distance between any link of arm a and any of arm b (eqs. 17-18); the
collision region is where ``d < d_min``. A quadtree certifies whole cells as free or blocked, between samples and for
every timing; the smallest that it cannot decide stay *undecided*. Enclosing capsules free a cell where they suffice,
else the links' real shapes do; only real shapes block one. Planning takes undecided for blocked, bounds for free.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Literal, final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armtempo.arrays import Bools, Floats, Ints
from armtempo.cache import Arrays, cached, content_key
from armtempo.errors import InputError, brief
from armtempo.planners.charts._arm_sweep import ArmSweep
from armtempo.planners.charts._exclusions import Exclusion, paint
from armtempo.planners.charts._motion_content import motion_content
from armtempo.planners.charts._quadtree import BLOCKED, FREE, UNDECIDED, certify
from armtempo.planners.charts._regions import CollisionRegion, collision_regions
from armtempo.planners.charts._walk import free_along, passable
from armtempo.planners.geometry import number
from armtempo.planners.joint_paths import AbstractJointPath
from armtempo.robots import Arm

__all__ = ["BLOCKED", "FREE", "MAX_RESOLUTION", "UNDECIDED", "CoordinationChart"]

MAX_RESOLUTION = 8192
CHART_VERSION = 2  # of the certification: raise it when the same input may get another chart


@dataclass(frozen=True, kw_only=True, eq=False)
@final
class CoordinationChart:
    """Where two arms on their paths come closer than ``d_min``, cell by cell.

    Attributes:
        states: (R, R) uint8, first index along path a: 0 free, 1 undecided, 2 blocked; each certified for the whole
            cell.
        length_a: ``lambda_max`` of path a.
        length_b: ``lambda_max`` of path b.
        d_min: Smallest allowed distance [m].
        joined: (L, 4) blocked cells (a, b) and (a', b') that are certified to hang together though undecided cells lie
            between them; see ``with_joined_cores``.
        pair_queries: Distances of link pairs that were computed, by their enclosing capsules.
        shape_queries: For how many of them those were too near, so that the real shapes were asked.
        exclusions: Rules between the two arms that its states hold, too.
    """

    states: NDArray[np.uint8]
    length_a: float
    length_b: float
    d_min: float
    joined: Ints = field(default_factory=lambda: np.empty((0, 4), dtype=np.int64))
    pair_queries: int = 0
    shape_queries: int = 0
    exclusions: tuple[Exclusion, ...] = ()

    def __post_init__(self) -> None:
        self.states.setflags(write=False)
        self.joined.setflags(write=False)

    @classmethod
    def build(
        cls,
        arm_a: Arm,
        path_a: AbstractJointPath,
        arm_b: Arm,
        path_b: AbstractJointPath,
        d_min: float,
        tolerance: float,
        *,
        shapes: Literal["real", "capsules"] = "real",
    ) -> CoordinationChart:
        """Certify the chart of two arms.

        Args:
            arm_a: First arm (the master, where order matters).
            path_a: Its path.
            arm_b: Second arm.
            path_b: Its path.
            d_min: Smallest allowed distance between links [m]. Boxes, cylinders and hulls that overlap are 0 apart
                however deep they are in each other, so they block a cell only if ``d_min`` exceeds the tolerance of
                such distances (5e-4 m) plus what they move within half the cell: at 5e-3 few do, at 0 none. Others
                stay undecided, which planning takes for blocked; bounds are weaker for it.
            tolerance: Largest side of a cell that may stay undecided, in the unit of lambda; there are at most
                8192 cells along each path.
            shapes: ``capsules`` looks at the enclosing capsules only, which is quicker: what they do not free stays
                undecided, unless they are the links' shapes themselves.

        Charts that needed real shapes are kept on disk (``ARMTEMPO_CACHE``: another folder, or ``off``).

        Raises:
            InputError: ``d_min`` is negative, ``tolerance`` not positive, one of them not finite, or ``shapes``
                unknown.
            PathError: A path, its speed bounds or an arm on it is not finite.
        """
        d_min, tolerance = number(d_min, "d_min"), number(tolerance, "tolerance")
        if not (0.0 <= d_min < math.inf and 0.0 < tolerance < math.inf):
            raise InputError(f"d_min must be >= 0 and tolerance > 0, got {d_min} and {tolerance}")
        if shapes not in ("real", "capsules"):
            raise InputError(f"shapes is {brief(shapes)}", remedy="give 'real' or 'capsules'")
        for path in (path_a, path_b):
            path.check_stations()
        levels = max(4, math.ceil(math.log2(max(path_a.length, path_b.length) / tolerance)))
        resolution = min(2**levels, MAX_RESOLUTION)
        sweep_a, sweep_b = ArmSweep.of(arm_a, path_a, resolution), ArmSweep.of(arm_b, path_b, resolution)
        real = shapes == "real"

        def compute() -> Arrays:
            found = certify(sweep_a, sweep_b, float(d_min), real=real)
            return {"states": found.states, "queries": np.array([found.capsule_queries, found.shape_queries])}

        if real and not (arm_a.capsules.exact.all() and arm_b.capsules.exact.all()):
            content = [
                part
                for arm, path, sweep in ((arm_a, path_a, sweep_a), (arm_b, path_b, sweep_b))
                for part in motion_content(arm, path, sweep.q, sweep.speed)
            ]
            arrays = cached("chart", content_key(["chart", CHART_VERSION, resolution, float(d_min), *content]), compute)
        else:
            arrays = compute()
        by_capsules, by_shapes = arrays["queries"].tolist()
        return cls(
            states=arrays["states"], length_a=path_a.length, length_b=path_b.length, d_min=float(d_min),
            pair_queries=by_capsules, shape_queries=by_shapes,
        )  # fmt: skip

    def excluding(self, exclusions: Sequence[Exclusion]) -> CoordinationChart:
        """The same chart in which further parts of the paths may not be combined; the arms are its own, in its order.

        Planning takes every cell that a rule touches for blocked, bounds those that are inside one that is certain.
        """
        if not exclusions:
            return self
        states = self.states.copy()
        for exclusion in exclusions:
            paint(states, exclusion, (self.step_a, self.step_b), UNDECIDED, BLOCKED)
        return replace(self, states=states, exclusions=(*self.exclusions, *exclusions))

    def rule_at(self, cell_a: int, cell_b: int) -> str | None:
        """The rule that shuts a cell, in words; None: there is none, but the arms may be too close."""
        for exclusion in self.exclusions:
            (a0, a1), (b0, b1) = exclusion.part_a, exclusion.part_b
            a, b = (cell_a + 0.5) * self.step_a, (cell_b + 0.5) * self.step_b
            if (
                a0 - 0.5 * self.step_a < a < a1 + 0.5 * self.step_a
                and b0 - 0.5 * self.step_b < b < b1 + 0.5 * self.step_b
            ):
                return exclusion.rule
        return None

    @property
    def resolution(self) -> int:
        """Number of cells R along each side."""
        return len(self.states)

    @property
    def step_a(self) -> float:
        """Side of a cell along path a."""
        return self.length_a / self.resolution

    @property
    def step_b(self) -> float:
        """Side of a cell along path b."""
        return self.length_b / self.resolution

    @cached_property
    def swapped(self) -> CoordinationChart:
        """The same chart with the arms exchanged."""
        return CoordinationChart(
            states=np.ascontiguousarray(self.states.T),
            length_a=self.length_b,
            length_b=self.length_a,
            d_min=self.d_min,
            joined=self.joined[:, [1, 0, 3, 2]],
            exclusions=tuple(exclusion.swapped for exclusion in self.exclusions),
        )

    @cached_property
    def last_column(self) -> Ints:
        """(R,) for every row (lambda_b) the last column (lambda_a) that is not free; -1 where all are."""
        occupied = self.states != FREE
        last = self.resolution - 1 - np.argmax(occupied[::-1], axis=0)
        return np.where(occupied.any(axis=0), last, -1).astype(np.int64)

    @cached_property
    def closure(self) -> Floats:
        """(R + 1,) for every column the lowest lambda_b that is not free *there or in any later column*; or inf.

        The collision point C(lambda_a) of the paper may fall back later; behind the closure nothing can.
        """
        occupied = self.states != FREE
        lowest = np.where(occupied.any(axis=1), np.argmax(occupied, axis=1) * self.step_b, np.inf)
        return np.append(np.minimum.accumulate(lowest[::-1])[::-1], np.inf)

    @cached_property
    def components(self) -> tuple[CollisionRegion, ...]:
        """The collision regions: sets of cells that are not free and touch, at corners at least."""
        return collision_regions(self.states != FREE, self.step_a, self.step_b)

    @cached_property
    def cores(self) -> tuple[CollisionRegion, ...]:
        """Likewise of cells that are certified blocked: whatever the others are, nothing gets through these."""
        return collision_regions(self.states == BLOCKED, self.step_a, self.step_b, self.joined)

    @property
    def regions(self) -> int:
        """Number of collision regions."""
        return len(self.components)

    @cached_property
    def passable(self) -> Bools:
        """(R, R) free cells that lie on a monotone walk over free cells from both starts to both ends.

        Outside it arms that never turn back are lost: the other free cells cannot be reached or lead into a deadlock
        (south-west closure of the collision regions, O'Donnell and Lozano-Perez 1989; for both orders of the arms).
        Steps go to the next cell along one path. A step along both at once counts only where its corner is free, all
        four cells about it, and there it is two such steps.
        """
        cells = passable(self.states)
        cells.setflags(write=False)
        return cells

    def share(self, state: int) -> float:
        """Share of the chart's area in a state (0 free, 1 undecided, 2 blocked)."""
        return float(np.mean(self.states == state))

    def _cells(self, value: float | tuple[float, float], length: float) -> slice:
        low, high = (float(end) for end in np.broadcast_to(value, 2))
        if not (0.0 <= low <= high <= length * (1.0 + 1e-12)):
            raise InputError(
                f"{value} is outside the path, [0, {length:.6g}]", remedy="give 0 <= low <= high <= length"
            )
        step = length / self.resolution
        start = math.ceil(low / step) - 1  # a point on a border touches the cells on both sides
        stop = math.floor(high / step) + 1
        return slice(max(start, 0), min(max(stop, start + 1), self.resolution))

    def is_free(self, lam_a: float | tuple[float, float], lam_b: float | tuple[float, float]) -> bool:
        """Whether every pair of positions in a point or box ((low, high) for a side) is certified free."""
        box = self.states[self._cells(lam_a, self.length_a), self._cells(lam_b, self.length_b)]
        return bool((box == FREE).all())

    def is_free_along(self, lam_a: ArrayLike, lam_b: ArrayLike, *, straight: bool = True) -> bool:
        """Whether a curve through the points (lam_a[k], lam_b[k]) is certified free.

        Args:
            lam_a: (P,) positions along path a.
            lam_b: (P,) along path b.
            straight: The curve is straight between the points, and all cells that it touches count. Else all of the
                box between two points counts, which holds every curve that is monotone between them.

        Raises:
            InputError: The arrays differ in length or are empty, or a point is outside the paths.
        """
        a, b = (np.array(lam, dtype=np.float64, ndmin=1) for lam in (lam_a, lam_b))
        if a.ndim != 1 or a.shape != b.shape or not len(a):
            raise InputError(f"a curve of shapes {a.shape} and {b.shape}", remedy="give two arrays (P,), P > 0")
        for lam, length in ((a, self.length_a), (b, self.length_b)):
            if not (lam.min() >= 0.0 and lam.max() <= length * (1.0 + 1e-12)):
                raise InputError(
                    f"the curve leaves the path, [0, {length:.6g}]", remedy="give positions between 0 and length"
                )
        return bool(free_along(self.states, a / self.step_a, b / self.step_b, straight))

    def next_collision(self, lam_a: float, lam_b: float) -> float:
        """The collision point: the first lambda_b from ``lam_b`` on not free with arm a at ``lam_a``; or inf."""
        rows = self.states[self._cells(lam_a, self.length_a)]
        row = self._cells(lam_b, self.length_b).start
        ahead = np.flatnonzero((rows[:, row:] != FREE).any(axis=0))
        return max(float((row + ahead[0]) * self.step_b), lam_b) if len(ahead) else math.inf

    def collision_interval(self, lam_a: float) -> list[tuple[float, float]]:
        """The intervals [P1, P2] of lambda_b that are not free with arm a at ``lam_a`` (Lee1991 Fig. 1)."""
        occupied = (self.states[self._cells(lam_a, self.length_a)] != FREE).any(axis=0)
        edges = np.flatnonzero(np.diff(np.concatenate([[0], occupied.astype(np.int8), [0]])))
        return [(float(p1 * self.step_b), float(p2 * self.step_b)) for p1, p2 in edges.reshape(-1, 2)]

r"""The coordination chart (Lee1991 section 2.3, Fig. 2): where on their paths two arms come too close.

``d(lambda_a, lambda_b)`` is the smallest distance between any link of arm a and any of arm b (eqs. 17-18); the
collision region is where ``d < d_min``. A quadtree certifies whole cells: the distance of two convex bodies changes
by at most the sum of their displacements, so with ``delta`` the farthest that any point of a link moves from its
place at the centre,

    d(centre) - delta_a - delta_b >= d_min   for all pairs of links: the cell is *free*
    d(centre) + delta_a + delta_b <  d_min   for one pair:            the cell is *blocked*

between samples and for every timing; else it is split, and *undecided* when it reaches the tolerance. Distances of
links that are capsules are computed by a compiled kernel that equals FCL's analytic one; other shapes are asked of
FCL, after their enclosing capsules have been found too near. Planning takes undecided for blocked, bounds take it for
free.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import final

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from armtempo.errors import InputError
from armtempo.planners._joint_path import JointPath
from armtempo.robots import Arm, kernels, njit, shape_distance

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

FREE, UNDECIDED, BLOCKED, ASK_FCL = 0, 1, 2, 3
OVERSAMPLING = 8  # path samples per smallest cell, for the displacement tables
MAX_RESOLUTION = 4096


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class _Motion:
    """Samples of an arm along its path: where the points that bound its shapes go, and how far."""

    points: Array  # (samples + 1, shapes, points, 3); the first two are the ends of the enclosing capsule's axis
    slack: Array  # (samples, shapes) how far a point may be from the nearest sample's
    link_poses: Array  # (samples + 1, links, 4, 4) world
    base_pose: Array  # (4, 4)

    @classmethod
    def of(cls, arm: Arm, path: JointPath, samples: int) -> _Motion:
        station = np.linspace(0.0, path.length, samples + 1)
        poses = arm.link_poses(path.evaluate(station)[0])
        local = []
        for shape in arm.shapes:
            ends = np.stack([shape.capsule[0], shape.capsule[1]])
            local.append(ends if shape.exact else np.concatenate([ends, shape.points]))
        most = max((len(points) for points in local), default=2)
        local = [np.concatenate([points, np.repeat(points[:1], most - len(points), axis=0)]) for points in local]
        speed = path.speed_bound(station[:-1], station[1:])
        step = path.length / samples
        points = np.empty((samples + 1, len(local), most, 3))
        slack = np.empty((samples, len(local)))
        offsets = np.linalg.norm(arm.model.placement_p, axis=1)
        for k, (shape, own) in enumerate(zip(arm.shapes, local, strict=True)):
            if shape.link < 0:
                points[:, k] = own @ arm.T_world_base[:3, :3].T + arm.T_world_base[:3, 3]
                slack[:, k] = 0.0
                continue
            pose = poses[:, shape.link]
            points[:, k] = np.einsum("sij,pj->spi", pose[:, :3, :3], own) + pose[:, None, :3, 3]
            reach = float(np.linalg.norm(own, axis=1).max())
            lever = [
                1.0 if arm.model.prismatic[j] else reach + float(offsets[j + 1 : shape.link + 1].sum())
                for j in range(shape.link + 1)
            ]
            slack[:, k] = 0.5 * step * (speed[:, : shape.link + 1] @ np.array(lever))
        return cls(points=points, slack=slack, link_poses=poses, base_pose=arm.T_world_base)

    def link_pose(self, link: int, sample: int) -> Array:
        return self.base_pose if link < 0 else self.link_poses[sample, link]


@njit
def _displacements(points: Array, slack: Array, cells: int) -> Array:
    """(cells, shapes): the farthest that any point of a shape gets from its place at the centre of each interval."""
    samples, shapes = slack.shape
    per = samples // cells
    out = np.empty((cells, shapes))
    for c in range(cells):
        centre = c * per + per // 2
        for k in range(shapes):
            far2, loose = 0.0, 0.0
            for m in range(c * per, (c + 1) * per + 1):
                for p in range(points.shape[2]):
                    d2 = 0.0
                    for axis in range(3):
                        d = points[m, k, p, axis] - points[centre, k, p, axis]
                        d2 += d * d
                    far2 = max(far2, d2)
            for m in range(c * per, (c + 1) * per):
                loose = max(loose, slack[m, k])
            out[c, k] = np.sqrt(far2) + loose
    return out


def swept_displacements(arm: Arm, path: JointPath, finest: int) -> dict[int, Array]:
    """How far, at most, any point of an arm gets from its place at the centre of each of 1, 2, 4, ... intervals."""
    motion = _Motion.of(arm, path, OVERSAMPLING * finest)
    sweeps = {}
    cells = 1
    while cells <= finest:
        sweeps[cells] = _displacements(motion.points, motion.slack, cells).max(axis=1, initial=0.0)
        cells *= 2
    return sweeps


@njit
def _classify(
    cell_a: Ints,
    cell_b: Ints,
    first: Ints,
    pairs: Ints,
    shapes_b: int,
    points_a: Array,
    points_b: Array,
    per: int,
    radius_a: Array,
    radius_b: Array,
    exact_a: NDArray[np.bool_],
    exact_b: NDArray[np.bool_],
    delta_a: Array,
    delta_b: Array,
    d_min: float,
    cell_state: NDArray[np.uint8],
    pair_state: NDArray[np.uint8],
) -> None:
    """Decide every pair still open in every cell by its capsules; a cell is blocked by one pair, free by all."""
    eps = 1e-9
    for c in range(cell_a.shape[0]):
        centre_a, centre_b = cell_a[c] * per + per // 2, cell_b[c] * per + per // 2
        worst = FREE
        for e in range(first[c], first[c + 1]):
            ka, kb = pairs[e] // shapes_b, pairs[e] % shapes_b
            between = kernels.segment_distance(
                points_a[centre_a, ka, 0],
                points_a[centre_a, ka, 1],
                points_b[centre_b, kb, 0],
                points_b[centre_b, kb, 1],
            )
            d = between - radius_a[ka] - radius_b[kb]
            moved = delta_a[cell_a[c], ka] + delta_b[cell_b[c], kb] + eps
            state = UNDECIDED
            if d - moved >= d_min:
                state = FREE
            elif not (exact_a[ka] and exact_b[kb]):
                state = ASK_FCL
            elif d + moved < d_min:
                state = BLOCKED
            pair_state[e] = state
            if state == BLOCKED:
                worst = BLOCKED
                break
            if state != FREE and worst == FREE:
                worst = UNDECIDED
        cell_state[c] = worst


@njit
def _paint(
    states: NDArray[np.uint8], cell_a: Ints, cell_b: Ints, cell_state: NDArray[np.uint8], size: int, last: bool
) -> None:
    for c in range(cell_a.shape[0]):
        if cell_state[c] != UNDECIDED or last:
            for i in range(cell_a[c] * size, (cell_a[c] + 1) * size):
                for j in range(cell_b[c] * size, (cell_b[c] + 1) * size):
                    states[i, j] = cell_state[c]


@njit
def _split(
    cell_a: Ints, cell_b: Ints, first: Ints, pairs: Ints, cell_state: NDArray[np.uint8], pair_state: NDArray[np.uint8]
) -> tuple[Ints, Ints, Ints, Ints]:
    """The four children of every undecided cell, with the pairs that are not yet free."""
    cells, entries = 0, 0
    for c in range(cell_a.shape[0]):
        if cell_state[c] == UNDECIDED:
            cells += 1
            for e in range(first[c], first[c + 1]):
                if pair_state[e] != FREE:
                    entries += 1
    new_a, new_b = np.empty(4 * cells, np.int64), np.empty(4 * cells, np.int64)
    new_first, new_pairs = np.empty(4 * cells + 1, np.int64), np.empty(4 * entries, np.int64)
    k, m = 0, 0
    for c in range(cell_a.shape[0]):
        if cell_state[c] == UNDECIDED:
            for child in range(4):
                new_a[k], new_b[k], new_first[k] = 2 * cell_a[c] + child // 2, 2 * cell_b[c] + child % 2, m
                for e in range(first[c], first[c + 1]):
                    if pair_state[e] != FREE:
                        new_pairs[m] = pairs[e]
                        m += 1
                k += 1
    new_first[k] = m
    return new_a, new_b, new_first, new_pairs


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
        pair_queries: Distances of link pairs that were computed.
        fcl_queries: How many of them were asked of FCL.
    """

    states: NDArray[np.uint8]
    length_a: float
    length_b: float
    d_min: float
    pair_queries: int = 0
    fcl_queries: int = 0

    def __post_init__(self) -> None:
        self.states.setflags(write=False)

    @classmethod
    def build(
        cls, arm_a: Arm, path_a: JointPath, arm_b: Arm, path_b: JointPath, d_min: float, tolerance: float
    ) -> CoordinationChart:
        """Certify the chart of two arms.

        Args:
            arm_a: First arm (the master, where order matters).
            path_a: Its path.
            arm_b: Second arm.
            path_b: Its path.
            d_min: Smallest allowed distance between links [m].
            tolerance: Largest side of a cell that may stay undecided, in the unit of lambda; there are at most
                4096 cells along each path.

        Raises:
            InputError: ``d_min`` is negative, ``tolerance`` not positive, or one of them not finite.
        """
        if not (math.isfinite(d_min) and d_min >= 0.0 and math.isfinite(tolerance) and tolerance > 0.0):
            raise InputError(f"d_min must be >= 0 and tolerance > 0, got {d_min} and {tolerance}")
        levels = max(4, math.ceil(math.log2(max(path_a.length, path_b.length) / tolerance)))
        resolution = min(2**levels, MAX_RESOLUTION)
        samples = OVERSAMPLING * resolution
        motion_a, motion_b = _Motion.of(arm_a, path_a, samples), _Motion.of(arm_b, path_b, samples)
        states = np.zeros((resolution, resolution), dtype=np.uint8)
        cell_a = cell_b = np.zeros(1, dtype=np.int64)
        pairs = np.arange(len(arm_a.shapes) * len(arm_b.shapes), dtype=np.int64)
        first = np.array([0, len(pairs)], dtype=np.int64)
        asked = asked_fcl = 0
        size = resolution
        while len(cell_a):
            cells = resolution // size
            delta_a = _displacements(motion_a.points, motion_a.slack, cells)
            delta_b = _displacements(motion_b.points, motion_b.slack, cells)
            cell_state = np.empty(len(cell_a), dtype=np.uint8)
            pair_state = np.zeros(len(pairs), dtype=np.uint8)
            _classify(
                cell_a, cell_b, first, pairs, len(arm_b.shapes), motion_a.points, motion_b.points, samples // cells,
                arm_a.capsules.radius, arm_b.capsules.radius, arm_a.capsules.exact, arm_b.capsules.exact,
                delta_a, delta_b, d_min, cell_state, pair_state,
            )  # fmt: skip
            asked += len(pairs)
            asked_fcl += _ask_fcl(
                arm_a, arm_b, motion_a, motion_b, samples // cells, (cell_a, cell_b, first, pairs),
                delta_a, delta_b, d_min, cell_state, pair_state,
            )  # fmt: skip
            _paint(states, cell_a, cell_b, cell_state, size, size == 1)
            if size == 1:
                break
            cell_a, cell_b, first, pairs = _split(cell_a, cell_b, first, pairs, cell_state, pair_state)
            size //= 2
        return cls(
            states=states, length_a=path_a.length, length_b=path_b.length, d_min=float(d_min),
            pair_queries=asked, fcl_queries=asked_fcl,
        )  # fmt: skip

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
            states=np.ascontiguousarray(self.states.T), length_a=self.length_b, length_b=self.length_a, d_min=self.d_min
        )

    @cached_property
    def last_column(self) -> Ints:
        """(R,) for every row (lambda_b) the last column (lambda_a) that is not free; -1 where all are."""
        occupied = self.states != FREE
        last = self.resolution - 1 - np.argmax(occupied[::-1], axis=0)
        return np.where(occupied.any(axis=0), last, -1).astype(np.int64)

    @cached_property
    def closure(self) -> Array:
        """(R + 1,) for every column the lowest lambda_b that is not free *there or in any later column*; or inf.

        The collision point C(lambda_a) of the paper may fall back later; behind the closure nothing can.
        """
        occupied = self.states != FREE
        lowest = np.where(occupied.any(axis=1), np.argmax(occupied, axis=1) * self.step_b, np.inf)
        return np.append(np.minimum.accumulate(lowest[::-1])[::-1], np.inf)

    @cached_property
    def regions(self) -> int:
        """Number of collision regions (connected sets of cells that are not free)."""
        return int(ndimage.label(self.states != FREE, structure=np.ones((3, 3)))[1])

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


def _ask_fcl(
    arm_a: Arm,
    arm_b: Arm,
    motion_a: _Motion,
    motion_b: _Motion,
    per: int,
    cells: tuple[Ints, Ints, Ints, Ints],
    delta_a: Array,
    delta_b: Array,
    d_min: float,
    cell_state: NDArray[np.uint8],
    pair_state: NDArray[np.uint8],
) -> int:
    """Settle by FCL the pairs whose enclosing capsules are too near to be free; returns the number of queries."""
    cell_a, cell_b, first, pairs = cells
    queries = 0
    if not (pair_state == ASK_FCL).any():
        return 0
    for c in np.flatnonzero(cell_state == UNDECIDED):
        entries = np.arange(first[c], first[c + 1])
        for e in entries[pair_state[entries] == ASK_FCL]:
            ka, kb = divmod(int(pairs[e]), len(arm_b.shapes))
            shape_a, shape_b = arm_a.shapes[ka], arm_b.shapes[kb]
            pose_a = motion_a.link_pose(shape_a.link, cell_a[c] * per + per // 2)
            pose_b = motion_b.link_pose(shape_b.link, cell_b[c] * per + per // 2)
            d = shape_distance(shape_a, pose_a, shape_b, pose_b)  # a lower bound, tolerance subtracted
            queries += 1
            moved = float(delta_a[cell_a[c], ka] + delta_b[cell_b[c], kb]) + 1e-9
            loose = 2.0 * max(shape_a.tolerance, shape_b.tolerance)
            if d - moved >= d_min:
                pair_state[e] = FREE
            elif d + loose + moved < d_min:
                pair_state[e] = BLOCKED
                cell_state[c] = BLOCKED
                break
            else:
                pair_state[e] = UNDECIDED
        if cell_state[c] != BLOCKED and (pair_state[entries] == FREE).all():
            cell_state[c] = FREE
    return queries

"""Clearance between arms, obstacles and an arm's own links: FCL distances, pruned by enclosing capsules.

FCL judges, where it can be trusted (research/coordination.md 1.2-1.4): unsigned distances, primitives and ``Convex``
hulls, one pair at a time, fresh results. Never BVH models, managers, signed distance or continuous collision.

Of capsules and spheres FCL has closed forms, right to the last digits: they stand as they are. All other pairs go
through its GJK, which now and then ends early and then reads too long, by 18 mm for one in 3000 random pairs of a
capsule and a cylinder. So its answer, less the tolerance, counts only as far as the lower bound of ``separation``
reaches, which a plane between the shapes proves.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Iterable, Sequence
from itertools import combinations, product
from typing import NamedTuple, NoReturn

import fcl
import numpy as np
from numpy.typing import ArrayLike

from armtempo.arrays import Floats, Ints, all_finite
from armtempo.errors import RobotError
from armtempo.robots._arm import Arm
from armtempo.robots._kernels import segment_distance
from armtempo.robots._numba import njit
from armtempo.robots._separation import Bodies, pack_bodies, separation
from armtempo.robots._shapes import ANALYTIC_TOLERANCE, Shape

__all__ = ["Clearance", "Nearest", "shape_distance"]

SELF_SAMPLES = 64
_LOG = logging.getLogger("armtempo")


class Nearest(NamedTuple):
    """The nearest pair of bodies found."""

    distance: float
    """[m]; never above the true distance but for rounding, and where ``exact`` below it by at most 5e-4 m (capsules
    and spheres: 1e-9 m). Negative: overlap of capsules or spheres; other overlaps are 0."""
    body_a: str
    """Like "master/link_2", or an obstacle's name; empty where there is no pair."""
    body_b: str
    exact: bool
    """True: the distance of the shapes. False: the bound by enclosing capsules, not smaller than the cutoff."""


def _geometry(shape: Shape) -> fcl.CollisionGeometry:
    if shape.kind == "capsule":
        return fcl.Capsule(*shape.size)
    if shape.kind == "sphere":
        # As a capsule of no length, overlaps have a closed form too; FCL's sphere would answer -1 there.
        return fcl.Capsule(shape.size[0], 0.0)
    if shape.kind == "box":
        return fcl.Box(*shape.size)
    if shape.kind == "cylinder":
        return fcl.Cylinder(*shape.size)
    assert shape.vertices is not None
    assert shape.faces is not None
    polygons = np.column_stack([np.full(len(shape.faces), 3), shape.faces])
    return fcl.Convex(shape.vertices, len(shape.faces), polygons.ravel())


_REQUEST = fcl.DistanceRequest()  # unsigned, without nearest points


@njit
def _proven(bodies: Bodies, frames: Floats, frame: Ints, a: int, b: int, far: float) -> float:
    """A lower bound of the distance of two shapes: the distance itself to 1e-7 m, or anything from ``far`` on."""
    low, _ = separation(
        bodies, a, frames[frame[a]], bodies, b, frames[frame[b]], far, math.nan, np.zeros(3), np.empty((4, 3))
    )
    return low


class _Scene(NamedTuple):
    """Shapes and where they are: placed in the world for FCL, by the frames of their links for ``separation``."""

    placed: list[fcl.CollisionObject]
    bodies: Bodies
    tolerance: list[float]
    frames: Floats
    frame: Ints

    def distance(self, a: int, b: int, bound: float) -> float:
        """What may be told of the distance of two shapes [m], given a lower ``bound`` of it."""
        # A result that already holds -inf is left alone, which saves python-fcl's bookkeeping; the distance comes back.
        told = float(fcl.distance(self.placed[a], self.placed[b], _REQUEST, fcl.DistanceResult(-math.inf)))
        tolerance = max(self.tolerance[a], self.tolerance[b])
        if not math.isfinite(told):
            raise RobotError(f"FCL tells {told} for a distance", remedy="look for numbers that are not finite")
        if tolerance <= ANALYTIC_TOLERANCE:
            return told
        told, bound = told - tolerance, max(bound, 0.0)
        if told <= bound:
            return bound
        proven = _proven(self.bodies, self.frames, self.frame, a, b, told)
        return min(told, proven) if proven > bound else bound  # also where nothing is proven


def shape_distance(shape_a: Shape, T_a: ArrayLike, shape_b: Shape, T_b: ArrayLike) -> float:
    """Distance [m] of two shapes whose links are at T_a and T_b (4, 4) in the world, as ``Clearance`` tells it.

    Capsules and spheres: exact, negative for overlaps. Else a lower bound, at most 5e-4 m too small, 0 for overlaps.
    """
    shapes, frames = (shape_a, shape_b), np.array([T_a, T_b], dtype=np.float64)
    placed = []
    for shape, T_link in zip(shapes, frames, strict=True):
        T = T_link @ shape.T_link_shape
        placed.append(fcl.CollisionObject(_geometry(shape), fcl.Transform(T[:3, :3], T[:3, 3])))
    tolerance = [shape.tolerance for shape in shapes]
    scene = _Scene(placed=placed, bodies=pack_bodies(shapes), tolerance=tolerance, frames=frames, frame=np.arange(2))
    return scene.distance(0, 1, 0.0)


@njit
def _bounds(
    movers: Ints,
    first_frame: Ints,
    joints: Floats,
    q: Floats,
    shape_frame: Ints,
    capsules: Floats,
    pairs: Ints,
    frames: Floats,
    axes: Floats,
    bounds: Floats,
) -> int:
    """Frames (F, 3, 4) of the moving arms, then capsule distances of the pairs (P, 2) into bounds (P,).

    Rows of joints and q go with frames: placement R (9), p (3), axis (3), prismatic; a base has its world pose.
    Returns the pair with the smallest bound, -1 without pairs, -2 for a q that is not finite, -3 for such distances.
    """
    for m in range(movers.shape[0]):
        for f in range(first_frame[movers[m]] + 1, first_frame[movers[m] + 1]):
            if not math.isfinite(q[f]):
                return -2
            J = joints[f]
            x, y, z = J[12], J[13], J[14]
            s, c, slide = 0.0, 1.0, q[f]
            if J[15] == 0.0:
                s, c, slide = math.sin(q[f]), math.cos(q[f]), 0.0
            v = 1.0 - c
            for r in range(3):
                # row r of (frame before) * placement
                b0, b1, b2 = frames[f - 1, r, 0], frames[f - 1, r, 1], frames[f - 1, r, 2]
                a0 = b0 * J[0] + b1 * J[3] + b2 * J[6]
                a1 = b0 * J[1] + b1 * J[4] + b2 * J[7]
                a2 = b0 * J[2] + b1 * J[5] + b2 * J[8]
                along = a0 * x + a1 * y + a2 * z
                frames[f, r, 3] = frames[f - 1, r, 3] + b0 * J[9] + b1 * J[10] + b2 * J[11] + slide * along
                # row times rotation about the axis: a cos + (a x axis) sin + axis (axis . a) (1 - cos)
                frames[f, r, 0] = a0 * c + (a1 * z - a2 * y) * s + x * along * v
                frames[f, r, 1] = a1 * c + (a2 * x - a0 * z) * s + y * along * v
                frames[f, r, 2] = a2 * c + (a0 * y - a1 * x) * s + z * along * v
    for k in range(shape_frame.shape[0]):
        T = frames[shape_frame[k]]
        C = capsules[k]
        for r in range(3):
            axes[k, 0, r] = T[r, 3] + T[r, 0] * C[0] + T[r, 1] * C[1] + T[r, 2] * C[2]
            axes[k, 1, r] = T[r, 3] + T[r, 0] * C[3] + T[r, 1] * C[4] + T[r, 2] * C[5]
    best, total = -1, 0.0
    for k in range(pairs.shape[0]):
        a, b = pairs[k, 0], pairs[k, 1]
        bounds[k] = segment_distance(axes[a, 0], axes[a, 1], axes[b, 0], axes[b, 1]) - capsules[a, 6] - capsules[b, 6]
        if best < 0 or bounds[k] < bounds[best]:
            best = k
        total += bounds[k]
    return best if math.isfinite(total) else -3  # NaN would pass for the distance of whatever is far away


def _joint_rows(arms: Sequence[Arm]) -> tuple[Ints, Floats]:
    """The arms' first frames (A + 1,), and a row of ``joints`` of ``_bounds`` for each frame.

    Frame 0 is the world; then come for each arm its base and its links.
    """
    first, rows = [], [np.zeros(16)]
    for arm in arms:
        first.append(len(rows))
        m = arm.model
        rows.append(np.zeros(16))
        rows += [
            np.concatenate([m.placement_R[j].ravel(), m.placement_p[j], m.axis[j], [float(m.prismatic[j])]])
            for j in range(arm.dof)
        ]
    first.append(len(rows))
    return np.array(first, dtype=np.int64), np.array(rows)


class _Query(NamedTuple):
    """Which arms move and which pairs of shapes are asked for; ``bounds`` is filled by every call."""

    movers: Ints
    pairs: Ints
    bounds: Floats


class Clearance:
    """Clearance queries for a fixed set of arms and static obstacles.

    Every query looks at the pairs of shapes by rising distance of their enclosing capsules and asks for the real
    shapes' until no other pair can be nearer. Keeps buffers between calls: use one object per thread.

    Args:
        arms: Their names become the first part of the body names.
        obstacles: Bodies made by ``static_shape``.
    """

    def __init__(self, arms: Sequence[Arm], obstacles: Sequence[Shape] = ()) -> None:
        for arm in arms:
            if not all_finite(*arm.model, arm.T_world_base):
                raise RobotError(f"the model of arm {arm.name!r} is not finite", remedy="give finite numbers")
        self._first, self._joints = _joint_rows(arms)
        first = self._first.tolist()
        carried = [(i, shape) for i, arm in enumerate(arms) for shape in arm.shapes]
        shapes = [*obstacles, *(shape for _, shape in carried)]
        self.names = (
            *(shape.link_name for shape in obstacles),
            *(f"{arms[i].name}/{shape.link_name}" for i, shape in carried),
        )
        self._dof = [arm.dof for arm in arms]
        self._arm_names = [arm.name for arm in arms]
        self._owner = [-1] * len(obstacles) + [i for i, _ in carried]
        self._link = [shape.link for shape in shapes]
        self._q = np.zeros(len(self._joints))
        self._q_of = [self._q[first[i] + 1 : first[i + 1]] for i in range(len(arms))]
        frame = [0] * len(obstacles) + [first[i] + 1 + shape.link for i, shape in carried]
        self._frame = np.array(frame, dtype=np.int64)
        self._poses = np.array([shape.T_link_shape[:3] for shape in shapes]).reshape(-1, 3, 4)
        self._capsules = np.array([np.concatenate([*shape.capsule[:2], [shape.capsule[2]]]) for shape in shapes])
        self._capsules = self._capsules.reshape(-1, 7)
        self._frames = np.tile(np.eye(3, 4), (len(self._joints), 1, 1))
        for i, arm in enumerate(arms):
            self._frames[first[i]] = arm.T_world_base[:3]
        self._axes = np.zeros((len(shapes), 2, 3))
        self._scene = _Scene(
            placed=[fcl.CollisionObject(_geometry(shape)) for shape in shapes],
            bodies=pack_bodies(shapes),
            tolerance=[shape.tolerance for shape in shapes],
            frames=self._frames,
            frame=self._frame,
        )
        self._between: dict[tuple[int, int], _Query] = {}
        couples = list(combinations(range(len(arms)), 2))
        for i, j in couples:
            self._between[i, j] = self._query((i, j), product(self._of(i), self._of(j)))
            self._between[j, i] = self._query((j, i), product(self._of(j), self._of(i)))
        self._all = self._query(range(len(arms)), (p for i, j in couples for p in product(self._of(i), self._of(j))))
        self._to_obstacles: list[_Query] = []
        self._self: list[_Query] = []
        self._ignored: list[tuple[tuple[str, str], ...]] = []
        link_names = [shape.link_name for shape in shapes]
        for i, arm in enumerate(arms):
            self._ask_of_itself(i, arm, link_names)
            self._ask_of_obstacles(i, arm, link_names)

    def _ask_of_itself(self, i: int, arm: Arm, link_names: list[str]) -> None:
        """What ``self_collision`` and ``ignored_pairs`` answer from."""
        pairs = [p for p in combinations(self._of(i), 2) if abs(self._link[p[0]] - self._link[p[1]]) > 1]
        named = {frozenset(pair) for pair in arm.ignored_pairs}
        asked = [p for p in pairs if frozenset(link_names[k] for k in p) not in named]
        always = self._always_touching(i, arm, asked)
        self._self.append(self._query((i,), (p for p in asked if p not in always)))
        ignored = [p for p in pairs if p in always or p not in asked]
        self._ignored.append(tuple((self.names[a], self.names[b]) for a, b in ignored))
        for a, b in always:
            _LOG.info("%s and %s touch wherever the joints are: left out", self.names[a], self.names[b])

    def _ask_of_obstacles(self, i: int, arm: Arm, link_names: list[str]) -> None:
        """What ``obstacles`` answers from: of the base that it shares with other arms, as if it were its own."""
        base, named = dict(arm.shared_base), {frozenset(pair) for pair in arm.ignored_pairs}
        pairs = list(product(self._of(i), self._of(-1)))
        own = [(k, o) for k, o in pairs if link_names[o] in base]
        left = [(k, o) for k, o in own if self._link[k] == 0 or {link_names[k], base[link_names[o]]} in named]
        out = {*left, *self._always_touching(i, arm, [pair for pair in own if pair not in left])}
        self._ignored[i] += tuple((self.names[k], self.names[o]) for k, o in own if (k, o) in out)
        self._to_obstacles.append(self._query((i,), (pair for pair in pairs if pair not in out)))

    def _always_touching(self, i: int, arm: Arm, pairs: list[tuple[int, int]]) -> set[tuple[int, int]]:
        """Pairs that touch in the middle of the joints' ranges and at samples all over them.

        Hulls are fatter than links: such a pair says nothing of the arm, and could never be certified.
        """
        low, high = np.maximum(arm.position_min, -math.pi), np.minimum(arm.position_max, math.pi)
        samples = np.random.default_rng(0).random((SELF_SAMPLES, arm.dof))
        touching = list(pairs)
        for share in (np.full(arm.dof, 0.5), *samples):
            if not touching:
                break
            self._set(i, low + share * (high - low))
            query = self._query((i,), touching)
            self._bound(query)
            kept = []
            for pair, bound in zip(touching, query.bounds, strict=True):
                if bound <= 0.0:
                    for shape in pair:
                        self._move(shape)
                    if self._scene.distance(*pair, float(bound)) <= 0.0:
                        kept.append(pair)
            touching = kept
        return set(touching)

    def _of(self, owner: int) -> list[int]:
        return [k for k, other in enumerate(self._owner) if other == owner]

    @staticmethod
    def _query(movers: Sequence[int], pairs: Iterable[tuple[int, int]]) -> _Query:
        listed = np.array(list(pairs), dtype=np.int64).reshape(-1, 2)
        return _Query(movers=np.array(list(movers), dtype=np.int64), pairs=listed, bounds=np.zeros(len(listed)))

    def between(self, i: int, j: int, q_i: ArrayLike, q_j: ArrayLike, cutoff: float = math.inf) -> Nearest:
        """Clearance between arms i and j at joint positions q_i (n_i,) and q_j (n_j,).

        Pairs whose capsules are at least ``cutoff`` apart are not looked at more closely: if the answer is larger than
        ``cutoff`` it may be that bound (``exact`` False). Raises RobotError for a wrong shape or NaN.
        """
        query = self._between.get((i, j))
        if query is None:
            self._unknown((i, j))
        self._set(i, q_i)
        self._set(j, q_j)
        return self._nearest(query, cutoff)

    def arms(self, qs: Sequence[ArrayLike] | Floats, cutoff: float = math.inf) -> Nearest:
        """Smallest clearance over all pairs of arms; qs: one (n,) per arm. Otherwise as ``between``."""
        if len(qs) != len(self._q_of):
            raise RobotError(f"{len(qs)} joint positions for {len(self._q_of)} arms", remedy="give one per arm")
        for i, q in enumerate(qs):
            self._set(i, q)
        return self._nearest(self._all, cutoff)

    def obstacles(self, i: int, q: ArrayLike, cutoff: float = math.inf) -> Nearest:
        """Clearance between arm i (its base included) and the obstacles. Otherwise as ``between``."""
        self._set(i, q)
        return self._nearest(self._to_obstacles[i], cutoff)

    def self_collision(self, i: int, q: ArrayLike, cutoff: float = math.inf) -> Nearest:
        """Clearance between links of arm i that no joint joins directly, but for ``ignored_pairs``; as ``between``."""
        self._set(i, q)
        return self._nearest(self._self[i], cutoff)

    def self_pairs(self, i: int) -> int:
        """Number of pairs of shapes that ``self_collision`` looks at for arm i."""
        return len(self._self[i].pairs)

    def ignored_pairs(self, i: int) -> tuple[tuple[str, str], ...]:
        """Pairs of bodies of arm i that ``self_collision`` leaves out: named by the arm, or always touching."""
        return self._ignored[i]

    def _unknown(self, arms: tuple[int, ...]) -> NoReturn:
        raise RobotError(f"no arms {arms}", remedy=f"give two different numbers from 0 to {len(self._q_of) - 1}")

    def _set(self, i: int, q: ArrayLike) -> None:
        if not 0 <= i < len(self._q_of):
            self._unknown((i,))
        try:
            array = np.asarray(q, dtype=np.float64)
        except (TypeError, ValueError, OverflowError):
            array = np.array(math.nan)
        if array.shape != (self._dof[i],):
            raise RobotError(
                f"arm {self._arm_names[i]!r}: q has shape {array.shape}",
                remedy=f"give ({self._dof[i]},): one value per joint",
                element="q",
            )
        self._q_of[i][:] = array

    def _bound(self, query: _Query) -> int:
        return _bounds(
            query.movers,
            self._first,
            self._joints,
            self._q,
            self._frame,
            self._capsules,
            query.pairs,
            self._frames,
            self._axes,
            query.bounds,
        )

    def _nearest(self, query: _Query, cutoff: float) -> Nearest:
        _, pairs, bounds = query
        first = self._bound(query)
        if first < 0:
            if first < -1:
                what = "joint positions" if first == -2 else "distances between bodies"
                raise RobotError(f"{what} are not finite", remedy="give finite numbers", element="q")
            return Nearest(math.inf, "", "", True)
        if bounds[first] >= cutoff:
            a, b = pairs[first]
            return Nearest(float(bounds[first]), self.names[a], self.names[b], False)
        best, pair, exact = math.inf, first, True
        moved: set[int] = set()
        for k in np.argsort(bounds, kind="stable").tolist():
            bound = float(bounds[k])
            if bound >= best:
                break
            if bound >= cutoff:
                # Nothing is nearer than the cutoff; the next bound is what is known.
                if best >= cutoff:
                    best, pair, exact = bound, k, False
                break
            a, b = pairs[k].tolist()
            for shape in (a, b):
                if shape not in moved:
                    moved.add(shape)
                    self._move(shape)
            distance = self._scene.distance(a, b, bound)
            if distance < best:
                best, pair = distance, k
        a, b = pairs[pair].tolist()
        return Nearest(best, self.names[a], self.names[b], exact)

    def _move(self, shape: int) -> None:
        F, S = self._frames[self._frame[shape]], self._poses[shape]
        R = F[:, :3]
        self._scene.placed[shape].setTransform(fcl.Transform(R @ S[:, :3], R @ S[:, 3] + F[:, 3]))

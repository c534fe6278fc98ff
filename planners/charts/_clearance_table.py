"""Clearance of two arms over their paths as a table, for simulations that ask it at every tick."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from armtempo.arrays import Bools, Floats, all_finite
from armtempo.cache import Arrays, cached, content_key
from armtempo.errors import PathError
from armtempo.planners.charts._arm_sweep import world_axes
from armtempo.planners.charts._motion_content import motion_content
from armtempo.planners.joint_paths import AbstractJointPath
from armtempo.robots import Arm, Bodies, kernels, njit, pack_bodies, separation, uncounted

NODES_PER_PATH = 513
TABLE_VERSION = 1  # of the content: raise it when the same input may get another table


class ClearanceTable(NamedTuple):
    """Distances at (K, K) nodes, equally spaced over both paths; bilinear in between.

    Distances change no faster than the arms' points move. So in between the table is off by no more than half of what
    one arm's farthest-moving point travels from node to node plus half of the other's; about a quarter of one near the
    border of a collision.
    """

    distance: Floats
    length_a: float
    length_b: float


def clearance_table(
    i: int, j: int, arms: tuple[Arm, ...], paths: tuple[AbstractJointPath, ...], exact_below: float
) -> ClearanceTable:
    """Tabulate the distance of arms i and j [m], as ``Clearance`` would answer at every node.

    Below ``exact_below`` [m] it is the distance of the real shapes, found by the kernel that charts use, FCL's
    tolerance subtracted; above, a lower bound may stand that is no smaller than ``exact_below``. Kept on disk as charts
    are.
    """
    lam = [np.linspace(0.0, paths[k].length, NODES_PER_PATH) for k in (i, j)]
    joints = [paths[k].sampled(own, arms[k].dof)[0] for k, own in zip((i, j), lam, strict=True)]

    def compute() -> Arrays:
        sides = [_side(arms[k], q) for k, q in zip((i, j), joints, strict=True)]
        distance = np.empty((NODES_PER_PATH, NODES_PER_PATH))
        _fill(sides[0], sides[1], exact_below, distance)
        return {"distance": distance}

    if arms[i].capsules.exact.all() and arms[j].capsules.exact.all():
        distance = compute()["distance"]
    else:
        none = np.zeros(0)
        content = [
            part for k, q in zip((i, j), joints, strict=True) for part in motion_content(arms[k], paths[k], q, none)
        ]
        key = content_key(["table", TABLE_VERSION, float(exact_below), *content])
        distance = cached("clearance", key, compute)["distance"]
    return ClearanceTable(distance, paths[i].length, paths[j].length)


class _Side(NamedTuple):
    """One arm at every node."""

    axes: Floats
    poses: Floats
    moves: Floats  # (K, shapes) from node to node, the farthest that a point of the shape or of its capsule gets
    radius: Floats
    exact: Bools
    bodies: Bodies


def _side(arm: Arm, q: Floats) -> _Side:
    poses = np.empty((len(q), arm.dof + 1, 4, 4))  # the base's is the last, at index -1
    poses[:, :-1] = arm.link_poses(q)
    poses[:, -1] = arm.T_world_base
    capsules = arm.capsules
    axes = np.empty((len(q), len(arm.shapes), 2, 3))
    world_axes(poses, poses[0, -1], capsules.link, np.stack([capsules.p0, capsules.p1], axis=1), axes)
    moves = np.zeros((len(q), len(arm.shapes)))
    for k, shape in enumerate(arm.shapes):
        followed = np.concatenate([np.stack(shape.capsule[:2]), shape.points])
        world = followed @ poses[:, shape.link, :3, :3].transpose(0, 2, 1) + poses[:, shape.link, None, :3, 3]
        moves[1:, k] = np.linalg.norm(np.diff(world, axis=0), axis=2).max(axis=1)
    if not all_finite(axes, poses, moves, capsules.radius):
        raise PathError(f"arm {arm.name!r} has no finite place on its path", remedy="its model must be finite")
    return _Side(axes, poses, moves, capsules.radius, capsules.exact, pack_bodies(arm.shapes))


@njit
def _fill(side_a: _Side, side_b: _Side, exact_below: float, out: Floats) -> None:
    """Distances at all nodes. From node to node a pair's bound falls by what its links move, and few are looked at."""
    many_a, many_b = side_a.radius.shape[0], side_b.radius.shape[0]
    last_a, last_b = side_a.poses.shape[1] - 1, side_b.poses.shape[1] - 1
    bound = np.empty(many_a * many_b)  # not above the pair's distance at this node
    stage = np.empty(many_a * many_b, dtype=np.uint8)  # what the bound is: 0 from before, 1 the capsules', 2 the answer
    shortest = np.zeros((many_a * many_b, 3))
    W = np.empty((4, 3))
    for a in range(out.shape[0]):
        bound[:] = -math.inf
        for b in range(out.shape[1]):
            for pair in range(len(bound)):
                bound[pair] -= side_b.moves[b, pair % many_b]
                stage[pair] = 0
            best = math.inf
            while len(bound):
                pair = int(np.argmin(bound))
                if bound[pair] >= best:
                    break
                k, m = pair // many_b, pair % many_b
                if stage[pair] == 0:
                    axis_a, axis_b = side_a.axes[a, k], side_b.axes[b, m]
                    d = kernels.segment_distance(axis_a[0], axis_a[1], axis_b[0], axis_b[1])
                    bound[pair] = max(bound[pair], d - side_a.radius[k] - side_b.radius[m])
                    stage[pair] = 1
                elif bound[pair] >= exact_below or (side_a.exact[k] and side_b.exact[m]):
                    best = bound[pair]
                else:
                    tolerance = max(side_a.bodies.tolerance[k], side_b.bodies.tolerance[m])
                    link_a, link_b = side_a.bodies.link[k], side_b.bodies.link[m]
                    d, _ = separation(
                        side_a.bodies, k, side_a.poses[a, last_a if link_a < 0 else link_a],
                        side_b.bodies, m, side_b.poses[b, last_b if link_b < 0 else link_b],
                        best + tolerance, math.nan, shortest[pair], W,
                    )  # fmt: skip
                    bound[pair] = max(d - tolerance, bound[pair], 0.0)
                    stage[pair] = 2
                    best = min(best, bound[pair])
            out[a, b] = best


@uncounted
def tabulated_clearance(table: ClearanceTable, lam_a: float, lam_b: float) -> float:
    """The distance [m] at a pair of positions."""
    last = table.distance.shape[0] - 1
    x = min(max(lam_a / table.length_a, 0.0), 1.0) * last
    y = min(max(lam_b / table.length_b, 0.0), 1.0) * last
    i, j = min(int(x), last - 1), min(int(y), last - 1)
    x, y = x - i, y - j
    d = table.distance
    before, after = (1.0 - y) * d[i, j] + y * d[i, j + 1], (1.0 - y) * d[i + 1, j] + y * d[i + 1, j + 1]
    return float((1.0 - x) * before + x * after)

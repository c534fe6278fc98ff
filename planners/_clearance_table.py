"""Clearance of two arms over their paths as a table, for simulations that ask it at every tick."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from armtempo.planners._joint_path import JointPath
from armtempo.robots import Arm, Clearance, kernels, njit

Array = NDArray[np.float64]

NODES = 513


class ClearanceTable(NamedTuple):
    """Distances at (K, K) nodes, equally spaced over both paths; bilinear in between (to about a quarter of a node)."""

    distance: Array
    length_a: float
    length_b: float


def clearance_table(
    clearance: Clearance, i: int, j: int, arms: tuple[Arm, ...], paths: tuple[JointPath, ...], exact_below: float
) -> ClearanceTable:
    """Tabulate the distance of arms i and j [m].

    Where capsules are the links themselves their distance is FCL's; else FCL is asked where the enclosing capsules are
    nearer than ``exact_below`` [m], and farther off their distance, a lower bound, stands.
    """
    axes, joints = [], []
    for k in (i, j):
        q = paths[k].evaluate(np.linspace(0.0, paths[k].length, NODES))[0]
        own = np.empty((NODES, len(arms[k].shapes), 2, 3))
        for node in range(NODES):
            kernels.capsule_axes(arms[k].model, arms[k].capsules, np.array(q[node]), own[node])
        axes.append(own)
        joints.append(q)
    distance = np.full((NODES, NODES), math.inf)
    _capsule_distances(axes[0], axes[1], arms[i].capsules.radius, arms[j].capsules.radius, distance)
    if not (arms[i].capsules.exact.all() and arms[j].capsules.exact.all()):
        for a, b in np.argwhere(distance < exact_below):
            distance[a, b] = clearance.between(i, j, joints[0][a], joints[1][b]).distance
    return ClearanceTable(distance, paths[i].length, paths[j].length)


@njit
def _capsule_distances(axes_a: Array, axes_b: Array, radius_a: Array, radius_b: Array, out: Array) -> None:
    for a in range(axes_a.shape[0]):
        for b in range(axes_b.shape[0]):
            for k in range(axes_a.shape[1]):
                for m in range(axes_b.shape[1]):
                    d = kernels.segment_distance(axes_a[a, k, 0], axes_a[a, k, 1], axes_b[b, m, 0], axes_b[b, m, 1])
                    out[a, b] = min(out[a, b], d - radius_a[k] - radius_b[m])


@njit
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

"""Episodes as the page plays them: the rows of their traces, thinned where there are very many."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import product
from typing import Any

import numpy as np

from armtempo.arrays import Floats, Ints
from armtempo.commands.viewer._kind_view import KindView, per_arm
from armtempo.commands.viewer._packing import packed
from armtempo.commands.viewer._panels import curve_json
from armtempo.commands.viewer._scene import color_of_policy, shapes_by_name
from armtempo.planners import Cell, CoordinationCell
from armtempo.robots import nearest_points

__all__ = ["LARGEST_RUNS", "run_json", "rows_of"]

LARGEST_RUNS = 600_000
"""Bytes of all columns of all runs: the page is to be below two megabytes, and base64 takes a third more."""
FEWEST_ROWS = 120


def columns_of(view: KindView[Any, Any, Any], cell: Any, trace: Any) -> dict[str, Floats]:
    """(T, k) columns of a trace: time, joints and torques as shares of their limits, and what its kind adds."""
    found: dict[str, Floats] = {"time": trace.time, "progress": view.progress(cell, trace)}
    for i, (q, torque, limit) in enumerate(
        zip(per_arm(trace.q), per_arm(trace.torque), per_arm(trace.torque_max), strict=True)
    ):
        found[f"q{i}"] = q
        found[f"torque{i}"] = torque / limit
    found |= view.columns(cell, trace)
    return {name: values.reshape(len(trace.time), -1) for name, values in found.items()}


def rows_of(columns: Mapping[str, Floats], most: int) -> Ints:
    """At most about so many rows, evenly spread, with the first, the last and the extremes of single columns."""
    count = len(columns["time"])
    if count <= most:
        return np.arange(count)
    alone = [values[:, 0] for values in columns.values() if values.shape[1] == 1 and not np.isnan(values).all()]
    extremes = [row for values in alone for row in (np.nanargmin(values), np.nanargmax(values))]
    spread = np.linspace(0, count - 1, max(most, 2)).round().astype(np.int64)
    return np.unique(np.concatenate([spread, np.array(extremes, dtype=np.int64)]))


def most_rows(all_columns: Sequence[Mapping[str, Floats]]) -> int:
    """How many rows each run may keep, so that all together stay below ``LARGEST_RUNS``: the longest lose first."""
    widths = [4 * sum(values.shape[1] for values in columns.values()) + 24 for columns in all_columns]  # nearest: 6
    lengths = [len(columns["time"]) for columns in all_columns]
    low, high = FEWEST_ROWS, max(lengths)
    while low < high:
        middle = (low + high + 1) // 2
        fits = sum(w * min(n, middle) for w, n in zip(widths, lengths, strict=True)) <= LARGEST_RUNS
        low, high = (middle, high) if fits else (low, middle - 1)
    return low


def nearest_columns(cell: CoordinationCell, joints: Sequence[Floats]) -> dict[str, Floats]:
    """(K, 1) ``clearance`` of the arms [m], and (K, 6) the two points ``nearest`` to each other, nan where they touch.

    Traces may hold lower bounds of the clearance, wherever it is above the smallest so far; this is the clearance.
    """
    shapes = shapes_by_name(cell.arms)
    frames = [
        np.concatenate([arm.link_poses(q), np.broadcast_to(arm.T_world_base, (len(q), 1, 4, 4))], axis=1)
        for arm, q in zip(cell.arms, joints, strict=True)
    ]  # the last one is the base, link -1
    clearance, found = np.empty((len(joints[0]), 1)), np.full((len(joints[0]), 6), np.nan)
    for row, postures in enumerate(zip(*joints, strict=True)):
        near = cell.clearance.arms(postures)
        clearance[row] = near.distance
        pairs = product(shapes.get(near.body_a, ()), shapes.get(near.body_b, ()))
        points = [nearest_points(a, frames[i][row, a.link], b, frames[j][row, b.link]) for (i, a), (j, b) in pairs]
        told = [pair for pair in points if pair is not None]
        if told and len(told) == len(points):
            found[row] = min(told, key=lambda pair: float(np.linalg.norm(pair[1] - pair[0]))).ravel()
    return {"clearance": clearance, "nearest": found}


def run_json(
    view: KindView[Any, Any, Any], cell: Cell, policy: str, number: int, result: Any, most: int
) -> dict[str, Any]:
    """The first episode of a policy, in at most about ``most`` rows."""
    trace = result.trace
    own = getattr(trace, "cell", cell)
    columns = columns_of(view, own, trace)
    rows = rows_of(columns, most)
    kept = {name: values[rows] for name, values in columns.items()}
    if isinstance(own, CoordinationCell) and len(own.arms) > 1:
        kept |= nearest_columns(own, [kept[f"q{i}"] for i in range(len(own.arms))])
    told = view.told(own, result)
    return {
        "policy": policy,
        "color": color_of_policy(policy, number),
        "brief": told.brief,
        "headline": told.headline,
        "mishap": told.mishap,
        "arrived": float(trace.arrived) if math.isfinite(trace.arrived) else None,
        "columns": {name: packed(values) for name, values in kept.items()},
        "curves": {title: [curve_json(one) for one in some] for title, some in view.curves(own, trace).items()},
    }

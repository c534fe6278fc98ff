"""Which blocked parts of a chart are one, though the cells between them are undecided: looked at closer and closer.

Where two parts nearly touch, distances hardly change, and cells of a whole chart would have to be very small to tell a
passage from a neck. Smaller and smaller windows about the narrowest place can, each cut into as many cells. Blocked
cells of a window that touch lead from the one part to the other: nobody gets through between them, so both are passed
on the same side. Where a free cell's row is in between there is a passage, or may be, and the parts stay two.
"""

from __future__ import annotations

import dataclasses
from itertools import combinations

import numpy as np
from scipy import ndimage
from scipy.spatial import KDTree

from armtempo.arrays import Floats, Ints
from armtempo.cache import cached, content_key
from armtempo.planners.charts._arm_sweep import ArmSweep
from armtempo.planners.charts._coordination_chart import BLOCKED, FREE, CoordinationChart
from armtempo.planners.charts._motion_content import motion_content
from armtempo.planners.charts._quadtree import certify
from armtempo.planners.charts._regions import TOUCHING, CollisionRegion, collision_regions
from armtempo.planners.joint_paths import AbstractJointPath
from armtempo.robots import Arm

WINDOW_CELLS = 512  # along each side
WIDEST = WINDOW_CELLS // 4  # cells of the chart between two parts: wider necks have cells smaller than the chart's
MOST_WINDOWS = 8  # about one narrow place
WORTH_WHILE = 0.95  # of the last distance: what a window must bring two parts to
BORDER_ROUNDING = 1e-6  # of a window's cell: so much may a box be outside it by rounding
MOST_PLACES = 12  # in one chart, the narrowest first
JOINED_VERSION = 1  # raise it when the same chart may get others


def with_joined_cores(
    chart: CoordinationChart, arms: tuple[Arm, Arm], paths: tuple[AbstractJointPath, AbstractJointPath]
) -> CoordinationChart:
    """A chart of two arms that knows which of its blocked parts are joined; the same one if none are.

    Only for arms whose capsules are their shapes: other distances have a tolerance that no cell is small enough for.
    What was looked at is kept on disk (``ARMTEMPO_CACHE``: another folder, or ``off``).
    """
    if not all(arm.capsules.exact.all() for arm in arms):
        return chart
    places = _narrow_places(chart)[:MOST_PLACES]
    if not places:
        return chart
    key = content_key(["joined", JOINED_VERSION, chart.states, chart.d_min, *_content(arms, paths)])
    joined = cached("joined", key, lambda: {"joined": _joined(chart, arms, paths, places)})["joined"]
    return dataclasses.replace(chart, joined=joined) if len(joined) else chart


def _content(arms: tuple[Arm, Arm], paths: tuple[AbstractJointPath, AbstractJointPath]) -> list[object]:
    sweeps = [ArmSweep.of(arm, path, WINDOW_CELLS) for arm, path in zip(arms, paths, strict=True)]
    return [
        part
        for sweep, path in zip(sweeps, paths, strict=True)
        for part in motion_content(sweep.arm, path, sweep.q, sweep.speed)
    ]


def _joined(
    chart: CoordinationChart,
    arms: tuple[Arm, Arm],
    paths: tuple[AbstractJointPath, AbstractJointPath],
    places: list[tuple[int, int, Ints]],
) -> Ints:
    """(L, 4) cells of cores that are one; see ``CoordinationChart.joined``."""
    group, joined = list(range(len(chart.cores))), []
    for one, other, ends in places:
        if group[one] != group[other] and _is_neck(chart, arms, paths, ends):
            joined.append(ends.ravel())
            group = [group[one] if own == group[other] else own for own in group]
    return np.array(joined, dtype=np.int64).reshape(-1, 4)


def _narrow_places(chart: CoordinationChart) -> list[tuple[int, int, Ints]]:
    """Which two cores only undecided cells keep apart, and their nearest cells (2, 2); the narrowest places first."""
    found = []
    rims = [_rim(core) for core in chart.cores] if len(chart.cores) > 1 else []
    for m, n in combinations(range(len(rims)), 2):
        ends = _nearest(rims[m], rims[n])
        if _apart(ends) <= WIDEST and _holding(chart.components, ends[0]) is _holding(chart.components, ends[1]):
            found.append((m, n, ends))
    return sorted(found, key=lambda place: _apart(place[2]))


def _holding(regions: tuple[CollisionRegion, ...], cell: Ints) -> CollisionRegion:
    """The region that has a cell (2,)."""
    for region in regions:
        a, b = cell - (region.begin_a, region.begin_b)
        if 0 <= a < len(region.cells) and 0 <= b < region.cells.shape[1] and region.cells[a, b]:
            return region
    raise AssertionError("no region has this cell")


def _rim(region: CollisionRegion) -> Ints:
    """(K, 2) cells of a region that have neighbours outside it."""
    inner = ndimage.binary_erosion(region.cells, TOUCHING)
    return np.asarray(np.argwhere(region.cells & ~inner) + np.array([region.begin_a, region.begin_b]), dtype=np.int64)


def _nearest(one: Ints, other: Ints) -> Ints:
    """(2, 2) a cell of each of (K, 2) and (L, 2), as near to each other as there are."""
    apart, which = KDTree(one).query(other, p=np.inf)
    last = int(np.argmin(apart))
    return np.stack([one[np.asarray(which)[last]], other[last]])


def _apart(ends: Ints) -> int:
    return int(np.abs(ends[1] - ends[0]).max())


def _is_neck(
    chart: CoordinationChart,
    arms: tuple[Arm, Arm],
    paths: tuple[AbstractJointPath, AbstractJointPath],
    ends: Ints,
) -> bool:
    """Whether blocked points lead from one of two blocked cells to the other."""
    length = np.array([chart.length_a, chart.length_b])
    low, step = np.zeros(2), length / chart.resolution
    apart = np.inf
    for _ in range(MOST_WINDOWS):
        corners = low + np.stack([ends, ends + 1]) * step  # (2, 2, 2): low and high corners of both ends
        begin, end = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
        margin = 0.5 * (end - begin).max()
        low, high = np.maximum(begin - margin, 0.0), np.minimum(end + margin, length)
        step = (high - low) / WINDOW_CELLS
        sweeps = [
            ArmSweep.of(arm, path, WINDOW_CELLS, (float(low[k]), float(high[k])))
            for k, (arm, path) in enumerate(zip(arms, paths, strict=True))
        ]
        states = certify(sweeps[0], sweeps[1], chart.d_min, real=True).states
        cells = _cells_in(corners, low, step)
        if cells is None:
            return False
        for (a, b), (a_stop, b_stop) in cells:
            states[a:a_stop, b:b_stop] = BLOCKED  # they are parts of larger ones that are
        cores = collision_regions(states == BLOCKED, step[0], step[1])
        one, other = (_holding(cores, first) for first, _ in cells)
        if one is other:
            return True
        ends = _nearest(_rim(one), _rim(other))
        whole = collision_regions(states != FREE, step[0], step[1])
        now = float(np.abs((ends[1] - ends[0]) * step / length).max())
        if _holding(whole, ends[0]) is not _holding(whole, ends[1]) or now > WORTH_WHILE * apart:
            return False
        apart = now
    return False


def _cells_in(corners: Floats, low: Floats, step: Floats) -> list[tuple[Ints, Ints]] | None:
    """The cells of a window that are inside each of two boxes, from (2,) to (2,) of them; None: there are none."""
    first = np.maximum(np.ceil((corners[0] - low) / step - BORDER_ROUNDING), 0).astype(np.int64)
    stop = np.minimum(np.floor((corners[1] - low) / step + BORDER_ROUNDING), WINDOW_CELLS).astype(np.int64)
    return None if (first >= stop).any() else list(zip(first, stop, strict=True))

"""Blocked parts of a chart that are one: what windows say of coarse charts against charts of many more cells."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from armtempo.planners import CoordinationCell, CoordinationChart
from armtempo.planners.charts import BLOCKED, CollisionRegion, with_joined_cores
from armtempo.planners.charts import _joined_cores as joined_cores
from armtempo.planners.instances import benchmark_instances

COARSE, FINE = 128, 2048


@pytest.fixture(scope="module")
def cell() -> CoordinationCell:
    """Of two arms with several regions, and passages that are as wide as one likes."""
    return next(one for one in benchmark_instances() if one.name == "planar-1991-0065").build()


def chart_of(cell: CoordinationCell, d_min: float, cells: int) -> CoordinationChart:
    (a, b), (path_a, path_b) = cell.arms, cell.paths
    return CoordinationChart.build(a, path_a, b, path_b, d_min, max(path_a.length, path_b.length) / cells * (1 + 1e-9))


def looked_closer(cell: CoordinationCell, d_min: float) -> CoordinationChart:
    return with_joined_cores(
        chart_of(cell, d_min, COARSE), (cell.arms[0], cell.arms[1]), (cell.paths[0], cell.paths[1])
    )


def number_at(regions: tuple[CollisionRegion, ...], a: int, b: int) -> int:
    """The region whose cells (a, b) of a coarse chart is in the middle of, in the fine one."""
    i, j = ((2 * end + 1) * FINE // COARSE // 2 for end in (a, b))
    for number, region in enumerate(regions):
        m, n = i - region.begin_a, j - region.begin_b
        if 0 <= m < len(region.cells) and 0 <= n < region.cells.shape[1] and region.cells[m, n]:
            return number
    raise AssertionError("a blocked cell is free")


@pytest.mark.parametrize("d_min", [0.0142, 0.0209, 0.0275, 0.0341, 0.0938, 0.1004, 0.1335])
def test_what_is_joined_is_never_apart_in_smaller_cells(cell: CoordinationCell, d_min: float) -> None:
    chart = looked_closer(cell, d_min)
    assert len(chart.joined)
    assert (chart.states[chart.joined[:, ::2], chart.joined[:, 1::2]] == BLOCKED).all()
    regions = chart_of(cell, d_min, FINE).components
    for a, b, other_a, other_b in chart.joined:
        assert number_at(regions, a, b) == number_at(regions, other_a, other_b)


def test_a_neck_joins_and_a_passage_does_not(cell: CoordinationCell) -> None:
    for d_min, joined in ((0.1269, 0), (0.1335, 1)):
        assert len(chart_of(cell, d_min, COARSE).components) == 1
        assert len(chart_of(cell, d_min, COARSE).cores) == 2
        assert len(chart_of(cell, d_min, FINE).components) == 2 - joined
        chart = looked_closer(cell, d_min)
        assert len(chart.joined) == joined
        assert len(chart.cores) == 2 - joined


def test_exchanged_arms_have_the_same_joined(cell: CoordinationCell) -> None:
    chart = looked_closer(cell, 0.1335)
    (core,), (swapped,) = chart.cores, chart.swapped.cores
    assert_array_equal(swapped.cells, core.cells.T)
    assert_array_equal(swapped.limit_a, core.limit_b)


def test_joined_cells_are_one_region_with_gaps() -> None:
    """Limits and corners of rows in between are those of the cells that are there."""
    states = np.zeros((16, 16), dtype=np.uint8)
    states[2:4, 2:4] = states[8:10, 6:8] = BLOCKED
    apart = CoordinationChart(states=states, length_a=16.0, length_b=16.0, d_min=0.0)
    joined = CoordinationChart(states=states, length_a=16.0, length_b=16.0, d_min=0.0, joined=np.array([[3, 3, 8, 6]]))
    assert len(apart.cores) == len(joined.components) == 2
    (core,) = joined.cores
    assert core.lam_a == (2.0, 10.0)
    assert core.lam_b == (2.0, 8.0)
    assert_array_equal(core.limit_b, [2.0] * 2 + [6.0] * 6)
    assert_array_equal(core.limit_a, [2.0] * 2 + [8.0] * 4)


def test_charts_with_nothing_undecided_between_stay(cell: CoordinationCell) -> None:
    assert looked_closer(cell, 0.0540).joined.shape == (0, 4)


def test_they_are_found_once(cell: CoordinationCell, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    bare = looked_closer(cell, 0.1335)
    monkeypatch.setenv("ARMTEMPO_CACHE", str(tmp_path))
    assert_array_equal(looked_closer(cell, 0.1335).joined, bare.joined)
    none = looked_closer(cell, 0.1269)
    kept = sorted(file.name for file in tmp_path.iterdir())
    assert [name.partition("-")[0] for name in kept] == ["joined", "joined"]

    def looked_again(*_: object) -> bool:
        raise AssertionError("they are kept")

    monkeypatch.setattr(joined_cores, "_is_neck", looked_again)
    assert_array_equal(looked_closer(cell, 0.1335).joined, bare.joined)
    assert len(looked_closer(cell, 0.1269).joined) == len(none.joined) == 0
    with pytest.raises(AssertionError, match="they are kept"):
        looked_closer(cell, 0.1004)  # another distance is another chart

"""Rules as regions of charts: exact for progress that never falls, in the order of the arms; zones by bisection."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from armtempo.errors import InputError
from armtempo.planners import CoordinationCell, CoordinationChart
from armtempo.planners.charts import BLOCKED, FREE, UNDECIDED, Exclusion, after, inside_zone, zone_exclusions
from armtempo.robots import Clearance, static_shape

CELLS = 16


def empty() -> CoordinationChart:
    return CoordinationChart(states=np.zeros((CELLS, CELLS), dtype=np.uint8), length_a=1.0, length_b=2.0, d_min=0.01)


@given(st.integers(1, CELLS - 1), st.integers(0, CELLS - 2), st.integers(0, 10**6))
def test_walks_that_keep_out_of_the_region_keep_the_rule_and_no_others_do(reached: int, beyond: int, seed: int) -> None:
    """Walks over cells, one step of one arm at a time."""
    rule = after(1, 2.0 * beyond / CELLS, 0, reached / CELLS, 2.0, "b waits for a")
    chart = empty().excluding([rule])
    generator = np.random.default_rng(seed)
    a = b = 0
    free, kept = chart.states[0, 0] == FREE, not (a < reached and b >= beyond)
    while a + b < 2 * (CELLS - 1):
        forward = a < CELLS - 1 and (b == CELLS - 1 or generator.uniform() < 0.5)
        a, b = (a + 1, b) if forward else (a, b + 1)
        free &= chart.states[a, b] == FREE
        kept &= not (a < reached and b >= beyond)
    assert free == kept


def test_cells_that_a_rule_cuts_are_undecided() -> None:
    rule = Exclusion(arms=(0, 1), part_a=(0.1, 0.5), part_b=(0.0, 0.2), rule="not both")
    states = empty().excluding([rule]).states
    assert (states[2:8, 0] == BLOCKED).all()
    assert states[1, 0] == states[1, 1] == states[5, 1] == UNDECIDED
    assert (states == FREE).sum() == CELLS**2 - 7 * 2
    only_plans = Exclusion(arms=(0, 1), part_a=(0.0, 0.5), part_b=(0.0, 1.0), rule="not both", certain=False)
    assert set(np.unique(empty().excluding([only_plans]).states)) == {FREE, UNDECIDED}


def test_the_swapped_chart_has_the_swapped_rule() -> None:
    rule = after(1, 0.5, 0, 0.25, 2.0, "b waits for a")
    chart = empty().excluding([rule])
    assert (chart.swapped.states == chart.states.T).all()
    assert chart.swapped.exclusions[0].arms == (1, 0)
    assert chart.rule_at(0, 8) == chart.swapped.rule_at(8, 0) == "b waits for a"
    assert chart.rule_at(8, 8) is None
    assert empty().excluding([]).exclusions == ()


def test_a_zone_is_met_where_the_arm_is_nearer_than_nothing(lee1991: CoordinationCell) -> None:
    arm, path = lee1991.arms[0], lee1991.paths[0]
    tip = arm.tip_pose(path.evaluate(0.5 * path.length)[0])[:3, 3]
    T = np.eye(4)
    T[:3, 3] = tip
    for zone in (
        static_shape("box", (0.2, 0.2, 0.2), T_world=T, name="fixture"),
        static_shape("cylinder", (0.1, 0.2), T_world=T, name="fixture"),
        static_shape("sphere", (0.1,), T_world=T, name="fixture"),
    ):
        met, inside = inside_zone(arm, path, zone, 256)
        clearance = Clearance([arm], [zone])
        lam = path.length * np.linspace(0.0, 1.0, 1025)
        touches = np.array([clearance.obstacles(0, path.evaluate(one)[0]).distance <= 0.0 for one in lam])
        cell = np.minimum((np.linspace(0.0, 1.0, 1025) * 256).astype(int), 255)
        assert met[cell[touches]].all()  # nothing is missed
        assert met.sum() <= touches.sum() / 4 + 4  # and little added
        assert not inside[cell[~touches]].any()
        assert inside.any() == (zone.kind != "sphere")


def test_zones_forbid_every_two_visits() -> None:
    met = {k: (np.isin(np.arange(8), cells), np.zeros(8, dtype=np.bool_)) for k, cells in ((0, [1, 2, 6]), (2, [3]))}
    found = zone_exclusions("fixture", met, ("a", "b", "c"), (1.0, 1.0, 2.0))
    assert [(one.arms, one.part_a, one.part_b) for one in found] == [
        ((0, 2), (0.125, 0.375), (0.75, 1.0)),
        ((0, 2), (0.75, 0.875), (0.75, 1.0)),
    ]
    assert found[0].rule == "zone 'fixture' holds one arm at a time, 'a' or 'c'"
    assert not found[0].certain


def test_paths_are_cut_in_powers_of_two(lee1991: CoordinationCell) -> None:
    with pytest.raises(InputError, match="a power of two of cells, not into 100"):
        inside_zone(lee1991.arms[0], lee1991.paths[0], static_shape("sphere", (0.1,)), 100)

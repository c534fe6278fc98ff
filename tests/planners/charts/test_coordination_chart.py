"""Certified charts against FCL at random points, and what is read off them."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from armtempo.errors import InputError
from armtempo.planners import AbstractJointPath, Arc, CartesianPath, CoordinationCell, CoordinationChart, PathDynamics
from armtempo.planners.joint_paths import TwoLinkPath
from armtempo.robots import Arm, Clearance, Tool

FREE, UNDECIDED, BLOCKED = 0, 1, 2


def audit(
    chart: CoordinationChart, clearance: Clearance, paths: tuple[AbstractJointPath, ...], points: int
) -> tuple[int, int]:
    """No free cell with a distance below d_min, no blocked one with one above it; returns how many were seen."""
    rng = np.random.default_rng(11)
    lam = rng.uniform(0.0, 1.0, (points, 2)) * [chart.length_a, chart.length_b]
    near = np.argwhere(chart.states == UNDECIDED)  # half of the points next to the border, where it matters
    if len(near):
        chosen = near[rng.integers(0, len(near), points // 2)] + rng.uniform(-3.0, 4.0, (points // 2, 2))
        lam[: points // 2] = np.clip(chosen * [chart.step_a, chart.step_b], 0.0, [chart.length_a, chart.length_b])
    cells = np.minimum((lam / [chart.step_a, chart.step_b]).astype(int), chart.resolution - 1)
    states = chart.states[cells[:, 0], cells[:, 1]]
    q_a, q_b = paths[0].evaluate(lam[:, 0])[0], paths[1].evaluate(lam[:, 1])[0]
    for state, one, other in zip(states, q_a, q_b, strict=True):
        if state == UNDECIDED:
            continue
        distance = clearance.between(0, 1, one, other).distance
        if state == FREE:
            assert distance >= chart.d_min - 1e-9
        else:
            assert distance < chart.d_min + 1e-9
    return int((states == FREE).sum()), int((states == BLOCKED).sum())


def test_the_papers_chart_is_true_at_20000_points(lee1991: CoordinationCell) -> None:
    for chart in (lee1991.chart, lee1991.bound_chart_between(0, 1)):
        free, blocked = audit(chart, lee1991.clearance, lee1991.paths, 10000)
        assert free > 2000
        assert blocked > 1000
        assert chart.share(UNDECIDED) < 0.005
        assert chart.share(FREE) + chart.share(UNDECIDED) + chart.share(BLOCKED) == pytest.approx(1.0)
        assert chart.regions == 1
        assert max(chart.step_a, chart.step_b) <= lee1991.config.chart_tolerance_m
        assert chart.pair_queries < 4 * chart.resolution**2 / 100
    assert lee1991.chart.d_min == pytest.approx(0.0105)
    assert lee1991.bound_chart_between(0, 1).d_min == 0.01


def test_more_clearance_frees_nothing(lee1991: CoordinationCell) -> None:
    assert (lee1991.chart.states != FREE)[lee1991.bound_chart_between(0, 1).states == BLOCKED].all()
    assert (lee1991.bound_chart_between(0, 1).states == FREE)[lee1991.chart.states == FREE].all()


def test_a_coarse_chart_never_contradicts_a_fine_one(lee1991: CoordinationCell) -> None:
    coarse = CoordinationChart.build(
        lee1991.arms[0], lee1991.paths[0], lee1991.arms[1], lee1991.paths[1], lee1991.planned_clearance, 0.003
    )
    fine, factor = lee1991.chart.states, lee1991.chart.resolution // coarse.resolution
    large = coarse.states.repeat(factor, axis=0).repeat(factor, axis=1)
    assert (fine[large == FREE] == FREE).all()
    assert (fine[large == BLOCKED] == BLOCKED).all()


@pytest.fixture(scope="module")
def with_tools(
    make_arm: Callable[..., Arm], lee1991: CoordinationCell
) -> tuple[tuple[Arm, ...], tuple[AbstractJointPath, ...]]:
    """Boxes as tools: shapes that are no capsules, which FCL has to settle."""
    half = np.array([0.02, 0.012, 0.03])
    hull = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * half
    tool = Tool(T_link_tool=np.eye(4), mass=0.1, com=np.zeros(3), inertia=1e-5 * np.eye(3), hull=hull)
    arms, paths = [], []
    for arm, path, elbow in zip(lee1991.arms, lee1991.paths, ("negative", "positive"), strict=True):
        own = make_arm(
            name=arm.name, T_world_base=arm.T_world_base,
            tool=tool, tip_link="tool",
        )  # fmt: skip
        assert isinstance(path, TwoLinkPath)
        arms.append(own)
        paths.append(TwoLinkPath(own, path.cartesian, elbow))  # type: ignore[arg-type]
    return tuple(arms), tuple(paths)


def test_hulls_are_settled_by_fcl(with_tools: tuple[tuple[Arm, ...], tuple[AbstractJointPath, ...]]) -> None:
    arms, paths = with_tools
    chart = CoordinationChart.build(arms[0], paths[0], arms[1], paths[1], 0.004, 0.0015)
    assert chart.shape_queries > 0
    free, blocked = audit(chart, Clearance(arms), paths, 4000)
    assert free > 300
    assert blocked > 300
    assert chart.share(UNDECIDED) < 0.12


@pytest.mark.parametrize("seed", range(3))
def test_charts_of_random_paths_are_true(
    make_arm: Callable[..., Arm], spline_dynamics: Callable[..., PathDynamics], seed: int
) -> None:
    """Wide motions, several regions, and places where links cross."""
    T = np.eye(4)
    T[:2, 3] = 0.55, 0.2
    T[:2, :2] = [[-1.0, 0.0], [0.0, -1.0]]
    arms = make_arm(name="one"), make_arm(name="two", T_world_base=T)
    paths = spline_dynamics(seed, intervals=10).path, spline_dynamics(seed + 50, intervals=10).path
    assert paths[0] is not None
    assert paths[1] is not None
    chart = CoordinationChart.build(arms[0], paths[0], arms[1], paths[1], 0.01, 0.002)
    free, blocked = audit(chart, Clearance(arms), (paths[0], paths[1]), 3000)
    assert free > 100
    assert blocked > 100
    assert chart.share(UNDECIDED) < 0.05


def test_what_is_read_off_agrees_with_the_cells(lee1991: CoordinationCell) -> None:
    chart = lee1991.chart
    states, rng = chart.states, np.random.default_rng(5)
    for lam_a, lam_b in rng.uniform(0.0, 1.0, (300, 2)) * [chart.length_a, chart.length_b]:
        i, j = int(lam_a / chart.step_a), int(lam_b / chart.step_b)
        assert chart.is_free(lam_a, lam_b) == (states[i, j] == FREE)
        ahead = np.flatnonzero(states[i, j:] != FREE)
        wanted = max((j + ahead[0]) * chart.step_b, lam_b) if len(ahead) else math.inf
        assert chart.next_collision(lam_a, lam_b) == pytest.approx(wanted)
        inside = [p1 <= lam_b <= p2 for p1, p2 in chart.collision_interval(lam_a)]
        assert any(inside) == (states[i, j] != FREE)
    for _ in range(200):
        a, b = np.sort(rng.integers(0, chart.resolution + 1, 2)), np.sort(rng.integers(0, chart.resolution + 1, 2))
        if a[0] == a[1] or b[0] == b[1]:
            continue
        box = [
            ((low + 0.5) * step, (high - 0.5) * step) for (low, high), step in ((a, chart.step_a), (b, chart.step_b))
        ]
        assert chart.is_free(box[0], box[1]) == bool((states[a[0] : a[1], b[0] : b[1]] == FREE).all())


def test_the_closure_is_the_lowest_collision_point_from_here_on(lee1991: CoordinationCell) -> None:
    chart = lee1991.chart
    lowest = math.inf
    assert chart.closure[-1] == math.inf
    for i in range(chart.resolution - 1, -1, -1):
        occupied = np.flatnonzero(chart.states[i] != FREE)
        lowest = min(lowest, occupied[0] * chart.step_b) if len(occupied) else lowest
        assert chart.closure[i] == lowest
    assert (np.diff(chart.closure[np.isfinite(chart.closure)]) >= 0.0).all()
    for j in (0, 500, 1500, 3000):
        columns = np.flatnonzero(chart.states[:, j] != FREE)
        assert chart.last_column[j] == (columns[-1] if len(columns) else -1)


def test_swapped_is_the_other_arms_view(lee1991: CoordinationCell) -> None:
    chart, other = lee1991.chart, lee1991.chart.swapped
    np.testing.assert_array_equal(other.states, chart.states.T)
    assert (other.length_a, other.length_b, other.d_min) == (chart.length_b, chart.length_a, chart.d_min)
    assert other.is_free(0.01, 0.3) == chart.is_free(0.3, 0.01)
    built = CoordinationChart.build(lee1991.arms[1], lee1991.paths[1], lee1991.arms[0], lee1991.paths[0], 0.0105, 0.002)
    back = built.swapped
    direct = CoordinationChart.build(
        lee1991.arms[0], lee1991.paths[0], lee1991.arms[1], lee1991.paths[1], 0.0105, 0.002
    )
    np.testing.assert_array_equal(back.states, direct.states)


def test_far_arms_never_meet(make_arm: Callable[..., Arm], lee1991: CoordinationCell) -> None:
    T = np.eye(4)
    T[0, 3] = 5.0
    far = make_arm(T_world_base=T)
    path = TwoLinkPath(
        far,
        CartesianPath([Arc(np.array([5.4, 0.35, 0]), np.array([5.4, 0.05, 0]), np.array([5.25, 0.2, 0]))]),
        "negative",
    )
    chart = CoordinationChart.build(lee1991.arms[0], lee1991.paths[0], far, path, 0.01, 0.001)
    assert chart.share(FREE) == 1.0
    assert chart.pair_queries == 4
    assert chart.regions == 0
    assert not np.isfinite(chart.closure).any()
    assert (chart.last_column == -1).all()
    assert chart.collision_interval(0.1) == []
    assert chart.next_collision(0.1, 0.1) == math.inf


def test_wrong_questions_are_refused(lee1991: CoordinationCell) -> None:
    chart = lee1991.chart
    for wrong in (-0.1, 0.5, math.nan, (0.2, 0.1)):
        with pytest.raises(InputError, match="is outside the path"):
            chart.is_free(wrong, 0.1)
    arms, paths = lee1991.arms, lee1991.paths
    for d_min, tolerance in ((-0.1, 0.01), (math.nan, 0.01), (0.01, 0.0), (0.01, math.inf)):
        with pytest.raises(InputError, match="d_min must be >= 0 and tolerance > 0"):
            CoordinationChart.build(arms[0], paths[0], arms[1], paths[1], d_min, tolerance)
    with pytest.raises(ValueError, match="read-only"):
        chart.states[0, 0] = 1

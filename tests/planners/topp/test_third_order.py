"""Grids, ends and stops of the problem with jerk limits."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from armtempo.arrays import Floats
from armtempo.errors import InfeasibleError
from armtempo.planners import Arc, CartesianPath, JointPath, Line, PathDynamics, PhasePlane
from armtempo.planners.topp._third_order import end_cap, first_interval, inner_stations, stops_of
from armtempo.robots import Arm


@settings(max_examples=100, deadline=None)
@given(
    st.floats(-10.0, 10.0), st.floats(1e-3, 100.0), st.floats(-9.0, -1.4), st.floats(-9.0, -1.4), st.integers(1, 300),
    st.lists(st.floats(0.01, 0.99), max_size=80),
)  # fmt: skip
def test_stations_shrink_towards_both_ends_and_hold_the_marks(
    start: float, length: float, first: float, last: float, intervals: int, marks: list[float]
) -> None:
    ends = (length * 10.0**first, length * 10.0**last)
    base = start + np.linspace(0.0, length, intervals + 1)
    mark = start + length * np.unique(np.round(marks, 6))
    station = inner_stations(base, start, start + length, ends, mark)
    assert station[0] == pytest.approx(start + ends[0], abs=1e-12 * max(abs(start), length))
    assert station[-1] == pytest.approx(start + length - ends[1], abs=1e-12 * max(abs(start), length))
    inside = mark[(mark > start + ends[0]) & (mark < start + length - ends[1])]
    assert np.isin(inside, station).all()
    assert len(station) >= 4
    step = np.diff(station)
    assert (step > 0.0).all()
    centre = 0.5 * (station[1:] + station[:-1])
    nearest = np.minimum(centre - start, start + length - centre)
    rounding = 1e-14 * max(abs(start), length)
    assert (step <= 0.15 * nearest + rounding).all()
    assert (step <= 1.3 * length / intervals).all()


def test_a_path_is_left_at_rest_where_its_curvature_jumps(make_arm: Callable[..., Arm]) -> None:
    arm = make_arm()
    start, middle, end = np.array([[0.3, 0.1, 0.0], [0.4, 0.1, 0.0], [0.5, 0.2, 0.0]])
    line, arc = Line(start, middle), Arc(middle, end, np.array([0.4, 0.2, 0.0]))
    path = JointPath.along(CartesianPath([line, arc]), arm, elbow="positive")
    np.testing.assert_allclose(stops_of(path, 0.0, path.length), [0.0, 0.1, path.length])
    np.testing.assert_allclose(stops_of(path, 0.12, 0.2), [0.12, 0.2])
    spline = JointPath.through([[0.0, 0.5], [0.6, 1.0], [1.0, 0.4], [0.2, 0.1]])
    np.testing.assert_allclose(stops_of(spline, 0.0, spline.length), [0.0, spline.length])


@pytest.mark.parametrize("way", [0.02, -0.02])
def test_the_cap_beside_an_end_is_that_of_dense_samples(
    joint_spline: Callable[[Floats], JointPath], way: float
) -> None:
    """The motion ``s = s_1 (t / t_1)^3`` differentiated three times in time, from finite differences of q."""
    path = joint_spline(np.random.default_rng(4).uniform(-1.0, 1.0, (5, 3)))
    limits, end = np.array([300.0, 200.0, 100.0]), 0.0 if way > 0.0 else 1.0
    x = end_cap(path, limits, end, way)
    time = 3.0 * abs(way) / np.sqrt(x)
    t = np.linspace(0.0, time, 2001)
    q = path.evaluate(end + way * (t / time) ** 3)[0]
    jerk = np.abs(np.diff(q, 3, axis=0)).max(axis=0) / t[1] ** 3
    assert (jerk / limits).max() == pytest.approx(1.0, rel=5e-3)


def test_the_first_interval_is_half_of_the_first_phase_of_jerk(make_arm: Callable[..., Arm]) -> None:
    arm = make_arm(torque_max=[1e6, 1e6], acceleration_max=[10.0, None], speed_max=[2.0, 100.0])
    dynamics = PathDynamics.from_path(arm, JointPath.through([[0.0, 0.0], [1.0, 0.0]]), intervals=300)
    mu = PhasePlane(dynamics).fastest().mu
    for jerk, time in ((100.0, 0.1), (2000.0, 10.0 / 2000.0), (40.0, np.sqrt(2.0 / 40.0))):
        for row, side in ((0, 1), (len(mu) - 1, -1)):
            found = first_interval(dynamics, np.array([jerk, np.inf]), row, mu, side)
            assert found == pytest.approx(0.5 * jerk * time**3 / 6.0, rel=0.02)
    assert first_interval(dynamics, np.array([np.inf, 1.0]), 0, mu, 1) == 0.0


def test_an_arm_that_cannot_rest_at_an_end_is_told_so(make_arm: Callable[..., Arm]) -> None:
    arm = make_arm(torque_max=[1.0, 1.0], gravity=(0.0, -9.81, 0.0))
    dynamics = PathDynamics.from_path(arm, JointPath.through([[0.0, 0.0], [1.0, 0.0]]), intervals=50)
    with pytest.raises(InfeasibleError, match="cannot start or stop at rest at station 0"):
        first_interval(dynamics, np.array([1.0, 1.0]), 0, np.ones(51), 1)

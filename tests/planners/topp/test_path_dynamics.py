"""Rows of the dynamics along a path against the paper's appendix, and what is refused."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from armtempo.arrays import Floats
from armtempo.errors import InputError
from armtempo.planners import Arc, CartesianPath, CoordinationCell, Line, PathDynamics
from armtempo.planners.joint_paths import TwoLinkPath
from armtempo.robots import Arm


def appendix(q: Floats, qd: Floats, qdd: Floats) -> Floats:
    """Lee1991, appendix (misprints corrected as in the paper's own page)."""
    c, s = np.cos(q[..., 1]), np.sin(q[..., 1])
    (d1, d2), (a1, a2) = np.moveaxis(qd, -1, 0), np.moveaxis(qdd, -1, 0)
    u1 = (0.8608 + 0.3404 * c) * a1 + (0.07905 + 0.1702 * c) * a2 - 0.3404 * s * d1 * d2 - 0.1702 * s * d2**2
    u2 = (0.07905 + 0.1702 * c) * a1 + 0.07905 * a2 + 0.1702 * s * d1**2
    return np.stack([u1, u2], axis=-1)


def test_the_rows_are_the_papers_dynamics(lee1991: CoordinationCell) -> None:
    for dynamics, path in zip(lee1991.dynamics, lee1991.paths, strict=True):
        q, dq, ddq = path.evaluate(dynamics.grid)
        np.testing.assert_allclose(dynamics.M, appendix(q, 0 * dq, dq), atol=1e-9)
        np.testing.assert_allclose(dynamics.Q, appendix(q, dq, ddq), atol=1e-9)
        assert not dynamics.R.any()
        np.testing.assert_allclose(dynamics.S, 0.0, atol=1e-12)
        np.testing.assert_array_equal(dynamics.torque_max, np.broadcast_to([25.0, 7.0], dynamics.M.shape))
        np.testing.assert_array_equal(dynamics.torque_min, -dynamics.torque_max)


def test_torques_are_exact_between_stations_and_equal_inverse_dynamics(lee1991: CoordinationCell) -> None:
    rng = np.random.default_rng(1)
    dynamics, path = lee1991.dynamics[0], lee1991.paths[0]
    lam, mu, mu_dot = rng.uniform(0, path.length, (4, 25)), rng.uniform(0, 3, (4, 25)), rng.uniform(-40, 40, (4, 25))
    q, dq, ddq = path.evaluate(lam)
    wanted = appendix(q, dq * mu[..., None], ddq * mu[..., None] ** 2 + dq * mu_dot[..., None])
    np.testing.assert_allclose(dynamics.torque(lam, mu, mu_dot), wanted, atol=1e-9)
    assert dynamics.torque(0.1, 1.0, 0.0).shape == (2,)


def test_gravity_is_in_S(make_arm: Callable[..., Arm]) -> None:
    arm = make_arm(gravity=(0.0, -9.81, 0.0), torque_max=(80.0, 20.0))
    path = TwoLinkPath(arm, CartesianPath([Line(np.array([0.2, 0.3, 0]), np.array([0.4, 0.0, 0]))]), "positive")
    dynamics = PathDynamics.from_path(arm, path, intervals=100)
    q = path.evaluate(dynamics.grid)[0]
    elbow, tip = 0.37 * np.cos(q[:, 0]), np.cos(q.sum(axis=1))
    second = 4 * 9.81 * 0.115 * tip
    np.testing.assert_allclose(
        dynamics.S, np.stack([5 * 9.81 * 0.5 * elbow + 4 * 9.81 * elbow + second, second], -1), atol=1e-9
    )


def test_reserve_and_speed_limits_are_taken_off(make_arm: Callable[..., Arm], lee1991: CoordinationCell) -> None:
    path = lee1991.paths[0]
    arm = make_arm(speed_max=(2.0, 3.0))
    dynamics = PathDynamics.from_path(arm, path, intervals=50, torque_reserve=0.1)
    np.testing.assert_allclose(dynamics.torque_max[7], [22.5, 6.3])
    dq = np.abs(path.evaluate(dynamics.grid)[1])
    np.testing.assert_allclose(dynamics.speed_max, np.minimum(2.0 / dq[:, 0], 3.0 / dq[:, 1]))


def test_breakpoints_are_stations_twice_with_their_own_rows(make_arm: Callable[..., Arm]) -> None:
    """One breakpoint falls on the uniform grid up to rounding: it must not leave an interval of 1e-17."""
    arm = make_arm()
    for length in (0.1, 0.12, 0.07, 0.3 / 7):
        corner = np.array([0.3 - 0.1, 0.3, 0])
        cartesian = CartesianPath(
            [
                Line(corner - np.array([length, 0, 0]), corner),
                Line(corner, corner + np.array([length, 0, 0])),
                Arc(
                    corner + np.array([length, 0, 0]),
                    corner + np.array([length + 0.1, -0.1, 0]),
                    corner + np.array([length, -0.1, 0]),
                ),
            ]
        )
        path = TwoLinkPath(arm, cartesian, "negative")
        for intervals in (10, 96, 100, 250):
            dynamics = PathDynamics.from_path(arm, path, intervals=intervals)
            steps = np.diff(dynamics.grid)
            assert (steps == 0).sum() == 2
            assert steps[steps > 0].min() > 1e-7 * path.length
            k = int(np.flatnonzero(steps == 0)[1])
            q, dq, ddq = path.evaluate(dynamics.grid[k], before=True)
            np.testing.assert_allclose(dynamics.Q[k], appendix(q, dq, ddq), atol=1e-9)
            q, dq, ddq = path.evaluate(dynamics.grid[k + 1])
            np.testing.assert_allclose(dynamics.Q[k + 1], appendix(q, dq, ddq), atol=1e-9)
            assert np.abs(dynamics.Q[k + 1] - dynamics.Q[k]).max() > 0.1


def rows(**changes: Any) -> PathDynamics:
    grid = np.linspace(0.0, 1.0, 5)
    good: dict[str, Any] = {
        "grid": grid, "M": np.ones((5, 2)), "Q": np.zeros((5, 2)), "R": np.zeros((5, 2)), "S": np.zeros((5, 2)),
        "torque_min": [-1.0, -1.0], "torque_max": [1.0, 1.0],
    }  # fmt: skip
    return PathDynamics(**(good | changes))


def nan_at(row: int) -> Floats:
    value = np.ones((5, 2))
    value[row, 1] = math.nan
    return value


REFUSED: dict[str, tuple[dict[str, Any], str]] = {
    "grid shape": (
        {"grid": np.linspace(0, 1, 4)},
        r"grid and M must have shapes \(N\+1,\) and \(N\+1, n\), got \(4,\) and \(5, 2\)",
    ),
    "flat M": ({"M": np.ones(5)}, "grid and M must have shapes"),
    "Q shape": ({"Q": np.zeros((5, 3))}, r"Q must have shape \(5, 2\) like M, got \(5, 3\)"),
    "R shape": ({"R": np.zeros(5)}, "R must have shape"),
    "limit shape": ({"torque_max": [1.0, 1.0, 1.0]}, r"torque_max must have shape \(2,\) or \(5, 2\), got \(3,\)"),
    "speed shape": ({"speed_max": np.ones(4)}, r"speed_max must have shape \(5,\), got \(4,\)"),
    "NaN in M": ({"M": nan_at(3)}, "M is not finite at row 3"),
    "NaN in S": ({"S": nan_at(0)}, "S is not finite at row 0"),
    "infinite Q": ({"Q": nan_at(2) * math.inf}, "Q is not finite at row 0"),
    "NaN grid": ({"grid": [0, 0.25, math.nan, 0.75, 1]}, "grid is not finite at row 2"),
    "NaN limit": ({"torque_min": [math.nan, -1.0]}, "must not hold NaN"),
    "NaN speed": ({"speed_max": np.full(5, math.nan)}, "must not hold NaN"),
    "negative speed": ({"speed_max": np.full(5, -1.0)}, "speed_max must not be negative"),
    "falling grid": ({"grid": [0, 0.5, 0.25, 0.75, 1]}, "grid must rise"),
    "end twice": ({"grid": [0, 0.3, 0.6, 1, 1]}, "grid must rise"),
    "grid of a point": ({"grid": np.zeros(5)}, "grid must rise"),
    "limits cross": ({"torque_min": [-1.0, 2.0]}, "torque_min exceeds torque_max at row 0, joint 1"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_wrong_rows_are_refused_by_name(case: str) -> None:
    changes, message = REFUSED[case]
    with pytest.raises(InputError, match=message):
        rows(**changes)


def test_rows_are_copies_and_read_only() -> None:
    M = np.ones((5, 2))
    dynamics = rows(M=M)
    M[:] = 7.0
    assert dynamics.M[0, 0] == 1.0
    with pytest.raises(ValueError, match="read-only"):
        dynamics.M[0, 0] = 2.0
    for name in ("M", "joints", "arm", "path"):
        with pytest.raises(AttributeError):
            setattr(dynamics, name, None)


def test_only_rows_can_be_of_joints() -> None:
    assert (rows().joints, rows().with_joints(1).joints) == (2, 1)
    for joints in (0, 3):
        with pytest.raises(InputError, match=f"joints must be from 1 to the number of rows, 2, got {joints}"):
            rows().with_joints(joints)


def test_a_part_has_the_rows_of_the_whole(lee1991: CoordinationCell) -> None:
    whole = lee1991.dynamics[0]
    start, stop = 0.1234, 0.3
    part = whole.between(start, stop, intervals=50)
    assert (part.grid[0], part.grid[-1]) == (start, stop)
    assert np.diff(part.grid).max() <= (stop - start) / 50 * (1 + 1e-9)
    assert set(whole.grid[(whole.grid > start) & (whole.grid < stop)]) < set(part.grid)
    assert (part.arm, part.path, part.joints) == (whole.arm, whole.path, whole.joints)
    for rows, exact in zip((part.M, part.Q, part.R, part.S), whole.evaluate(part.grid), strict=True):
        np.testing.assert_allclose(rows, exact, atol=1e-12)
    np.testing.assert_allclose(part.torque_max, np.broadcast_to(whole.torque_max[0], part.M.shape), rtol=1e-12)
    assert len(part.refined([0.2]).grid) == len(part.grid) + 3


def test_a_part_of_bare_rows_is_interpolated() -> None:
    ramp = np.linspace(0.0, 1.0, 5)[:, None]
    part = rows(S=np.hstack([ramp, -ramp]), speed_max=np.array([1.0, 2.0, 3.0, 4.0, 5.0])).between(0.3, 0.7)
    np.testing.assert_allclose(part.S, np.stack([part.grid, -part.grid], axis=1), atol=1e-12)
    assert part.speed_max[0] == 2.0  # the lower end of its interval
    assert part.arm is None


@pytest.mark.parametrize(("start", "stop"), [(0.5, 0.5), (0.6, 0.4), (-0.1, 0.5), (0.5, 1.1), (math.nan, 0.5)])
def test_a_part_that_is_none_is_refused(start: float, stop: float) -> None:
    with pytest.raises(InputError, match=r"a part must lie in \[0, 1\], got"):
        rows().between(start, stop)

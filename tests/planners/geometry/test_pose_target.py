"""Targets over time: even rows, middles that are exact or of the right order, bounds, and what is no target."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from armtempo.arrays import Floats
from armtempo.errors import InputError
from armtempo.planners.geometry import PoseTarget

TURNING = np.array([0.4, -0.3, 0.8])  # [rad/s]


def instants(count: int, step: float) -> Floats:
    return np.asarray(step * np.arange(count), dtype=np.float64)


def screw(t: Floats) -> tuple[Floats, Floats, Floats, Floats]:
    """Round a circle of radius 0.5 at 2 rad/s, turning steadily."""
    p = 0.5 * np.stack([np.cos(2 * t), np.sin(2 * t), 0.2 * t], axis=1)
    v = 0.5 * np.stack([-2 * np.sin(2 * t), 2 * np.cos(2 * t), np.full_like(t, 0.2)], axis=1)
    return p, Rotation.from_rotvec(t[:, None] * TURNING).as_matrix(), v, np.tile(TURNING, (len(t), 1))


def without_rates(t: Floats) -> tuple[Floats, Floats, None, None]:
    return (*screw(t)[:2], None, None)


def angle_between(one: Floats, other: Floats) -> Floats:
    return np.asarray((Rotation.from_matrix(one) * Rotation.from_matrix(other).inv()).magnitude())


@given(st.integers(1, 40), st.floats(1e-3, 0.5), st.floats(-0.49, 0.49))
def test_the_duration_is_rounded_to_whole_steps(steps: int, step: float, off: float) -> None:
    target = PoseTarget.sample(screw, (steps + off) * step, step)
    assert len(target.position) == 2 * steps + 1
    np.testing.assert_allclose(target.time, step * np.arange(steps + 1))


def test_samples_of_a_function_are_its_values_at_samples_and_middles() -> None:
    target = PoseTarget.sample(screw, 1.0, 0.1)
    p, R, v, w = screw(instants(21, 0.05))
    np.testing.assert_array_equal(target.position, p)
    np.testing.assert_allclose(target.rotation, R, atol=1e-15)
    np.testing.assert_array_equal(target.velocity, v)
    np.testing.assert_array_equal(target.angular_velocity, w)
    assert not target.differentiated


def test_the_accelerations_bound_what_the_motion_has() -> None:
    target = PoseTarget.sample(screw, 2.0, 0.01)
    assert target.acceleration == pytest.approx(0.5 * 2.0**2, rel=1e-4)  # r omega^2
    assert target.angular_acceleration == pytest.approx(0.0, abs=1e-12)
    given = PoseTarget.sample(screw, 2.0, 0.01, acceleration=7.0, angular_acceleration=8.0)
    assert (given.acceleration, given.angular_acceleration) == (7.0, 8.0)


def test_differences_serve_where_no_rates_are_given() -> None:
    target, exact = PoseTarget.sample(without_rates, 1.0, 0.01), PoseTarget.sample(screw, 1.0, 0.01)
    assert target.differentiated
    np.testing.assert_allclose(target.velocity[1:-1], exact.velocity[1:-1], atol=1e-4)
    np.testing.assert_allclose(target.velocity, exact.velocity, atol=2e-2)  # one-sided at the ends
    np.testing.assert_allclose(target.angular_velocity, exact.angular_velocity, atol=1e-9)


def test_middles_between_samples_with_rates_are_of_fourth_order() -> None:
    misses = []
    for step in (0.1, 0.05):
        t = instants(21, step)
        p, R, v, w = screw(t)
        target = PoseTarget.through(p, R, step, velocity=v, angular_velocity=w)
        exact_p, exact_R, exact_v, _ = screw(instants(41, 0.5 * step))
        np.testing.assert_array_equal(target.position[::2], p)
        misses.append(
            [
                np.abs(target.position - exact_p).max(),
                max(angle_between(target.rotation, exact_R).max(), 1e-15),
                np.abs(target.velocity - exact_v).max(),
            ]
        )
    assert misses[0][0] / misses[1][0] == pytest.approx(16.0, rel=0.05)
    assert misses[0][1] < 1e-9  # steady turning: no error at all
    assert misses[0][2] / misses[1][2] > 7.5  # and the rates of third at least


@settings(max_examples=30)
@given(st.integers(0, 1000), st.floats(0.01, 0.1))
def test_turning_between_samples_follows_any_axis(seed: int, step: float) -> None:
    one, two = np.random.default_rng(seed).uniform(-1.0, 1.0, (2, 3))

    def rotations(t: Floats) -> Any:
        return Rotation.from_rotvec(t[:, None] * one) * Rotation.from_rotvec(np.sin(t)[:, None] * two)

    def turning(t: Floats) -> Floats:  # of the first factor, and of the second turned by the first
        first = Rotation.from_rotvec(t[:, None] * one)
        return np.asarray(one + first.apply(np.cos(t)[:, None] * two))

    t, fine = instants(9, step), instants(17, 0.5 * step)
    p = np.zeros((9, 3))
    target = PoseTarget.through(p, rotations(t).as_matrix(), step, velocity=p, angular_velocity=turning(t))
    assert angle_between(target.rotation, rotations(fine).as_matrix()).max() < 0.5 * step**4 + 1e-12
    np.testing.assert_allclose(target.angular_velocity, turning(fine), atol=step**3 + 1e-12)


def test_arrays_cannot_be_written() -> None:
    target = PoseTarget.sample(screw, 1.0, 0.1)
    for array in (target.position, target.rotation, target.velocity, target.angular_velocity):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0.0


def test_rotations_that_are_off_by_a_hair_are_made_true() -> None:
    p, R, _, _ = screw(np.arange(5.0))
    target = PoseTarget.through(p, R * (1.0 + 3e-10), 1.0)
    off = target.rotation @ target.rotation.transpose(0, 2, 1) - np.eye(3)
    assert np.abs(off).max() < 1e-14


P, R = screw(np.arange(3.0))[:2]
REFUSED: dict[str, tuple[Any, str]] = {
    "no step": (lambda: PoseTarget.sample(screw, 1.0, 0.0), "step 0.0 s"),
    "shorter than half a step": (lambda: PoseTarget.sample(screw, 0.04, 0.1), "duration 0.04 s, step 0.1 s"),
    "endless": (lambda: PoseTarget.sample(screw, np.inf, 0.1), "duration inf s"),
    "too few rows": (lambda: PoseTarget.sample(lambda t: (P, R, None, None), 5.0, 1.0), "11 times give 3 poses"),
    "one sample": (lambda: PoseTarget.through(P[:1], R[:1], 1.0), "two or more positions"),
    "fewer rotations": (lambda: PoseTarget.through(P, R[:2], 1.0), r"shapes \(3, 3\) and \(2, 3, 3\)"),
    "nan": (lambda: PoseTarget.through(P * np.nan, R, 1.0), "the target is not finite"),
    "a mirror": (lambda: PoseTarget.through(P, -R, 1.0), "rotations are none"),
    "a stretch": (lambda: PoseTarget.through(P, 1.1 * R, 1.0), "rotations are none"),
    "one rate": (lambda: PoseTarget.through(P, R, 1.0, velocity=P), "one of velocity and angular velocity is missing"),
    "short rates": (
        lambda: PoseTarget.through(P, R, 1.0, velocity=P[:2], angular_velocity=P[:2]),
        r"rates of shapes \(2, 3\)",
    ),
    "negative": (lambda: PoseTarget.through(P, R, 1.0, acceleration=-1.0), "accelerations -1.0 m/s"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_is_no_target_is_refused(name: str) -> None:
    make, message = REFUSED[name]
    with pytest.raises(InputError, match=message):
        make()

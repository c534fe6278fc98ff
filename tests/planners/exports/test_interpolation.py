"""What controllers make of points: against scipy's polynomials, and against motions known in closed form."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.interpolate import BPoly

from armtempo.arrays import Floats
from armtempo.planners.exports import RobotMotion, interpolate, interpolation
from armtempo.planners.exports._interpolation import Kind
from armtempo.planners.topp import JointTrajectory
from armtempo.robots import Arm


def trajectory(names: tuple[str, ...], time: Floats, q: Floats, qd: Floats, qdd: Floats) -> JointTrajectory:
    return JointTrajectory(joint_names=names, time=time, q=q, qd=qd, qdd=qdd, torque=np.zeros_like(q))


@given(seed=st.integers(0, 10**6), kind=st.sampled_from(["cubic", "quintic"]))
def test_polynomials_are_those_of_scipy(seed: int, kind: Kind) -> None:
    generator = np.random.default_rng(seed)
    time = np.cumsum(generator.uniform(0.001, 0.2, 5))
    q, qd, qdd = generator.normal(size=(3, 5, 2))
    shares = np.array([0.0, 0.3, 0.7, 1.0])
    found = interpolate(trajectory(("a", "b"), time, q, qd, qdd), shares, kind)
    given_there = [q, qd] if kind == "cubic" else [q, qd, qdd]
    for joint in range(2):
        oracle = BPoly.from_derivatives(time, np.stack([rows[:, joint] for rows in given_there], axis=1))
        at = time[:-1, None] + shares[None, 1:-1] * np.diff(time)[:, None]
        for order, value in enumerate(found):
            np.testing.assert_allclose(value[:, 1:-1, joint], oracle(at, order), rtol=1e-7, atol=1e-5)
    for k, rows in enumerate(given_there):
        np.testing.assert_allclose(found[k][:, 0], rows[:-1], atol=1e-6)
        np.testing.assert_allclose(found[k][:, -1], rows[1:], atol=1e-6)


def waves(arm: Arm, rate: float) -> tuple[JointTrajectory, JointTrajectory]:
    """A harmonic motion with the largest of its derivatives known, coarse and fine."""
    fine = np.linspace(0.0, 1.0, int(rate) * 8 + 1)
    w = 2.0 * np.pi
    q, qd, qdd = 0.2 * np.sin(w * fine), 0.2 * w * np.cos(w * fine), -0.2 * w**2 * np.sin(w * fine)
    every = [np.repeat(value[:, None], arm.dof, axis=1) for value in (q, qd, qdd)]
    whole = trajectory(arm.joint_names, fine, *every)
    return trajectory(arm.joint_names, fine[::8], *(value[::8] for value in every)), whole


@pytest.mark.parametrize(("kind", "order", "factor"), [("cubic", 4, 384.0), ("quintic", 6, 46080.0)])
def test_errors_are_those_of_the_remainder(ur: Arm, kind: Kind, order: int, factor: float) -> None:
    """The remainder of an interpolation through both ends is h^order max |derivative| / factor, in its middle."""
    for rate in (10.0, 20.0):
        made = interpolation(ur, *waves(ur, rate), kind)
        assert made.position_error == pytest.approx(0.2 * (2 * np.pi / rate) ** order / factor, rel=0.05)
    assert made.speed_ratio_max == pytest.approx(0.2 * 2 * np.pi / ur.speed_max.min(), rel=1e-3)
    assert made.acceleration_ratio_max == pytest.approx(0.2 * (2 * np.pi) ** 2 / 8.0, rel=0.02)
    assert made.excess["acceleration"] == 0.0


def test_what_jumps_between_points_is_told(pair_motion: RobotMotion) -> None:
    """Bang-bang torques jump, polynomials do not: they go beyond the limits, and nobody is told otherwise."""
    for own in pair_motion.interpolations:
        assert own["quintic"].position_error < own["cubic"].position_error < 1e-5  # type: ignore[operator]
        assert own["quintic"].excess["torque"] > 0.01
        assert own["cubic"].acceleration_ratio_max == 0.0  # none is known


def test_without_finer_samples_the_error_is_unknown(ur_motion: RobotMotion, ur: Arm) -> None:
    made = interpolation(ur, ur_motion.motions[0], ur_motion.motions[0], "cubic")
    assert made.position_error is None
    assert made.speed_ratio_max > 0.0

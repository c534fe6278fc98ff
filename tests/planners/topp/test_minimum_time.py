"""What ``minimum_time`` takes for jerk limits, and what it says of others."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from armtempo.errors import InputError
from armtempo.planners import JointPath, PathDynamics, minimum_time
from armtempo.planners.topp import SmoothTrajectory
from armtempo.robots import Arm

MakeArm = Callable[..., Arm]


@pytest.fixture
def dynamics(make_arm: MakeArm) -> PathDynamics:
    path = JointPath.through([[0.0, 0.5], [0.6, 1.0], [1.0, 0.4]])
    return PathDynamics.from_path(make_arm(jerk_max=[800.0, None]), path, intervals=200)


def test_without_a_word_nothing_is_asked_of_jerk(dynamics: PathDynamics) -> None:
    motion = minimum_time(dynamics)
    assert not isinstance(motion, SmoothTrajectory)
    assert motion.certificate.jerk_ratio_max == 0.0


def test_the_arms_limits_or_given_ones(dynamics: PathDynamics) -> None:
    own = minimum_time(dynamics, jerk=True)
    assert isinstance(own, SmoothTrajectory)
    np.testing.assert_array_equal(own.jerk_max, [800.0, np.inf])
    same = minimum_time(dynamics, jerk=[800.0, None])
    assert same.duration == pytest.approx(own.duration, rel=1e-12)
    assert minimum_time(dynamics, jerk=np.array([400.0, 400.0])).duration > own.duration


@pytest.mark.parametrize(
    ("jerk", "words"),
    [
        ([800.0], r"jerk limits \[800.0\] of arm 'planar' are not 2 positive numbers .*joint_1, joint_2"),
        (800.0, "are not 2 positive numbers"),
        ([800.0, 0.0], "are not 2 positive numbers"),
        ([800.0, -1.0], "are not 2 positive numbers"),
        ([800.0, float("nan")], "are not 2 positive numbers"),
        ([800.0, "much"], "jerk must be numbers"),
    ],
)
def test_limits_that_are_none_are_refused(dynamics: PathDynamics, jerk: object, words: str) -> None:
    with pytest.raises(InputError, match=words):
        minimum_time(dynamics, jerk=jerk)  # type: ignore[arg-type]


def test_what_is_missing_is_said(dynamics: PathDynamics, make_arm: MakeArm) -> None:
    assert dynamics.path is not None
    limitless = PathDynamics.from_path(make_arm(), dynamics.path, intervals=50)
    with pytest.raises(InputError, match=r"arm 'planar' has no jerk limits .*limits.jerk_rad_s3"):
        minimum_time(limitless, jerk=True)
    ones = np.ones((3, 1))
    bare = PathDynamics([0.0, 0.5, 1.0], ones, 0 * ones, 0 * ones, 0 * ones, [-1.0], [1.0])
    with pytest.raises(InputError, match=r"bare arrays have no joints .*from_path"):
        minimum_time(bare, jerk=[1.0])
    for speeds in ((0.1, 0.0), (0.0, 0.1)):
        with pytest.raises(InputError, match="starts and ends at rest"):
            minimum_time(dynamics, *speeds, jerk=True)

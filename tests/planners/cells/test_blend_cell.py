"""Blend cells: built and certified from their files, changed by variants, told apart from what cannot work."""

from __future__ import annotations

import copy
import pickle

import numpy as np
import pytest

from armtempo.configs import BlendCellConfig
from armtempo.errors import ConfigError, InfeasibleError, UnknownNameError
from armtempo.planners import BlendCell
from armtempo.planners.geometry import Line

ASIDE = np.array([0.0, 0.01, 0.0])


def weaker(config: BlendCellConfig, torque: float) -> BlendCellConfig:
    """The same cell with no joint stronger than so much [N m, N]."""
    limits = config.arm.limits
    arm = config.arm.model_copy(update={"limits": limits.model_copy(update={"torque_nm": (torque,) * 4})})
    return config.model_copy(update={"arm": arm})


def test_a_cell_is_its_config_again(lee2006: BlendCell) -> None:
    again = BlendCell.from_config(lee2006.config)
    lam = np.linspace(0.0, again.path.length, 101)
    np.testing.assert_array_equal(again.path.evaluate(lam)[0], lee2006.path.evaluate(lam)[0])
    assert (again.kind, again.name, again.obstacles) == ("blend", "lee2006", ())
    assert again.arms == (again.arm,)


def test_it_travels_to_other_processes_and_is_its_own_copy(lee2006: BlendCell) -> None:
    sent: BlendCell = pickle.loads(pickle.dumps(lee2006))
    lam = np.linspace(0.0, sent.path.length, 101)
    np.testing.assert_array_equal(sent.path.evaluate(lam)[0], lee2006.path.evaluate(lam)[0])
    np.testing.assert_array_equal(sent.limit_aware.at(0.3)[0], lee2006.limit_aware.at(0.3)[0])
    assert copy.deepcopy(lee2006) is lee2006


def test_an_arm_that_cannot_hold_itself_is_refused_with_its_joint(lee2006: BlendCell) -> None:
    with pytest.raises(
        InfeasibleError, match=r"cannot hold still at station .* m: joint .* its limit is 1 N"
    ) as caught:
        BlendCell.from_config(weaker(lee2006.config, 1.0))
    q = lee2006.path.evaluate(caught.value.data["station"])[0]
    needed = np.abs(lee2006.arm.inverse_dynamics(q, np.zeros(4), np.zeros(4)))
    assert needed[caught.value.data["joint"]] > 1.0
    assert str(lee2006.config.source) in str(caught.value)


def test_a_variant_keeps_what_it_is_not_told(lee2006: BlendCell) -> None:
    other = lee2006.variant(curve="quintic", remaining_distance=0.02)
    assert other.config.blend.curve == "quintic"
    assert other.arm is lee2006.arm
    assert other.segments == lee2006.segments
    assert other.blended.length > lee2006.blended.length  # smaller blends cut less off
    assert lee2006.config.blend.curve != "quintic"


def test_a_variant_with_other_segments_follows_them(lee2006: BlendCell) -> None:
    moved = [
        Line(segment.start + ASIDE, segment.end + ASIDE) for segment in lee2006.segments if isinstance(segment, Line)
    ]
    other = lee2006.variant(segments=moved)
    lam = np.linspace(0.0, other.path.length, 51)
    tip = other.arm.tip_pose(other.path.evaluate(lam)[0])[:, :3, 3]
    np.testing.assert_allclose(tip, other.blended.position(lam), atol=1e-9)
    np.testing.assert_allclose(tip[[0, -1]], [moved[0].start, moved[-1].end], atol=1e-9)


def test_values_that_no_file_could_have_are_refused(lee2006: BlendCell) -> None:
    with pytest.raises(ConfigError, match="shape_factor"):
        lee2006.variant(shape_factor=-1.0)


def test_profiles_go_by_name(lee2006: BlendCell) -> None:
    assert lee2006.profile("line-speed") is lee2006.line_speed
    assert lee2006.profile("limit-aware") is lee2006.limit_aware
    assert lee2006.limit_aware.duration > lee2006.line_speed.duration
    with pytest.raises(UnknownNameError, match="limit-awre"):
        lee2006.profile("limit-awre")

"""The closed-form joint path of a two-link arm, and its table for compiled loops."""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Literal

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from armtempo.arrays import Floats
from armtempo.configs import data_path
from armtempo.errors import PathError
from armtempo.planners import Arc, CartesianPath, Line
from armtempo.planners.joint_paths import TwoLinkPath
from armtempo.planners.joint_paths.kernels import path_point
from armtempo.robots import Arm

MakeArm = Callable[..., Arm]
Elbow = Literal["positive", "negative"]
BENT = data_path("robots/planar_two_link.urdf").read_text()


def quarter_circle() -> CartesianPath:
    return CartesianPath([Arc(np.array([0.4, 0.35, 0]), np.array([0.4, 0.05, 0]), np.array([0.25, 0.2, 0]))])


def line_and_arc() -> CartesianPath:
    return CartesianPath(
        [
            Line(np.array([0.1, 0.35, 0]), np.array([0.3, 0.35, 0])),
            Arc(np.array([0.3, 0.35, 0]), np.array([0.4, 0.25, 0]), np.array([0.3, 0.25, 0])),
            Line(np.array([0.4, 0.25, 0]), np.array([0.4, 0.0, 0])),
        ]
    )


def across_the_cut() -> CartesianPath:
    """Passes behind the base, where atan2 jumps."""
    return CartesianPath([Line(np.array([-0.3, 0.25, 0]), np.array([-0.3, -0.25, 0]))])


def round_the_base() -> CartesianPath:
    """One and a half turns about the first axis."""
    r = 0.35
    ends = [np.array([r * math.cos(w), r * math.sin(w), 0]) for w in np.linspace(0.0, 3.0 * math.pi, 5)]
    return CartesianPath([Arc(p, q, np.zeros(3), np.array([0, 0, 1.0])) for p, q in pairwise(ends)])


PATHS = {"arc": quarter_circle, "line and arc": line_and_arc, "cut": across_the_cut, "round": round_the_base}


def moved(path: CartesianPath, T: Floats) -> CartesianPath:
    R, p = T[:3, :3], T[:3, 3]
    segments: list[Line | Arc] = []
    for s in path.segments:
        if isinstance(s, Arc):
            assert s.normal is not None
            segments.append(Arc(R @ s.start + p, R @ s.end + p, R @ s.center + p, R @ s.normal))
        elif isinstance(s, Line):
            segments.append(Line(R @ s.start + p, R @ s.end + p))
    return CartesianPath(segments)


def pose(rpy: tuple[float, float, float], position: tuple[float, float, float]) -> Floats:
    (cr, cp, cy), (sr, sp, sy) = np.cos(rpy), np.sin(rpy)
    T = np.eye(4)
    Rz, Ry = np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]]), np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
    T[:3, :3] = Rz @ Ry @ np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]])
    T[:3, 3] = position
    return T


@pytest.mark.parametrize("elbow", ["positive", "negative"])
@pytest.mark.parametrize("name", PATHS)
@pytest.mark.parametrize("base", [None, ((0.3, -0.7, 2.0), (0.2, -0.1, 0.5)), ((math.pi, 0.0, 0.4), (0.0, 0.0, 0.0))])
def test_the_tip_follows_the_path_and_the_derivatives_are_exact(
    make_arm: MakeArm,
    name: str,
    elbow: Elbow,
    base: tuple[tuple[float, float, float], tuple[float, float, float]] | None,
) -> None:
    T = np.eye(4) if base is None else pose(*base)
    cartesian = moved(PATHS[name](), T)
    arm = make_arm(T_world_base=T, position_limits=[(-20, 20), (-math.pi, math.pi)])
    path = TwoLinkPath(arm, cartesian, elbow)
    lam = np.linspace(0.0, path.length, 1234)
    q, dq, ddq = path.evaluate(lam)
    np.testing.assert_allclose(arm.tip_pose(q)[:, :3, 3], cartesian.evaluate(lam)[0], atol=1e-12)
    assert (np.sign(q[:, 1]) == (1 if elbow == "positive" else -1)).all()
    assert np.abs(np.diff(q, axis=0)).max() < 0.05  # no jump of the branch
    h = 1e-6
    inner = lam[np.abs(lam[:, None] - path.breakpoints).min(axis=1) > 1e-3]
    (q1, dq1, _), (q0, dq0, _), (_, dq, ddq) = (path.evaluate(inner + shift) for shift in (h, -h, 0.0))
    np.testing.assert_allclose(dq, (q1 - q0) / (2 * h), atol=1e-6 * (1 + np.abs(dq).max()))
    np.testing.assert_allclose(ddq, (dq1 - dq0) / (2 * h), atol=1e-6 * (1 + np.abs(ddq).max()))


@pytest.mark.parametrize("side", [1, -1])
@pytest.mark.parametrize("bend", [0.0, 1.0, 2.2, -2.2, 3.0])
@pytest.mark.parametrize("elbow", ["positive", "negative"])
def test_arms_whose_zero_is_bent_or_whose_second_axis_is_turned_over_keep_one_branch(
    tmp_path: Path, elbow: Elbow, bend: float, side: int
) -> None:
    """The tool is mounted at an angle: the elbow's zero is not the stretched arm."""
    text = BENT.replace(
        '<origin xyz="0.23 0 0"/>', f'<origin xyz="{0.23 * math.cos(bend)} {0.23 * math.sin(bend)} 0"/>'
    )
    if side < 0:
        text = text.replace(
            '<origin xyz="0.37 0 0"/>\n    <axis xyz="0 0 1"/>', '<origin xyz="0.37 0 0"/>\n    <axis xyz="0 0 -1"/>'
        )
        assert 'xyz="0 0 -1"' in text
    file = tmp_path / "bent.urdf"
    file.write_text(text)
    arm = Arm.from_urdf(file, position_limits=[(-20, 20), (-7, 7)])
    path = TwoLinkPath(arm, CartesianPath([Line(np.array([0.17, 0.05, 0]), np.array([0.55, 0.2, 0]))]), elbow)
    lam = np.linspace(0.0, path.length, 999)
    q, dq, _ = path.evaluate(lam)
    np.testing.assert_allclose(arm.tip_pose(q)[:, :3, 3], path.cartesian.evaluate(lam)[0], atol=1e-12)
    assert np.abs(np.diff(q, axis=0)).max() < 0.05
    np.testing.assert_allclose(dq[1:-1], (q[2:] - q[:-2]) / (lam[2:] - lam[:-2])[:, None], rtol=1e-2, atol=1e-2)


def test_joint_1_takes_the_turn_that_fits_its_limits(make_arm: MakeArm) -> None:
    for low, high in ((0.0, 2 * math.pi), (-2 * math.pi, 0.0), (math.pi - 0.5, 3 * math.pi - 0.5)):
        arm = make_arm(position_limits=[(low, high), (-math.pi, math.pi)])
        q = TwoLinkPath(arm, across_the_cut(), "negative").evaluate(np.linspace(0.0, 0.5, 50))[0]
        assert low <= q[:, 0].min() <= q[:, 0].max() <= high


@settings(max_examples=60, deadline=None)
@given(st.sampled_from(sorted(PATHS)), st.sampled_from(["positive", "negative"]), st.floats(0, 1), st.floats(0, 1))
def test_the_speed_bound_is_one(name: str, elbow: Elbow, first: float, second: float) -> None:
    arm = Arm.from_urdf(data_path("robots/planar_two_link.urdf"), position_limits=[(-20, 20), (-math.pi, math.pi)])
    path = TwoLinkPath(arm, PATHS[name](), elbow)
    low, high = sorted((first * path.length, second * path.length))
    speed = np.abs(path.evaluate(np.linspace(low, high, 400))[1]).max(axis=0)
    assert (path.speed_bound(low, high) >= speed * (1 - 1e-12)).all()
    middle = 0.5 * (low + high)
    here = np.abs(path.evaluate(middle)[1])
    assert (path.speed_bound(middle, middle + 1e-7) <= 3.0 * here.max() + 10.0).all()  # and not a wild one


@pytest.mark.parametrize("name", PATHS)
def test_the_table_reproduces_the_path(make_arm: MakeArm, name: str) -> None:
    arm = make_arm(position_limits=[(-20, 20), (-math.pi, math.pi)])
    path = TwoLinkPath(arm, PATHS[name](), "negative")
    table, q = path.table(), np.empty(2)
    lam = np.concatenate([np.random.default_rng(0).uniform(0.0, path.length, 3000), path.breakpoints, [-1.0, 99.0]])
    wanted = path.evaluate(lam)[0]
    for value, row in zip(lam, wanted, strict=True):
        path_point(table, value, q)
        np.testing.assert_allclose(q, row, atol=1e-11)


def line(start: tuple[float, float, float], end: tuple[float, float, float]) -> CartesianPath:
    return CartesianPath([Line(np.array(start), np.array(end))])


REFUSED = {
    "far": (
        line((0.3, 0.0, 0.0), (0.7, 0.0, 0.0)),
        r"unreachable at station 0.4 m: 0.7 m from its base, too far for links of 0.37 m and 0.23 m",
        0.4,
    ),
    "near": (
        line((0.3, 0.0, 0.0), (0.1, 0.0, 0.0)),
        r"unreachable at station 0.2 m: 0.1 m from its base, too near",
        0.2,
    ),
    "stretched": (line((0.3, 0.0, 0.0), (0.6, 0.0, 0.0)), r"singular at station 0.3 m: the arm is stretched", 0.3),
    "folded": (line((0.3, 0.0, 0.0), (0.14, 0.0, 0.0)), r"(singular|unreachable) at station 0.16 m", 0.16),
    "touches its reach": (line((0.59999999, -0.1, 0.0), (0.59999999, 0.1, 0.0)), "unreachable at station", 0.0),
    "plane": (line((0.3, 0.0, 0.0), (0.4, 0.0, 0.1)), r"leaves the plane in which its tip moves by 0.1 m", None),
}


@pytest.mark.parametrize("case", REFUSED)
def test_paths_that_the_arm_cannot_follow_are_refused_with_the_station(make_arm: MakeArm, case: str) -> None:
    cartesian, message, station = REFUSED[case]
    with pytest.raises(PathError, match=message) as refusal:
        TwoLinkPath(make_arm(name="left"), cartesian, "positive")
    assert "'left'" in str(refusal.value)
    assert refusal.value.remedy
    assert refusal.value.data["arm"] == "left"
    if station is not None:
        assert refusal.value.data["station"] == pytest.approx(station, abs=1e-9)


def test_a_joint_limit_on_the_path_is_named(make_arm: MakeArm) -> None:
    arm = make_arm(position_limits=[(-math.pi, math.pi), (-1.0, 1.0)])
    with pytest.raises(
        PathError, match=r"limit of joint 'joint_2' at station .* is outside \[-1, 1\].*other elbow"
    ) as refusal:
        TwoLinkPath(arm, quarter_circle(), "negative")
    assert refusal.value.data["joint"] == 1


def test_other_arms_are_refused() -> None:
    import pybullet_data

    iiwa = Arm.from_urdf(Path(pybullet_data.getDataPath()) / "kuka_iiwa" / "model.urdf", name="iiwa")
    with pytest.raises(PathError, match=r"arm 'iiwa' has 7 joints.*two revolute joints"):
        TwoLinkPath(iiwa, quarter_circle(), "positive")

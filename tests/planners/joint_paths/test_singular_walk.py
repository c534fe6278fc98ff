"""Joint paths that begin at, pass, end in or stay in singular postures: exact, or refused with the two postures."""

from __future__ import annotations

import logging
from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import ArrayLike
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from armtempo.arrays import Floats
from armtempo.configs import data_path
from armtempo.errors import PathError
from armtempo.planners import BlendedPath, JointPath, Line, PathDynamics, minimum_time
from armtempo.planners.joint_paths import CartesianJointPath, Poses
from armtempo.robots import Arm

WIDE = [None, None, None, (-6.0, 6.0), None, (-6.0, 6.0)]
UR = Arm.from_urdf(data_path("robots/ur5e_like.urdf"))
PUMA = Arm.from_urdf(data_path("robots/puma560.urdf"), position_limits=WIDE)
UR_START, PUMA_START = (0.3, -1.2, 1.5, -1.8, 0.0, 0.2), (0.2, -0.5, 0.3, 0.0, 0.0, 0.0)
OUT = {"ur": np.array([np.cos(0.3), np.sin(0.3), 0.0]), "puma": np.array([np.cos(0.2), np.sin(0.2), 0.0])}
UP = np.array([0.0, 0.0, 1.0])
CENTRAL = ((1, 4 / 5), (2, -1 / 5), (3, 4 / 105), (4, -1 / 280))  # differences of eighth order


class PolynomialMotion:
    """The poses of joints that are polynomials of lambda: a path that can be followed through any posture."""

    def __init__(self, arm: Arm, coefficients: ArrayLike, length: float = 0.3) -> None:
        self.arm, self.coefficients, self.length = arm, np.asarray(coefficients), length
        self.breakpoints = np.array([0.0, length])
        self.bends = np.array([[50.0, 50.0]])

    def joints(self, s: ArrayLike, order: int = 0) -> Floats:
        polynomial = np.polynomial.polynomial
        c = polynomial.polyder(self.coefficients, order) if order else self.coefficients
        return np.moveaxis(np.asarray(polynomial.polyval(np.asarray(s, dtype=np.float64), c), dtype=np.float64), 0, -1)

    def twist(self, s: Floats) -> Floats:
        return np.asarray(np.einsum("...ij,...j->...i", self.arm.jacobian(self.joints(s)), self.joints(s, 1)))

    def poses(self, s: ArrayLike, *, before: bool = False) -> Poses:
        s, h = np.asarray(s, dtype=np.float64), 1e-3
        T, twist = self.arm.tip_pose(self.joints(s)), self.twist(s)
        change = np.asarray(sum(w * (self.twist(s + k * h) - self.twist(s - k * h)) for k, w in CENTRAL)) / h
        return Poses(
            T[..., :3, 3], T[..., :3, :3], twist[..., :3], twist[..., 3:], change[..., :3], change[..., 3:]
        )  # fmt: skip


def check_exact(path: CartesianJointPath, arm: Arm, pieces: bool = False) -> None:
    """On the poses to rounding; both derivatives are those of the joints (differences of eighth order)."""
    lam = np.linspace(0.0, path.length, 1501)
    q = path.evaluate(lam)[0]
    T, wanted = arm.tip_pose(q), path._poses.poses(lam)
    np.testing.assert_allclose(T[:, :3, 3], wanted.position, atol=1e-12)
    np.testing.assert_allclose(T[:, :3, :3], wanted.rotation, atol=1e-12)
    h = 2e-3 * path.length
    inner = np.linspace(5 * h, path.length - 5 * h, 499)
    if pieces:  # curvature jumps at breakpoints
        inner = inner[np.abs(inner[:, None] - path.breakpoints).min(axis=1) > 5 * h]
    _, dq, ddq = path.evaluate(inner)
    for order, exact, tolerance in ((0, dq, 1e-6 if pieces else 1e-7), (1, ddq, 1e-3 if pieces else 1e-5)):
        steps = (w * (path.evaluate(inner + k * h)[order] - path.evaluate(inner - k * h)[order]) for k, w in CENTRAL)
        np.testing.assert_allclose(np.asarray(sum(steps)) / h, exact, atol=tolerance * np.abs(exact).max())
    bound = path.speed_bound(lam[:-1], lam[1:])
    speed = np.abs(path.evaluate(0.5 * (lam[1:] + lam[:-1]))[1])
    assert (speed <= bound * (1 + 1e-9)).all()


def along(arm: Arm, start: Floats, *ways: Floats) -> CartesianJointPath:
    points = [arm.tip_pose(start)[:3, 3]]
    for way in ways:
        points.append(points[-1] + way)
    lines = [Line(a, b) for a, b in pairwise(points)]
    path = JointPath.along(BlendedPath(lines, 0.02, curve="quintic"), arm, start=start)
    assert isinstance(path, CartesianJointPath)
    return path


@pytest.mark.parametrize("bent", [0.0, 1e-12, 1e-9, 1e-7, 1e-5, 1e-4, -1e-3, 0.003, 0.01, -0.05])
@pytest.mark.parametrize(("name", "way"), [("ur", "out"), ("ur", "up"), ("puma", "up"), ("puma", "down")])
def test_lines_in_the_plane_of_the_arm_with_a_straight_wrist(name: str, way: str, bent: float) -> None:
    """The joints that least squares find who knows of three parallel joints only: they alone move."""
    arm, start = (UR, np.array(UR_START)) if name == "ur" else (PUMA, np.array(PUMA_START))
    start[4] += bent
    v = 0.1 * {"out": OUT[name], "up": UP, "down": -UP}[way]
    path = along(arm, start, v)
    check_exact(path, arm)
    np.testing.assert_allclose(path.evaluate(0.0)[0], start, atol=1e-9)
    moving = [1, 2, 3] if name == "ur" else [1, 2, 4]
    T, q = arm.tip_pose(start), start.copy()
    for s in np.linspace(0.0, 1.0, 11):

        def miss(x: Floats) -> Floats:
            y = q.copy()
            y[moving] = x
            here = arm.tip_pose(y)
            turned = Rotation.from_matrix(here[:3, :3] @ T[:3, :3].T).as_rotvec()
            return np.concatenate([here[:3, 3] - T[:3, 3] - s * v, turned])  # noqa: B023

        q[moving] = least_squares(miss, q[moving], xtol=1e-15, ftol=1e-15, gtol=1e-15).x
        np.testing.assert_allclose(path.evaluate(s * path.length)[0], q, atol=1e-7)


@pytest.mark.parametrize("where", [0.0, 0.001, 0.07, 0.15, 0.3])
@pytest.mark.parametrize("seed", [0, 1])
@pytest.mark.parametrize("name", ["ur", "puma"])
def test_motions_across_a_straight_wrist_come_out_again(name: str, seed: int, where: float) -> None:
    """All joints move, the wrist is straight for an instant: joints and derivatives are those it was made of."""
    arm = UR if name == "ur" else PUMA
    random = np.random.default_rng(seed)
    c = np.zeros((4, 6))
    c[0] = UR_START if name == "ur" else (0.2, 0.8, -2.9, 0.3, 0.0, 0.1)
    c[1:] = random.normal(size=(3, 6)) * np.array([[1.0], [1.0], [2.0]])
    c[1, 4] = (-1.0) ** seed * 2.0
    c[0, 4] = -np.polynomial.polynomial.polyval(where, c[:, 4])
    motion = PolynomialMotion(arm, c)
    path = CartesianJointPath(arm, motion, motion.joints(0.0))
    check_exact(path, arm)
    lam = np.linspace(0.0, motion.length, 997)
    for order, tolerance in enumerate((1e-9, 1e-6, 1e-3)):
        np.testing.assert_allclose(path.evaluate(lam)[order], motion.joints(lam, order), atol=tolerance)


@pytest.mark.parametrize("bent", [0.0, 0.02, -0.05])
@pytest.mark.parametrize("name", ["ur", "puma"])
def test_blended_corners_in_the_plane_and_their_minimum_time(name: str, bent: float) -> None:
    arm, start = (UR, np.array(UR_START)) if name == "ur" else (PUMA, np.array(PUMA_START))
    start[4] += bent
    path = along(arm, start, 0.1 * UP, -0.1 * OUT[name])
    check_exact(path, arm, pieces=True)
    assert minimum_time(PathDynamics.from_path(arm, path)).certificate.excess <= 1e-3


@pytest.mark.parametrize("twisted", [0.3, 1e-3, 1e-5])
def test_a_start_that_the_line_does_not_leave_from_is_told_with_the_one_it_does(twisted: float) -> None:
    """Joints 4 and 6 cancel out where the wrist is straight; to bend it in the plane they must both be zero."""
    start = np.array(PUMA_START)
    start[3], start[5] = twisted, -twisted
    with pytest.raises(PathError, match=r"its joints would have to jump from \[.*\] to \[.*station 0 m") as told:
        along(PUMA, start, 0.1 * UP)
    np.testing.assert_allclose(told.value.data["before"], start, atol=1e-9)
    np.testing.assert_allclose(told.value.data["after"], PUMA_START, atol=1e-6)


def test_a_line_that_asks_for_what_is_lost_is_refused() -> None:
    with pytest.raises(PathError, match="would have to jump from") as told:
        along(PUMA, np.array(PUMA_START), 0.1 * np.cross(UP, OUT["puma"]))
    assert told.value.data["reason"] == "singular"
    assert len(told.value.data["before"]) == len(told.value.data["after"]) == 6


def test_an_arc_at_the_full_reach_of_a_straight_elbow_is_refused_not_cut_short() -> None:
    """Two links: that the elbow stays straight follows from second derivatives only."""
    two = Arm.from_urdf(data_path("robots/planar_two_link.urdf"), tip_link="tool")
    with pytest.raises(PathError, match="too near a singularity"):
        CartesianJointPath(two, PolynomialMotion(two, [[0.3, 0.0], [1.0, 0.0]]), [0.3, 0.0])


def test_a_start_beside_the_path_is_moved_with_a_word(caplog: pytest.LogCaptureFixture) -> None:
    start = np.array([0.3, 0.8, -2.9, 0.2, 1.0, 0.1])
    T = PUMA.tip_pose(start)
    motion = BlendedPath(
        [Line(T[:3, 3], T[:3, 3] + 0.05 * UP)], 0.01, orientation=[Rotation.from_matrix(T[:3, :3]).as_quat()] * 2
    )
    with caplog.at_level(logging.WARNING, "armtempo"):
        near = JointPath.along(motion, PUMA, start=np.round(start, 6) + 1e-6)
        assert not caplog.records
        beside = JointPath.along(motion, PUMA, start=start + np.array([0, 0, 0, 0, 0.02, 0]))
    assert isinstance(near, CartesianJointPath)
    assert isinstance(beside, CartesianJointPath)
    assert np.abs(near.moved).max() < 1e-5
    assert beside.moved[4] == pytest.approx(-0.02, abs=1e-9)
    assert "joint 'joint_5' was moved by -0.02" in caplog.text or "was moved by -0.02 " in caplog.text

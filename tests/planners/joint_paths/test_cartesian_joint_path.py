"""Joint paths of any arm along Cartesian paths: closed forms, exact derivatives, bounds, refusals, timing."""

from __future__ import annotations

import importlib
import math
from collections.abc import Callable
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pybullet_data
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from armtempo.arrays import Floats
from armtempo.configs import data_path, robot_config
from armtempo.errors import InputError, PathError, UnknownNameError
from armtempo.planners import (
    AbstractJointPath,
    Arc,
    BlendedPath,
    CartesianPath,
    JointPath,
    Line,
    PathDynamics,
    minimum_time,
)
from armtempo.planners.ik import SphericalWristIK
from armtempo.planners.joint_paths import CartesianJointPath, Poses, ScaraPath, TwoLinkPath
from armtempo.planners.joint_paths.kernels import path_point
from armtempo.robots import Arm

pin: Any = importlib.import_module("pinocchio")  # without types of its own
ta: Any = importlib.import_module("toppra")
constraint: Any = importlib.import_module("toppra.constraint")

STARTS = {
    "puma": (0.3, 0.8, -2.9, 0.2, 1.0, 0.1),
    "panda": (0.2, 0.3, 0.1, -2.0, 0.1, 2.2, 0.785),
    "iiwa": (0.2, 0.5, 0.1, -1.4, 0.1, 1.0, 0.2),
    "scara": (0.3, 0.9, -0.1, 0.2),
    "two": (0.3, 1.7),
}


@cache
def robot(name: str) -> Arm:
    if name == "puma":
        return Arm.from_urdf(data_path("robots/puma560.urdf"))
    if name in ("scara", "two"):
        file = {"scara": "scara_800", "two": "planar_two_link"}[name]
        return Arm.from_urdf(data_path(f"robots/{file}.urdf"), tip_link="tool")
    file = {"panda": "franka_panda/panda.urdf", "iiwa": "kuka_iiwa/model.urdf"}[name]
    sheet = robot_config(f"pybullet_data/{file}")
    assert sheet is not None
    limits = sheet.limits
    return Arm.from_urdf(
        Path(pybullet_data.getDataPath()) / file, tip_link=sheet.tip_link, torque_max=limits.torque_nm,
        speed_max=limits.speed_rad_s, position_limits=limits.position_rad, acceleration_max=limits.acceleration_rad_s2,
    )  # fmt: skip


def corners(name: str, seed: int = 0, *, turned: bool = False, scale: float = 0.12) -> BlendedPath:
    """Four corners between lines and arcs about the tip of the start, which they begin at; quintic blends."""
    random = np.random.default_rng(seed)
    pose = robot(name).tip_pose(STARTS[name])
    steps = random.normal(size=(5, 3)) * (1.0, 1.0, 0.0 if name == "two" else 0.4)
    steps *= scale / np.linalg.norm(steps, axis=1, keepdims=True)
    points = [pose[:3, 3]]
    for k, step in enumerate(steps):  # to and fro: sides that two blends fit on
        points.append(pose[:3, 3] + (step if k % 2 == 0 else -0.5 * step))
    segments: list[Line | Arc] = []
    for k, (a, b) in enumerate(pairwise(points)):
        bulge = 0.15 * np.cross(b - a, (0.0, 0.0, 1.0))
        segments.append(Line(a, b) if k % 2 == 0 else Arc.through(a, 0.5 * (a + b) + bulge, b))
    ends = None
    if turned:
        first = Rotation.from_matrix(pose[:3, :3])
        ends = [first.as_quat(), (Rotation.from_rotvec([0.2, -0.3, 0.3]) * first).as_quat()]
    size = 0.25 * min(segment.length for segment in segments)
    return BlendedPath(segments, size, curve="quintic", orientation=ends)


@cache
def followed(name: str, seed: int = 0, *, turned: bool = False, scale: float = 0.12) -> CartesianJointPath:
    return CartesianJointPath(robot(name), corners(name, seed, turned=turned, scale=scale), STARTS[name])


class Swing:
    """Poses of one's own: a circle, the tool swings about z to and fro."""

    def __init__(self, first: Floats) -> None:
        self.first, self.radius, self.length = first, 0.1, 0.4
        self.breakpoints = np.array([0.0, self.length])
        self.bends = np.array([[1.0 / self.radius, 0.3 * 8.0**2]])

    def poses(self, s: ArrayLike, *, before: bool = False) -> Poses:
        s = np.asarray(s, dtype=np.float64)
        angle, zero = s / self.radius, np.zeros(s.shape)
        out = np.stack([np.cos(angle), np.sin(angle), zero], axis=-1)
        along = np.stack([-np.sin(angle), np.cos(angle), zero], axis=-1)
        yaw = 0.3 * np.sin(8.0 * s)
        c, s_, one = np.cos(yaw), np.sin(yaw), np.ones(s.shape)
        z = np.stack([c, -s_, zero, s_, c, zero, zero, zero, one], axis=-1).reshape(*s.shape, 3, 3)
        up = np.array([0.0, 0.0, 1.0])
        return Poses(
            self.first[:3, 3] + self.radius * (out - (1.0, 0.0, 0.0)),
            z @ self.first[:3, :3],
            along,
            (2.4 * np.cos(8.0 * s))[..., None] * up,
            -out / self.radius,
            (-19.2 * np.sin(8.0 * s))[..., None] * up,
        )


def test_the_closed_forms_of_scara_and_two_links_come_out() -> None:
    lam = np.linspace(0.0, 1.0, 700)
    for name, scale in (("scara", 0.08), ("two", 0.12)):
        cartesian = corners(name, scale=scale)
        closed = JointPath.along(cartesian, robot(name), elbow="positive")
        ours = JointPath.along(cartesian, robot(name), start=closed.evaluate(0.0)[0])
        assert isinstance(closed, ScaraPath if name == "scara" else TwoLinkPath)
        assert isinstance(ours, CartesianJointPath)
        stations = np.concatenate([lam * ours.length, ours.breakpoints])
        for before in (False, True):
            both = (path.evaluate(stations, before=before) for path in (ours, closed))
            for a, b in zip(*both, strict=True):
                np.testing.assert_allclose(a, b, rtol=1e-10, atol=1e-11 * (1.0 + np.abs(b).max()))


def test_the_closed_form_of_a_puma_comes_out() -> None:
    path = followed("puma", turned=True)
    closed = SphericalWristIK(path.arm)
    q = path.evaluate(np.linspace(0.0, path.length, 500))[0]
    branch = closed.branch(q)
    assert (branch == branch[0]).all()
    own = closed.solve(path.arm.tip_pose(q))[np.arange(500), branch]
    np.testing.assert_allclose(np.sin(0.5 * (own - q)), 0.0, atol=1e-10)


@pytest.mark.parametrize("name", ["puma", "panda", "iiwa"])
@pytest.mark.parametrize("turned", [False, True])
def test_the_tip_is_on_the_path_and_both_derivatives_are_exact(name: str, turned: bool) -> None:
    cartesian, path = corners(name, turned=turned), followed(name, turned=turned)
    lam = np.linspace(0.0, path.length, 2001)
    q, dq, ddq = path.evaluate(lam)
    T = path.arm.tip_pose(q)
    np.testing.assert_allclose(T[:, :3, 3], cartesian.position(lam), atol=1e-13)
    keep = Rotation.from_quat(cartesian.orientation(lam)) if turned else Rotation.from_matrix(T[0, :3, :3])
    np.testing.assert_allclose(T[:, :3, :3], np.broadcast_to(keep.as_matrix(), (2001, 3, 3)), atol=1e-13)
    np.testing.assert_allclose(q[0], STARTS[name], atol=1e-12)
    # Central differences err by h^2: so extrapolated, by h^4, where no sample of the reference is near.
    edges = np.union1d(path.breakpoints, path.station)
    inner = 0.5 * (edges[1:] + edges[:-1])[::7]
    h = 0.03 * np.diff(edges)[::7, None]
    sides = [[path.evaluate(inner + sign * k * h[:, 0]) for sign in (1.0, -1.0)] for k in (1.0, 0.5)]
    _, dq, ddq = path.evaluate(inner)
    for order, exact in ((0, dq), (1, ddq)):
        coarse, fine = (
            (after[order] - before[order]) / (2.0 * k * h) for k, (after, before) in zip((1.0, 0.5), sides, strict=True)
        )
        np.testing.assert_allclose((4.0 * fine - coarse) / 3.0, exact, atol=2e-7 * np.abs(exact).max())


def test_both_sides_of_a_breakpoint_fit_the_curvature_there() -> None:
    """A line runs into an arc: the curvature jumps, and with it f''; pinocchio has the drift J' q'."""
    puma = robot("puma")
    start = puma.tip_pose(STARTS["puma"])[:3, 3]
    end = start - (0.1, 0.0, 0.0)
    cartesian = CartesianPath([Line(start, end), Arc(end, end - (0.1, 0.1, 0.0), end - (0.0, 0.1, 0.0))])
    path = CartesianJointPath(puma, cartesian, STARTS["puma"])
    model = pin.buildModelFromUrdf(str(puma.urdf))
    data, joint = model.createData(), model.frames[-1].name
    frame = model.getFrameId(joint)
    for before, bend in ((True, (0.0, 0.0, 0.0)), (False, (0.0, -10.0, 0.0))):
        q, dq, ddq = path.evaluate(path.breakpoints[1], before=before)
        pin.forwardKinematics(model, data, q, dq, ddq)
        pin.updateFramePlacements(model, data)
        found = pin.getFrameClassicalAcceleration(model, data, frame, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED)
        np.testing.assert_allclose(found.linear, bend, atol=1e-9)
        np.testing.assert_allclose(found.angular, 0.0, atol=1e-9)
        np.testing.assert_allclose(puma.jacobian(q) @ dq, (-1.0, 0.0, 0.0, 0.0, 0.0, 0.0), atol=1e-12)


@pytest.mark.parametrize("name", ["puma", "panda"])
def test_poses_of_ones_own(name: str) -> None:
    arm = robot(name)
    motion = Swing(arm.tip_pose(STARTS[name]))
    path = JointPath.along(motion, arm, start=STARTS[name])
    lam = np.linspace(0.0, path.length, 300)
    q, dq, _ = path.evaluate(lam)
    wanted, T = motion.poses(lam), arm.tip_pose(q)
    np.testing.assert_allclose(T[:, :3, 3], wanted.position, atol=1e-13)
    np.testing.assert_allclose(T[:, :3, :3], wanted.rotation, atol=1e-13)
    twist = np.concatenate([wanted.tangent, wanted.turning], axis=1)
    np.testing.assert_allclose(np.einsum("kij,kj->ki", arm.jacobian(q), dq), twist, atol=1e-10)


def test_spare_joints_move_smoothly_and_the_same_each_time() -> None:
    path, again = followed("panda"), CartesianJointPath(robot("panda"), corners("panda"), STARTS["panda"])
    lam = np.linspace(0.0, path.length, 999)
    for a, b in zip(path.evaluate(lam), again.evaluate(lam), strict=True):
        np.testing.assert_array_equal(a, b)
    # C2 at the samples of the reference, where N jumps, as long as the Cartesian path is.
    inside = path.station[np.abs(path.station[:, None] - path.breakpoints).min(axis=1) > 1e-9]
    for order, tolerance in ((0, 1e-12), (1, 1e-10), (2, 1e-9)):
        a, b = path.evaluate(inside)[order], path.evaluate(inside, before=True)[order]
        np.testing.assert_allclose(a, b, atol=tolerance * (1.0 + np.abs(a).max()))
    # Drawn to another posture the tip still follows.
    spare = np.linalg.svd(path.arm.jacobian(STARTS["panda"]))[2][-1]
    other = CartesianJointPath(path.arm, corners("panda"), STARTS["panda"], posture=STARTS["panda"] + 0.3 * spare)
    q = other.evaluate(lam)[0]
    assert np.abs(q - path.evaluate(lam)[0]).max() > 0.02
    np.testing.assert_allclose(path.arm.tip_pose(q)[:, :3, 3], corners("panda").position(lam), atol=1e-13)


def test_position_alone_leaves_a_puma_three_spare_joints() -> None:
    path = CartesianJointPath(robot("puma"), corners("puma"), STARTS["puma"], task="position")
    lam = np.linspace(0.0, path.length, 400)
    q, dq, _ = path.evaluate(lam)
    np.testing.assert_allclose(path.arm.tip_pose(q)[:, :3, 3], corners("puma").position(lam), atol=1e-13)
    whole = followed("puma").evaluate(lam)[1]
    assert np.linalg.norm(dq, axis=1).mean() < np.linalg.norm(whole, axis=1).mean()  # it moves less
    low = np.linspace(0.0, path.length, 257)[:-1]
    _check_bounds(path, low, low + path.length / 256)


def _check_bounds(path: AbstractJointPath, low: Floats, high: Floats) -> float:
    """Bounds are above dense samples; how much at most, of what the fastest joint does there."""
    bound = path.speed_bound(low, high)
    seen = np.abs(path.evaluate(low[:, None] + np.linspace(0.0, 1.0, 9) * (high - low)[:, None])[1]).max(axis=1)
    assert (bound >= seen).all()
    return float((bound.max(axis=1) / seen.max(axis=1)).max())


@settings(max_examples=8)
@given(st.sampled_from(["puma", "panda", "iiwa"]), st.integers(0, 40), st.booleans(), st.floats(0.05, 0.15))
def test_the_speed_bound_is_one_and_tight(name: str, seed: int, turned: bool, scale: float) -> None:
    try:
        path = followed(name, seed, turned=turned, scale=scale)
    except PathError:  # out of reach
        assume(False)
    edge = np.linspace(0.0, path.length, 2049)
    assert _check_bounds(path, edge[:-1], edge[1:]) < 1.3
    random = np.sort(np.random.default_rng(seed).uniform(0.0, path.length, (200, 2)), axis=1)
    _check_bounds(path, random[:, 0], random[:, 1])


@pytest.mark.parametrize("name", ["puma", "panda"])
def test_the_table_of_inner_loops_is_the_path(name: str) -> None:
    path = followed(name, turned=True)
    table, out = path.table(), np.empty(path.dof)
    lam = np.random.default_rng(3).uniform(0.0, path.length, 500)
    for station, wanted in zip(lam, path.evaluate(lam)[0], strict=True):
        path_point(table, station, out)
        np.testing.assert_allclose(out, wanted, atol=1e-9)


def test_inverse_takes_a_tip_beside_the_path() -> None:
    path = followed("panda")
    lam = np.linspace(0.0, path.length, 50)
    beside = corners("panda").position(lam) + np.array([1e-4, -1e-4, 2e-4])
    q = path.inverse(beside, lam)
    np.testing.assert_allclose(path.arm.tip_pose(q)[:, :3, 3], beside, atol=1e-13)
    assert np.abs(q - path.evaluate(lam)[0]).max() < 0.01
    assert path.inverse(beside[3], lam[3]).shape == (7,)
    with pytest.raises(PathError, match="is lost"):
        path.inverse(beside[3] + 2.0, lam[3])


def line(name: str, *steps: tuple[float, float, float]) -> CartesianPath:
    points = [robot(name).tip_pose(STARTS[name])[:3, 3]]
    for step in steps:
        points.append(points[-1] + step)
    return CartesianPath([Line(a, b) for a, b in pairwise(points)])


def test_out_of_the_workspace() -> None:
    with pytest.raises(PathError, match=r"'puma560' leaves the workspace: .*stops .* short.*station 0\.\d+") as e:
        CartesianJointPath(robot("puma"), line("puma", (0.5, 0.0, 0.0)), STARTS["puma"])
    assert e.value.data["reason"] == "workspace"
    # The oracle: no branch of the closed form reaches on from there.
    closed, T = SphericalWristIK(robot("puma")), robot("puma").tip_pose(STARTS["puma"])
    for offset, reaches in ((-0.005, True), (0.005, False)):
        there = T.copy()
        there[0, 3] += e.value.data["station"] + offset
        assert np.isfinite(closed.solve(there)).all(axis=-1).any() == reaches


def test_through_a_singular_wrist() -> None:
    """The tool of a PUMA turns until axes 4 and 6 are in line, then on: in a plane through them both ways are steady,
    beside it joint 4 has to turn by nearly 180 degrees at once."""
    free = [None, None, None, (-7.0, 7.0), None, (-7.0, 7.0)]
    puma = Arm.from_urdf(data_path("robots/puma560.urdf"), position_limits=free)
    q = np.array([0.3, 0.8, -2.9, 0.05, 0.6, 0.1])
    T = puma.tip_pose(q)
    axis = puma.link_poses(np.where(np.arange(6) == 3, 0.0, q))[4, :3, :3] @ puma.model.axis[4]
    first = Rotation.from_matrix(T[:3, :3])
    ends = [first.as_quat(), (Rotation.from_rotvec(-1.2 * axis) * first).as_quat()]
    path = BlendedPath([Line(T[:3, 3], T[:3, 3] + (0.0, 0.0, 0.05))], 0.01, orientation=ends)
    with pytest.raises(PathError, match=r"passes too near a singularity.*allow .* m/s only; the smallest") as e:
        CartesianJointPath(puma, path, q, speed_min=0.02)
    assert e.value.data["reason"] == "singular"
    assert e.value.data["singular_value"] < 0.05
    slow = CartesianJointPath(puma, path, q, speed_min=1e-4)
    lam = np.linspace(0.0, slow.length, 4001)
    speed = (puma.speed_max / np.abs(slow.evaluate(lam)[1]).max(axis=0)).min()
    assert 1e-4 < speed < 0.02
    edge = np.linspace(0.0, slow.length, 2049)
    assert _check_bounds(slow, edge[:-1], edge[1:]) < 1.3


@pytest.mark.parametrize("alone", ["closed form", "falling error"])
def test_a_straight_wrist_is_no_end_of_the_workspace(alone: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Axes 4 and 6 come into line within the reach: the damped tracker gets there, but slowly. Two things tell."""
    if alone == "closed form":
        monkeypatch.setattr("armtempo.planners.joint_paths._cartesian_joint_path.FALLING_SHARE", 1.0)
    else:
        monkeypatch.setattr(CartesianJointPath, "_in_closed_form", lambda *_: False)
    free = [None, None, None, (-6.0, 6.0), None, (-6.0, 6.0)]
    puma = Arm.from_urdf(data_path("robots/puma560.urdf"), position_limits=free)
    q = np.array([0.3, 0.8, -2.9, 0.2, 0.3, 0.1])
    first, last = puma.tip_pose(q), puma.tip_pose(q + np.array([0.05, 0.02, -0.03, 0.0, -0.6, 0.0]))
    ends = [Rotation.from_matrix(T[:3, :3]).as_quat() for T in (first, last)]
    path = BlendedPath([Line(first[:3, 3], last[:3, 3])], 0.01, orientation=ends)
    with pytest.raises(PathError, match="too near a singularity") as e:
        CartesianJointPath(puma, path, q, speed_min=1e-4)
    assert e.value.data["reason"] == "singular"


def test_at_a_joints_limit() -> None:
    panda = robot("panda")
    limits = np.stack([panda.position_min, panda.position_max], axis=1)
    limits[3] = -2.2, -1.9
    narrow = Arm.from_urdf(panda.urdf, tip_link=panda.tip_link, position_limits=limits.tolist())
    with pytest.raises(PathError, match=r"breaks the limit of joint 'panda_joint4'.*-1.9.*station 0\.") as e:
        CartesianJointPath(narrow, line("panda", (0.15, 0.0, 0.15)), STARTS["panda"])
    assert (e.value.data["reason"], e.value.data["joint"]) == ("limit", 3)
    beyond = np.array(STARTS["panda"])
    beyond[3] = -1.8
    with pytest.raises(PathError, match="starts outside the range of joint 'panda_joint4'"):
        CartesianJointPath(narrow, line("panda", (0.1, 0.0, 0.0)), beyond)
    limits[3] = -1.99, -1.0  # the start is inside, what it is moved to is not
    inside = np.array(STARTS["panda"])
    inside[3] = -1.98
    narrow = Arm.from_urdf(panda.urdf, tip_link=panda.tip_link, position_limits=limits.tolist())
    with pytest.raises(PathError, match="starts outside the range of joint 'panda_joint4': -2"):
        CartesianJointPath(narrow, corners("panda", turned=True), inside)


def test_the_start_is_moved_onto_the_path_or_refused() -> None:
    rounded = np.round(STARTS["panda"], 1)
    path = CartesianJointPath(robot("panda"), corners("panda", turned=True), rounded)
    assert np.abs(path.evaluate(0.0)[0] - rounded).max() < 0.25
    np.testing.assert_allclose(
        path.arm.tip_pose(path.evaluate(0.0)[0])[:3, 3], corners("panda").position(0.0), atol=1e-13
    )
    with pytest.raises(PathError, match=r"does not begin at the start posture, whose tip is 0\.\d+ m") as e:
        CartesianJointPath(robot("panda"), corners("panda"), np.array(STARTS["panda"]) + 0.5)
    assert e.value.data["reason"] == "start"


def test_a_singular_start_is_told_as_such() -> None:
    for name, joint in (("puma", 4), ("two", 1)):
        straight = np.array(STARTS[name])
        straight[joint] = 0.0
        tip = robot(name).tip_pose(straight)[:3, 3]
        with pytest.raises(PathError, match=r"too near a singularity.*station 0 m") as e:
            CartesianJointPath(robot(name), Line(tip, 0.9 * tip), straight)
        assert e.value.data["reason"] == "singular"


@pytest.mark.parametrize("axis", [(1.0, 0.0, 0.0), (0.0, 0.6, 0.8)])
def test_half_a_turn_at_the_start(axis: tuple[float, float, float]) -> None:
    """Newton's error, the sine of the angle, is zero there."""
    tip = robot("puma").tip_pose(STARTS["puma"])
    half = (Rotation.from_rotvec(np.pi * np.array(axis)) * Rotation.from_matrix(tip[:3, :3])).as_quat()
    path = BlendedPath.through([tip[:3, 3], 0.9 * tip[:3, 3]], orientation=[half, half])
    with pytest.raises(PathError, match=r"does not begin at the start.* 3\.142 rad from it"):
        CartesianJointPath(robot("puma"), path, STARTS["puma"])


@pytest.mark.parametrize(("rise", "height"), [(0.03, 0.0), (0.0, 0.5), (1e-5, 0.0)])
def test_beside_the_plane_of_two_links(rise: float, height: float) -> None:
    """As the closed form refuses it: the task has no row across the plane."""
    tip = robot("two").tip_pose(STARTS["two"])[:3, 3] + (0.0, 0.0, height)
    path = Line(tip, tip + np.array([-0.05, 0.02, rise]))
    with pytest.raises(PathError, match=rf"workspace: it is {max(rise, height):.4g} m beside"):
        JointPath.along(path, robot("two"), start=STARTS["two"])
    with pytest.raises(PathError, match="leaves the plane"):
        JointPath.along(path, robot("two"), elbow="positive")


@pytest.mark.parametrize("tilt", [0.5, np.pi])
def test_a_tilt_that_a_scara_has_not(tilt: float) -> None:
    tip = robot("scara").tip_pose(STARTS["scara"])
    tilted = (Rotation.from_rotvec((tilt, 0.0, 0.0)) * Rotation.from_matrix(tip[:3, :3])).as_quat()
    path = BlendedPath.through([tip[:3, 3], 0.9 * tip[:3, 3]], orientation=[tilted, tilted])
    with pytest.raises(PathError, match=rf"by {tilt:.4g} rad about axes that the arm has not \(station 0 m") as e:
        CartesianJointPath(robot("scara"), path, STARTS["scara"])
    assert e.value.data["reason"] == "turning"


def test_turning_that_the_arm_has_not() -> None:
    first = Rotation.from_matrix(robot("scara").tip_pose(STARTS["scara"])[:3, :3])
    points = robot("scara").tip_pose(STARTS["scara"])[:3, 3] + [(0.0, 0.0, 0.0), (0.1, 0.0, 0.0)]
    for axis, fits in (((0.0, 0.0, 0.4), True), ((0.4, 0.0, 0.0), False)):
        ends = [first.as_quat(), (Rotation.from_rotvec(axis) * first).as_quat()]
        path = BlendedPath.through(points, orientation=ends)
        if fits:
            q = CartesianJointPath(robot("scara"), path, STARTS["scara"]).evaluate(path.length)[0]
            T = robot("scara").tip_pose(q)
            np.testing.assert_allclose(T[:3, :3], Rotation.from_quat(ends[1]).as_matrix(), atol=1e-12)
            continue
        with pytest.raises(PathError, match=r"turns the tool by 4 rad/m about axes that the arm has not"):
            CartesianJointPath(robot("scara"), path, STARTS["scara"])
    with pytest.raises(PathError, match="has 4 joints, its task 6 rows"):
        CartesianJointPath(robot("scara"), BlendedPath.through(points), STARTS["scara"], task="pose")


def test_what_cannot_be_used() -> None:
    puma, path, start = robot("puma"), corners("puma"), STARTS["puma"]
    for options, words in (
        ({"start": start[:5]}, "start of shape"),
        ({"start": [*start[:5], math.nan]}, "not finite"),
        ({"posture": [*start[:5], math.inf], "task": "position"}, "posture of shape .* not finite"),
        ({"task": np.eye(6)}, "task array"),
        ({"speed_min": 0.0}, "speed_min"),
        ({"task": "tip"}, "task 'tip'"),
        ({"cartesian": 3}, "int is no Cartesian path"),
    ):
        arguments: dict[str, Any] = {"cartesian": path, "start": start, **options}
        with pytest.raises(InputError, match=words):
            CartesianJointPath(puma, **arguments)
    bad: Callable[[str, Any], Swing] = lambda name, value: _changed(Swing(puma.tip_pose(start)), name, value)  # noqa: E731
    with pytest.raises(InputError, match="bends of shape"):
        CartesianJointPath(puma, bad("bends", np.zeros((2, 2))), start)
    with pytest.raises(InputError, match="breakpoints do not rise"):
        CartesianJointPath(puma, bad("breakpoints", np.array([0.0, 0.3])), start)
    mirrored = puma.tip_pose(start)
    mirrored[:3, 0] *= -1.0
    with pytest.raises(InputError, match="no rotations"):
        CartesianJointPath(puma, Swing(mirrored), start)
    for choice in ({}, {"elbow": "positive", "start": start}):
        with pytest.raises(InputError, match="its elbow or its start posture, one of the two"):
            JointPath.along(path, puma, **choice)  # type: ignore[arg-type]
    with pytest.raises(PathError, match="is no SCARA"):
        JointPath.along(path, puma, elbow="positive")
    with pytest.raises(UnknownNameError, match="elbow"):
        JointPath.along(path, robot("two"), elbow="up")  # type: ignore[arg-type]
    with pytest.raises(InputError, match="closed forms are for lines"):
        JointPath.along(Swing(puma.tip_pose(start)), puma, elbow="positive")


def _changed(motion: Swing, name: str, value: object) -> Swing:
    setattr(motion, name, value)
    return motion


def test_the_door_takes_a_line_for_a_chain_of_one() -> None:
    tip = robot("two").tip_pose(STARTS["two"])[:3, 3]
    one = Line(tip, tip + np.array([0.05, 0.02, 0.0]))
    closed = JointPath.along(one, robot("two"), elbow="positive")
    ours = JointPath.along(one, robot("two"), start=STARTS["two"])
    assert isinstance(closed, TwoLinkPath)
    np.testing.assert_allclose(ours.evaluate(0.03)[0], closed.evaluate(0.03)[0], atol=1e-12)


@pytest.mark.parametrize("name", ["panda", "puma"])
def test_minimum_time_along_lines_and_arcs(name: str) -> None:
    """The path of the issue: certificate clean, the tip on the path, Pinocchio's torques, toppra's duration."""
    arm, path = robot(name), followed(name, turned=True)
    motion = minimum_time(PathDynamics.from_path(arm, path, intervals=1500))
    assert motion.certificate.excess <= 1e-3
    t = np.linspace(0.0, motion.duration, 4001)
    lam, mu, mu_dot = motion.at(t)
    q, dq, ddq = path.evaluate(lam)
    tip = arm.tip_pose(q)[:, :3, 3]
    np.testing.assert_allclose(tip, corners(name, turned=True).position(lam), atol=1e-9)
    qd, qdd = dq * mu[:, None], ddq * mu[:, None] ** 2 + dq * mu_dot[:, None]
    assert (np.abs(qd) <= arm.speed_max * (1 + 1e-3)).all()
    torque = arm.inverse_dynamics(q, qd, qdd)
    assert (np.abs(torque) <= arm.torque_max * 1.01).all()  # a grid's corner between samples
    if name == "puma":
        model = pin.buildModelFromUrdf(str(arm.urdf))
        data = model.createData()
        rows = range(0, 4001, 40)
        friction = arm.damping * qd + arm.coulomb * np.sign(qd)
        theirs = np.array([pin.rnea(model, data, q[k], qd[k], qdd[k]) for k in rows]) + friction[rows]
        np.testing.assert_allclose(torque[rows], theirs, atol=1e-8 * np.abs(theirs).max())
    assert motion.duration == pytest.approx(toppra_duration(arm, path), rel=8e-3)  # finer: in tests/benchmarks


def toppra_duration(arm: Arm, path: AbstractJointPath, intervals: int = 1500) -> float:
    """The oracle: toppra with the arm's inverse dynamics and limits."""

    class Geometry(ta.interpolator.AbstractGeometricPath):  # type: ignore[misc]
        dof = path.dof
        path_interval = np.array([0.0, path.length])
        waypoints = None

        def __call__(self, s: Floats, order: int = 0) -> Floats:
            return path.evaluate(s)[order]

    def both(most: Floats) -> Floats:
        return np.stack([-most, most], axis=1)

    scheme = constraint.DiscretizationType.Interpolation
    limits = [
        constraint.JointTorqueConstraint(
            arm.inverse_dynamics, both(arm.torque_max), np.zeros(path.dof), discretization_scheme=scheme
        ),
        constraint.JointVelocityConstraint(both(arm.speed_max)),
    ]
    if np.isfinite(arm.acceleration_max).any():
        most = np.where(np.isfinite(arm.acceleration_max), arm.acceleration_max, 1e6)
        limits.append(constraint.JointAccelerationConstraint(both(most), discretization_scheme=scheme))
    solver = ta.algorithm.TOPPRA(
        limits, Geometry(), gridpoints=np.union1d(np.linspace(0.0, path.length, intervals + 1), path.breakpoints),
        solver_wrapper="seidel", parametrizer="ParametrizeConstAccel",
    )  # fmt: skip
    return float(solver.compute_trajectory(0.0, 0.0).duration)

"""IK cells: the paper's, own files, what is refused; motions of a pose; random targets for any arm."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from hypothesis import given
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from armtempo.configs import IKCellConfig, parse_cell_config
from armtempo.errors import CollisionError, ConfigError, InfeasibleError, InputError, PathError, UnknownNameError
from armtempo.planners import CoordinationCell, IKCell, build_cell, load_cell
from armtempo.planners.cells import TARGET_FAMILIES, draw_target
from armtempo.planners.geometry._pose_motions import JointMotion, smooth_step, through_poses
from armtempo.planners.ik import SphericalWristIK
from armtempo.robots import Arm, Clearance

FAMILIES = TARGET_FAMILIES[1:]
ARMS: dict[str, tuple[str, str | None, list[float]]] = {
    "puma": ("puma560.urdf", None, [0, -0.5, 0.5, 0, 0.7, 0]),
    "panda": ("pybullet_data/franka_panda/panda.urdf", None, [0, -0.3, 0, -2.0, 0, 1.8, 0.5]),
    "scara": ("scara_800.urdf", "tool", [0.3, 0.8, 0.0, 0.05]),
    "planar": ("planar_two_link.urdf", "tool", [0.3, 0.8]),
}


def data(arm: str, **changes: Any) -> dict[str, Any]:
    urdf, tip, start = ARMS[arm]
    body = {"name": arm, "urdf": urdf, "start_rad": start}
    if tip:
        body["tip_link"] = tip
    T = {"time_s": 0, "position_m": [0.3, 0.0, 0.3]}
    poses = [T, {"time_s": 1.0, "position_m": [0.3, 0.1, 0.3], "rpy_rad": [0, 0, 1]}]
    return {"kind": "ik", "name": "mine", "arm": body, "target": {"poses": poses}, "law": {"task": "auto"}} | changes


def cell_of(arm: str, folder: Path = Path(), **changes: Any) -> IKCell:
    return build_cell(parse_cell_config(data(arm, **changes), folder / "mine.yaml", IKCellConfig))


def test_the_papers_cell(chung: IKCell) -> None:
    assert chung.duration == pytest.approx(4.0 * math.pi, abs=0.5 * chung.control_period)
    assert chung.ticks % chung.ticks_per_period == 0
    t = chung.target.time
    swing = np.cos(0.5 * t)[:, None]
    wanted = np.array([0.45, -0.05, 0.55]) + np.array([0.25, 0.45, 0.45]) * swing
    np.testing.assert_allclose(chung.target.position[::2], wanted, atol=1e-14)
    np.testing.assert_allclose(chung.target.rotation[0], [[0, 1, 0], [0, 0, 1], [1, 0, 0]], atol=1e-15)
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = chung.target.rotation[0], chung.target.position[0]
    branches = SphericalWristIK(chung.arm).solve(T)
    np.testing.assert_allclose(chung.start, branches[0], atol=1e-12)  # arm +, elbow +, wrist +
    J = chung.arm.jacobian(chung.nominal.q)
    assert np.linalg.svd(J, compute_uv=False)[:, -1].min() == pytest.approx(0.193, abs=5e-4)
    others = [float(chung.singular_value(chung.solver.track(chung.target, q).q).min()) for q in branches[1::2]]
    assert max(others) < float(chung.singular_value(chung.nominal.q).min()) + 1e-9
    assert np.abs(chung.nominal.qd).max() == pytest.approx(0.706, abs=1e-3)
    assert chung.nominal.position_error.max() < 1e-10


@pytest.mark.parametrize("arm", ARMS)
@pytest.mark.parametrize("family", FAMILIES)
def test_every_family_suits_every_arm(arm: str, family: str) -> None:
    cell = cell_of(arm)
    singular = []
    for seed in range(2):
        drawn = draw_target(cell, family, np.random.default_rng(seed))
        target, start = drawn.target, drawn.start
        assert drawn.arm is cell.arm
        T = cell.arm.tip_pose(start)
        np.testing.assert_allclose(T[:3, 3], target.position[0], atol=1e-9)
        np.testing.assert_allclose(T[:3, :3], target.rotation[0], atol=1e-9)
        assert (start >= cell.arm.position_min).all()
        assert (start <= cell.arm.position_max).all()
        for rate in (target.velocity, target.angular_velocity):  # at rest at both ends, and smooth between
            assert np.abs(rate[[0, -1]]).max() < 1e-9
            assert np.abs(np.diff(rate, axis=0)).max() < 0.05
        steps = np.diff(target.position[::2], axis=0) / target.step  # rates are those of the positions
        np.testing.assert_allclose(steps, target.velocity[1::2], atol=1e-4)
        again = draw_target(cell, family, np.random.default_rng(seed))
        np.testing.assert_array_equal(again.target.position, target.position)
        run = drawn.nominal
        assert np.isfinite(run.q).all()
        singular.append(float(drawn.singular_value(run.q).min()))
        if family == "smooth":
            assert run.position_error.max() < 1e-5
            assert run.share["damped"] == 0.0
            assert run.share["speed"] == 0.0
        if family == "partly-unreachable":
            reach, base = cell.solver.length, cell.arm.link_poses(start)[0, :3, 3]
            away = np.linalg.norm(target.position[::2] - base, axis=1) > reach
            assert 0.05 < away.mean() < 0.8
            assert not away[[0, -1]].any()
            assert run.position_error.max() > 0.02 * reach
    if family == "near-singular":
        spare = cell.arm.dof > len(cell.solver.task)  # then the law's own motion may pass at a distance
        assert max(singular) < (2.0 if spare else 1.0) * cell.config.law.damping
    if family == "smooth":
        assert min(singular) > 2.0 * cell.config.law.damping


@pytest.mark.parametrize("family", FAMILIES[:2])
@pytest.mark.parametrize("arm", ["puma", "panda"])
def test_drawn_motions_keep_the_limits_they_promise(arm: str, family: str) -> None:
    """Of the arm's own motion; out of reach there is none."""
    cell = cell_of(arm)
    clearance = Clearance([cell.arm], ())
    for seed in range(2):
        drawn = draw_target(cell, family, np.random.default_rng(10 + seed))
        run = drawn.nominal
        q, qd = run.q[::10], run.qd[::10]
        assert (q >= cell.arm.position_min).all()
        assert (q <= cell.arm.position_max).all()
        if family == "smooth":
            if cell.arm.dof == 6:  # with spare joints the law's motion is not the one that was drawn
                assert (np.abs(qd) / cell.arm.speed_max).max() < 0.52
                qdd = np.gradient(run.qd, cell.physics_tick, axis=0)[::10]
                torque = np.abs(cell.arm.inverse_dynamics(q, qd, qdd)) / cell.arm.torque_max
                assert torque[5:-5].max() < 0.85
            assert min(clearance.self_collision(0, row).distance for row in q[::10]) > 0.0


def test_given_is_the_cells_own_and_unknown_families_are_refused(chung: IKCell) -> None:
    assert draw_target(chung, "given", np.random.default_rng(0)) is chung
    with pytest.raises(UnknownNameError, match=r"unknown family of targets 'singular' \(.*near-singular"):
        draw_target(chung, "singular", np.random.default_rng(0))


def test_an_arm_that_only_slides_is_never_out_of_reach(chung: IKCell, tmp_path: Path) -> None:
    file = tmp_path / "gantry.urdf"
    file.write_text(
        """<robot name="gantry"><link name="base"/><link name="cart"><inertial><mass value="1"/>
        <inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link><joint name="x" type="prismatic">
        <parent link="base"/><child link="cart"/><axis xyz="1 0 0"/>
        <limit lower="3.5" upper="4" effort="9" velocity="1"/></joint></robot>"""
    )
    arm = Arm.from_urdf(file)
    with pytest.raises(PathError, match="nothing is known to be out of reach of arm 'gantry'"):
        draw_target(replace(chung, arm=arm), "partly-unreachable", np.random.default_rng(0))


def test_variants_of_a_cell_are_checked(chung: IKCell) -> None:
    motion = JointMotion(chung.arm, np.stack([chung.start, chung.start]), 1.0)
    with pytest.raises(InputError, match="nan of joint 'waist_joint'"):
        chung.variant(motion, 1.0, chung.start * np.nan)
    for duration in (-5.0, 0.0, np.nan):
        with pytest.raises(InputError, match="duration"):
            chung.variant(motion, duration, chung.start)


def test_an_arm_too_weak_for_any_target_says_so(chung: IKCell, monkeypatch: pytest.MonkeyPatch) -> None:
    from armtempo.planners.cells import _pose_families

    monkeypatch.setattr(_pose_families, "MOST_DRAWS", 5)
    monkeypatch.setattr(_pose_families, "LOAD_SHARE_MAX", 1e-3)
    with pytest.raises(PathError, match="none of 5 targets drawn as 'smooth' suits arm 'puma'"):
        draw_target(chung, "smooth", np.random.default_rng(0))


@given(seed=st.integers(0, 10_000))
@hypothesis_settings(max_examples=30)
def test_motions_have_the_rates_they_say(seed: int) -> None:
    """Against central differences, in position and rotation."""
    random = np.random.default_rng(seed)
    times = np.concatenate([[0.0], np.cumsum(random.uniform(0.3, 1.0, 3))])
    rotations = Rotation.from_quat(random.normal(size=(4, 4))).as_matrix()
    motion = through_poses(times.tolist(), random.normal(size=(4, 3)), rotations)
    t, h = random.uniform(0.01, times[-1] + 0.2, 20), 1e-5
    _, _, v, w = (np.asarray(part) for part in motion(t))
    (p0, R0, _, _), (p1, R1, _, _) = motion(t - h), motion(t + h)
    np.testing.assert_allclose((np.asarray(p1) - np.asarray(p0)) / (2 * h), v, atol=2e-4)
    turn = (Rotation.from_matrix(np.asarray(R1)) * Rotation.from_matrix(np.asarray(R0)).inv()).as_rotvec()
    np.testing.assert_allclose(turn / (2 * h), w, atol=2e-4)
    at_poses = np.asarray(motion(times)[2])
    np.testing.assert_allclose(at_poses, 0.0, atol=1e-12)


def test_poses_are_passed_at_their_times_and_the_last_one_held() -> None:
    R = Rotation.from_rotvec([[0, 0, 0], [0, 0, 1.0], [0, 0.5, -2.0]]).as_matrix()
    motion = through_poses([0.0, 1.0, 1.5], np.eye(3), R)
    p, rotations, _, _ = motion(np.array([0.0, 1.0, 1.5, 9.0]))
    np.testing.assert_allclose(np.asarray(p), np.eye(3)[[0, 1, 2, 2]], atol=1e-15)
    np.testing.assert_allclose(np.asarray(rotations), R[[0, 1, 2, 2]], atol=1e-12)
    value, slope = smooth_step([-1.0, 0.0, 0.5, 1.0, 2.0])
    np.testing.assert_allclose(value, [0, 0, 0.5, 1, 1])
    np.testing.assert_allclose(slope, [0, 0, 15 / 8, 0, 0])


def test_joint_motions_run_from_rest_to_rest(chung: IKCell) -> None:
    postures = chung.start + np.array([0.0, 0.3, -0.2])[:, None]
    motion = JointMotion(chung.arm, postures, 2.0)
    q, qd = motion.joints(np.array([0.0, 1.0, 2.0, 3.0]))
    np.testing.assert_allclose(q, postures[[0, 1, 2, 2]], atol=1e-12)
    np.testing.assert_allclose(qd[[0, 2, 3]], 0.0, atol=1e-12)
    T = chung.arm.tip_pose(q)
    np.testing.assert_allclose(np.asarray(motion(np.array([0.0, 1.0, 2.0, 3.0]))[0]), T[:, :3, 3], atol=1e-12)


def test_own_files_load_and_faults_are_named(tmp_path: Path) -> None:
    file = tmp_path / "mine.yaml"

    def load(**changes: Any) -> IKCell:
        file.write_text(yaml.safe_dump(data("puma") | changes))
        return load_cell(file, IKCell)

    cell = load(control_period_s=0.03, physics_tick_s=0.002)
    assert (cell.ticks_per_period, cell.ticks) == (15, 34 * 15)  # 1 s in whole periods
    assert cell.arms == (cell.arm,)
    np.testing.assert_allclose(cell.target.position[-1], [0.3, 0.1, 0.3])
    body = data("puma")["arm"]
    with pytest.raises(InputError, match=r"mine.yaml, arm: start_rad has 5 values, and arm 'puma' has 6 joints"):
        load(arm=body | {"start_rad": [0] * 5})
    with pytest.raises(InputError, match=r"start_rad: 7 of joint 'waist_joint' is outside its range"):
        load(arm=body | {"start_rad": [7, 0, 0, 0, 0, 0]})
    with pytest.raises(InfeasibleError, match=r"cannot hold still where the target has it at .* 'shoulder_joint'"):
        load(arm=body | {"limits": {"torque_nm": [None, 1, None, None, None, None]}})
    with pytest.raises(ConfigError, match="an ik cell, and a coordination cell is needed here"):
        load_cell(file, CoordinationCell)


def test_a_start_that_touches_itself_is_refused() -> None:
    """A Panda whose hand is at its own base."""
    said = data("panda")
    said["arm"]["start_rad"] = [0.79, -0.81, -2.66, -3.02, 1.82, 3.42, 0.62]
    with pytest.raises(CollisionError, match=r"touches itself where the target has it at 0 s"):
        build_cell(parse_cell_config(said, Path("mine.yaml"), IKCellConfig))

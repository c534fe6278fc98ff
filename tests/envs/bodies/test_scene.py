"""The arm in PyBullet is the planners' arm: pose, tip, dynamics, with and without a tool; resets are exact."""

from __future__ import annotations

import ctypes
import os
import subprocess
import sys
import threading
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pybullet
import pytest
import yaml

from armtempo.configs import ArmConfig
from armtempo.envs import CoordinationEnv, CoordinationOptions, CoordinationSimulation, YieldingEnv
from armtempo.envs.bodies import _bullet_scene
from armtempo.envs.bodies._bullet_scene import BulletScene
from armtempo.errors import RobotError
from armtempo.planners import CoordinationCell, load_cell
from armtempo.robots import Arm, urdf_text

POSITION, RPY = (0.1, -0.2, 0.3), (0.35, -0.2, 0.5)


def _tilted_cell(folder: Path, *, tool: bool) -> CoordinationCell:
    """One arm on a tilted base, so that it carries weight, on a line; with or without a tool."""
    cr, cp, cy = np.cos(RPY)
    sr, sp, sy = np.sin(RPY)
    R = np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]]) @ [[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]]
    R = R @ [[1, 0, 0], [0, cr, -sr], [0, sr, cr]]
    height = 0.04 if tool else 0.0  # of the working point above the plane of the links
    start, end = ((R @ point + POSITION).tolist() for point in ([0.42, 0.05, height], [0.30, 0.30, height]))
    arm: dict[str, object] = {
        "name": "master",
        "urdf": "planar_two_link.urdf",
        "base": {"position_m": list(POSITION), "rpy_rad": list(RPY)},
        "elbow": "negative",
        "tip_link": "tool",
        "limits": {"torque_nm": [40, 20]},
        "path": {"start_m": start, "segments": [{"line": {"to_m": end}}]},
    }
    if tool:
        arm["tool"] = {
            "mass_kg": 0.8,
            "com_m": [0.03, 0.01, 0.02],
            "inertia_kgm2": [0.002, 0.003, 0.004, 0.0005, -0.0003, 0.0002],
            "frame": {"position_m": [0.05, 0.02, height], "rpy_rad": [0.1, 0.2, 0.3]},
        }
    content = {
        "kind": "coordination",
        "name": "tilted",
        "description": "one arm on a tilted base",
        "d_min_m": 0.01,
        "clearance_reserve_m": 0.0005,
        "physics_tick_s": 0.001,
        "control_period_s": 0.004,
        "arms": [arm],
    }
    file = folder / "tilted.yaml"
    file.write_text(yaml.safe_dump(content))
    return load_cell(file)


@pytest.fixture(params=["lee1991", "tilted", "tilted with tool"])
def cell(request: pytest.FixtureRequest, lee1991: CoordinationCell, tmp_path: Path) -> CoordinationCell:
    if request.param == "lee1991":
        return lee1991
    return _tilted_cell(tmp_path, tool=request.param.endswith("tool"))


def _tip_in_pybullet(scene: BulletScene, i: int, arm: Arm) -> tuple[np.ndarray, np.ndarray]:
    """Origin and rotation of the arm's tip link (without the tool's frame) as PyBullet has them."""
    body, client = scene.bodies[i], scene.client
    state = pybullet.getLinkState(body, arm.dof - 1, computeForwardKinematics=True, physicsClientId=client)
    rotation = np.array(pybullet.getMatrixFromQuaternion(state[5])).reshape(3, 3)
    return np.array(state[4]) + rotation @ arm.model.tip_p, rotation @ arm.model.tip_R


def test_tips_are_where_the_planner_has_them(cell: CoordinationCell) -> None:
    scene, random = BulletScene(cell), np.random.default_rng(0)
    for _ in range(10):
        q = random.uniform(-2.5, 2.5, (len(cell.arms), 2))
        scene.put_joints(q, np.zeros_like(q))
        for i, arm in enumerate(cell.arms):
            bare = Arm.from_urdf(arm.urdf, T_world_base=arm.T_world_base, tip_link=arm.tip_link)
            origin, rotation = _tip_in_pybullet(scene, i, bare)
            np.testing.assert_allclose(
                origin, bare.tip_pose(q[i])[:3, 3], atol=1e-6
            )  # link frames are told in single precision
            np.testing.assert_allclose(rotation, bare.tip_pose(q[i])[:3, :3], atol=1e-6)
            config = cell.config.arms[i]
            if config.tool is not None:  # the planner's tip is the tool's working point
                tip = origin + rotation @ np.array(config.tool.frame.position_m)
                np.testing.assert_allclose(tip, arm.tip_pose(q[i])[:3, 3], atol=1e-6)
    scene.close()


def test_one_tick_obeys_the_planners_dynamics(cell: CoordinationCell) -> None:
    """Free fall and random torques: the change of speed over one tick against our inverse dynamics."""
    scene, random, dt = BulletScene(cell), np.random.default_rng(1), 1e-3
    pybullet.setTimeStep(dt, physicsClientId=scene.client)
    pybullet.setGravity(*cell.config.gravity_m_s2, physicsClientId=scene.client)
    shape = (len(cell.arms), 2)
    for trial in range(20):
        q, qd = random.uniform(-2.5, 2.5, shape), random.uniform(-3.0, 3.0, shape)
        torque = random.uniform(-5.0, 5.0, shape) if trial else np.zeros(shape)
        scene.put_joints(q, np.zeros_like(q))
        for body, joints, row, speed in zip(scene.bodies, scene.joints, q, qd, strict=True):
            for joint, a, b in zip(joints, row, speed, strict=True):
                pybullet.resetJointState(body, joint, a, b, physicsClientId=scene.client)
        scene.apply_torque(torque)
        after, speed_after = np.zeros(shape), np.zeros(shape)
        scene.read_joints(after, speed_after)
        for i, arm in enumerate(cell.arms):
            wanted = arm.inverse_dynamics(q[i], qd[i], (speed_after[i] - qd[i]) / dt)
            np.testing.assert_allclose(wanted, torque[i], atol=2e-6 * max(1.0, np.abs(wanted).max()))
        np.testing.assert_allclose(after, q + dt * speed_after, atol=1e-12)  # semi-implicit
    scene.close()


def _goal(cell: CoordinationCell) -> np.ndarray:
    """Where the cell file wants the tip to end."""
    given = cell.config.arms[0]
    assert isinstance(given, ArmConfig)
    line = given.path.segments[-1].line
    assert line is not None
    return np.array(line.to_m)


@pytest.mark.parametrize("tool", [False, True])
def test_an_arm_alone_that_carries_its_weight_and_a_tool(tmp_path: Path, tool: bool) -> None:
    cell = _tilted_cell(tmp_path, tool=tool)
    env = CoordinationEnv(cell, record=True)
    observations, _ = env.reset()
    assert not observations["arm_0"][5:].any()
    while env.agents:
        observations, _, _, _, infos = env.step({"arm_0": np.ones(1, dtype=np.float32)})
    trace = env.trace
    assert infos["arm_0"]["is_success"]
    assert trace.makespan == pytest.approx(cell.fastest[0].duration, rel=0.01)
    assert trace.torque_ratio_max <= 1.0
    assert trace.path_error.max() < 2e-4
    tips = cell.arms[0].tip_pose(trace.q[0])[:, :3, 3]
    np.testing.assert_allclose(tips[-1], _goal(cell), atol=1e-3)
    env.close()


def test_the_mass_without_the_tool_is_another_one(tmp_path: Path) -> None:
    """The tests above can fail: a forgotten tool changes the torques by far more than their tolerance."""
    with_tool = _tilted_cell(tmp_path, tool=True).arms[0]
    without = Arm.from_urdf(with_tool.urdf, T_world_base=with_tool.T_world_base, tip_link=with_tool.tip_link)
    q, zero = np.array([0.3, 0.4]), np.zeros(2)
    assert np.abs(with_tool.inverse_dynamics(q, zero, zero) - without.inverse_dynamics(q, zero, zero)).max() > 0.1


def test_resets_are_bit_exact(lee1991: CoordinationCell) -> None:
    simulation, random = CoordinationSimulation(lee1991, CoordinationOptions()), np.random.default_rng(4)
    runs: list[list[bytes]] = []
    for _ in range(3):
        simulation.reset(0.2)
        runs.append([])
        for k in range(40):
            simulation.step(np.array([1.0, 0.5 + 0.5 * np.sin(k)]))
            runs[-1].append(simulation.joint_positions().tobytes())
        for _ in range(int(random.integers(1, 20))):  # leave it somewhere
            simulation.step(random.uniform(0.0, 1.0, 2))
    assert runs[0] == runs[1] == runs[2]
    simulation.close()


def test_no_contacts_and_no_hidden_damping(lee1991: CoordinationCell) -> None:
    """Arms through each other in PyBullet: no contact force, and their energy of motion stays."""
    scene = BulletScene(lee1991)
    pybullet.setTimeStep(1e-4, physicsClientId=scene.client)
    pybullet.setGravity(0.0, 0.0, 0.0, physicsClientId=scene.client)
    q = np.array([path.evaluate(0.5 * path.length)[0] for path in lee1991.paths])
    scene.put_joints(q, np.zeros_like(q))
    for body, joints, row in zip(scene.bodies, scene.joints, q, strict=True):
        for joint, a in zip(joints, row, strict=True):
            pybullet.resetJointState(body, joint, a, 1.0, physicsClientId=scene.client)
    arm, qd = lee1991.arms[0], np.ones((2, 2))
    before = [0.5 * v @ arm.mass_matrix(x) @ v for x, v in zip(q, qd, strict=True)]
    for _ in range(2000):
        scene.apply_torque(np.zeros((2, 2)))
        assert not pybullet.getContactPoints(physicsClientId=scene.client)
    scene.read_joints(q, qd)
    after = [0.5 * v @ arm.mass_matrix(x) @ v for x, v in zip(q, qd, strict=True)]
    np.testing.assert_allclose(after, before, rtol=1e-3)
    scene.close()


def test_bodies_that_are_not_the_arms_are_refused(lee1991: CoordinationCell, monkeypatch: pytest.MonkeyPatch) -> None:
    """A mass, a place and an axis that are off by little; the client is left, too."""
    model = lee1991.arms[1].model
    for change in (
        {"mass": model.mass * (1.0 + 1e-6)},
        {"placement_p": model.placement_p + np.array([1e-6, 0.0, 0.0])},
        {"com": model.com + np.array([0.0, 1e-7, 0.0])},
        {"inertia": model.inertia * 1.001},
    ):
        other = replace(lee1991.arms[1], model=model._replace(**change))
        monkeypatch.setattr(_bullet_scene, "urdf_text", lambda arm, visuals, other=other: urdf_text(other, visuals))
        monkeypatch.setattr(BulletScene, "_weigh", lambda self, *args: None)
        with pytest.raises(
            RobotError, match=r"arm 'slave': its .* in PyBullet are off by .* from what is planned with"
        ):
            BulletScene(replace(lee1991, arms=(lee1991.arms[1],)))


def test_pybullet_prints_nothing(capfd: pytest.CaptureFixture[str]) -> None:
    """Its console output is C's: a JSON on standard output stays one."""
    env = CoordinationEnv("panda-pair", physics="bullet", render_mode="rgb_array")
    env.reset(seed=0)
    env.render()
    env.close()
    ctypes.CDLL(None).fflush(None)
    assert capfd.readouterr() == ("", "")


def test_threads_leave_standard_output_where_it_is(lee1991: CoordinationCell) -> None:
    def work() -> None:
        for _ in range(8):
            BulletScene(lee1991).close()

    before = [os.fstat(number) for number in (1, 2)]
    threads = [threading.Thread(target=work) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    for number, was in zip((1, 2), before, strict=True):
        now = os.fstat(number)
        assert (now.st_dev, now.st_ino) == (was.st_dev, was.st_ino)


def test_without_standard_output_and_at_the_end_of_a_process(tmp_path: Path) -> None:
    line = "from armtempo.envs import YieldingEnv; e = YieldingEnv(physics='bullet', render_mode='rgb_array')"
    line += "; e.reset(seed=0); assert e.render().shape == (480, 640, 3)"  # never closed
    open_ = subprocess.run([sys.executable, "-c", line], capture_output=True, text=True, check=True)
    assert (open_.stdout, open_.stderr) == ("", "")
    shell = f'"{sys.executable}" -c "{line}" >&- 2>&-'
    assert subprocess.run(["sh", "-c", shell], check=False, cwd=tmp_path).returncode == 0


@pytest.mark.parametrize("seed", [1, 4])
def test_a_chain_of_forty_joints(tmp_path: Path, seed: int) -> None:
    """Its text is longer than the lines that PyBullet reads."""
    random, parts = np.random.default_rng(seed), ['<robot name="long"><link name="l0"/>']
    for k in range(1, 41):
        xyz, rpy, axis = (" ".join(map(repr, random.uniform(-1.0, 1.0, 3).tolist())) for _ in range(3))
        parts.append(
            f'<link name="l{k}"><inertial><origin xyz="{xyz}"/><mass value="1.2345678901234567"/>'
            '<inertia ixx="0.3" iyy="0.4" izz="0.5" ixy="0.01" ixz="0.02" iyz="0.03"/></inertial></link>'
            f'<joint name="j{k}" type="revolute"><origin xyz="{xyz}" rpy="{rpy}"/><axis xyz="{axis}"/>'
            f'<parent link="l{k - 1}"/><child link="l{k}"/>'
            '<limit lower="-1" upper="1" effort="1" velocity="1"/></joint>'
        )
    file = tmp_path / "long.urdf"
    file.write_text("".join([*parts, "</robot>"]))
    arm = Arm.from_urdf(file)
    assert len(urdf_text(arm)) > 3 * 8192
    cell: Any = SimpleNamespace(arms=(arm,), gravity=(0.0, 0.0, -9.81), physics_tick=1e-3)
    BulletScene(cell).close()


def test_many_environments_share_nothing_in_pybullet(lee1991: CoordinationCell) -> None:
    envs = [YieldingEnv(lee1991) for _ in range(8)]
    clients = [env.simulation._controller.scene.client for env in envs]  # type: ignore[union-attr]
    assert len(set(clients)) == len(clients)
    for env in envs:
        env.close()

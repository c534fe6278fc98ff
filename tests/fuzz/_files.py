"""Fuzzers of everything that is read from a file but checkpoints: valid files, damaged, and their readers."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import trimesh

from armtempo.agents.policies import load_agent
from armtempo.configs import data_path, load_cell_config, load_sweep_config, load_train_config
from armtempo.files import write_sealed
from armtempo.planners import JointPath, build_cell, load_cell, read_trajectory, write_trajectory
from armtempo.planners.instances import label_cell, load_instance, save_instance
from armtempo.robots import Arm
from tests.agents.trained import FILES
from tests.fuzz._finite import check_finite
from tests.fuzz._mutations import (
    Damage,
    Random,
    damaged_bytes,
    damaged_json,
    damaged_npz,
    damaged_text,
    damaged_xml,
    damaged_yaml,
    pick,
)


class Seed(NamedTuple):
    """A valid file: its name, what it says, and how it is damaged."""

    name: str
    data: bytes
    damage: Damage


class FileFuzzer:
    """Writes a damaged file and reads it.

    Args:
        folder: Where it is written.
        seeds: Valid files.
        read: Takes the file's path; the model, or raises.
    """

    spent = False

    def __init__(self, folder: Path, seeds: list[Seed], read: Callable[[Path], object]) -> None:
        self._folder, self._seeds, self._read = folder, seeds, read
        for seed in seeds:
            self.run((seed.name, seed.data))  # what is not damaged must be accepted, and compiles what is used

    def make(self, random: Random) -> tuple[str, bytes]:
        seed = pick(random, self._seeds)
        return seed.name, seed.damage(random, seed.data)

    def run(self, given: tuple[str, bytes]) -> bool:
        name, data = given
        file = self._folder / name
        file.write_bytes(data)
        check_finite(self._read(file))
        return True

    def shown(self, given: tuple[str, bytes]) -> bytes:
        return given[1]


def _coarse(name: str) -> bytes:
    """A bundled cell of which a plan takes little time."""
    text = data_path(f"cells/{name}.yaml").read_text(encoding="utf-8")
    for fine, coarse in (("stations: 1000", "stations: 200"), ("duration_s: 12.566370614359172", "duration_s: 0.2")):
        text = text.replace(fine, coarse)
    return text.encode()


def sealed_again(random: Random, folder: Path, data: bytes) -> bytes:
    """Mostly with a digest that fits: what reads the contents is to be tried, not the digest alone."""
    if random.random() < 0.1:
        return data
    write_sealed(folder / "sealed", data)
    return (folder / "sealed").read_bytes()


def cell_files(folder: Path) -> FileFuzzer:
    """Cells of all kinds; those that are accepted are built."""
    names = ("lee1991", "lee2006", "chung", "mixed-priority", "planar-four", "panda-poses")
    seeds = [Seed("mine.yaml", _coarse(name), damaged_yaml) for name in names]
    seeds.append(Seed("mine.yaml", _everything().encode(), damaged_yaml))

    def read(file: Path) -> object:
        config = load_cell_config(file, None)
        check_finite(config)
        cell: Any = build_cell(config)
        return config, cell.arms, getattr(cell, "paths", None), [_numbers(arm) for arm in cell.arms]

    return FileFuzzer(folder, seeds, read)


def _everything() -> str:
    """A cell that uses what the bundled ones do not: tools, friction, obstacles, waypoints."""
    return """
kind: coordination
name: everything
d_min_m: 0.005
physics_tick_s: 0.001
control_period_s: 0.004
stations: 100
chart_cells: 128
gravity_m_s2: [0, 0, -9.81]
obstacles:
  - name: post
    pose: {position_m: [0.3, 2.0, 0], rpy_rad: [0, 0, 0.1]}
    box: {size_m: [0.1, 0.1, 0.5]}
  - name: ball
    pose: {position_m: [0.3, -2.0, 0]}
    sphere: {radius_m: 0.1}
arms:
  - name: one
    urdf: planar_two_link.urdf
    base: {position_m: [0, 0, 0], rpy_rad: [0, 0, 0]}
    tip_link: tool
    tool:
      mass_kg: 0.5
      com_m: [0.02, 0, 0]
      inertia_kgm2: [0.001, 0.001, 0.001, 0, 0, 0]
      frame: {position_m: [0.05, 0, 0], rpy_rad: [0, 0, 0]}
      hull_m: [[0, 0, 0], [0.05, 0, 0], [0, 0.01, 0], [0, 0, 0.01]]
    limits:
      {torque_nm: [25, null], speed_rad_s: [10, 10], acceleration_rad_s2: [100, null], jerk_rad_s3: [null, 9000],
       position_rad: [[-3, 3], null]}
    friction: {viscous_nm_s_rad: [0.1, 0.1], coulomb_nm: [0.01, null]}
    path:
      waypoints_rad: [[0.1, 0.2], [0.5, -0.3], [0.9, 0.4]]
  - name: other
    urdf: planar_two_link.urdf
    base: {position_m: [1.5, 0, 0], rpy_rad: [0, 0, 3.14]}
    tip_link: tool
    elbow: positive
    limits: {torque_nm: [25, 7]}
    path:
      start_m: [1.1, 0.1, 0]
      blend: {curve: cubic, remaining_distance_m: 0.02}
      segments:
        - line: {to_m: [1.1, 0.2, 0]}
        - line: {to_m: [1.2, 0.25, 0]}
        - arc: {to_m: [1.3, 0.25, 0], via_m: [1.25, 0.27, 0]}
"""


def _numbers(arm: Arm) -> tuple[object, ...]:
    """What planners ask of an arm, in a posture within its limits."""
    low, high = (np.clip(limit, -1.0, 1.0) for limit in (arm.position_min, arm.position_max))
    q = 0.5 * (low + high)
    ones = np.ones(arm.dof)
    tip = arm.tip_pose(q)
    return tip, arm.inverse_dynamics(q, ones, ones), arm.model, arm.capsules, [shape.vertices for shape in arm.shapes]


def urdf_files(folder: Path) -> FileFuzzer:
    """Robots of boxes, capsules, cylinders, spheres and meshes; meshes, too."""
    seeds = [
        Seed("robot.urdf", data_path(f"robots/{name}.urdf").read_bytes(), damaged_xml)
        for name in ("planar_two_link", "puma560", "scara_800", "ur5e_like")
    ]
    robot = _WITH_MESHES.encode()
    seeds += [Seed("robot.urdf", robot, damaged_xml)] * 2
    box: Any = trimesh.creation.box((0.1, 0.1, 0.3))
    meshes = {"bar.stl": box.export(file_type="stl"), "bar.obj": box.export(file_type="obj").encode()}
    for name, data in meshes.items():
        (folder / name).write_bytes(data)
    seeds += [Seed(name, data, damaged_bytes if name == "bar.stl" else damaged_text) for name, data in meshes.items()]

    def read(file: Path) -> object:
        if file.suffix != ".urdf":
            whole, file = file, folder / "whole.urdf"
            file.write_bytes(robot)
        else:
            whole = None
        try:
            tip = "tool" if b'name="finger"' in file.read_bytes() else None
            arm = Arm.from_urdf(file, tip_link=tip)
        finally:
            if whole is not None:
                whole.write_bytes(meshes[whole.name])
        return arm, _numbers(arm)

    return FileFuzzer(folder, seeds, read)


_WITH_MESHES = """<robot name="meshes">
  <link name="base"><collision><geometry><box size="0.2 0.2 0.1"/></geometry></collision></link>
  <link name="one">
    <inertial><origin xyz="0 0 0.1" rpy="0 0 0.1"/><mass value="2"/>
      <inertia ixx="0.02" ixy="0" ixz="0.001" iyy="0.02" iyz="0" izz="0.01"/></inertial>
    <collision><origin xyz="0 0 0.15"/><geometry><mesh filename="bar.stl" scale="1 1 1"/></geometry></collision>
    <collision><origin xyz="0 0 0.15"/>
      <geometry><mesh filename="package://any/bar.obj" scale="0.5 0.5 1"/></geometry></collision>
  </link>
  <link name="two">
    <inertial><mass value="1"/><inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/></inertial>
    <collision><geometry><sphere radius="0.05"/></geometry></collision>
    <collision><geometry><capsule radius="0.02" length="0.1"/></geometry></collision>
    <collision><geometry><cylinder radius="0.02" length="0.1"/></geometry></collision>
  </link>
  <link name="tool"/>
  <link name="finger">
    <inertial><mass value="0.1"/><inertia ixx="0.001" ixy="0" ixz="0" iyy="0.001" iyz="0" izz="0.001"/></inertial>
  </link>
  <joint name="a" type="continuous"><parent link="base"/><child link="one"/><origin xyz="0 0 0.1" rpy="0 0.1 0"/>
    <axis xyz="0 0 1"/><limit effort="50" velocity="2"/><dynamics damping="0.1" friction="0.2"/></joint>
  <joint name="b" type="prismatic"><parent link="one"/><child link="two"/><origin xyz="0 0 0.4" rpy="0 0 0"/>
    <axis xyz="1 0 0"/><limit lower="-0.5" upper="0.5" effort="20" velocity="1"/></joint>
  <joint name="t" type="fixed"><parent link="two"/><child link="tool"/><origin xyz="0.1 0 0"/></joint>
  <joint name="g" type="revolute"><parent link="two"/><child link="finger"/><axis xyz="0 1 0"/>
    <limit lower="0" upper="1" effort="1" velocity="1"/></joint>
</robot>"""


def waypoint_files(folder: Path) -> FileFuzzer:
    """CSV and JSON; splines through those that are accepted."""
    arm = load_cell("lee1991").arms[0]
    one, other = arm.joint_names
    table = [[0.1, 0.2], [0.5, -0.3], [0.9, 0.4], [1.1, 0.45]]
    rows = "".join(f"{a},{b}\n" for a, b in table)
    named = json.dumps({"joints": [other, one], "waypoints_rad": table}).encode()
    seeds = [
        Seed("w.csv", f"{one},{other}\n{rows}".encode(), damaged_text),
        Seed("w.csv", f"# bare\n{rows}".encode(), damaged_text),
        Seed("w.json", json.dumps(table).encode(), damaged_json),
        Seed("w.json", named, damaged_json),
    ]

    def read(file: Path) -> object:
        path = JointPath.from_file(file, arm=arm)
        lam = np.linspace(0.0, path.length, 7)
        return path.length, path.evaluate(lam), path.speed_bound(lam[:-1], lam[1:])

    return FileFuzzer(folder, seeds, read)


def trajectory_files(folder: Path) -> FileFuzzer:
    """CSV and JSON."""
    motion = load_cell("lee1991").fastest[0]
    seeds = []
    for suffix, damage in (("csv", damaged_text), ("json", damaged_json)):
        write_trajectory(folder / f"t.{suffix}", motion, 0.05)
        seeds.append(Seed(f"t.{suffix}", (folder / f"t.{suffix}").read_bytes(), damage))
    return FileFuzzer(folder, seeds, read_trajectory)


def agent_files(folder: Path) -> FileFuzzer:
    """Agents that are accepted act."""

    def damage(random: Random, data: bytes) -> bytes:
        return sealed_again(random, folder, damaged_npz(random, data, ["header"]))

    seeds = [Seed("a.npz", (FILES / f"{name}.npz").read_bytes(), damage) for name in ("lee1991", "feedback-ik")]

    def read(file: Path) -> object:
        agent = load_agent(file)
        return agent, agent.act(np.zeros(len(agent.header.entries))), agent.act(np.full(len(agent.header.entries), 1e3))

    return FileFuzzer(folder, seeds, read)


def instance_files(folder: Path) -> FileFuzzer:
    """Instances that are accepted are planned."""

    def damage(random: Random, data: bytes) -> bytes:
        return sealed_again(random, folder, damaged_npz(random, data, ["head"]))

    file = folder / "seed.yaml"
    file.write_bytes(_coarse("lee1991").replace(b"chart_tolerance_m: 0.0001", b"chart_tolerance_m: 0.004"))
    cell = load_cell(file)
    save_instance(folder / "i.npz", cell, label_cell(cell), family="planar")
    seeds = [Seed("i.npz", (folder / "i.npz").read_bytes(), damage)]

    def read(file: Path) -> object:
        instance = load_instance(file)
        planes = [plane.dynamics for plane in instance.timing.planes]
        arrays = [[getattr(one, name) for name in ("grid", "M", "Q", "R", "S")] for one in planes]
        motions = instance.plan("delay")
        return arrays, instance.control_period, [(one.lam, one.mu, one.time) for one in motions]

    return FileFuzzer(folder, seeds, read)


def training_files(folder: Path) -> FileFuzzer:
    """Training files."""
    names = ("lee1991", "arms", "blend-tracking", "feedback-ik")
    data = [data_path(f"train/{name}.yaml").read_bytes() for name in names]
    sac = b"name: s\nalgorithm: sac\ncoordination: {cells: [lee1991]}\nsac: {learning_starts: 40, batch_size: 32}\n"
    seeds = [Seed("t.yaml", one, damaged_yaml) for one in (*data, sac)]
    return FileFuzzer(folder, seeds, load_train_config)


def sweep_files(folder: Path) -> FileFuzzer:
    """Sweep files."""
    (folder / "t.yaml").write_bytes(data_path("train/lee1991.yaml").read_bytes())
    bundled = data_path("sweep/lee1991.yaml").read_bytes()
    own = bundled.replace(b"training: lee1991", b"training: t.yaml")
    seeds = [Seed("s.yaml", one, damaged_yaml) for one in (bundled, own)]
    return FileFuzzer(folder, seeds, load_sweep_config)

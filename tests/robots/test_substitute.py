"""Robots whose files have no inertia: planned by speeds and accelerations, simulated with a mass that is told."""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np
import pytest

from armtempo.configs import data_path
from armtempo.envs import CoordinationEnv
from armtempo.errors import RobotError
from armtempo.planners import JointPath, PathDynamics, load_cell, minimum_time
from armtempo.robots import Arm
from armtempo.robots._substitute import spread_mass


@pytest.fixture
def bare(tmp_path: Path) -> Path:
    """The two-link arm as makers publish theirs: no inertia, no effort."""
    text = data_path("robots/planar_two_link.urdf").read_text()
    text = re.sub(r"<inertial>.*?</inertial>", "", text, flags=re.DOTALL)
    file = tmp_path / "bare.urdf"
    file.write_text(re.sub(r'effort="[^"]*"', 'effort="0"', text))
    return file


def test_it_is_planned_by_speed_and_acceleration_alone(bare: Path) -> None:
    arm = Arm.from_urdf(bare, speed_max=[3.0, 3.0], acceleration_max=[20.0, 20.0])
    assert arm.kinematic
    motion = minimum_time(PathDynamics.from_path(arm, JointPath.through([[0.2, 0.5], [1.2, 0.5]], arm=arm)))
    assert motion.duration == pytest.approx(1.0 / 3.0 + 3.0 / 20.0, rel=1e-4)  # up, along at full speed, down
    assert motion.certificate.excess < 1e-6
    heavy = Arm.from_urdf(bare, speed_max=[3.0, 3.0], acceleration_max=[20.0, 20.0], substitute_mass=9.0)
    path = JointPath.through([[0.2, 0.5], [1.2, 0.5]], arm=heavy)
    assert minimum_time(PathDynamics.from_path(heavy, path)).duration == pytest.approx(motion.duration, rel=1e-9)


def test_nothing_that_speeds_up_at_once_is_planned(bare: Path) -> None:
    arm = Arm.from_urdf(bare, acceleration_max=[20.0, None])
    with pytest.raises(RobotError, match=r"no inertia for joint 'joint_2', which has no acceleration limit either"):
        PathDynamics.from_path(arm, JointPath.through([[0.2, 0.5], [1.2, 0.5]], arm=arm))
    with pytest.raises(
        RobotError, match="torque_max is given in place of effort limits, but no link has an <inertial>"
    ):
        Arm.from_urdf(bare, torque_max=[25.0, 7.0])


def test_an_effort_of_zero_tells_nothing(tmp_path: Path) -> None:
    text = data_path("robots/planar_two_link.urdf").read_text()
    file = tmp_path / "arm.urdf"
    file.write_text(re.sub(r'effort="[^"]*"', 'effort="0"', text))
    arm = Arm.from_urdf(file, acceleration_max=[20.0, 20.0])
    assert not arm.kinematic
    PathDynamics.from_path(arm, JointPath.through([[0.2, 0.5], [1.2, 0.5]], arm=arm))
    free = Arm.from_urdf(file)
    with pytest.raises(RobotError, match="effort=0 for joint 'joint_1'"):
        PathDynamics.from_path(free, JointPath.through([[0.2, 0.5], [1.2, 0.5]], arm=free))


def test_the_substitute_is_a_body_of_one_density(bare: Path) -> None:
    """Capsules: mass and moments as those of their slices."""
    arm = Arm.from_urdf(bare, substitute_mass=6.0)
    assert arm.model.mass.sum() == pytest.approx(6.0)
    parts = spread_mass(6.0, arm.dof, arm.shapes)
    assert parts is not None
    p0, p1, radius = next(shape for shape in arm.shapes if shape.link == 0).capsule
    ((mass, com, inertia),) = parts[0]
    length = float(np.linalg.norm(p1 - p0))
    z = np.linspace(-0.5 * length - radius, 0.5 * length + radius, 400_001)  # slices: discs
    disc = radius**2 - np.maximum(np.abs(z) - 0.5 * length, 0.0) ** 2
    density = mass / np.trapezoid(np.pi * disc, z)
    along = float(density * np.trapezoid(0.5 * np.pi * disc**2, z))
    across = float(density * np.trapezoid(np.pi * disc * (z**2 + 0.25 * disc), z))
    np.testing.assert_allclose(com, 0.5 * (p0 + p1))
    np.testing.assert_allclose(np.linalg.eigvalsh(inertia), [along, across, across], rtol=1e-6)
    with pytest.raises(RobotError, match="substitute_mass = -1"):
        Arm.from_urdf(bare, substitute_mass=-1)
    with pytest.raises(RobotError, match="has links with <inertial>"):
        Arm.from_urdf(data_path("robots/planar_two_link.urdf"), substitute_mass=2.0)


def test_cells_of_such_arms_are_coordinated_and_with_a_mass_simulated(bare: Path, tmp_path: Path) -> None:
    old, limits = "limits: {torque_nm: [25, 7]}", "limits: {speed_rad_s: [3, 3], acceleration_rad_s2: [60, 60]}"
    file = tmp_path / "mine.yaml"
    text = data_path("cells/lee1991.yaml").read_text().replace("chart_tolerance_m: 0.0001", "chart_tolerance_m: 0.0004")
    text = text.replace("urdf: planar_two_link.urdf", f"urdf: {bare.as_posix()}").replace(old, limits)
    file.write_text(text)
    cell = load_cell(str(file))
    assert all(arm.kinematic for arm in cell.arms)
    with pytest.raises(RobotError, match="PyBullet cannot move it") as caught:
        CoordinationEnv(cell, physics="bullet")
    assert "substitute_mass_kg" in caught.value.remedy
    file.write_text(text.replace(limits, f"{limits}\n    substitute_mass_kg: 6"))
    for physics in ("ideal", "bullet"):
        env = CoordinationEnv(load_cell(str(file)), physics=physics, shield=True, record=True)
        env.reset(seed=0)
        while env.agents:
            env.step({agent: np.ones(1, dtype=np.float32) for agent in env.agents})
        assert math.isfinite(env.simulation.arrival.max())
        env.close()

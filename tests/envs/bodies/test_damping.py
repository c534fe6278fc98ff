"""Damping that is too strong for the tick is told where an environment is made, with the tick that would do."""

from __future__ import annotations

import logging
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import yaml

from armtempo.configs import data_path
from armtempo.envs import CoordinationEnv
from armtempo.envs.bodies._bullet_scene import BulletScene
from armtempo.envs.bodies._damping import check_damping
from armtempo.errors import RobotError
from armtempo.planners import CoordinationCell, load_cell
from armtempo.robots import Arm

INERTIA, MASS, LEVER = 0.02, 1.5, 0.1
PENDULUM = f"""<robot name="pendulum"><link name="base"/><link name="bob"><inertial><origin xyz="{LEVER} 0 0"/>
<mass value="{MASS}"/><inertia ixx="{INERTIA}" iyy="{INERTIA}" izz="{INERTIA}" ixy="0" ixz="0" iyz="0"/></inertial>
</link><joint name="hinge" type="revolute"><parent link="base"/><child link="bob"/><axis xyz="0 0 1"/>
<limit lower="-3" upper="3" effort="50" velocity="5"/></joint></robot>"""


@pytest.fixture
def pendulum(tmp_path: Path) -> Arm:
    file = tmp_path / "pendulum.urdf"
    file.write_text(PENDULUM)
    return Arm.from_urdf(file, gravity=(0.0, 0.0, 0.0))


def cell_of(arm: Arm, stiffness: float, tick: float = 1e-3) -> Any:
    """The pendulum with such a damping over its inertia times the tick, in closed form."""
    damping = stiffness / tick * (INERTIA + MASS * LEVER**2)
    damped = replace(arm, damping=np.array([damping]), model=arm.model._replace(damping=np.array([damping])))
    posture = SimpleNamespace(q=np.zeros((3, 1)))
    return SimpleNamespace(arms=(damped,), gravity=(0, 0, 0), physics_tick=tick, sweeps=lambda _: (posture,))


@pytest.mark.parametrize(("stiffness", "grows"), [(0.9, False), (1.7, False), (1.99, False), (2.01, True), (2.5, True)])
def test_above_two_speeds_grow_in_pybullet(pendulum: Arm, stiffness: float, grows: bool) -> None:
    scene = BulletScene(cell_of(pendulum, stiffness))
    q, qd = np.zeros((1, 1)), np.full((1, 1), 1e-6)
    scene.put_joints(q, qd)
    for _ in range(300):
        scene.apply_torque(np.zeros((1, 1)))
    scene.read_joints(q, qd)
    assert (abs(qd[0, 0]) > 1e-6) == grows
    scene.close()


def test_what_is_refused_and_what_is_told(pendulum: Arm, caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.WARNING, "armtempo"):
        check_damping(cell_of(pendulum, 0.999))
        assert not caplog.records
        check_damping(cell_of(pendulum, 1.5))
    (told,) = caplog.messages
    assert "'pendulum'" in told
    assert "'hinge'" in told
    assert "1.50" in told
    with pytest.raises(RobotError, match=r"damping of joint 'hinge'.*physics_tick_s of 0.00053 or less"):
        check_damping(cell_of(pendulum, 1.9))
    with pytest.raises(RobotError, match="too strong"):  # damping and mass that are not as planned count
        check_damping(cell_of(pendulum, 1.0), factor=1.9)


def test_the_wrist_of_the_iiwa_needs_a_short_tick(tmp_path: Path) -> None:
    """Damping 0.5 N m s on a wrist of 1 g m^2: at 1/240 s it would explode; the bundled cell has a tick that holds."""
    text = data_path("cells/iiwa-pair.yaml").read_text(encoding="utf-8")
    check_damping(load_cell("iiwa-pair"), factor=1.5)
    content = yaml.safe_load(text)
    file = tmp_path / "slow.yaml"
    file.write_text(yaml.safe_dump(content | {"physics_tick_s": 1.0 / 240.0}))
    slow = load_cell(file)
    assert isinstance(slow, CoordinationCell)
    with pytest.raises(
        RobotError, match=r"arm 'left': the damping of joint 'lbr_iiwa_joint_7'.*unstable above 2"
    ) as error:
        CoordinationEnv(slow, physics="bullet")
    assert "physics_tick_s" in error.value.remedy
    CoordinationEnv(slow, physics="ideal").close()

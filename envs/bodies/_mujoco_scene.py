"""A cell's arms in a MuJoCo model of their own (extra ``mujoco``)."""

from __future__ import annotations

import logging
import math
from typing import Any, final

import numpy as np

from armtempo.arrays import Bools, Floats
from armtempo.envs.bodies._scene import COMPARING_STEP, check_inertia, compare
from armtempo.errors import InputError, RobotError
from armtempo.planners import Cell
from armtempo.robots import mjcf_text

try:
    import mujoco
except ModuleNotFoundError as error:
    raise InputError(
        "physics 'mujoco' needs the package mujoco, which is not installed", remedy='pip install "armtempo[mujoco]"'
    ) from error


mujoco.set_mju_user_warning(logging.getLogger("armtempo").warning)  # else it writes a file into the working folder


@final
class MujocoScene:
    """See ``Scene``; all arms are in one model.

    Args:
        cell: Whose arms.
        model_error: The bodies are heavier by this share than the arms say, inertia and all.
        friction_error: Damping and dry friction of the joints are larger by this share.

    Raises:
        RobotError: MuJoCo refuses an arm, or would simulate another one than was planned.
    """

    def __init__(self, cell: Cell, *, model_error: float = 0.0, friction_error: float = 0.0) -> None:
        self.cell, self.engine = cell, "MuJoCo"
        check_inertia(self)
        self._errors = model_error, friction_error
        width = max(arm.dof for arm in cell.arms)
        self._joints: Bools = np.arange(width) < np.array([[arm.dof] for arm in cell.arms])
        self._make(COMPARING_STEP, 1.0, 0.0)
        compare(self)
        self._make(cell.physics_tick, 1.0 + model_error, 1.0 + friction_error)

    def _make(self, step: float, mass: float, friction: float) -> None:
        text = mjcf_text(self.cell.arms, self.cell.gravity, step, mass=mass, friction=friction)
        try:
            model = mujoco.MjModel.from_xml_string(text)
        except ValueError as error:  # MuJoCo's messages are of several lines
            names = ", ".join(repr(arm.name) for arm in self.cell.arms)
            raise RobotError(
                f"arms {names} cannot be handed to MuJoCo: {' '.join(str(error).split())}",
                remedy='use physics="bullet" or "ideal"',
            ) from error
        self._model: Any = model
        self._data: Any = mujoco.MjData(model)

    def put_joints(self, q: Floats, qd: Floats) -> None:
        """See ``Scene``."""
        self._data.qpos[:], self._data.qvel[:] = q[self._joints], qd[self._joints]

    def read_joints(self, q: Floats, qd: Floats) -> None:
        """See ``Scene``."""
        q[self._joints], qd[self._joints] = self._data.qpos, self._data.qvel

    def apply_torque(self, torque: Floats) -> None:
        """See ``Scene``.

        Raises:
            RobotError: The motion diverged.
        """
        self._data.qfrc_applied[:] = torque[self._joints]
        mujoco.mj_step(self._model, self._data)
        if not math.isfinite(self._data.qacc.sum()):
            raise RobotError(
                "the arms' motion in MuJoCo diverged",
                remedy="give the cell a smaller physics_tick_s, or less model_error",
            )

    def centres(self, i: int) -> Floats:
        """See ``Scene``."""
        mujoco.mj_kinematics(self._model, self._data)
        first = self._model.body(f"arm_{i}_link_0").id
        return np.array(self._data.xipos[first : first + self.cell.arms[i].dof])

    def __reduce__(self) -> tuple[object, tuple[object, ...]]:
        q = np.zeros((2, *self._joints.shape))
        self.read_joints(*q)
        return _scene_again, (self.cell, *self._errors, q)

    def close(self) -> None:
        """Nothing to leave: the model goes with its last user."""


def _scene_again(cell: Cell, model_error: float, friction_error: float, joints: Floats) -> MujocoScene:
    scene = MujocoScene(cell, model_error=model_error, friction_error=friction_error)
    scene.put_joints(*joints)
    return scene

"""Arms that follow joint references tick by tick: torque-controlled in a physics engine, or without bodies."""

from __future__ import annotations

from collections.abc import Mapping
from importlib import import_module
from importlib.metadata import version
from typing import Any, Literal, final

import numpy as np

from armtempo.arrays import Floats
from armtempo.envs.bodies._bullet import bullet_version
from armtempo.envs.bodies._damping import check_damping
from armtempo.envs.bodies._joint_control import control, stack_models
from armtempo.envs.bodies._scene import Scene
from armtempo.errors import InputError
from armtempo.planners import Cell
from armtempo.state import Stateful

Physics = Literal["bullet", "mujoco", "ideal"]
PHYSICS: tuple[Physics, ...] = ("bullet", "mujoco", "ideal")
SCENES = {  # where the bodies are; an engine is imported when it is asked for
    "bullet": "armtempo.envs.bodies._bullet_scene:BulletScene",
    "mujoco": "armtempo.envs.bodies._mujoco_scene:MujocoScene",
}

CONTROLLER_GAIN = 0.2  # bandwidth of the joint controller, as a share of the tick rate
STABLE_SHARE = 0.9  # of the gain at which it becomes unstable: what is allowed


@final
class Controller(Stateful):
    """The joint controllers of a cell's arms and, where there is physics, their bodies.

    Arrays have one row per arm, padded with zeros to the largest number of joints.

    Args:
        cell: Whose arms.
        physics: ``bullet``, ``mujoco``: torque-controlled in PyBullet or MuJoCo. ``ideal``: no bodies; whoever owns it
            puts the arms on their references.
        model_error: The bodies are heavier by this share than the controllers believe.
        friction_error: Damping and dry friction of the bodies' joints are larger by this share.

    Attributes:
        measured: (2, A, n) joint positions and speeds now.
        reference: (3, A, n) joint positions asked for at the tick before, now and next; those of now at rest.
        torque, demand: (A, n) torques of the last tick, and before they were clipped at the limits.
        gain: Bandwidth of the controllers [1/s].
        scene: The bodies; None in ``ideal``.

    Raises:
        RobotError: The bodies are not the planned ones, or their damping is too strong for the tick.
        InputError: The engine is not installed.
    """

    changing = ("measured", "reference", "torque", "demand")

    def __init__(self, cell: Cell, physics: Physics, *, model_error: float = 0.0, friction_error: float = 0.0) -> None:
        arms, width = len(cell.arms), max(arm.dof for arm in cell.arms)
        self.tick = cell.physics_tick
        self.gain = CONTROLLER_GAIN / self.tick
        self.measured: Floats = np.zeros((2, arms, width))
        self.reference: Floats = np.zeros((3, arms, width))
        self.torque: Floats = np.zeros((arms, width))
        self.demand: Floats = np.zeros((arms, width))
        self._models, self._dofs = stack_models([arm.model for arm in cell.arms]), np.array([a.dof for a in cell.arms])
        self._coulomb, self._torque_max = np.zeros((arms, width)), np.zeros((arms, width))
        for i, arm in enumerate(cell.arms):
            self._coulomb[i, : arm.dof], self._torque_max[i, : arm.dof] = arm.coulomb, arm.torque_max
        self.scene: Scene | None = None
        if physics in SCENES:
            _check_weight(model_error)
            check_damping(cell, (1.0 + friction_error) / (1.0 + model_error))
            self.scene = make_scene(cell, physics, model_error=model_error, friction_error=friction_error)

    @property
    def q(self) -> Floats:
        """(A, n) joint positions now."""
        q: Floats = self.measured[0]  # views are not kept: those of a copy would be arrays of their own
        return q

    @property
    def qd(self) -> Floats:
        """(A, n) joint speeds now."""
        qd: Floats = self.measured[1]
        return qd

    def reset(self, q: Floats) -> None:
        """At rest at ``q`` (A, n)."""
        self.q[:], self.qd[:] = q, 0.0
        self.reference[:] = q
        self.torque[:], self.demand[:] = 0.0, 0.0
        if self.scene is not None:
            self.scene.put_joints(self.q, self.qd)

    def ask(self, joints: Floats) -> bool:
        """Work out the torques of one tick towards the references ``joints`` (A, n); whether some are clipped."""
        return control(
            self._models, self._dofs, joints, self.gain, self.tick, self.measured, self.reference, self._coulomb,
            self._torque_max, self.demand, self.torque,
        )  # fmt: skip

    def shift(self) -> None:
        """The references before and now of the next tick; what is next is the caller's to fill."""
        self.reference[0], self.reference[1] = self.reference[1], self.reference[2]

    def act(self) -> None:
        """Apply ``torque`` for one tick in the engine."""
        assert self.scene is not None
        self.scene.apply_torque(self.torque)
        self.scene.read_joints(self.q, self.qd)

    def track(self, joints: Floats) -> None:
        """One tick in the engine towards the references ``joints`` (A, n)."""
        self.ask(joints)
        self.act()

    def put(self, q: Floats, torque: Floats, demand: Floats) -> None:
        """Without physics: what is so, all (A, n), where the arms are on their references of now."""
        self.qd[:] = (self.reference[2] - self.reference[1]) / self.tick
        self.q[:], self.torque[:], self.demand[:] = q, torque, demand

    def _go_on(self, state: Mapping[str, Any]) -> None:
        super()._go_on(state)
        if self.scene is not None:
            self.scene.put_joints(self.q, self.qd)

    @property
    def clipped(self) -> bool:
        """Whether torques were, in the last tick."""
        return bool((self.demand != self.torque).any())

    def close(self) -> None:
        """Leave the engine; may be called twice."""
        if self.scene is not None:
            self.scene.close()


def make_scene(cell: Cell, physics: Physics, *, model_error: float = 0.0, friction_error: float = 0.0) -> Scene:
    """The bodies of a cell's arms in an engine; see ``Controller``."""
    module, name = SCENES[physics].split(":")
    scene: Scene = getattr(import_module(module), name)(cell, model_error=model_error, friction_error=friction_error)
    return scene


def engine_name(physics: Physics) -> str | None:
    """Name and version of the engine; None: ``ideal`` has none."""
    if physics == "bullet":
        return f"PyBullet {bullet_version()}"
    return f"MuJoCo {version('mujoco')}" if physics == "mujoco" else None


def _check_weight(model_error: float) -> None:
    """Raise InputError where bodies are so light that the controllers' feedback, a tick late, makes errors grow.

    With ``G`` their gain times the tick and ``k = 1 / (1 + model_error)`` errors obey ``x'' - (2 - k (G^2 + 2 G)) x' +
    (1 - 2 k G) x = 0`` from tick to tick, which is stable for ``k < 4 / (G^2 + 4 G)``.
    """
    most = STABLE_SHARE * 4.0 / (CONTROLLER_GAIN**2 + 4.0 * CONTROLLER_GAIN)
    if 1.0 / (1.0 + model_error) > most:
        raise InputError(
            f"model_error is {model_error:g}: the controllers are unstable with bodies so much lighter than planned",
            remedy=f"give {1.0 / most - 1.0:.2f} or more",
        )

"""One arm that follows a joint reference tick by tick: torque-controlled in PyBullet, or always on it."""

from __future__ import annotations

import math
from typing import Literal, final

import numpy as np

from armtempo.arrays import Floats
from armtempo.envs.bodies._bullet import pybullet
from armtempo.envs.bodies._joint_control import joint_torques
from armtempo.envs.bodies._scene import Scene
from armtempo.errors import InputError, UnknownNameError
from armtempo.planners import BlendCell, IKCell


def is_number(value: object) -> bool:
    """Whether it is one finite number."""
    return (
        isinstance(value, int | float | np.integer | np.floating)
        and not isinstance(value, bool)
        and math.isfinite(value)
    )


@final
class TrackedArm:
    """The arm of a cell, its controller and, in ``bullet``, its body.

    Args:
        cell: The arm's cell.
        physics: ``bullet``: torque-controlled in PyBullet. ``ideal``: always on its reference.
        model_error: The bodies in PyBullet are heavier by this share than the controller believes.

    Attributes:
        q, qd: (1, n) joint positions and speeds now.
        reference: (3, n) joint positions asked for at the tick before, now and next; those of now at rest.
        torque, demand: (1, n) torques of the last tick, and before they were clipped at the limits.
        scene: The body; None in ``ideal``.

    Raises:
        UnknownNameError: No such physics.
        InputError: A model error that no body can have, or without bodies.
    """

    def __init__(self, cell: BlendCell | IKCell, *, physics: Physics, model_error: float) -> None:
        if physics not in PHYSICS:
            raise UnknownNameError("physics", str(physics), PHYSICS)
        if not (is_number(model_error) and model_error > -1.0):
            raise InputError(
                f"model_error must be a share above -1, got {model_error!r}", remedy="give 0.1 for bodies 10 % heavier"
            )
        if model_error and physics == "ideal":
            raise InputError(
                f"model_error is {model_error:g} and physics 'ideal', which has no bodies to be heavier",
                remedy="take physics='bullet', or leave model_error out",
            )
        n = cell.arm.dof
        self.model, self.tick = cell.arm.model, cell.physics_tick
        self.coulomb, self.torque_max = cell.arm.coulomb.copy(), cell.arm.torque_max.copy()
        self.q: Floats = np.zeros((1, n))
        self.qd: Floats = np.zeros((1, n))
        self.reference = np.zeros((3, n))
        self.torque: Floats = np.zeros((1, n))
        self.demand: Floats = np.zeros((1, n))
        self.scene: Scene | None = None
        if physics == "bullet":
            self.scene = Scene(cell)
            if model_error:
                self.scene.weigh(1.0 + model_error)
            pybullet.setGravity(*cell.config.gravity_m_s2, physicsClientId=self.scene.client)
            pybullet.setPhysicsEngineParameter(numSolverIterations=10, physicsClientId=self.scene.client)

    def place(self, q: Floats) -> None:
        """At rest at ``q`` (n,)."""
        self.q[0], self.qd[0] = q, 0.0
        self.reference[:] = q
        self.torque[:], self.demand[:] = 0.0, 0.0
        if self.scene is not None:
            self.scene.place(self.q)

    def advance(self, joints: Floats) -> None:
        """One tick in PyBullet towards the reference ``joints`` (n,)."""
        reference, tick = self.reference, self.tick
        reference[:2], reference[2] = reference[1:].copy(), joints
        joint_torques(
            self.model, reference[0], reference[1], reference[2], self.q[0], self.qd[0], self.coulomb, self.torque_max,
            CONTROLLER_GAIN / tick, tick, self.demand[0], self.torque[0],
        )  # fmt: skip
        assert self.scene is not None
        self.scene.push(self.torque)
        self.scene.read(self.q, self.qd)

    @property
    def clipped(self) -> bool:
        """Whether torques were, in the last tick."""
        return bool((self.demand != self.torque).any())

    def follow(self, joints: Floats) -> Floats:
        """Ticks in PyBullet towards references ``joints`` (K, n): q, torques and demand after each, (K, 3, n).

        They end with the first in which torques were clipped: then there are fewer rows.
        """
        rows = np.empty((len(joints), 3, joints.shape[1]))
        for k, wanted in enumerate(joints):
            self.advance(wanted)
            rows[k, 0], rows[k, 1], rows[k, 2] = self.q[0], self.torque[0], self.demand[0]
            if self.clipped:
                return rows[: k + 1]
        return rows

    def stay(self, reference: Floats, row: Floats) -> None:
        """On its reference (3, n), without physics; ``row`` (3, n): q, torques and demand there."""
        self.reference[:] = reference
        self.qd[0] = (reference[2] - reference[1]) / self.tick
        self.q[0], self.torque[0], self.demand[0] = row

    def close(self) -> None:
        """Leave PyBullet; may be called twice."""
        if self.scene is not None:
            self.scene.close()


Physics = Literal["bullet", "ideal"]


PHYSICS: tuple[Physics, ...] = ("bullet", "ideal")


CONTROLLER_GAIN = 0.2  # bandwidth of the joint controller, as a share of the tick rate


SETTLED_DISTANCE = 1e-3  # [m] of the tip from its goal, and


SETTLED_SPEED = 1e-2  # [m/s] of the tip,


SETTLED_TIME = 0.020  # [s] for which both must hold

"""What a physics engine is to everybody else: arms that are put somewhere, pushed for one step, and read.

An engine's bodies are made from the planners' own model, and are compared with it before anything moves.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np

from armtempo.arrays import Floats
from armtempo.errors import RobotError
from armtempo.planners import Cell
from armtempo.robots import Arm

SAME_TO = 1e-9
"""What is simulated is what was planned, to this share of the masses, of the torques and of the arm's size."""
STATES_COMPARED = 3
"""Random states at which that is looked at, with"""
COMPARED_SIZES = np.array([np.pi, 1.0, 10.0])
"""joint positions, speeds and accelerations up to these [rad, m and s],"""
COMPARING_STEP = 1e-3
"""by one step of this length [s]."""


class Scene(Protocol):
    """The arms of a cell in a physics engine.

    There are no contacts (clearance is FCL's business), friction is that of the ``Arm``, viscous and dry. A step is
    ``qd' = qd + dt qdd``, ``q' = q + dt qd'`` with what acts at its start, and depends on positions, speeds and torques
    alone: resets are bit-exact, and a copy, pickled or not, is another scene in the same state.

    Attributes:
        cell: Whose arms.
        engine: Its name.
    """

    cell: Cell
    engine: str

    def put_joints(self, q: Floats, qd: Floats) -> None:
        """Put every arm at ``q`` with the speeds ``qd``, both (A, n)."""

    def read_joints(self, q: Floats, qd: Floats) -> None:
        """Write positions and speeds of all arms to ``q``, ``qd`` (A, n)."""

    def apply_torque(self, torque: Floats) -> None:
        """Apply ``torque`` (A, n) for the next step and make it."""

    def centres(self, i: int) -> Floats:
        """(n, 3) where the centres of mass of arm i's links are [m]."""

    def close(self) -> None:
        """Leave the engine; may be called twice."""


def check_inertia(scene: Scene) -> None:
    """Raise RobotError for an arm that has none: nothing but ``ideal`` can move it."""
    for arm in scene.cell.arms:
        if arm.model.mass[-1] <= 0.0:
            raise RobotError(
                f"arm {arm.name!r}: {arm.urdf} has no inertia: {scene.engine} cannot move it",
                remedy='give substitute_mass_kg in the cell, or physics="ideal" (--physics ideal)',
                file=str(arm.urdf),
            )


def compare(scene: Scene) -> None:
    """Look at random states whether bodies without friction are the arms: where they are, and how torques move them.

    Args:
        scene: It steps by ``COMPARING_STEP``.

    Raises:
        RobotError: One is not; nothing is simulated then.
    """
    random, arms = np.random.default_rng(0), scene.cell.arms
    shape = len(arms), max(arm.dof for arm in arms)
    after, speeds = np.zeros(shape), np.zeros(shape)
    for _ in range(STATES_COMPARED):
        q, qd, qdd = random.uniform(-1.0, 1.0, (3, *shape)) * COMPARED_SIZES[:, None, None]
        scene.put_joints(q, qd)
        torque = np.zeros(shape)
        for i, arm in enumerate(arms):
            n = arm.dof
            torque[i, :n] = arm.inverse_dynamics(q[i, :n], qd[i, :n], qdd[i, :n], friction=False)
        scene.apply_torque(torque)
        scene.read_joints(after, speeds)
        for i, arm in enumerate(arms):
            n = arm.dof
            found = (speeds[i, :n] - qd[i, :n]) / COMPARING_STEP
            asked = arm.inverse_dynamics(q[i, :n], qd[i, :n], found, friction=False)
            T = arm.link_poses(after[i, :n])
            centres = np.einsum("nij,nj->ni", T[:, :3, :3], arm.model.com) + T[:, :3, 3]
            _check_same(scene, arm, "inverse dynamics", asked, torque[i, :n])
            _check_same(scene, arm, "centres of mass", scene.centres(i), centres)


def _check_same(scene: Scene, arm: Arm, what: str, found: Floats, wanted: Floats) -> None:
    off = float(np.abs(found - wanted).max() / max(np.abs(wanted).max(), 1e-3))
    if not off <= SAME_TO:
        name = scene.engine
        raise RobotError(
            f"arm {arm.name!r}: its {what} in {name} are off by {off:.1e} from what is planned with",
            remedy=f'use physics="ideal", and report the URDF: this is a fault of armtempo or of {name}',
            file=str(arm.urdf),
            element=what,
        )

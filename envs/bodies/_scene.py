"""A cell's arms in a PyBullet client: made from the planners' own model, compared with it, moved by joint states."""

from __future__ import annotations

import importlib.util
import os
import sys
import tempfile
import weakref
from contextlib import suppress
from pathlib import Path
from typing import final

import numpy as np

from armtempo.arrays import Floats
from armtempo.envs.bodies._bullet import pybullet, quiet
from armtempo.errors import RobotError
from armtempo.planners import Cell
from armtempo.robots import Arm, principal_moments, read_visuals, urdf_text

SAME_TO = 1e-9
"""What is simulated is what was planned, to this share of the masses, of the torques and of the arm's size."""
STATES_COMPARED = 3
"""Random states at which that is looked at, with"""
COMPARED_SIZES = np.array([np.pi, 1.0, 10.0])
"""joint positions, speeds and accelerations up to these [rad, m and s],"""
COMPARING_STEP = 1e-3
"""by one step of this length [s]."""
FRICTION_ITERATIONS = 50
"""Of the solver, a step: all that it solves for here is the joints' dry friction, and that to rounding."""


@final
class Scene:
    """The arms of a cell in a PyBullet client of their own.

    Their bodies are written by ``urdf_text``: nothing of the user's file reaches PyBullet but what the planners read.
    There are no contacts (clearance is FCL's business, and resets stay bit-exact), friction is that of the ``Arm``,
    viscous and dry, and the default motors are off. A copy, pickled or not, is another client in the same state.

    Args:
        cell: Whose arms.
        model_error: The bodies are heavier by this share than the arms say, inertia and all.
        friction_error: Damping and dry friction of the joints are larger by this share.
        visible: Show what the arms look like; without, nothing is to be seen.
        window: Open PyBullet's window instead of working unseen.
        egl: Draw by the EGL plugin, where it loads; it draws only what comes into the scene after it.

    Attributes:
        bodies, joints: PyBullet's numbers of the arms, and of the joints of each: those of the ``Arm``.
        hardware: Whether that plugin draws.

    Raises:
        RobotError: PyBullet did not start, or would simulate another arm than the one that was planned.
    """

    def __init__(
        self,
        cell: Cell,
        *,
        model_error: float = 0.0,
        friction_error: float = 0.0,
        visible: bool = False,
        window: bool = False,
        egl: bool = False,
    ) -> None:
        for arm in cell.arms:
            if arm.model.mass[-1] <= 0.0:
                raise RobotError(
                    f"arm {arm.name!r}: {arm.urdf} has no inertia: PyBullet cannot move it",
                    remedy='give substitute_mass_kg in the cell, or physics="ideal" (--physics ideal)',
                    file=str(arm.urdf),
                )
        self.cell = cell
        self._errors = model_error, friction_error
        with quiet():
            self.client: int = pybullet.connect(pybullet.GUI if window else pybullet.DIRECT)
        if self.client < 0:
            raise RobotError("PyBullet did not start", remedy="close other PyBullet windows and try again")
        self._closer = weakref.finalize(self, _disconnect, self.client)  # at the end of the process, too
        self.hardware = egl and _load_egl(self.client)
        self.joints = [list(range(arm.dof)) for arm in cell.arms]
        width = max(map(len, self.joints))
        self._padding = [[0.0] * (width - len(joints)) for joints in self.joints]
        pybullet.setGravity(*cell.gravity, physicsClientId=self.client)
        rubs = any(arm.coulomb.any() for arm in cell.arms)
        pybullet.setPhysicsEngineParameter(
            numSolverIterations=FRICTION_ITERATIONS if rubs else 1, solverResidualThreshold=0.0,
            deterministicOverlappingPairs=1, enableFileCaching=0, physicsClientId=self.client,
        )  # fmt: skip
        try:
            self.bodies = [self._load(arm, visible) for arm in cell.arms]
            self._compare()
            self._err(1.0 + model_error, 1.0 + friction_error)
        except BaseException:
            self.close()
            raise

    def _load(self, arm: Arm, visible: bool) -> int:
        """The arm without friction; its links are the model's."""
        T, joints = arm.T_world_base, range(arm.dof)
        try:
            with tempfile.TemporaryDirectory() as folder:
                visuals = read_visuals(arm, Path(folder)) if visible else ()
                file = Path(folder) / "arm.urdf"
                file.write_text(urdf_text(arm, visuals), encoding="utf-8")
                with quiet():
                    body: int = pybullet.loadURDF(
                        str(file), T[:3, 3].tolist(), quat_xyzw(T[:3, :3]), useFixedBase=True,
                        flags=pybullet.URDF_USE_INERTIA_FROM_FILE, physicsClientId=self.client,
                    )  # fmt: skip
        except (pybullet.error, OSError) as error:
            remedy = "TMPDIR must name a folder that can be written, by a short name"
            raise RobotError(f"arm {arm.name!r} cannot be handed to PyBullet: {error}", remedy=remedy) from error
        for link in (-1, *joints):
            pybullet.changeDynamics(
                body, link, linearDamping=0.0, angularDamping=0.0, jointDamping=0.0, physicsClientId=self.client
            )
        pybullet.setJointMotorControlArray(
            body, joints, pybullet.VELOCITY_CONTROL, forces=[0.0] * arm.dof, physicsClientId=self.client
        )
        self._weigh(body, arm, 1.0)
        return body

    def _weigh(self, body: int, arm: Arm, factor: float) -> None:
        """Make an arm's links so many times as heavy as the model's; PyBullet drops inertias that it finds odd."""
        for link, (mass, inertia) in enumerate(zip(arm.model.mass.tolist(), arm.model.inertia, strict=True)):
            moments = (factor * principal_moments(inertia)[0]).tolist()
            pybullet.changeDynamics(
                body, link, mass=factor * mass, localInertiaDiagonal=moments, physicsClientId=self.client
            )

    def _compare(self) -> None:
        """Look at random states whether the bodies are the arms: where they are, and how torques move them.

        Raises:
            RobotError: One is not; nothing is simulated then.
        """
        random = np.random.default_rng(0)
        pybullet.setTimeStep(COMPARING_STEP, physicsClientId=self.client)
        shape = len(self.bodies), max(arm.dof for arm in self.cell.arms)
        after, speeds = np.zeros(shape), np.zeros(shape)
        for _ in range(STATES_COMPARED):
            q, qd, qdd = random.uniform(-1.0, 1.0, (3, *shape)) * COMPARED_SIZES[:, None, None]
            self.put_joints(q, qd)
            torque = np.zeros(shape)
            for i, arm in enumerate(self.cell.arms):
                n = arm.dof
                torque[i, :n] = arm.inverse_dynamics(q[i, :n], qd[i, :n], qdd[i, :n], friction=False)
            self.apply_torque(torque)
            self.read_joints(after, speeds)
            for i, (body, arm) in enumerate(zip(self.bodies, self.cell.arms, strict=True)):
                n = arm.dof
                found = (speeds[i, :n] - qd[i, :n]) / COMPARING_STEP
                asked = arm.inverse_dynamics(q[i, :n], qd[i, :n], found, friction=False)
                self._check_same(arm, "inverse dynamics", asked, torque[i, :n])
                self._check_same(arm, "centres of mass", *self._centres(body, arm, after[i, :n]))
        pybullet.setTimeStep(self.cell.physics_tick, physicsClientId=self.client)

    def _centres(self, body: int, arm: Arm, q: Floats) -> tuple[Floats, Floats]:
        """(n, 3) where the links' centres of mass are, in PyBullet and for the planners [m]."""
        states = pybullet.getLinkStates(
            body, range(arm.dof), computeForwardKinematics=True, physicsClientId=self.client
        )
        T = arm.link_poses(q)
        return np.array([state[0] for state in states]), np.einsum("nij,nj->ni", T[:, :3, :3], arm.model.com) + T[
            :, :3, 3
        ]

    @staticmethod
    def _check_same(arm: Arm, what: str, found: Floats, wanted: Floats) -> None:
        off = float(np.abs(found - wanted).max() / max(np.abs(wanted).max(), 1e-3))
        if not off <= SAME_TO:
            raise RobotError(
                f"arm {arm.name!r}: its {what} in PyBullet are off by {off:.1e} from what is planned with",
                remedy='use physics="ideal", and report the URDF: this is a fault of armtempo or of PyBullet',
                file=str(arm.urdf),
                element=what,
            )

    def _err(self, mass: float, friction: float) -> None:
        """Give the arms their friction, and make both so many times as large; last, after the time step is set.

        PyBullet turns a motor's force into the impulse of a step when it is set.

        PyBullet adds ``-damping qd`` before every step, as the plans have it. Dry friction is a motor that wants to
        stand still and is as strong as the friction: it opposes motion, and holds at rest without chatter.
        """
        for body, arm in zip(self.bodies, self.cell.arms, strict=True):
            if mass != 1.0:
                self._weigh(body, arm, mass)
            for joint, (damping, coulomb) in enumerate(zip(arm.damping.tolist(), arm.coulomb.tolist(), strict=True)):
                pybullet.setJointMotorControl2(
                    body, joint, pybullet.VELOCITY_CONTROL, force=friction * coulomb, physicsClientId=self.client
                )
                pybullet.changeDynamics(body, joint, jointDamping=friction * damping, physicsClientId=self.client)

    def put_joints(self, q: Floats, qd: Floats) -> None:
        """Put every arm at ``q`` with the speeds ``qd``, both (A, n)."""
        for body, arm, places, speeds in zip(self.bodies, self.cell.arms, q.tolist(), qd.tolist(), strict=True):
            for joint in range(arm.dof):
                pybullet.resetJointState(body, joint, places[joint], speeds[joint], physicsClientId=self.client)

    def read_joints(self, q: Floats, qd: Floats) -> None:
        """Write positions and speeds of all arms to ``q``, ``qd`` (A, n)."""
        places, speeds = [], []
        for body, joints, none in zip(self.bodies, self.joints, self._padding, strict=True):
            states = pybullet.getJointStates(body, joints, physicsClientId=self.client)
            places.append([state[0] for state in states] + none)
            speeds.append([state[1] for state in states] + none)
        q[:], qd[:] = places, speeds

    def apply_torque(self, torque: Floats) -> None:
        """Apply ``torque`` (A, n) for the next step and make it."""
        for body, joints, row in zip(self.bodies, self.joints, torque.tolist(), strict=True):
            pybullet.setJointMotorControlArray(
                body, joints, pybullet.TORQUE_CONTROL, forces=row[: len(joints)], physicsClientId=self.client
            )
        pybullet.stepSimulation(physicsClientId=self.client)

    def __reduce__(self) -> tuple[object, tuple[object, ...]]:
        q = np.zeros((2, len(self.joints), max(map(len, self.joints))))
        if self.client >= 0:
            self.read_joints(*q)
        return _scene_again, (self.cell, *self._errors, q if self.client >= 0 else None)

    def close(self) -> None:
        """Leave PyBullet; may be called twice."""
        self._closer()
        self.client = -1


def _disconnect(client: int) -> None:
    with quiet(), suppress(pybullet.error):  # a window may be closed already
        pybullet.disconnect(client)


def _scene_again(cell: Cell, model_error: float, friction_error: float, joints: Floats | None) -> Scene:
    """A scene without pictures in a client of its own, where another one is: ``joints`` (2, A, n); None: closed."""
    scene = Scene(cell, model_error=model_error, friction_error=friction_error)
    if joints is None:
        scene.close()
    else:
        scene.put_joints(*joints)
    return scene


def _load_egl(client: int) -> bool:
    spec = importlib.util.find_spec("eglRenderer")
    if spec is None or spec.origin is None:
        return False
    with quiet():
        return int(pybullet.loadPlugin(spec.origin, "_eglRendererPlugin", physicsClientId=client)) >= 0


def display_available() -> bool:
    """Whether a window could be opened; PyBullet would end the process if it cannot."""
    return not sys.platform.startswith("linux") or bool(os.environ.get("DISPLAY"))


def quat_xyzw(R: Floats) -> tuple[float, float, float, float]:
    """A rotation matrix as PyBullet's quaternion."""
    from scipy.spatial.transform import Rotation

    x, y, z, w = Rotation.from_matrix(R).as_quat()
    return float(x), float(y), float(z), float(w)

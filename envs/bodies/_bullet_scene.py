"""A cell's arms in a PyBullet client of their own, moved by joint states."""

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
from armtempo.envs.bodies._scene import COMPARING_STEP, check_inertia, compare
from armtempo.errors import RobotError
from armtempo.planners import Cell
from armtempo.robots import Arm, principal_moments, read_visuals, urdf_text

FRICTION_ITERATIONS = 50
"""Of the solver, a step: all that it solves for here is the joints' dry friction, and that to rounding."""


@final
class BulletScene:
    """See ``Scene``; the arms are in a PyBullet client of their own.

    Their bodies are written by ``urdf_text``: nothing of the user's file reaches PyBullet but what the planners read.
    The default motors are off.

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
        self.cell, self.engine = cell, "PyBullet"
        check_inertia(self)
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
            pybullet.setTimeStep(COMPARING_STEP, physicsClientId=self.client)
            compare(self)
            pybullet.setTimeStep(cell.physics_tick, physicsClientId=self.client)
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

    def centres(self, i: int) -> Floats:
        """See ``Scene``."""
        states = pybullet.getLinkStates(
            self.bodies[i], self.joints[i], computeForwardKinematics=True, physicsClientId=self.client
        )
        return np.array([state[0] for state in states])

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
        """See ``Scene``."""
        for body, arm, places, speeds in zip(self.bodies, self.cell.arms, q.tolist(), qd.tolist(), strict=True):
            for joint in range(arm.dof):
                pybullet.resetJointState(body, joint, places[joint], speeds[joint], physicsClientId=self.client)

    def read_joints(self, q: Floats, qd: Floats) -> None:
        """See ``Scene``."""
        places, speeds = [], []
        for body, joints, none in zip(self.bodies, self.joints, self._padding, strict=True):
            states = pybullet.getJointStates(body, joints, physicsClientId=self.client)
            places.append([state[0] for state in states] + none)
            speeds.append([state[1] for state in states] + none)
        q[:], qd[:] = places, speeds

    def apply_torque(self, torque: Floats) -> None:
        """See ``Scene``."""
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


def _scene_again(cell: Cell, model_error: float, friction_error: float, joints: Floats | None) -> BulletScene:
    """A scene without pictures in a client of its own, where another one is: ``joints`` (2, A, n); None: closed."""
    scene = BulletScene(cell, model_error=model_error, friction_error=friction_error)
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

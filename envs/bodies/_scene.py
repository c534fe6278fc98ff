"""A cell's arms in a PyBullet client: loaded once, moved by joint states, the same bodies as the planners'."""

from __future__ import annotations

import importlib.util
import os
import sys
import tempfile
from pathlib import Path
from typing import Any, NoReturn, final
from xml.etree import ElementTree

from armtempo.arrays import Floats
from armtempo.configs import ToolConfig
from armtempo.envs.bodies._bullet import pybullet, quiet
from armtempo.errors import InputError, RobotError
from armtempo.planners import Cell
from armtempo.robots import Arm

_FLAGS = pybullet.URDF_USE_INERTIA_FROM_FILE  # the file's inertias, not those of the collision shapes


@final
class Scene:
    """The arms of a cell in a PyBullet client of their own.

    PyBullet's own contacts are masked off (clearance is FCL's business, and resets stay bit-exact), friction is that
    of the ``Arm``, viscous and dry, and the default motors are off.

    Args:
        cell: What to load.
        window: Open PyBullet's window instead of working unseen.
        egl: Draw by the EGL plugin, where it loads; it draws only what comes into the scene after it.

    Attributes:
        hardware: Whether that plugin draws.
    """

    def __init__(self, cell: Cell, *, window: bool = False, egl: bool = False) -> None:
        self.cell = cell
        self.client: int = pybullet.connect(pybullet.GUI if window else pybullet.DIRECT)
        if self.client < 0:
            raise RobotError("PyBullet did not start", remedy="close other PyBullet windows and try again")
        self.hardware = egl and _load_egl(self.client)
        # Before any motor: PyBullet turns a motor's force into the impulse of a step when it is set.
        pybullet.setTimeStep(cell.physics_tick, physicsClientId=self.client)
        self.bodies: list[int] = []
        self.joints: list[list[int]] = []
        for arm, tool in zip(cell.arms, cell.tools, strict=True):
            body = self._load(arm, tool)
            self.bodies.append(body)
            index = {
                pybullet.getJointInfo(body, j, physicsClientId=self.client)[1].decode(): j
                for j in range(pybullet.getNumJoints(body, physicsClientId=self.client))
            }
            self.joints.append([index[name] for name in arm.joint_names])
            self._disable_contacts_and_motors(body, self.joints[-1], arm)

    def _load(self, arm: Arm, tool: ToolConfig | None) -> int:
        x, y, z, w = quat_xyzw(arm.T_world_base[:3, :3])
        with tempfile.TemporaryDirectory() as folder:
            file = _with_tool(arm, tool, Path(folder))
            try:
                body: int = pybullet.loadURDF(
                    str(file), list(arm.T_world_base[:3, 3]), [x, y, z, w], useFixedBase=True, flags=_FLAGS,
                    physicsClientId=self.client,
                )  # fmt: skip
            except pybullet.error as error:
                raise RobotError(
                    f"PyBullet cannot load {arm.urdf}: {error}",
                    remedy="check the file and its meshes",
                    file=str(arm.urdf),
                ) from None
        return body

    def _disable_contacts_and_motors(self, body: int, driven: list[int], arm: Arm) -> None:
        """No contacts, no damping but the arm's own, no motors but those that stand for dry friction.

        PyBullet adds ``-damping qd`` before every step, as the plans have it. Dry friction is a motor that wants to
        stand still and is as strong as the friction: it opposes motion, and holds at rest without chatter.
        """
        client = self.client
        for link in range(-1, pybullet.getNumJoints(body, physicsClientId=client)):
            pybullet.setCollisionFilterGroupMask(body, link, 0, 0, physicsClientId=client)
            pybullet.changeDynamics(body, link, linearDamping=0.0, angularDamping=0.0, physicsClientId=client)
        for joint in range(pybullet.getNumJoints(body, physicsClientId=client)):
            if pybullet.getJointInfo(body, joint, physicsClientId=client)[2] != pybullet.JOINT_FIXED:
                held = joint not in driven
                k = 0 if held else driven.index(joint)
                pybullet.setJointMotorControl2(
                    body, joint, pybullet.POSITION_CONTROL if held else pybullet.VELOCITY_CONTROL, targetPosition=0.0,
                    force=1e4 if held else float(arm.coulomb[k]), physicsClientId=client,
                )  # fmt: skip
                if not held:
                    damping = float(arm.damping[k])
                    pybullet.changeDynamics(body, joint, jointDamping=damping, physicsClientId=client)

    def scale_mass(self, factor: float) -> None:
        """Make every body of the arms so many times as heavy as its file says, inertia and all."""
        for body in self.bodies:
            for link in range(pybullet.getNumJoints(body, physicsClientId=self.client)):
                mass, _, inertia = pybullet.getDynamicsInfo(body, link, physicsClientId=self.client)[:3]
                pybullet.changeDynamics(
                    body, link, mass=factor * mass, localInertiaDiagonal=[factor * value for value in inertia],
                    physicsClientId=self.client,
                )  # fmt: skip

    def scale_friction(self, factor: float) -> None:
        """Make damping and dry friction of every driven joint so many times as large as the arm's."""
        for body, joints, arm in zip(self.bodies, self.joints, self.cell.arms, strict=True):
            for k, joint in enumerate(joints):
                pybullet.setJointMotorControl2(
                    body, joint, pybullet.VELOCITY_CONTROL, force=factor * float(arm.coulomb[k]),
                    physicsClientId=self.client,
                )  # fmt: skip
                damping = factor * float(arm.damping[k])
                pybullet.changeDynamics(body, joint, jointDamping=damping, physicsClientId=self.client)

    def reset_joints(self, q: Floats) -> None:
        """Put every arm at rest at ``q`` (A, n)."""
        for body, joints, row in zip(self.bodies, self.joints, q.tolist(), strict=True):
            for joint, value in zip(joints, row, strict=False):
                pybullet.resetJointState(body, joint, value, 0.0, physicsClientId=self.client)

    def read_joints(self, q: Floats, qd: Floats) -> None:
        """Write positions and speeds of all arms to ``q``, ``qd`` (A, n)."""
        for i, (body, joints) in enumerate(zip(self.bodies, self.joints, strict=True)):
            for j, state in enumerate(pybullet.getJointStates(body, joints, physicsClientId=self.client)):
                q[i, j], qd[i, j] = state[0], state[1]

    def apply_torque(self, torque: Floats) -> None:
        """Apply ``torque`` (A, n) for the next step and make it."""
        for body, joints, row in zip(self.bodies, self.joints, torque.tolist(), strict=True):
            pybullet.setJointMotorControlArray(
                body, joints, pybullet.TORQUE_CONTROL, forces=row[: len(joints)], physicsClientId=self.client
            )
        pybullet.stepSimulation(physicsClientId=self.client)

    def __reduce__(self) -> NoReturn:
        raise InputError(  # a copy would move the same bodies
            "what is in PyBullet can neither be copied nor pickled",
            remedy='copy one of physics="ideal" without pictures, or reset another one with the same seed',
        )

    def close(self) -> None:
        """Leave PyBullet; may be called twice."""
        if self.client >= 0:
            with quiet():
                pybullet.disconnect(self.client)
            self.client = -1


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


def _with_tool(arm: Arm, tool: ToolConfig | None, folder: Path) -> Path:
    """The arm's URDF, or a copy in ``folder`` with a tool bolted to its tip."""
    if tool is None:
        return arm.urdf
    tree = ElementTree.parse(arm.urdf)  # noqa: S314 (read before)
    for mesh in tree.iter("mesh"):
        name = mesh.get("filename", "")
        if "://" not in name:
            mesh.set("filename", str((arm.urdf.parent / name).resolve()))
    root = tree.getroot()
    link = ElementTree.SubElement(root, "link", name="armtempo_tool")
    if tool.mass_kg > 0.0:
        inertial = ElementTree.SubElement(link, "inertial")
        ElementTree.SubElement(inertial, "origin", xyz=" ".join(map(repr, tool.com_m)))
        ElementTree.SubElement(inertial, "mass", value=repr(tool.mass_kg))
        names = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
        values: dict[str, Any] = {name: repr(v) for name, v in zip(names, tool.inertia_kgm2, strict=True)}
        ElementTree.SubElement(inertial, "inertia", **values)
    else:  # PyBullet takes a link without an inertial for 1 kg
        inertial = ElementTree.SubElement(link, "inertial")
        ElementTree.SubElement(inertial, "mass", value="0")
        zeros: dict[str, Any] = dict.fromkeys(("ixx", "iyy", "izz", "ixy", "ixz", "iyz"), "0")
        ElementTree.SubElement(inertial, "inertia", **zeros)
    joint = ElementTree.SubElement(root, "joint", name="armtempo_tool_joint", type="fixed")
    ElementTree.SubElement(joint, "parent", link=arm.tip_link)
    ElementTree.SubElement(joint, "child", link="armtempo_tool")
    file = folder / "arm.urdf"
    tree.write(file)
    return file

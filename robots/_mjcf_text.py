"""The arms of a cell as the text of one MuJoCo model, which moves as the planned arms do and as PyBullet's do.

MuJoCo's usual settings are for contacts and long steps. Four are others here. *Euler without implicit damping*: damping
and torques act as they are at a step's start, as in PyBullet, ``qd' = qd + dt qdd``, ``q' = q + dt qd'``. *Dry friction
that is hard*: it aims to stop a joint within the step, up to its limit, where the usual one creeps. *Nothing from the
shapes*: masses and inertias are the model's. *No restart*: a motion that diverges is an error, not a new episode. And
no warm start: a step depends on positions, speeds and torques alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from xml.etree import ElementTree as ET

import numpy as np

from armtempo.arrays import Floats
from armtempo.robots._arm import Arm

__all__ = ["mjcf_text"]

FRICTION_ITERATIONS = 50
FRICTION_IMPEDANCE = 0.9999  # the largest that MuJoCo takes
LEAST = 1e-14  # [kg, kg m^2] of a moving body: MuJoCo refuses less


def mjcf_text(
    arms: Sequence[Arm], gravity: Sequence[float], step: float, *, mass: float = 1.0, friction: float = 1.0
) -> str:
    """All arms at their bases, ``arm_k_link_i`` turning about ``arm_k_joint_i``; nothing collides, nothing is seen.

    Args:
        arms: Whose placements, masses (with tools) and frictions.
        gravity: (3,) in the world [m/s^2].
        step: Of the simulation [s].
        mass: The links are so many times as heavy, inertia and all.
        friction: Damping and dry friction are so many times as large.
    """
    root = ET.Element("mujoco", model="cell")
    off = ("autolimits", "balanceinertia", "inertiafromgeom", "fusestatic")
    ET.SubElement(root, "compiler", {"angle": "radian", **dict.fromkeys(off, "false")})
    rubs = any(arm.coulomb.any() for arm in arms)
    option = ET.SubElement(
        root, "option", timestep=repr(step), gravity=_numbers(gravity), integrator="Euler", tolerance="0",
        iterations=str(FRICTION_ITERATIONS if rubs else 1),
    )  # fmt: skip
    disabled = ("contact", "limit", "equality", "eulerdamp", "autoreset", "warmstart")
    ET.SubElement(option, "flag", dict.fromkeys(disabled, "disable"))
    world = ET.SubElement(root, "worldbody")
    for k, arm in enumerate(arms):
        T = arm.T_world_base
        parent = ET.SubElement(world, "body", {"name": f"arm_{k}", **_pose(T[:3, :3], T[:3, 3])})
        for i in range(arm.dof):
            parent = _link(parent, arm, f"arm_{k}", i, mass)
            _joint(parent, arm, f"arm_{k}", i, step, friction)
    ET.indent(root)
    return ET.tostring(root, encoding="unicode")


def _link(parent: ET.Element, arm: Arm, name: str, i: int, factor: float) -> ET.Element:
    model = arm.model
    pose = _pose(model.placement_R[i], model.placement_p[i])
    body = ET.SubElement(parent, "body", {"name": f"{name}_link_{i}", **pose})
    inertia = factor * model.inertia[i]
    if not inertia.any():
        inertia = LEAST * np.eye(3)
    xx, yy, zz, xy, xz, yz = inertia[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
    ET.SubElement(
        body, "inertial", pos=_numbers(model.com[i]), mass=repr(max(factor * float(model.mass[i]), LEAST)),
        fullinertia=_numbers((xx, yy, zz, xy, xz, yz)),
    )  # fmt: skip
    return body


def _joint(body: ET.Element, arm: Arm, name: str, i: int, step: float, factor: float) -> None:
    impedance = f"{FRICTION_IMPEDANCE} {FRICTION_IMPEDANCE} 0.001 0.5 2"
    ET.SubElement(
        body, "joint", name=f"{name}_joint_{i}", type="slide" if arm.model.prismatic[i] else "hinge", limited="false",
        axis=_numbers(arm.model.axis[i]), damping=repr(factor * float(arm.damping[i])),
        frictionloss=repr(factor * float(arm.coulomb[i])), solimpfriction=impedance,
        solreffriction=f"{2.0 * step / FRICTION_IMPEDANCE!r} 1",
    )  # fmt: skip


def _pose(R: Floats, p: Floats) -> dict[str, str]:
    from scipy.spatial.transform import Rotation

    x, y, z, w = Rotation.from_matrix(R).as_quat()
    return {"pos": _numbers(p), "quat": _numbers((w, x, y, z))}


def _numbers(values: Sequence[float] | Floats) -> str:
    return " ".join(repr(float(value)) for value in values)

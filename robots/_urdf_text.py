"""An arm as the text of a URDF: an engine that reads it simulates what was planned, whatever the file was like.

Links are merged as the planners have them, every moment of inertia is explicit and given in its principal axes (engines
differ in how well they find these), joints turn without end (limits are the planners' business), nothing collides.
"""

from __future__ import annotations

from collections.abc import Sequence
from xml.etree import ElementTree as ET

import numpy as np

from armtempo.arrays import Floats
from armtempo.robots._arm import Arm
from armtempo.robots._visuals import Visual

__all__ = ["principal_moments", "urdf_text"]

UNLIMITED = 1e9  # of effort and velocity: what a URDF has to say of a joint without limits


def urdf_text(arm: Arm, visuals: Sequence[Visual] = ()) -> str:
    """The chain as a URDF: a ``base``, then ``link_i`` behind ``joint_i``, i = 0 .. n - 1, in the arm's own frames.

    Args:
        arm: Whose masses, with its tool's, and placements; base pose, gravity and friction are not in a URDF.
        visuals: What its links look like. Meshes are named as they are, in the scale that they have.
    """
    model, robot = arm.model, ET.Element("robot", name="arm")
    _link(robot, "base", -1, 0.0, np.zeros(3), np.zeros((3, 3)), visuals)
    parent = "base"
    for i, joint_type in enumerate("prismatic" if slides else "continuous" for slides in model.prismatic):
        _link(robot, f"link_{i}", i, float(model.mass[i]), model.com[i], model.inertia[i], visuals)
        joint = ET.SubElement(robot, "joint", name=f"joint_{i}", type=joint_type)
        joint.append(_origin(model.placement_R[i], model.placement_p[i]))
        ET.SubElement(joint, "parent", link=parent)
        ET.SubElement(joint, "child", link=f"link_{i}")
        ET.SubElement(joint, "axis", xyz=_numbers(model.axis[i]))
        # No range (lower > upper): PyBullet would stop slides at 0 without one.
        ET.SubElement(joint, "limit", lower="1", upper="-1", effort=f"{UNLIMITED}", velocity=f"{UNLIMITED}")
        parent = f"link_{i}"
    ET.indent(robot)  # PyBullet reads lines of 8 KB at most, and damages longer ones
    return ET.tostring(robot, encoding="unicode")


def _link(
    robot: ET.Element, name: str, i: int, mass: float, com: Floats, inertia: Floats, visuals: Sequence[Visual]
) -> None:
    link = ET.SubElement(robot, "link", name=name)
    moments, axes = principal_moments(inertia)
    inertial = ET.SubElement(link, "inertial")
    inertial.append(_origin(axes, com))
    ET.SubElement(inertial, "mass", value=repr(mass))
    ixx, iyy, izz = map(repr, moments.tolist())
    ET.SubElement(inertial, "inertia", ixx=ixx, iyy=iyy, izz=izz, ixy="0", ixz="0", iyz="0")
    for shape in visuals:
        if shape.link == i:
            visual = ET.SubElement(link, "visual")
            visual.append(_origin(shape.T_link_shape[:3, :3], shape.T_link_shape[:3, 3]))
            ET.SubElement(ET.SubElement(visual, "geometry"), shape.kind, _size(shape))


def _size(shape: Visual) -> dict[str, str]:
    if shape.kind == "mesh":
        return {"filename": str(shape.mesh), "scale": _numbers(np.array(shape.size))}
    if shape.kind == "box":
        return {"size": _numbers(np.array(shape.size))}
    return dict(zip(("radius", "length"), map(repr, shape.size), strict=False))


def principal_moments(inertia: Floats) -> tuple[Floats, Floats]:
    """Of a tensor of inertia (3, 3): its principal moments (3,), and their axes (3, 3), a rotation [kg m^2].

    A diagonal tensor keeps its axes.
    """
    if not (inertia - np.diag(np.diag(inertia))).any():
        return np.diag(inertia), np.eye(3)
    moments, axes = np.linalg.eigh(inertia)
    axes[:, 0] *= np.sign(np.linalg.det(axes))
    return np.maximum(moments, 0.0), axes


def _origin(R: Floats, p: Floats) -> ET.Element:
    return ET.Element("origin", xyz=_numbers(p), rpy=_numbers(np.array(_rpy(R))))


def _rpy(R: Floats) -> tuple[float, float, float]:
    """Roll, pitch and yaw that make up ``R``, to rounding also where pitch is a right angle."""
    yaw = np.arctan2(R[1, 0], R[0, 0])
    s, c = np.sin(yaw), np.cos(yaw)
    roll = np.arctan2(s * R[0, 2] - c * R[1, 2], c * R[1, 1] - s * R[0, 1])
    return float(roll), float(np.arctan2(-R[2, 0], np.hypot(R[0, 0], R[1, 0]))), float(yaw)


def _numbers(values: Floats) -> str:
    return " ".join(map(repr, values.tolist()))

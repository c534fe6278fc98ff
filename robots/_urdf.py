"""URDF to a serial chain: movable joints from root to tip, everything else merged into the links that carry it."""

from __future__ import annotations

import io
import logging
import math
import os
import xml.etree.ElementTree as ET
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path
from typing import Any, Final, Literal, NoReturn

import numpy as np
import yourdfpy
from scipy.spatial.transform import Rotation

from armtempo.arrays import Floats
from armtempo.errors import RobotError, closest
from armtempo.robots._shapes import MESH_LENGTH_USUAL, Shape, hull_length, load_mesh, make_shape
from armtempo.robots._sizes import read_number
from armtempo.robots._srdf import Srdf, group_tip
from armtempo.robots._substitute import spread_mass
from armtempo.robots._tip import choose_tip
from armtempo.robots._urdf_numbers import check_numbers, has_no_size, numbers_of
from armtempo.robots._xacro import expand

__all__ = ["Body", "Chain", "ChainJoint", "Unphysical", "UrdfReader", "merge_inertia"]

MOVABLE_TYPES: Final = ("revolute", "continuous", "prismatic")
HELD_SLACK: Final = 1e-6  # [rad, m] beyond its range that a held joint may be: rounding
LIMITS_OF_URDF_1_2: Final = ("acceleration", "deceleration", "jerk")
Unphysical = Literal["refuse", "point-mass"]
_LOG = logging.getLogger("armtempo")


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Body:
    """Mass, centre of mass (3,) and inertia about it (3, 3), in one link's frame."""

    mass: float
    com: Floats
    inertia: Floats


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class ChainJoint:
    """A movable joint and the moving link behind it. Limits that the URDF does not give are None."""

    name: str
    type: str
    link_name: str
    T_before_link: Floats
    axis: Floats
    lower: float | None
    upper: float | None
    effort: float | None
    velocity: float | None
    acceleration: float | None
    jerk: float | None
    damping: float
    coulomb: float
    body: Body


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Chain:
    """What ``Arm`` needs of a URDF."""

    name: str
    joints: tuple[ChainJoint, ...]
    shapes: tuple[Shape, ...]
    tip_link: str
    T_last_tip: Floats
    kinematic: bool
    """The file has no inertia: bodies have no mass, or a substitute."""


def merge_inertia(bodies: list[tuple[float, Floats, Floats]]) -> Body:
    """One rigid body from (mass, com, inertia about com) parts in the same frame (parallel-axis theorem)."""
    mass = math.fsum(m for m, _, _ in bodies)
    com = sum((m * c for m, c, _ in bodies), np.zeros(3)) / mass if mass > 0 else np.zeros(3)
    inertia = np.zeros((3, 3))
    for m, c, about_com in bodies:
        d = c - com
        inertia += about_com + m * (d @ d * np.eye(3) - np.outer(d, d))
    return Body(mass=mass, com=com, inertia=inertia)


class UrdfReader:
    """A robot's file as a tree of links. Raises RobotError naming the file, the element and the remedy.

    Args:
        file: Its name.
        unphysical_inertia: See ``Arm.from_urdf``.
        substitute_mass: Where no link has an inertia, it is spread over all of them [kg]; without it they have none.
        locked: Where joints are held [rad or m]; those that mimic them follow.

    Attributes:
        file: Its name.
        visuals: The <visual> elements of every link, as they are: nobody has looked at them.
    """

    def __init__(
        self,
        file: Path,
        unphysical_inertia: Unphysical,
        substitute_mass: float | None = None,
        locked: Mapping[str, float] | None = None,
    ) -> None:
        self.file = file
        self.unphysical_inertia = unphysical_inertia
        self.substitute_mass = substitute_mass
        self.kinematic = False
        self.visuals: dict[str, list[ET.Element]] = {}
        self.capsules: dict[tuple[str, int], tuple[float, float]] = {}
        """Radius and length of PyBullet's <capsule> elements, which yourdfpy refuses, by link and collision."""
        self.visible: set[str] = set()
        """Links that have geometry."""
        self.accelerations: dict[str, float] = {}
        """Limits of joints, the smaller of acceleration and deceleration (URDF 1.2)."""
        self.jerks: dict[str, float] = {}
        """Likewise."""
        self.hints: list[str] = []
        """What is left out, or looks odd."""
        self.huge_meshes: list[str] = []
        self.robot = robot = self._parse()
        self.links = {link.name: link for link in robot.links}
        self.parent_joint: dict[str, Any] = {}
        self.children: dict[str, list[Any]] = {name: [] for name in self.links}
        for joint in robot.joints:
            for end in (joint.parent, joint.child):
                if end not in self.links:
                    self.fail(f"joint {joint.name!r}", f"joins the unknown link {end!r}", self._known(end, self.links))
            if joint.child in self.parent_joint:
                self.fail(f"link {joint.child!r}", "has two parent joints", "remove one: the links must form a tree")
            self.parent_joint[joint.child] = joint
            self.children[joint.parent].append(joint)
        roots = [name for name in self.links if name not in self.parent_joint]
        if len(roots) != 1:
            self.fail("robot", f"has {len(roots)} root links {roots}", "join the links into one tree")
        self.root = roots[0]
        self._hold(locked or {})

    def _hold(self, locked: Mapping[str, float]) -> None:
        """Make joints that are held, and those that mimic them, fixed ones."""
        by_name = {joint.name: joint for joint in self.robot.joints}
        for name, value in locked.items():
            joint = by_name.get(name)
            if joint is None or joint.type not in MOVABLE_TYPES or joint.mimic is not None:
                free = [j.name for j in self.robot.joints if j.type in MOVABLE_TYPES and j.mimic is None]
                remedy = f"{closest(name, free)}joints: {', '.join(free)}"
                self.fail(f"locked joint {name!r}", "does not exist" if joint is None else "is none that moves", remedy)
            limit = joint.limit
            lower, upper = (-math.inf, math.inf)
            if joint.type != "continuous" and limit is not None and limit.lower is not None and limit.upper is not None:
                lower, upper = limit.lower, limit.upper
            if not lower - HELD_SLACK <= read_number(value) <= upper + HELD_SLACK:
                self.fail(f"locked joint {name!r}", f"at {value!r:.60} is out of range", f"give {lower:g} to {upper:g}")
        for joint in self.robot.joints:
            if joint.type not in MOVABLE_TYPES:
                continue
            at = locked.get(joint.name)
            if joint.mimic is not None:  # of one that is held, or at zero as all that are off the chain
                drive, factor, offset = joint.mimic.joint, joint.mimic.multiplier, joint.mimic.offset
                if drive not in locked and not (drive in by_name and offset):
                    continue
                at = (1.0 if factor is None else factor) * locked.get(drive, 0.0) + (offset or 0.0)
            if at is None:
                continue
            origin = np.eye(4) if joint.origin is None else joint.origin
            joint.origin = origin @ self._moved(joint, float(at))
            joint.type = "fixed"

    @staticmethod
    def _moved(joint: Any, at: float) -> Floats:
        """(4, 4) the motion of a joint from zero to a position."""
        T, axis = np.eye(4), joint.axis / max(float(np.linalg.norm(joint.axis)), 1e-300)
        if joint.type == "prismatic":
            T[:3, 3] = at * axis
        else:
            T[:3, :3] = Rotation.from_rotvec(at * axis).as_matrix()
        return T

    def fail(self, element: str, problem: str, remedy: str) -> NoReturn:
        raise RobotError(f"{self.file}: {element} {problem}", remedy=remedy, file=str(self.file), element=element)

    @staticmethod
    def _known(name: str, known: Any) -> str:
        close = get_close_matches(name, known, n=1)
        return (f"did you mean {close[0]!r}? " if close else "") + f"links: {', '.join(known)}"

    def _parse(self) -> Any:
        """The robot as yourdfpy has it, and what that leaves out."""
        root = self._xml()
        for kind in ("link", "joint"):
            names = [element.get("name", "") for element in root.findall(kind)]
            for name in names:
                if not name or names.count(name) > 1:
                    self.fail(f"{kind} {name!r}", "has no name of its own", "give each one its own name")
        check_numbers(root, self.fail)
        for joint in root.findall("joint"):
            self._look_at_joint(joint)
        for link in root.findall("link"):
            self._look_at_link(link)
        try:
            text = io.BytesIO(ET.tostring(root))
            return yourdfpy.URDF.load(text, build_scene_graph=False, load_meshes=False).robot
        except Exception as error:  # noqa: BLE001 - yourdfpy lets KeyError, AttributeError, ValueError through
            self.fail("file", f"is not a valid URDF: {type(error).__name__}: {error}", "check it with check_urdf")

    def _look_at_joint(self, joint: ET.Element) -> None:
        element = f"joint {joint.get('name')!r}"
        for end in ("parent", "child"):
            found = joint.find(end)
            if found is None or not found.get("link"):
                self.fail(element, f"has no <{end} link=...>", "name the link that it joins")
        limit = joint.find("limit")
        if limit is None:
            return
        given = {kind: numbers_of(limit.get(kind, ""))[0] for kind in LIMITS_OF_URDF_1_2 if kind in limit.attrib}
        for kind, value in given.items():
            if not value > 0.0:
                self.fail(element, f"has {kind}={value:g}", "give a limit > 0, or leave it out")
        name = joint.get("name", "")
        if "acceleration" in given or "deceleration" in given:  # one limit for both directions: the safe one
            self.accelerations[name] = min(given.get("acceleration", math.inf), given.get("deceleration", math.inf))
        if "jerk" in given:
            self.jerks[name] = given["jerk"]

    def _look_at_link(self, link: ET.Element) -> None:
        name = link.get("name", "")
        for collision in link.findall("collision"):
            geometry = collision.find("geometry")
            if geometry is not None and len(geometry) and has_no_size(geometry[0]):
                self.hints.append(f"link {name!r} has a collision <{geometry[0].tag}> without any size: left out")
                link.remove(collision)
        if link.find("visual") is not None or link.find("collision") is not None:
            self.visible.add(name)
        self.visuals[name] = link.findall("visual")
        for visual in self.visuals[name]:
            link.remove(visual)  # not ours; and yourdfpy would refuse its capsules
        for index, collision in enumerate(link.findall("collision")):
            capsule = self._take_capsule(name, index, collision)
            if capsule is not None:
                self.capsules[name, index] = capsule

    def _xml(self) -> ET.Element:
        try:
            root = ET.parse(self.file).getroot()  # noqa: S314 - the user's own file
        except FileNotFoundError:
            self.fail("file", "does not exist", "check the path of the URDF")
        except (OSError, ET.ParseError) as error:
            self.fail("file", f"cannot be read as XML: {error}", "repair it")
        if root.tag != "robot":
            self.fail(f"<{root.tag}>", "is not a URDF's <robot>", "give a URDF file")
        if any("xacro}" in element.tag for element in root.iter()):  # {http://wiki.ros.org/xacro}, or another address
            return ET.fromstring(expand(self.file))  # noqa: S314 - likewise
        return root

    def _take_capsule(self, name: str, index: int, collision: ET.Element) -> tuple[float, float] | None:
        """Radius and length of a collision body that is a capsule, which becomes a cylinder in the XML; else None."""
        geometry = collision.find("geometry")
        shape = None if geometry is None or not len(geometry) else geometry[0]
        if shape is None:
            self.fail(f"link {name!r}", f"collision {index} has no shape", "add one inside its <geometry>")
        if shape.tag != "capsule":
            return None
        shape.tag = "cylinder"
        return float(shape.attrib["radius"]), float(shape.attrib["length"])

    def _tip(self, tip_link: str | None) -> str:
        if tip_link is not None:
            if tip_link not in self.links:
                self.fail(f"tip_link {tip_link!r}", "does not exist", self._known(tip_link, self.links))
            return tip_link
        leaves = [name for name, joints in self.children.items() if not joints]
        if len(leaves) == 1:
            return leaves[0]
        tips = choose_tip(self.root, self.children, lambda joint: joint.type in MOVABLE_TYPES)
        if tips.link is None:
            remedy = f"choose the tip with tip_link: {', '.join(tips.candidates)}"
            self.fail("robot", f"ends in {len(leaves)} links", remedy)
        _LOG.info("%s: the tip is %r, as none is named", self.file, tips.link)
        return tips.link

    def group_tip(self, srdf: Srdf, group: str) -> str:
        """The link at the end of an SRDF's group, whose joints must be all that move on the way to it."""
        tip, own = group_tip(srdf, group, self.parent_joint, lambda name: self._known(name, self.links))
        above = [joint.name for joint in self._movable(tip) if joint.name not in own]
        if above:
            held = ", ".join(f"{name}: 0.0" for name in above)
            self.fail(f"joint {above[0]!r}", f"moves, and is not of group {group!r}", f"hold it: locked: {{{held}}}")
        return tip

    def chain(self, tip_link: str | None) -> Chain:
        tip = self._tip(tip_link)
        movable = self._movable(tip)
        moving = {joint.name for joint in movable}
        for joint in self.robot.joints:
            if joint.mimic is not None and joint.type in MOVABLE_TYPES and joint.mimic.joint in moving:
                self.hints.append(f"joint {joint.name!r} follows {joint.mimic.joint!r}, but is held at zero here")
        place, before = self._places(movable)
        shapes = [
            self._shape(name, index, collision, *place[name])
            for name, link in self.links.items()
            for index, collision in enumerate(link.collisions)
        ]
        bodies = self._bodies(movable, place, shapes)
        joints = [self._joint(j, T, b) for j, T, b in zip(movable, before, bodies, strict=True)]
        if self.huge_meshes:
            self.hints.append(
                f"{self.huge_meshes[0]}, {len(self.huge_meshes)} such in all: are they in millimetres? "
                'Then write <mesh scale="0.001 0.001 0.001" .../>'
            )
        for hint in self.hints:
            _LOG.warning("%s: %s", self.file, hint)
        return Chain(
            name=self.robot.name or "robot",
            joints=tuple(joints),
            shapes=tuple(shapes),
            tip_link=tip,
            T_last_tip=place[tip][1],
            kinematic=self.kinematic,
        )

    def places(self, tip_link: str) -> dict[str, tuple[int, Floats]]:
        """Of each link: the moving link on the way to the tip that carries it (-1: the base), and its pose there."""
        return self._places(self._movable(self._tip(tip_link)))[0]

    def _movable(self, tip: str) -> list[Any]:
        """The movable joints from the root to the tip."""
        chain: list[Any] = []
        link = tip
        while link != self.root:
            if len(chain) > len(self.links):
                self.fail(f"link {link!r}", "is part of a loop", "the links must form a tree")
            chain.insert(0, self.parent_joint[link])
            link = chain[0].parent
        for joint in chain:
            if joint.type in MOVABLE_TYPES:
                if joint.mimic is not None:
                    self.fail(f"joint {joint.name!r}", "mimics another", "choose a tip_link before it")
            elif joint.type != "fixed":
                remedy = f"only {', '.join(MOVABLE_TYPES)} and fixed are supported"
                self.fail(f"joint {joint.name!r}", f"is {joint.type}", remedy)
        movable = [joint for joint in chain if joint.type in MOVABLE_TYPES]
        if not movable:
            movers = [j.child for j in self.robot.joints if j.type in MOVABLE_TYPES]
            remedy = f"choose a tip_link behind one: {', '.join(movers)}" if movers else "give a robot with joints"
            self.fail("robot", f"has no movable joint between {self.root!r} and {tip!r}", remedy)
        return movable

    def _places(self, movable: list[Any]) -> tuple[dict[str, tuple[int, Floats]], list[Floats]]:
        """Of each link: the moving link that carries it (-1: the base), and its pose there; the moving links' poses.

        The latter at zero, in the moving link before.
        """
        place: dict[str, tuple[int, Floats]] = {self.root: (-1, np.eye(4))}
        before: list[Floats] = []
        number = {joint.name: i for i, joint in enumerate(movable)}
        stack = [self.root]
        while stack:
            parent = stack.pop()
            body, T = place[parent]
            for joint in self.children[parent]:
                T_joint = T if joint.origin is None else T @ joint.origin
                place[joint.child] = (body, T_joint) if joint.name not in number else (number[joint.name], np.eye(4))
                if joint.name in number:
                    before.append(T_joint)  # in chain order: the walk reaches them one behind the other
                stack.append(joint.child)
        for name in self.links:
            if name not in place:
                self.fail(f"link {name!r}", "hangs on a loop", "the links must form a tree")
        return place, before

    def _bodies(self, movable: list[Any], place: dict[str, tuple[int, Floats]], shapes: Sequence[Shape]) -> list[Body]:
        """Of the moving links, with all that is fixed to them."""
        if all(link.inertial is None for name, link in self.links.items() if place[name][0] >= 0):
            return self._substitutes(len(movable), shapes)
        if self.substitute_mass is not None:
            self.fail("robot", "has links with <inertial>", "leave substitute_mass_kg out, or all of these")
        parts: list[list[tuple[float, Floats, Floats]]] = [[] for _ in movable]
        for name, link in self.links.items():
            body, T = place[name]
            if body < 0:
                continue
            if link.inertial is not None:
                parts[body].append(self._inertial(name, link.inertial, T))
            elif movable[body].child == name or name in self.visible:
                self.fail(f"link {name!r}", "moves but has no <inertial>", "add its mass and inertia")
        bodies = [merge_inertia(part) for part in parts]
        if bodies[-1].mass <= 0:
            self.fail(f"link {movable[-1].child!r}", "moves but has no mass", "give it a mass greater than 0")
        return bodies

    def _substitutes(self, links: int, shapes: Sequence[Shape]) -> list[Body]:
        """Bodies of a robot in whose file none has an inertia."""
        self.kinematic = True
        if self.substitute_mass is None:
            return [merge_inertia([])] * links
        parts = spread_mass(self.substitute_mass, links, shapes)
        if parts is None:
            self.fail("robot", "has no <collision> on its last link to spread a mass over", "add one")
        return [merge_inertia(part) for part in parts]

    def _inertial(self, name: str, inertial: Any, T: Floats) -> tuple[float, Floats, Floats]:
        mass, inertia = inertial.mass, inertial.inertia
        if mass is None or inertia is None:
            self.fail(f"link {name!r}", "has an <inertial> without mass or inertia", "add both")
        moments = np.linalg.eigvalsh(inertia)
        if mass < 0.0 or moments[0] < -1e-12:
            self.fail(f"link {name!r}", "has a negative mass or inertia", "give physical values")
        if moments[2] > (moments[0] + moments[1]) * (1 + 1e-6) + 1e-12:
            # PyBullet replaces it by zero with no more than a warning, and simulates another arm.
            listed = np.array2string(moments, precision=4)
            problem = f"has principal moments of inertia {listed}, which no body can have"
            if self.unphysical_inertia == "refuse":
                remedy = "the largest may not exceed the sum of the others; mend it, or allow unphysical_inertia"
                self.fail(f"link {name!r}", problem, remedy)
            _LOG.info("%s: link %r %s; it is taken for a point mass, as PyBullet does", self.file, name, problem)
            inertia = np.zeros((3, 3))
        T = T if inertial.origin is None else T @ inertial.origin
        return float(mass), T[:3, 3].copy(), T[:3, :3] @ inertia @ T[:3, :3].T

    def _joint(self, joint: Any, T: Floats, body: Body) -> ChainJoint:
        length = float(np.linalg.norm(joint.axis))
        if not length > 1e-9:
            self.fail(f"joint {joint.name!r}", "has no axis", "give <axis xyz> a direction")
        limit = joint.limit
        damping, coulomb = (self._friction(joint, attribute) for attribute in ("damping", "friction"))
        continuous = joint.type == "continuous"
        return ChainJoint(
            name=joint.name,
            type=joint.type,
            link_name=joint.child,
            T_before_link=T,
            axis=joint.axis / length,
            lower=-math.inf if continuous else limit and limit.lower,
            upper=math.inf if continuous else limit and limit.upper,
            effort=limit and limit.effort,
            velocity=limit and limit.velocity,
            acceleration=self.accelerations.get(joint.name),
            jerk=self.jerks.get(joint.name),
            damping=damping,
            coulomb=coulomb,
            body=body,
        )

    def _friction(self, joint: Any, attribute: str) -> float:
        value = float(getattr(joint.dynamics, attribute, None) or 0.0)
        if value < 0.0:
            self.fail(f"joint {joint.name!r}", f"has {attribute}={value:g}", "give a number >= 0")
        return value

    def _shape(self, name: str, index: int, collision: Any, body: int, T: Floats) -> Shape:
        geometry = collision.geometry
        T = T if collision.origin is None else T @ collision.origin
        kind: str
        size: tuple[float, ...]
        vertices = None
        if (name, index) in self.capsules:
            kind, size = "capsule", self.capsules[name, index]
        elif geometry.box is not None:
            kind, size = "box", tuple(geometry.box.size)
        elif geometry.sphere is not None:
            kind, size = "sphere", (geometry.sphere.radius,)
        elif geometry.cylinder is not None:
            kind, size = "cylinder", (geometry.cylinder.radius, geometry.cylinder.length)
        else:
            kind, size = "convex", ()
            scale = 1.0 if geometry.mesh.scale is None else geometry.mesh.scale
            file = self.mesh_file(name, geometry.mesh.filename or "")
            vertices = load_mesh(file, element=f"{self.file}: link {name!r}") * scale
        try:
            shape = make_shape(kind, size, T, link=body, link_name=name, vertices=vertices)
        except RobotError as error:
            raise RobotError(f"{self.file}: {error}", file=str(self.file), element=f"link {name!r}") from error
        if hull_length(shape) > MESH_LENGTH_USUAL:
            length = f"{hull_length(shape):.0f} m long"
            self.huge_meshes.append(f"the mesh {geometry.mesh.filename!r} of link {name!r} is {length}")
        return shape

    def mesh_file(self, name: str, filename: str) -> Path:
        """package://, model:// and file:// names, absolute ones, and ones relative to the URDF or a folder above it."""
        scheme, _, rest = filename.rpartition("://")
        path = Path(rest)
        if path.is_absolute() and path.is_file():
            return path
        folders = [self.file.parent, *self.file.parent.parents]
        for variable in ("ROS_PACKAGE_PATH", "AMENT_PREFIX_PATH"):
            for entry in os.environ.get(variable, "").split(os.pathsep):
                folders += [Path(entry), Path(entry) / "share"] if entry else []
        inside = Path(*path.parts[1:]) if scheme in ("package", "model") and len(path.parts) > 1 else None
        for folder in folders:
            for candidate in (path, inside):
                if candidate is not None and (folder / candidate).is_file():
                    return folder / candidate
        remedy = "put it beside the URDF, or its package's folder on ROS_PACKAGE_PATH"
        return self.fail(f"link {name!r}", f"wants the mesh {filename!r}, which is not there", remedy)

"""What an arm looks like: the visual shapes of its file, and the collision shapes where there is none to be had."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import final
from xml.etree import ElementTree as ET

import numpy as np
import trimesh
from scipy.spatial.transform import Rotation

from armtempo.arrays import Floats, Ints
from armtempo.errors import RobotError
from armtempo.robots._arm import Arm
from armtempo.robots._shapes import SIZE_NAMES, Shape, load_triangles
from armtempo.robots._urdf import UrdfReader
from armtempo.robots._urdf_numbers import check_part, numbers_of

__all__ = ["Visual", "read_visuals"]

_LOG = logging.getLogger("armtempo")


@final
@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Visual:
    """One thing to draw, fixed to a link."""

    link: int
    """Moving link 0..n-1 that carries it, -1 for the base."""
    kind: str
    """capsule, sphere, box, cylinder or mesh."""
    T_link_shape: Floats
    """(4, 4) pose in the link's frame; capsules and cylinders lie along z."""
    size: tuple[float, ...] = ()
    """As ``Shape.size`` [m]; mesh: the scale of its three axes."""
    mesh: Path | None = None
    """mesh: an OBJ file, written here: a damaged one of the user's would end PyBullet's process."""


def read_visuals(arm: Arm, folder: Path) -> tuple[Visual, ...]:
    """What to draw of an arm. Meshes of any format are read here, and written to ``folder`` as OBJ files.

    A link whose visuals cannot be read is drawn as its collision shapes, and so is the whole arm where its URDF is
    gone; both are logged. A link that has none is, too. No picture fails for want of a mesh.
    """
    writer = _Meshes(folder)
    try:
        reader = UrdfReader(arm.urdf, "point-mass", locked=dict(arm.locked))
        place = reader.places(arm.tip_link)
    except RobotError as error:
        _LOG.warning("%s is drawn from its collision shapes: %s", arm.name, error)
        return tuple(_of_shape(shape, writer) for shape in arm.shapes)
    found: list[Visual] = []
    for name, elements in reader.visuals.items():
        shapes = [shape for shape in arm.shapes if shape.link_name == name]
        try:
            drawn = [*_of_elements(reader, name, elements, *place[name], writer)]
        except RobotError as error:
            instead = "its collision shape is drawn instead" if shapes else "it is not drawn"
            _LOG.warning("%s; %s", error, instead)
            drawn = []
        found += drawn or [_of_shape(shape, writer) for shape in shapes]
    others = [shape for shape in arm.shapes if shape.link_name not in reader.visuals]  # a tool
    return (*found, *(_of_shape(shape, writer) for shape in others))


@final
class _Meshes:
    """OBJ files in a folder."""

    def __init__(self, folder: Path) -> None:
        self._folder, self._count = folder, 0

    def write(self, vertices: Floats, faces: Ints) -> Path:
        self._count += 1
        file = self._folder / f"{self._count}.obj"
        trimesh.Trimesh(vertices, faces).export(file, include_normals=True)
        return file


def _of_shape(shape: Shape, meshes: _Meshes) -> Visual:
    if shape.vertices is None or shape.faces is None:
        return Visual(link=shape.link, kind=shape.kind, T_link_shape=shape.T_link_shape, size=shape.size)
    mesh = meshes.write(shape.vertices, shape.faces)
    return Visual(link=shape.link, kind="mesh", T_link_shape=shape.T_link_shape, size=(1.0, 1.0, 1.0), mesh=mesh)


def _of_elements(
    reader: UrdfReader, name: str, elements: list[ET.Element], link: int, T: Floats, meshes: _Meshes
) -> Iterator[Visual]:
    """The <visual> elements of a link; RobotError where one cannot be drawn."""
    for element in elements:
        geometry = element.find("geometry")
        if geometry is None or not len(geometry):
            reader.fail(f"link {name!r}", "has a <visual> without a shape", "add one inside its <geometry>")
        check_part(f"link {name!r}", element, reader.fail)
        kind, given = geometry[0].tag, geometry[0].attrib
        T_shape = T @ _origin(element.find("origin"))
        if kind == "mesh":
            file = reader.mesh_file(name, given.get("filename", ""))
            mesh = meshes.write(*load_triangles(file, element=f"{reader.file}: link {name!r}"))
            scale = np.broadcast_to(numbers_of(given.get("scale", "1")), 3).tolist()
            yield Visual(link=link, kind="mesh", T_link_shape=T_shape, size=tuple(scale), mesh=mesh)
        elif kind in SIZE_NAMES:
            text = given["size"] if kind == "box" else " ".join(given[one] for one in SIZE_NAMES[kind])
            size = tuple(numbers_of(text))
            if min(size) <= 0.0:
                reader.fail(f"link {name!r}", f"has a <visual> <{kind}> that is not larger than 0", "give metres")
            yield Visual(link=link, kind=kind, T_link_shape=T_shape, size=size)
        else:
            remedy = "give a box, cylinder, sphere, capsule or mesh"
            reader.fail(f"link {name!r}", f"has a <visual> that is a <{kind}>", remedy)


def _origin(element: ET.Element | None) -> Floats:
    """(4, 4) of an <origin> that was checked."""
    T = np.eye(4)
    if element is not None:
        T[:3, 3] = numbers_of(element.get("xyz", "0 0 0"))
        T[:3, :3] = Rotation.from_euler("xyz", numbers_of(element.get("rpy", "0 0 0"))).as_matrix()
    return T

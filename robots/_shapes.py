"""Collision shapes: primitives and convex hulls, their enclosing capsules, and the points that bound their motion."""

from __future__ import annotations

import logging
import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
import trimesh
from numpy.typing import ArrayLike
from scipy.optimize import minimize
from scipy.spatial import QhullError

from armtempo.arrays import Floats, Ints
from armtempo.errors import RobotError, UnknownNameError
from armtempo.robots._model import Capsules
from armtempo.robots._sizes import LENGTH_MAX, read_array, read_number

__all__ = [
    "ANALYTIC_TOLERANCE",
    "GJK_TOLERANCE",
    "MESH_LENGTH_USUAL",
    "SHAPE_KINDS",
    "Shape",
    "hull_length",
    "make_shape",
    "pack",
    "static_shape",
]

ANALYTIC_TOLERANCE: Final = 1e-9
"""Error of FCL's closed-form capsule distances [m]."""
GJK_TOLERANCE: Final = 5e-4
"""FCL's GJK reads up to 2e-4 m too long on rare pairs of robot hulls: subtracted from its results, which is not enough
for all other kinds, so ``Clearance`` has them proven too [m]."""

MESH_LENGTH_USUAL: Final = 10.0
"""A mesh that is longer is likely to be in millimetres [m]."""
THICKNESS_MIN: Final = 1e-6
"""Of a hull [m]: thinner ones are points in a plane, on a line or in one place."""

SIZE_NAMES: Final = {
    "capsule": ("radius", "length"),
    "sphere": ("radius",),
    "box": ("x", "y", "z"),
    "cylinder": ("radius", "length"),
}
SHAPE_KINDS: Final = (*SIZE_NAMES, "convex")
_LOG = logging.getLogger("armtempo")


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Shape:
    """One convex collision body fixed to a link."""

    link: int
    """Moving link 0..n-1 that carries it, -1 for the base or the world."""
    link_name: str
    kind: str
    """capsule, sphere, box, cylinder or convex."""
    T_link_shape: Floats
    """(4, 4) pose in the link's frame; capsules and cylinders lie along z."""
    size: tuple[float, ...]
    """capsule, cylinder: radius, length of the axis; sphere: radius; box: x, y, z; convex: empty [m]."""
    vertices: Floats | None = None
    """convex: (v, 3) in the shape's frame [m]."""
    faces: Ints | None = None
    """convex: (f, 3) triangles, normals outwards."""
    points: Floats
    """(m, 3) in the link's frame. No point of the shape moves farther than the farthest-moving of these."""
    capsule: tuple[Floats, Floats, float]
    """Ends of the axis in the link's frame and radius of a capsule that holds the shape [m]."""
    exact: bool
    """True where that capsule is the shape."""
    tolerance: float
    """What is subtracted from FCL's distances to this shape [m]."""


def _frozen(values: ArrayLike) -> Floats:
    array = np.array(values, dtype=np.float64, order="C")
    array.setflags(write=False)
    return array


def _spindle(radius: float, length: float) -> tuple[float, float]:
    """Least-volume capsule about a cylinder of the same axis: (radius, half the axis length).

    A wider capsule may be shorter: its round ends reach over the rim.
    """
    radii = np.linspace(radius, math.hypot(radius, length / 2), 101)
    halves = np.maximum(length / 2 - np.sqrt(np.maximum(radii**2 - radius**2, 0.0)), 0.0)
    best = int(np.argmin(radii**2 * (2 * halves + 4 / 3 * radii)))
    return float(radii[best]), float(halves[best])


def _axis_for(points: Floats, direction: Floats, offset: Floats) -> tuple[float, Floats, Floats, float]:
    """Least-volume capsule about points for an axis line: (volume, p0, p1, radius)."""
    direction = direction / np.linalg.norm(direction)
    relative = points - offset
    along = relative @ direction
    across = np.einsum("ij,ij->i", relative, relative) - along**2
    narrowest = math.sqrt(max(float(across.max()), 0.0))
    best: tuple[float, Floats, Floats, float] | None = None
    for factor in (1.0, 1.01, 1.03, 1.06, 1.1, 1.15, 1.22, 1.3):
        radius = factor * narrowest
        cap = np.sqrt(np.maximum(radius**2 - across, 0.0))
        low, high = float((along + cap).min()), float((along - cap).max())
        if low > high:  # one ball is enough
            low = high = (low + high) / 2
        volume = math.pi * radius**2 * (high - low + 4 / 3 * radius)
        if best is None or volume < best[0]:
            best = volume, offset + low * direction, offset + high * direction, radius
    assert best is not None
    return best


def _enclosing_capsule(points: Floats, box_axes: Floats) -> tuple[Floats, Floats, float]:
    """A capsule of nearly least volume that holds all points (m, 3); box_axes: rows to start the search from."""
    centre = (points.min(axis=0) + points.max(axis=0)) / 2
    starts = [*box_axes] + [np.eye(3)[k] for k in range(3)]
    direction = min(starts, key=lambda d: _axis_for(points, d, centre)[0])
    volume = _axis_for(points, direction, centre)[0]
    scale = float(np.ptp(points, axis=0).max())
    first, second = np.linalg.svd(direction.reshape(1, 3))[2][1:]

    def candidate(x: Floats) -> tuple[float, Floats, Floats, float]:
        tilted = direction + x[0] * first + x[1] * second
        return _axis_for(points, tilted, centre + scale * (x[2] * first + x[3] * second))

    simplex = np.vstack([np.zeros(4), 0.1 * np.eye(4)])
    options: Any = {"maxfev": 300, "initial_simplex": simplex, "xatol": 1e-4, "fatol": 1e-4 * volume}
    search: Any = minimize  # scipy-stubs' overloads refuse plain functions
    solution = search(lambda x: candidate(x)[0], np.zeros(4), method="Nelder-Mead", options=options)
    _, p0, p1, _ = candidate(np.asarray(solution.x))
    # The radius is measured, not derived, so that the capsule holds every point whatever the search did.
    axis = p1 - p0
    squared = float(axis @ axis)
    t = np.clip((points - p0) @ axis / squared, 0.0, 1.0) if squared > 0 else np.zeros(len(points))
    radius = float(np.linalg.norm(points - (p0 + t[:, None] * axis), axis=1).max())
    return p0, p1, radius * (1 + 1e-12) + 1e-12


def _to_box(points: Floats) -> Floats:
    """(4, 4) transform into the axes of a small box about the points."""
    return np.asarray(trimesh.bounds.oriented_bounds(points)[0], dtype=np.float64)  # type: ignore[no-untyped-call]


def _box_corners(low: Floats, high: Floats) -> Floats:
    return np.array([[x, y, z] for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])])


class _Hull(NamedTuple):
    vertices: Floats
    faces: Ints
    corners: Floats
    capsule: tuple[Floats, Floats, float]


def _thickness(points: Floats) -> float:
    """How far the points reach across the plane that fits them best [m]."""
    relative = points - points.mean(axis=0)
    across = np.linalg.eigh(relative.T @ relative)[1][:, 0]
    return float(np.ptp(relative @ across))


@lru_cache(maxsize=256)
def _hull(data: bytes) -> _Hull:
    """Hull of the points in ``data``; cached, since arms of one kind share their meshes. Raises ValueError."""
    points = np.frombuffer(data, dtype=np.float64).reshape(-1, 3)
    if len(points) < 4 or _thickness(points) < THICKNESS_MIN:
        raise ValueError("its points span no volume")
    try:
        mesh = trimesh.convex.convex_hull(points)
        to_box = _to_box(_frozen(mesh.vertices))
    except (QhullError, ValueError, IndexError, TypeError) as error:  # a few micrometres flat
        raise ValueError("its points span no volume") from error
    vertices, faces = _frozen(mesh.vertices), np.array(mesh.faces, dtype=np.int64)
    faces.setflags(write=False)
    R, p = to_box[:3, :3], to_box[:3, 3]
    boxed = vertices @ R.T + p
    corners = (_box_corners(boxed.min(axis=0) - 1e-9, boxed.max(axis=0) + 1e-9) - p) @ R
    return _Hull(vertices=vertices, faces=faces, corners=corners, capsule=_enclosing_capsule(vertices, R))


def _checked_size(kind: str, size: Sequence[float], link_name: str) -> tuple[float, ...]:
    names = SIZE_NAMES.get(kind, ())
    size = tuple(read_number(v) for v in np.ravel(np.asarray(size, dtype=object)))
    positive = [0.0 < v <= LENGTH_MAX for v in size]
    if kind == "capsule" and len(size) == 2:
        positive[1] = 0.0 <= size[1] <= LENGTH_MAX
    if len(size) != len(names) or not all(positive):
        raise RobotError(
            f"collision shape of {link_name!r}: a {kind} cannot have the size {list(size)}",
            remedy=f"give {', '.join(names) or 'no size'} in metres, greater than 0 and up to {LENGTH_MAX:g}",
            element=link_name,
        )
    return size


def _convex(vertices: ArrayLike | None, link_name: str) -> _Hull:
    what = f"collision hull of {link_name!r}: the list of its points"
    points = read_array(np.zeros((0, 3)) if vertices is None else vertices, (None, 3), LENGTH_MAX, what, "m")
    try:
        return _hull(points.tobytes())
    except ValueError as error:
        raise RobotError(
            f"collision hull of {link_name!r}: {error}",
            remedy="give at least four points that are not in one plane",
            element=link_name,
        ) from error


def _primitive(kind: str, size: tuple[float, ...]) -> tuple[Floats, tuple[Floats, Floats, float]]:
    """The points that bound the motion of a primitive (m, 3), and its enclosing capsule, in its own frame."""
    if kind in ("capsule", "sphere"):
        half = size[1] / 2 if kind == "capsule" else 0.0
        p0, p1 = np.array([0.0, 0.0, -half]), np.array([0.0, 0.0, half])
        return np.array([p0, p1]) if half > 0 else p0.reshape(1, 3), (p0, p1, size[0])
    sides = np.array(size if kind == "box" else (2 * size[0], 2 * size[0], size[1]))
    longest = int(np.argmax(sides)) if kind == "box" else 2
    across = size[0] if kind == "cylinder" else math.hypot(*np.delete(sides, longest)) / 2
    radius, half = _spindle(across, sides[longest])
    p1 = half * np.eye(3)[longest]
    return _box_corners(-sides / 2, sides / 2), (-p1, p1, radius * (1 + 1e-12) + 1e-12)


def make_shape(
    kind: str,
    size: Sequence[float],
    T_link_shape: ArrayLike,
    *,
    link: int,
    link_name: str,
    vertices: ArrayLike | None = None,
) -> Shape:
    """A Shape of ``kind`` with its enclosing capsule. Raises UnknownNameError, RobotError."""
    if kind not in SHAPE_KINDS:
        raise UnknownNameError("collision shape", kind, SHAPE_KINDS)
    T = np.asarray(T_link_shape, dtype=np.float64)
    size = _checked_size(kind, size, link_name)
    solid = _convex(vertices, link_name) if kind == "convex" else None
    points, (p0, p1, radius) = _primitive(kind, size) if solid is None else (solid.corners, solid.capsule)
    exact = kind in ("capsule", "sphere")
    R, p = T[:3, :3], T[:3, 3]
    return Shape(
        link=link,
        link_name=link_name,
        kind=kind,
        T_link_shape=_frozen(T),
        size=size,
        vertices=None if solid is None else solid.vertices,
        faces=None if solid is None else solid.faces,
        points=_frozen(points @ R.T + p),
        capsule=(_frozen(R @ p0 + p), _frozen(R @ p1 + p), radius),
        exact=exact,
        tolerance=ANALYTIC_TOLERANCE if exact else GJK_TOLERANCE,
    )


def static_shape(
    kind: str,
    size: Sequence[float] = (),
    *,
    T_world: ArrayLike | None = None,
    name: str = "obstacle",
    vertices: ArrayLike | None = None,
    file: str | Path | None = None,
) -> Shape:
    """A body fixed in the world.

    Args:
        kind: capsule, sphere, box, cylinder, convex (hull of ``vertices``) or mesh (hull of ``file``).
        size: As ``Shape.size`` [m].
        T_world: (4, 4) pose, the identity by default.
        name: Name in messages and clearance results.
        vertices: (v, 3) in the shape's frame, for convex [m].
        file: Mesh file, for mesh.

    Raises:
        RobotError: bad size, pose, hull or mesh file. UnknownNameError: unknown kind.
    """
    if kind == "mesh":
        kind, vertices = "convex", load_mesh(Path(file or ""), element=name)
    T = check_pose(np.eye(4) if T_world is None else T_world, f"pose of {name!r}")
    shape = make_shape(kind, size, T, link=-1, link_name=name, vertices=vertices)
    if file is not None and hull_length(shape) > MESH_LENGTH_USUAL:
        _LOG.warning("the mesh %r of %r is %.0f m long: is it in millimetres?", str(file), name, hull_length(shape))
    return shape


def hull_length(shape: Shape) -> float:
    """Longest side of a hull's box [m]; 0 of other shapes."""
    return 0.0 if shape.vertices is None else float(np.ptp(shape.vertices, axis=0).max())


def load_mesh(file: Path, *, element: str) -> Floats:
    """Vertices (v, 3) of a mesh file. Raises RobotError."""
    return load_triangles(file, element=element)[0]


def load_triangles(file: Path, *, element: str) -> tuple[Floats, Ints]:
    """Vertices (v, 3) and triangles (f, 3) of a mesh file. Raises RobotError."""
    try:
        mesh = trimesh.load_mesh(str(file), process=False)
        if not len(mesh.faces):
            raise ValueError("it has no triangles")
        if mesh.vertices.shape[1:] != (3,) or mesh.faces.shape[1:] != (3,):  # as an OBJ with a line cut short
            raise ValueError("its points are not all of three numbers, or its faces of three points")
        vertices, faces = np.array(mesh.vertices, dtype=np.float64), np.array(mesh.faces, dtype=np.int64)
        if not np.isfinite(vertices).all() or faces.min() < 0 or faces.max() >= len(vertices):
            raise ValueError("points of its triangles are missing or not finite")
        return vertices, faces
    except Exception as error:
        raise RobotError(
            f"{element}: cannot read the mesh {str(file)!r}: {error or type(error).__name__}",
            remedy="check the file name and that it is an STL, OBJ, DAE, PLY or GLB mesh",
            file=str(file),
            element=element,
        ) from error


def check_pose(values: ArrayLike, what: str) -> Floats:
    """``values`` as an array. Raises RobotError unless it is a (4, 4) rigid transform of no absurd size."""
    try:
        T = read_array(values, (4, 4), LENGTH_MAX, what)
        turned = np.allclose(T[:3, :3] @ T[:3, :3].T, np.eye(3), atol=1e-6) and np.linalg.det(T[:3, :3]) > 0
        if turned and np.allclose(T[3], [0, 0, 0, 1]):
            return T
    except RobotError:
        pass
    raise RobotError(
        f"{what} is not a rigid transform",
        remedy=f"give a (4, 4) rotation and translation, finite and up to {LENGTH_MAX:g} m",
        element=what,
    )


def pack(shapes: Sequence[Shape]) -> Capsules:
    """The shapes' enclosing capsules as arrays; index = shape index."""
    arrays = Capsules(
        link=np.array([s.link for s in shapes], dtype=np.int64),
        p0=np.array([s.capsule[0] for s in shapes], dtype=np.float64).reshape(-1, 3),
        p1=np.array([s.capsule[1] for s in shapes], dtype=np.float64).reshape(-1, 3),
        radius=np.array([s.capsule[2] for s in shapes], dtype=np.float64),
        exact=np.array([s.exact for s in shapes], dtype=np.bool_),
    )
    for array in arrays:
        array.setflags(write=False)
    return arrays

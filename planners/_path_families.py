"""Random paths of lines and arcs that an arm can follow, drawn in the ring that its given path sweeps."""

from __future__ import annotations

from itertools import pairwise
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from armtempo.configs import change_blend
from armtempo.errors import PathError, UnknownNameError
from armtempo.planners._blend_cell import BlendCell
from armtempo.planners._cartesian_path import Arc, Line

Array = NDArray[np.float64]
FamilyName = Literal["given", "polyline", "zigzag", "line-arc"]
PATH_FAMILIES: tuple[FamilyName, ...] = get_args(FamilyName)

DRAWS = 200
SHARPEST, STRAIGHTEST = 0.5, 2.8  # [rad] interior angles of corners
SHORTEST = 0.08  # [m] segments
LARGEST_SHARE = 0.45  # of the shortest segment that a blend takes


def draw_path(
    cell: BlendCell,
    family: str,
    random: np.random.Generator,
    *,
    remaining_distance: float | None = None,
    shape_factor: float | None = None,
    curve: str | None = None,
) -> BlendCell:
    """The cell with a path drawn at random.

    Corners lie at distances from the arm's axis, at angles about it and at heights that its given path has, too. The
    sides between them make interior angles of 29 to 160 degrees, and the remaining distance is 20 to 45 % of the
    shortest segment, at most the cell's.

    Args:
        cell: The arm and its given path.
        family: ``polyline``: 3 to 6 lines anywhere; ``zigzag``: 4 to 8 lines to and fro along a line; ``line-arc``:
            3 to 5 lines and arcs by turns. ``given``: the cell's own path.
        random: Draws all of it.
        remaining_distance: What a blend takes off each segment [m], instead of the drawn one.
        shape_factor: Instead of the cell's.
        curve: Instead of the cell's.

    Raises:
        UnknownNameError: No such family.
        ConfigError: A value that a cell file could not have.
        PathError: None of 200 draws can be blended and followed; a smaller remaining distance may help.
    """
    if family not in PATH_FAMILIES:
        raise UnknownNameError("family of paths", family, PATH_FAMILIES)
    corners = {"remaining_distance": remaining_distance, "shape_factor": shape_factor, "curve": curve}
    if family == "given":
        return cell if not any(value is not None for value in corners.values()) else cell.variant(**corners)  # type: ignore[arg-type]
    blend = {"curve": curve, "shape_factor": shape_factor, "remaining_distance_m": remaining_distance}
    change_blend(cell.config, **blend)  # refuses nonsense before anything is drawn
    for _ in range(DRAWS):
        points = _zigzag(cell, random) if family == "zigzag" else _corners(cell, random, family)
        size = float(random.uniform(0.2, LARGEST_SHARE))
        sides = np.diff(points, axis=0)
        lengths = np.linalg.norm(sides, axis=1)
        cosine = np.einsum("ki,ki->k", sides[:-1], sides[1:]) / (lengths[:-1] * lengths[1:])
        angle = np.pi - np.arccos(np.clip(cosine, -1.0, 1.0))
        if lengths.min() < SHORTEST or angle.min() < SHARPEST or angle.max() > STRAIGHTEST:
            continue
        segments = _segments(cell, points, family, random)
        if remaining_distance is None:
            given = cell.config.blend.remaining_distance_m
            shortest = min(segment.length for segment in segments)
            corners["remaining_distance"] = size * shortest if given is None else min(given, size * shortest)
        try:
            return cell.variant(segments=segments, **corners)  # type: ignore[arg-type]
        except PathError:
            continue
    raise PathError(
        f"none of {DRAWS} paths drawn as {family!r} can be blended and followed by arm {cell.arm.name!r}",
        remedy="give a smaller remaining distance, or a cell whose given path sweeps more of the arm's reach",
        arm=cell.arm.name,
    )


def _ring(cell: BlendCell) -> tuple[Array, Array]:
    """Lowest and highest distance, angle and height of the given path."""
    polar = cell.path.pair.polar(cell.blended.position(np.linspace(0.0, cell.blended.length, 400)))
    polar[:, 1] = np.unwrap(polar[:, 1])
    return polar.min(axis=0), polar.max(axis=0)


def _corners(cell: BlendCell, random: np.random.Generator, family: str) -> Array:
    """3 to 6 (lines and arcs: 3 to 5) sides between points anywhere in the ring."""
    count = int(random.integers(4, 8 if family == "polyline" else 7))
    low, high = _ring(cell)
    return cell.path.pair.point(random.uniform(low, high, (count, 3)))


def _zigzag(cell: BlendCell, random: np.random.Generator) -> Array:
    """4 to 8 sides to and fro between two rows of points."""
    ends = _corners(cell, random, "polyline")[:2]
    count = int(random.integers(5, 10))
    along = (ends[1] - ends[0]) / (count - 1)
    across = random.uniform(0.5, 2.0) * np.cross(cell.path.pair.axis, along)
    side = np.where(np.arange(count) % 2 == 0, 0.0, 1.0)
    points: Array = ends[0] + np.arange(count)[:, None] * along + side[:, None] * across
    return points


def _segments(cell: BlendCell, points: Array, family: str, random: np.random.Generator) -> list[Line | Arc]:
    """Lines between the points; by turns arcs, bent within the plane of motion, for ``line-arc``."""
    segments: list[Line | Arc] = []
    for k, (start, end) in enumerate(pairwise(points)):
        if family != "line-arc" or k % 2 == 0:
            segments.append(Line(start, end))
            continue
        bulge = float(random.uniform(0.05, 0.3)) * float(random.choice([-1.0, 1.0]))
        side = end - start
        across = np.cross(cell.path.pair.axis, side)
        segments.append(Arc.through(start, 0.5 * (start + end) + bulge * across, end))
    return segments

"""Random paths of lines and arcs that an arm can follow, drawn in the ring that its given path sweeps."""

from __future__ import annotations

from itertools import pairwise
from typing import Literal, get_args

import numpy as np

from armtempo.arrays import Bools, Floats
from armtempo.configs import change_blend
from armtempo.errors import PathError, UnknownNameError
from armtempo.planners.cells._blend_cell import BlendCell
from armtempo.planners.cells._motion_demand import MotionDemand, motion_demand
from armtempo.planners.geometry import Arc, Line
from armtempo.planners.joint_paths import CartesianJointPath, PlanarPair

FamilyName = Literal["given", "polyline", "zigzag", "line-arc"]
PATH_FAMILIES: tuple[FamilyName, ...] = get_args(FamilyName)

MOST_DRAWS = 1000
LOAD_SHARE_MAX = 0.9  # largest share of a torque limit at full rate
SLOWEST_RATE = 0.25  # a constant rate at which every path keeps its limits
MOTION_SAMPLES = 400  # of a motion
TURN_RANGE = (0.35, 1.3)  # [rad] between one side and the next
SIDE_RANGE = (0.3, 0.8)  # in mean lengths of the given segments
BLEND_SHARE_RANGE = (0.3, 0.45)  # of the shortest segment that a blend takes
CORNER_TRIES = 16  # places for a corner


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

    All of it lies at distances from the arm's axis, at angles about it and at heights that the given path has, too.
    Sides turn by 20 to 75 degrees, and the remaining distance is 30 to 45 % of the shortest segment, at most the
    cell's. With cubic blends of shape factor 3, at full rate, no torque is above 90 % of its limit (or what the given
    path asks for) and no joint too fast, and a quarter of this rate keeps all limits of the tip. What is drawn depends
    on the seed, the family and the remaining distance, not on the curve asked for.

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
        PathError: The arm is no two-link arm and no SCARA; none of 1000 draws can be blended and followed.
    """
    if not isinstance(family, str) or family not in PATH_FAMILIES:
        raise UnknownNameError("family of paths", family, PATH_FAMILIES)
    corners = {"remaining_distance": remaining_distance, "shape_factor": shape_factor, "curve": curve}
    if family == "given":
        return cell if not any(value is not None for value in corners.values()) else cell.variant(**corners)  # type: ignore[arg-type]
    blend = {"curve": curve, "shape_factor": shape_factor, "remaining_distance_m": remaining_distance}
    change_blend(cell.config, **blend)  # refuses nonsense before anything is drawn
    ring, load = _ring(cell), max(LOAD_SHARE_MAX, _demand(cell).torque_ratio_max)
    by_size = change_blend(cell.config, **blend).blend.curve != "least-time"
    given = cell.config.blend.remaining_distance_m
    if isinstance(given, tuple):  # those of other corners
        given = None
    for _ in range(MOST_DRAWS):
        points = _zigzag(cell, random, ring) if family == "zigzag" else _walk(cell, random, ring, family)
        size = float(random.uniform(*BLEND_SHARE_RANGE))
        segments = _segments(cell, points, family, random)
        if remaining_distance is None:
            size *= min(segment.length for segment in segments)
            size = size if given is None else min(given, size)
        else:
            size = remaining_distance
        if not _inside(cell, ring, _outline(segments, size)):
            continue
        try:
            yardstick = cell.variant(segments=segments, curve="cubic", shape_factor=3.0, remaining_distance=size)
        except PathError:
            continue
        if _fits(yardstick, load):
            corners["remaining_distance"] = size if by_size else None
            return cell.variant(segments=segments, **corners)  # type: ignore[arg-type]
    raise PathError(
        f"none of {MOST_DRAWS} paths drawn as {family!r} can be blended and followed by arm {cell.arm.name!r}",
        remedy="give a smaller remaining distance, or a cell whose given path sweeps more of the arm's reach",
        arm=cell.arm.name,
    )


def _pair(cell: BlendCell) -> PlanarPair:
    """What the arm sweeps its ring with."""
    if isinstance(cell.path, CartesianJointPath):
        raise PathError(
            f"random paths are drawn for two-link arms and SCARAs, not for arm {cell.arm.name!r}",
            remedy="use the family 'given'",
            arm=cell.arm.name,
        )
    return cell.path.pair


def _demand(cell: BlendCell) -> MotionDemand:
    """What its line-speed profile asks for at full rate."""
    profile = cell.line_speed
    return motion_demand(cell, *profile.at(np.linspace(0.0, profile.duration, MOTION_SAMPLES)))


def _fits(cell: BlendCell, load: float) -> bool:
    demand = _demand(cell)
    return (
        demand.torque_ratio_max <= load
        and demand.joint_speed_ratio_max <= 1.0
        and demand.normal_ratio_max * SLOWEST_RATE**2 <= 1.0
        and demand.jerk_ratio_max * SLOWEST_RATE**3 <= 1.0
    )


def _ring(cell: BlendCell) -> tuple[Floats, Floats]:
    """Lowest and highest distance, angle and height of the given path."""
    polar = _pair(cell).polar(cell.blended.position(np.linspace(0.0, cell.blended.length, MOTION_SAMPLES)))
    polar[:, 1] = np.unwrap(polar[:, 1])
    return polar.min(axis=0), polar.max(axis=0)


def _inside(cell: BlendCell, ring: tuple[Floats, Floats], points: Floats) -> bool:
    """Whether all points (K, 3) are in the ring."""
    return bool(_each_inside(cell, ring, points).all())


def _each_inside(cell: BlendCell, ring: tuple[Floats, Floats], points: Floats) -> Bools:
    low, high = ring
    polar = _pair(cell).polar(points)
    middle = 0.5 * (low[1] + high[1])
    polar[:, 1] = middle + (polar[:, 1] - middle + np.pi) % (2.0 * np.pi) - np.pi
    return np.asarray(((polar >= low - 1e-9) & (polar <= high + 1e-9)).all(axis=1))


def _outline(segments: list[Line | Arc], size: float) -> Floats:
    """Points on the segments, and on the chords that no blend of this size gets beyond."""
    rows = [segment.evaluate(np.linspace(0.0, segment.length, 17))[0] for segment in segments]
    for before, after in pairwise(segments):
        start = before.evaluate(max(before.length - size, 0.0))[0]
        end = after.evaluate(min(size, after.length))[0]
        rows.append(start + np.linspace(0.0, 1.0, 9)[:, None] * (end - start))
    return np.concatenate(rows)


def _unit(cell: BlendCell) -> float:
    """Mean length of the given segments [m]."""
    return sum(segment.length for segment in cell.segments) / len(cell.segments)


def _headings(cell: BlendCell, heading: Floats | float) -> Floats:
    """Unit vectors (..., 3) in the plane of motion."""
    pair = _pair(cell)
    angle = np.asarray(heading)
    here = np.stack([np.ones_like(angle), angle, np.zeros_like(angle)], axis=-1)
    step: Floats = pair.point(here) - pair.point(here * np.array([0.0, 1.0, 1.0]))
    return step


def _walk(cell: BlendCell, random: np.random.Generator, ring: tuple[Floats, Floats], family: str) -> Floats:
    """3 to 6 (lines and arcs: 3 to 5) sides, each turned from the one before, corners in the ring where there is room.

    A walk that has got stuck ends early or outside, and is refused later.
    """
    pair, (low, high), unit = _pair(cell), ring, _unit(cell)
    count = int(random.integers(4, 8 if family == "polyline" else 7))
    points = [pair.point(random.uniform(low, high))]
    heading = random.uniform(-np.pi, np.pi)
    for k in range(count - 1):
        turn = random.uniform(*TURN_RANGE, CORNER_TRIES) * random.choice([-1.0, 1.0], CORNER_TRIES)
        headings = heading + turn if k else random.uniform(-np.pi, np.pi, CORNER_TRIES)
        sides = unit * random.uniform(*SIDE_RANGE, CORNER_TRIES)[:, None] * _headings(cell, headings)
        rise = random.uniform(low[2], high[2], CORNER_TRIES) - float(pair.polar(points[-1])[2])
        places = points[-1] + sides + rise[:, None] * pair.axis
        best = int(np.argmax(_each_inside(cell, ring, places)))
        heading = float(headings[best])
        points.append(places[best])
    return np.array(points)


def _zigzag(cell: BlendCell, random: np.random.Generator, ring: tuple[Floats, Floats]) -> Floats:
    """4 to 8 sides of one length that turn to and fro, at one height, as many as fit between two places in the ring."""
    pair = _pair(cell)
    ends = random.uniform(*ring, (2, 3))
    ends[1, 2] = ends[0, 2]
    start, way = pair.point(ends[0]), pair.point(ends[1]) - pair.point(ends[0])
    turn = random.uniform(*TURN_RANGE) * random.choice([-1.0, 1.0])
    side = _unit(cell) * random.uniform(0.2, 0.5)
    fit = float(np.linalg.norm(way)) / (side * np.cos(0.5 * turn))
    count = int(random.integers(4, max(min(int(fit), 8), 4) + 1))
    along, to_and_fro = way / np.linalg.norm(way), np.where(np.arange(count) % 2 == 0, 1.0, -1.0)
    across = np.sin(0.5 * turn) * to_and_fro[:, None] * np.cross(pair.axis, along)
    steps = side * (np.cos(0.5 * turn) * along + across)
    points: Floats = start + np.concatenate([np.zeros((1, 3)), np.cumsum(steps, axis=0)])
    return points


def _segments(cell: BlendCell, points: Floats, family: str, random: np.random.Generator) -> list[Line | Arc]:
    """Lines between the points; by turns arcs, bent within the plane of motion, for ``line-arc``."""
    segments: list[Line | Arc] = []
    for k, (start, end) in enumerate(pairwise(points)):
        if family != "line-arc" or k % 2 == 0:
            segments.append(Line(start, end))
            continue
        bulge = float(random.uniform(0.04, 0.15)) * float(random.choice([-1.0, 1.0]))
        side = end - start
        across = np.cross(_pair(cell).axis, side)
        segments.append(Arc.through(start, 0.5 * (start + end) + bulge * across, end))
    return segments

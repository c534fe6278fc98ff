r"""Audits of schedules by an engine that no planner here uses, densely between the samples of the control.

coal (extra ``dev``) measures convex bodies and capsules pair by pair to about 1e-6 m; its broad phase is not used
(research: it returns some pair's distance for capsules). PyBullet's distances of boxes and cylinders are up to 1.1 mm
too long. So it gets them as hulls, to which it gives a margin of 1 mm each: it answers up to 2 mm too short, never too
long.
"""

from __future__ import annotations

import importlib
import importlib.util
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import combinations, product
from typing import Any, Literal

import numpy as np

from armtempo.arrays import Floats, all_finite
from armtempo.errors import InputError, UnknownNameError
from armtempo.planners.cells import CoordinationCell
from armtempo.planners.topp import PhaseTrajectory
from armtempo.robots import Arm, Shape

Engine = Literal["coal", "pybullet"]

ENGINES: tuple[Engine, ...] = ("coal", "pybullet")
INSTANTS_PER_PERIOD = 10  # instants per control period
COAL_ERROR = 1e-6  # [m]
HULL_MARGIN = 2.2e-3  # [m] by which PyBullet's distances of two hulls may be too short
PRISM_SIDES = 32  # of the prism about a cylinder
PRISM_EXCESS_SHARE = 1.0 / math.cos(math.pi / PRISM_SIDES) - 1.0  # of the cylinder's radius: the prism's corners


@dataclass(frozen=True, kw_only=True)
class Audit:
    """What an engine found.

    Attributes:
        engine: ``coal`` or ``pybullet``.
        instants: How many were looked at.
        min_clearance: Smallest distance of two arms [m].
        time: When [s].
        required: Smallest distance that counts as none too close: ``d_min`` less the engine's error [m].
    """

    engine: Engine
    instants: int
    min_clearance: float
    time: float
    required: float

    @property
    def violated(self) -> bool:
        """Whether two arms come closer than ``d_min``, the engine's error forgiven."""
        return not self.min_clearance >= self.required  # NaN, too


def default_engine() -> Engine:
    """``coal`` where it is installed, else ``pybullet``."""
    return "coal" if importlib.util.find_spec("coal") is not None else "pybullet"


def audit_clearance(
    cell: CoordinationCell,
    motions: Sequence[PhaseTrajectory],
    *,
    engine: Engine | None = None,
    period: float | None = None,
) -> Audit:
    """Measure the arms' smallest distance over a schedule.

    Args:
        cell: Whose arms and paths.
        motions: One per arm.
        engine: None: ``default_engine()``.
        period: Between two instants [s]; None: a tenth of the cell's control period.

    Raises:
        UnknownNameError: No such engine.
        InputError: ``motions`` are not one per arm, of two arms at least; ``period`` is not positive; coal is asked for
            and missing; the arms' places are not finite.
    """
    engine = default_engine() if engine is None else engine
    period = cell.control_period / INSTANTS_PER_PERIOD if period is None else period
    if engine not in ENGINES:
        raise UnknownNameError("engine", engine, ENGINES)
    if len(motions) != len(cell.arms) or len(motions) < 2 or not period > 0.0:
        raise InputError(f"{len(motions)} motions for {len(cell.arms)} arms, every {period} s")
    makespan = max(motion.duration for motion in motions)
    instants = np.append(np.arange(0.0, makespan, period), makespan)
    places = [
        _places(arm, path.evaluate(motion.at(np.minimum(instants, motion.duration))[0])[0])
        for arm, path, motion in zip(cell.arms, cell.paths, motions, strict=True)
    ]
    if not all_finite(*places):
        raise InputError("the arms have no finite places over the motions", remedy="give motions along their paths")
    shapes = [arm.shapes for arm in cell.arms]
    nearest = (_by_coal if engine == "coal" else _by_pybullet)(shapes, places)
    worst = int(nearest.argmin())
    return Audit(
        engine=engine,
        instants=len(instants),
        min_clearance=float(nearest[worst]),
        time=float(instants[worst]),
        required=cell.d_min - (COAL_ERROR if engine == "coal" else _bullet_error(shapes)),
    )


def _bullet_error(shapes: Sequence[Sequence[Shape]]) -> float:
    """By how much PyBullet's distances may be too short [m]."""
    every = [shape for own in shapes for shape in own]
    radius = max((shape.size[0] for shape in every if shape.kind == "cylinder"), default=0.0)
    return COAL_ERROR if all(shape.exact for shape in every) else HULL_MARGIN + 2.0 * PRISM_EXCESS_SHARE * radius


def _places(arm: Arm, q: Floats) -> Floats:
    """(T, shapes, 4, 4) poses of an arm's collision shapes in the world."""
    links = np.concatenate([arm.link_poses(q), np.broadcast_to(arm.T_world_base, (len(q), 1, 4, 4))], axis=1)
    return np.stack([links[:, shape.link] @ shape.T_link_shape for shape in arm.shapes], axis=1)


def _by_coal(shapes: Sequence[Sequence[Shape]], places: Sequence[Floats]) -> Floats:
    """(T,) smallest distance of two arms [m]."""
    try:
        coal: Any = importlib.import_module("coal")  # without types of its own
    except ImportError:
        raise InputError("coal is not installed", remedy="pip install coal, or audit by pybullet") from None
    bodies = [[_coal_body(coal, shape) for shape in own] for own in shapes]
    request = coal.DistanceRequest()
    request.gjk_tolerance = 0.1 * COAL_ERROR
    nearest = np.full(len(places[0]), np.inf)
    for row in range(len(nearest)):
        frames = [[coal.Transform3s(T[:3, :3], T[:3, 3]) for T in own[row]] for own in places]
        for i, j in combinations(range(len(bodies)), 2):
            for body_a, T_a in zip(bodies[i], frames[i], strict=True):
                for body_b, T_b in zip(bodies[j], frames[j], strict=True):
                    # a used result would keep the last answer
                    distance = coal.distance(body_a, T_a, body_b, T_b, request, coal.DistanceResult())
                    nearest[row] = np.minimum(nearest[row], distance)  # NaN stays NaN
    return nearest


def _coal_body(coal: Any, shape: Shape) -> Any:
    if shape.vertices is None:
        return {
            "capsule": coal.Capsule,
            "sphere": coal.Sphere,
            "box": coal.Box,
            "cylinder": coal.Cylinder,
        }[shape.kind](*shape.size)
    points = coal.StdVec_Vec3s()
    for vertex in shape.vertices:
        points.append(vertex)
    return coal.Convex.convexHull(points, True, "Qt")


def _by_pybullet(shapes: Sequence[Sequence[Shape]], places: Sequence[Floats]) -> Floats:
    """(T,) smallest distance of two arms [m], or the reach of the query where they are farther apart."""
    import pybullet
    from scipy.spatial.transform import Rotation

    client = pybullet.connect(pybullet.DIRECT)
    reach = 0.1  # [m]; what is farther does not matter
    try:
        bodies = [[_bullet_body(pybullet, client, shape) for shape in own] for own in shapes]
        turns = [Rotation.from_matrix(own[..., :3, :3].reshape(-1, 3, 3)).as_quat() for own in places]
        turns = [turn.reshape(*own.shape[:2], 4) for turn, own in zip(turns, places, strict=True)]
        nearest = np.full(len(places[0]), reach)
        for row in range(len(nearest)):
            for own, place, turn in zip(bodies, places, turns, strict=True):
                for body, T, quaternion in zip(own, place[row], turn[row], strict=True):
                    pybullet.resetBasePositionAndOrientation(body, T[:3, 3], quaternion, physicsClientId=client)
            for i, j in combinations(range(len(bodies)), 2):
                for body_a in bodies[i]:
                    for body_b in bodies[j]:
                        points = pybullet.getClosestPoints(body_a, body_b, reach, physicsClientId=client)
                        nearest[row] = np.min([nearest[row], *(point[8] for point in points)])  # NaN stays NaN
    finally:
        pybullet.disconnect(client)
    return nearest


def _bullet_body(pybullet: Any, client: int, shape: Shape) -> int:
    create: Callable[..., int] = pybullet.createCollisionShape
    if shape.kind == "sphere":
        form = create(pybullet.GEOM_SPHERE, radius=shape.size[0], physicsClientId=client)
    elif shape.kind == "capsule":
        radius, length = shape.size
        form = create(pybullet.GEOM_CAPSULE, radius=radius, height=length, physicsClientId=client)
    else:
        form = create(pybullet.GEOM_MESH, vertices=_hull_points(shape).tolist(), physicsClientId=client)
    return int(pybullet.createMultiBody(1.0, form, physicsClientId=client))


def _hull_points(shape: Shape) -> Floats:
    """(v, 3) points whose hull holds a shape, in its frame: of a cylinder, a prism about it."""
    if shape.vertices is not None:
        return shape.vertices
    if shape.kind == "box":
        return np.array(list(product(*((-0.5 * side, 0.5 * side) for side in shape.size))))
    radius, length = shape.size
    turn = np.arange(PRISM_SIDES) * (2.0 * math.pi / PRISM_SIDES)
    rim = radius * (1.0 + PRISM_EXCESS_SHARE) * np.column_stack([np.cos(turn), np.sin(turn)])
    return np.concatenate([np.column_stack([rim, np.full(PRISM_SIDES, end)]) for end in (-0.5 * length, 0.5 * length)])

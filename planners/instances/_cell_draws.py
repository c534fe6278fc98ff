"""What the files of random cells say: arms of a family, where they stand and where they go, from a random stream."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from armtempo.arrays import Floats

PLANAR_LINKS = (0.37, 0.23)  # [m] of the planar arm
VERTICAL_SHARE = 0.2  # of planar cells: gravity lies in the plane of motion
FRICTION_SHARE = 0.3  # of planar cells: viscous friction
DRAWN_DIGITS = 4  # of drawn numbers, so that files of them stay short


def _numbers(values: Any) -> list[float]:
    return [round(float(value), DRAWN_DIGITS) + 0.0 for value in values]


def _ring(generator: np.random.Generator, arms: int) -> dict[str, Any]:
    """Planar arms on a circle so wide that a forearm gets past its neighbours' upper arms."""
    least = max(0.58, PLANAR_LINKS[0] + 1.17 * PLANAR_LINKS[1] / (2.0 * math.sin(math.pi / arms)))
    return _planar_arms(generator, _circle(arms, least + generator.uniform(0.0, 0.02)), _swinging)


def _planar(generator: np.random.Generator, arms: int) -> dict[str, Any]:
    """Planar arms on a circle so narrow that they get everywhere in its middle."""
    return _planar_arms(generator, _circle(arms, generator.uniform(0.30, 0.50)))


def _rows(generator: np.random.Generator, arms: int) -> dict[str, Any]:
    """Planar arms in two rows that face each other; a forearm reaches those of its neighbours and of those opposite."""
    pitch, apart = generator.uniform(0.34, 0.44), generator.uniform(1.00, 1.12)
    bases = [
        ((k - 0.25 * (arms - 2)) * pitch, side * 0.5 * apart, -side * 0.5 * math.pi)
        for side in (-1.0, 1.0)
        for k in range(arms // 2)
    ]
    return _planar_arms(generator, bases, _swinging)


def _fixture(generator: np.random.Generator, arms: int) -> dict[str, Any]:
    """Planar arms on a circle around a box: each works in front of it, and reaches past it on both sides."""
    half, ring = generator.uniform(0.03, 0.06), generator.uniform(0.46, 0.54)
    clear = ring - math.sqrt(2.0) * half  # how far an arm gets toward the middle, wherever the box is turned
    cell = _planar_arms(generator, _circle(arms, ring), partial(_around, clear))
    box = {"size_m": _numbers([2.0 * half, 2.0 * half, 0.2])}
    turn = _numbers([0.0, 0.0, generator.uniform(0.0, 0.5 * math.pi)])
    return {**cell, "obstacles": [{"name": "fixture", "box": box, "pose": {"rpy_rad": turn}}]}


Base = tuple[float, float, float]  # x, y [m] and the direction in which an arm looks [rad]


def _circle(arms: int, radius: float) -> list[Base]:
    """Places on a circle from which arms look to its middle."""
    angles = [math.tau * k / arms + math.pi for k in range(arms)]
    return [
        (radius * math.cos(angle), radius * math.sin(angle), math.remainder(angle + math.pi, math.tau))
        for angle in angles
    ]


def _planar_arms(
    generator: np.random.Generator,
    bases: Sequence[Base],
    waypoints: Callable[[np.random.Generator], Floats] | None = None,
) -> dict[str, Any]:
    """Planar arms through waypoints; without such a draw, half of the cells along lines and arcs."""
    by_waypoints = generator.random() < 0.5
    vertical, rubs = generator.random() < VERTICAL_SHARE, generator.random() < FRICTION_SHARE
    entries = []
    for k, (x, y, looks) in enumerate(bases):
        base, toward = _numbers([x, y, 0.0]), round(looks, DRAWN_DIGITS) + 0.0
        entry: dict[str, Any] = {
            "name": f"arm_{k + 1}",
            "urdf": "planar_two_link.urdf",
            "base": {"position_m": base, "rpy_rad": [0.0, 0.0, toward]},
            "tip_link": "tool",
        }
        if rubs:
            entry["friction"] = {"viscous_nm_s_rad": _numbers(generator.uniform(0.0, [2.0, 0.5]))}
        if by_waypoints or waypoints is not None:
            entry["path"] = {"waypoints_rad": [_numbers(row) for row in (waypoints or _anywhere)(generator)]}
        else:
            entry["elbow"] = ("negative", "positive")[generator.integers(2)]
            entry["path"] = _planar_segment(generator, np.array(base[:2]), toward)
        entries.append(entry)
    return {
        "d_min_m": _numbers([generator.uniform(0.005, 0.02)])[0],
        "gravity_m_s2": [0.0, -9.81, 0.0] if vertical else [0.0, 0.0, -9.81],
        "chart_cells": 1024,
        "arms": entries,
    }


def _anywhere(generator: np.random.Generator) -> Floats:
    """Three to five joint positions (K, 2) that point more or less to the middle."""
    return generator.uniform([-1.3, -2.6], [1.3, 2.6], size=(generator.integers(3, 6), 2))


def _swinging(generator: np.random.Generator) -> Floats:
    """A forearm that swings through the middle from one side to the other (5, 2): of many arms few others get past."""
    swing = np.linspace(1.0, -1.0, 5) * generator.choice([-1.0, 1.0]) * generator.uniform(2.5, 2.75)
    waypoints = np.column_stack([np.zeros(5), swing])
    waypoints += generator.uniform([-0.1, -0.15], [0.1, 0.15], size=(5, 2))
    return waypoints


def _around(clear: float, generator: np.random.Generator) -> Floats:
    """From one side to the other (5, 2), less than ``clear`` [m] from the base where the tool is before the middle."""
    side, bend = generator.choice([-1.0, 1.0], 2)
    direction = side * np.array([1.0, 0.5, 0.0, -0.5, -1.0]) * generator.uniform(0.7, 1.1)
    reach = generator.uniform([0.42, 0.36, 0.28, 0.36, 0.42], [0.57, clear, clear - 0.06, clear, 0.57])
    upper, fore = PLANAR_LINKS
    elbow = bend * np.arccos(np.clip((reach**2 - upper**2 - fore**2) / (2.0 * upper * fore), -1.0, 1.0))
    shoulder = direction - np.arctan2(fore * np.sin(elbow), upper + fore * np.cos(elbow))
    return np.column_stack([shoulder, elbow])


def _planar_segment(generator: np.random.Generator, base: Any, toward: float) -> dict[str, Any]:
    """A line or an arc between two points within reach, on the side of the middle."""
    ways = generator.uniform(0.45, 0.97, size=2) * sum(PLANAR_LINKS)
    sides = toward + generator.uniform(-1.4, 1.4, size=2)
    start, end = (
        base + way * np.array([math.cos(side), math.sin(side)]) for way, side in zip(ways, sides, strict=True)
    )
    start, end = np.round(start, DRAWN_DIGITS), np.round(end, DRAWN_DIGITS)
    segment: dict[str, Any] = {"line": {"to_m": [*map(float, end), 0.0]}}
    if generator.random() < 0.5:
        across = np.array([start[1] - end[1], end[0] - start[0]])
        center = 0.5 * (start + end) + generator.uniform(-1.5, 1.5) * across
        segment = {"arc": {"to_m": [*map(float, end), 0.0], "center_m": [*(round(float(x), 12) for x in center), 0.0]}}
    return {"start_m": [*map(float, start), 0.0], "segments": [segment]}


@dataclass(frozen=True, kw_only=True)
class _Robot:
    """A robot, and where its random positions are.

    Attributes:
        urdf: Its file.
        middle: Of the positions [rad].
        spread: How far they go to either side [rad].
        looks: Where it reaches to there, about its z axis [rad].
        circle: Least and largest radius of a circle on which more than two stand [m].
    """

    urdf: str
    middle: tuple[float, ...]
    spread: tuple[float, ...]
    looks: float = 0.0
    circle: tuple[float, float] = (0.5, 0.7)


_ROBOTS = {
    "panda": _Robot(
        urdf="pybullet_data/franka_panda/panda.urdf",
        middle=(0.0, 0.3, 0.0, -1.9, 0.0, 2.2, 0.785),
        spread=(1.3, 0.5, 0.4, 0.5, 0.4, 0.4, 0.8),
    ),
    "iiwa": _Robot(
        urdf="pybullet_data/kuka_iiwa/model.urdf",
        middle=(0.0, 0.6, 0.0, -1.5, 0.0, 1.0, 0.0),
        spread=(1.4, 0.4, 0.3, 0.4, 0.4, 0.4, 0.8),
    ),
    "ur5e": _Robot(
        urdf="ur5e_like.urdf",
        middle=(0.0, -1.1, 1.6, -1.6, -1.57, 0.0),
        spread=(1.3, 0.4, 0.5, 0.5, 0.4, 0.8),
        looks=math.pi,
    ),
}


def _robots(robot: _Robot, generator: np.random.Generator, arms: int) -> dict[str, Any]:
    """Two robots that face each other, or more on a circle."""
    places: dict[str, Base]
    if arms == 2:
        apart = _numbers([generator.uniform(0.7, 1.0)])[0]
        places = {"left": (0.0, 0.0, 0.0), "right": (apart, 0.0, math.pi)}
    else:
        circle = [_numbers(base) for base in _circle(arms, generator.uniform(*robot.circle))]
        places = {f"arm_{k + 1}": (x, y, looks) for k, (x, y, looks) in enumerate(circle)}
    entries = []
    for name, (x, y, yaw) in places.items():
        turns = generator.uniform(-1.0, 1.0, size=(generator.integers(3, 6), len(robot.middle)))
        turns[[0, -1], 0] = generator.choice([-1.0, 1.0], 2) * generator.uniform(0.4, 1.0, 2)  # from and to a side
        waypoints = np.array(robot.middle) + turns * robot.spread
        entries.append(
            {
                "name": name,
                "urdf": robot.urdf,
                "base": {"position_m": [x, y, 0.0], "rpy_rad": [0.0, 0.0, yaw - robot.looks]},
                "path": {"waypoints_rad": [_numbers(row) for row in waypoints]},
            }
        )
    return {
        "d_min_m": 0.02,
        "torque_reserve": 0.1,
        "physics_tick_s": 1.0 / 240.0,
        "control_period_s": 0.05,
        "chart_cells": 1024,
        "arms": entries,
    }


@dataclass(frozen=True, kw_only=True)
class _Family:
    """How the file of a cell is drawn, and of how many arms."""

    draw: Callable[[np.random.Generator, int], dict[str, Any]]
    arms: tuple[int, ...]


_FAMILIES: Mapping[str, _Family] = {
    "planar": _Family(draw=_planar, arms=(2,)),
    "shaped": _Family(draw=_planar, arms=(2,)),
    "ring": _Family(draw=_ring, arms=tuple(range(2, 17))),
    "rows": _Family(draw=_rows, arms=(4, 6, 8, 10, 12, 14, 16)),
    "fixture": _Family(draw=_fixture, arms=(3, 4, 5, 6)),
    **{name: _Family(draw=partial(_robots, robot), arms=(2, 3, 4)) for name, robot in _ROBOTS.items()},
}
FAMILIES = tuple(_FAMILIES)
ARMS_OF: Mapping[str, tuple[int, ...]] = {name: family.arms for name, family in _FAMILIES.items()}
"""How many arms cells of a family may have, the fewest first."""


def draw_data(family: str, generator: np.random.Generator, arms: int) -> dict[str, Any]:
    """What the file of a cell says but for its kind and name, as plain values; whether it is any good is not asked."""
    return _FAMILIES[family].draw(generator, arms)

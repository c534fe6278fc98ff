"""Masses of a robot whose file has none: that of its data sheet, spread over the bodies by their volume."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from armtempo.arrays import Floats
from armtempo.robots._shapes import Shape


def spread_mass(mass: float, links: int, shapes: Sequence[Shape]) -> list[list[tuple[float, Floats, Floats]]] | None:
    """Parts (mass [kg], centre of mass (3,) [m], inertia about it (3, 3) [kg m^2]) of every moving link, in its frame.

    Each shape that moves is taken for its enclosing capsule, of one density with all the others. None: there is none
    on the last link, which would be without mass.

    Args:
        mass: Of all moving links together.
        links: How many there are.
        shapes: Collision bodies.
    """
    moving = [shape for shape in shapes if shape.link >= 0]
    volumes = [_volume(shape) for shape in moving]
    parts: list[list[tuple[float, Floats, Floats]]] = [[] for _ in range(links)]
    for shape, volume in zip(moving, volumes, strict=True):
        share = mass * volume / math.fsum(volumes)
        p0, p1, _ = shape.capsule
        parts[shape.link].append((share, 0.5 * (p0 + p1), _inertia(share, shape)))
    return parts if parts[-1] else None


def _volume(shape: Shape) -> float:
    p0, p1, radius = shape.capsule
    return math.pi * radius**2 * (float(np.linalg.norm(p1 - p0)) + 4.0 / 3.0 * radius)


def _inertia(mass: float, shape: Shape) -> Floats:
    """(3, 3) of a capsule: a rod and the two halves of a ball at its ends."""
    p0, p1, r = shape.capsule
    length = float(np.linalg.norm(p1 - p0))
    rod = mass * length / (length + 4.0 / 3.0 * r)
    ball = mass - rod
    along = rod * r**2 / 2.0 + ball * 0.4 * r**2
    across = rod * (length**2 / 12.0 + r**2 / 4.0) + ball * (0.4 * r**2 + length**2 / 4.0 + 0.375 * length * r)
    axis = (p1 - p0) / length if length > 0.0 else np.array([0.0, 0.0, 1.0])
    return across * np.eye(3) + (along - across) * np.outer(axis, axis)

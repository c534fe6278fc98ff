"""Where two shapes are nearest to each other, for pictures; distances that count come from ``Clearance``."""

from __future__ import annotations

import fcl
import numpy as np
from numpy.typing import ArrayLike

from armtempo.arrays import Floats
from armtempo.robots._clearance import _geometry
from armtempo.robots._shapes import Shape

__all__ = ["nearest_points"]

AGREEMENT = 1e-3
"""FCL's points are now and then others than those of its distance: they may be so much farther apart [m]."""


def nearest_points(shape_a: Shape, T_a: ArrayLike, shape_b: Shape, T_b: ArrayLike) -> Floats | None:
    """The point of each shape nearest to the other, (2, 3) in the world [m], with their links at T_a and T_b (4, 4).

    None: they overlap, or FCL tells points that are not as far apart as the shapes.
    """
    placed = []
    for shape, T_link in ((shape_a, T_a), (shape_b, T_b)):
        T = np.asarray(T_link) @ shape.T_link_shape
        placed.append(fcl.CollisionObject(_geometry(shape), fcl.Transform(T[:3, :3], T[:3, 3])))
    result = fcl.DistanceResult()
    distance = float(fcl.distance(*placed, fcl.DistanceRequest(enable_nearest_points=True), result))
    points = np.array(result.nearest_points, dtype=np.float64)
    if not distance > 0.0 or not abs(float(np.linalg.norm(points[1] - points[0])) - distance) <= AGREEMENT:
        return None
    return points

"""What decides where an arm's shapes get along a path: the content that cached charts and tables are known by."""

from __future__ import annotations

from armtempo.arrays import Floats
from armtempo.planners.joint_paths import AbstractJointPath
from armtempo.robots import Arm


def motion_content(arm: Arm, path: AbstractJointPath, q: Floats, speed: Floats) -> list[object]:
    """What decides where an arm's shapes get: its chain, its shapes, and samples of its path."""
    model = arm.model
    parts: list[object] = [arm.T_world_base, model.placement_R, model.placement_p, model.axis, model.prismatic]
    for shape in arm.shapes:
        parts += [shape.link, shape.kind, shape.size, shape.T_link_shape, shape.points, *shape.capsule]
        parts += [shape.exact, shape.tolerance, shape.vertices]
    return [*parts, path.length, q, speed]

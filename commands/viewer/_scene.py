"""A cell as the page draws it: arms by their joints and collision shapes, obstacles, paths."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from armtempo.arrays import Floats
from armtempo.commands.figures._style import ARM_COLORS, POLICY_COLORS
from armtempo.commands.viewer._packing import packed
from armtempo.envs.bodies import outline
from armtempo.planners import Cell
from armtempo.robots import Arm, Shape

__all__ = ["color_of_arm", "color_of_policy", "scene_json", "way_of"]

POSTURES = 40  # along the path, for what the arms reach
WAY_POINTS = 240
FLAT = 0.45  # of its width: a scene that is not higher is looked at from above
# Colours that are too dark on a dark ground get a brighter one there.
BRIGHT = {
    "#24476B": "#6FA8DC", "#0072B2": "#4AA3DF", "#3B3B3B": "#B9BEC4", "#7A7A7A": "#A2A8AF", "#8C6D31": "#C4A55A",
    "#7A4B9E": "#B38AD6", "#222222": "#E8EAED", "#D55E00": "#FF8A3D", "#009E73": "#2FC79A",
}  # fmt: skip
SPARE = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")


def _toned(color: str) -> dict[str, str]:
    return {"light": color, "dark": BRIGHT.get(color, color)}


def color_of_arm(i: int) -> dict[str, str]:
    """The colour of an arm, on a light ground and on a dark one."""
    return _toned(ARM_COLORS[i % len(ARM_COLORS)])


def color_of_policy(name: str, k: int) -> dict[str, str]:
    """The colour of a policy; one that is not ours gets a spare one by its number."""
    return _toned(POLICY_COLORS.get(name, SPARE[k % len(SPARE)]))


def scene_json(cell: Cell) -> dict[str, Any]:
    """What does not move, and how the rest does.

    ``low`` and ``high`` are the corners of what the arms reach, ``reach`` the points of it that a camera has to see.
    """
    meshes = _Meshes()
    points = []
    for arm, (q, tip) in zip(cell.arms, cell.sweeps(POSTURES), strict=True):
        points += [outline(arm, q), tip]
    reach = np.concatenate([*points, *(_corners(shape) for shape in cell.obstacles)])
    low, high = reach.min(axis=0), reach.max(axis=0)
    return {
        "arms": [_arm_json(arm, i, meshes) for i, arm in enumerate(cell.arms)],
        "obstacles": [_shape_json(shape, meshes) for shape in cell.obstacles],
        "meshes": meshes.listed,
        "low": low.tolist(),
        "high": high.tolist(),
        "reach": packed(_thinned(reach)),
        "flat": bool(high[2] - low[2] < FLAT * np.hypot(*(high - low)[:2])),
        "follows": cell.follows_poses,
        "d_min": getattr(cell, "d_min", 0.0),
    }


def way_of(cell: Cell) -> list[Floats]:
    """(K, 3) [m] of each arm's tip along its path."""
    return [tip for _, tip in cell.sweeps(WAY_POINTS)]


def _thinned(points: Floats) -> Floats:
    """The points that are extreme in some direction: a camera that sees them sees the rest."""
    golden = np.arange(200) + 0.5
    height = 1.0 - 2.0 * golden / 200.0
    angle, ring = np.pi * (1.0 + 5.0**0.5) * golden, np.sqrt(1.0 - height**2)
    directions = np.stack([ring * np.cos(angle), ring * np.sin(angle), height])
    return np.asarray(points[np.unique((points @ directions).argmax(axis=0))])


def _corners(shape: Shape) -> Floats:
    """(8, 3) of a box around the capsule that encloses an obstacle."""
    p0, p1, radius = shape.capsule
    sides = 2.0 * np.array(list(np.ndindex(2, 2, 2))) - 1.0
    return np.concatenate([p + radius * sides for p in (p0, p1)])


class _Meshes:
    """Hulls, each once: arms of one kind share theirs."""

    def __init__(self) -> None:
        self.listed: list[dict[str, Any]] = []
        self._known: dict[bytes, int] = {}

    def number(self, vertices: Floats, faces: Any) -> int:
        key = vertices.tobytes() + faces.tobytes()
        if key not in self._known:
            self._known[key] = len(self.listed)
            self.listed.append({"vertices": packed(vertices), "faces": packed(faces)})
        return self._known[key]


def _arm_json(arm: Arm, i: int, meshes: _Meshes) -> dict[str, Any]:
    model = arm.model
    placements = np.concatenate([model.placement_R, model.placement_p[..., None]], axis=-1)
    return {
        "name": arm.name,
        "color": color_of_arm(i),
        "base": arm.T_world_base[:3].ravel().tolist(),
        "joints": [
            {
                "placement": placement.ravel().tolist(),
                "axis": axis.tolist(),
                "slides": bool(slides),
            }
            for placement, axis, slides in zip(placements, model.axis, model.prismatic, strict=True)
        ],
        "tip": arm.T_link_tip[:3, 3].tolist(),
        "shapes": [{"link": shape.link, **_shape_json(shape, meshes)} for shape in arm.shapes],
    }


def _shape_json(shape: Shape, meshes: _Meshes) -> dict[str, Any]:
    told: dict[str, Any] = {
        "kind": shape.kind,
        "pose": shape.T_link_shape[:3].ravel().tolist(),
        "size": list(shape.size),
    }
    if shape.vertices is not None and shape.faces is not None:
        told["mesh"] = meshes.number(shape.vertices, shape.faces)
    return told


def shapes_by_name(arms: Sequence[Arm]) -> dict[str, list[tuple[int, Shape]]]:
    """The shapes of all arms with their arm's number, by the name that ``Clearance`` calls a body."""
    found: dict[str, list[tuple[int, Shape]]] = {}
    for i, arm in enumerate(arms):
        for shape in arm.shapes:
            found.setdefault(f"{arm.name}/{shape.link_name}", []).append((i, shape))
    return found

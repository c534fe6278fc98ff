"""Pictures of a cell: PyBullet's window, or images without a display.

The renderer has a PyBullet client of its own, with the paths drawn as beads: the physics stays as lean and as exact
with pictures as without.
"""

from __future__ import annotations

import functools
import subprocess
import sys
from collections.abc import Sequence
from contextlib import nullcontext
from typing import Any, final

import numpy as np
from numpy.typing import NDArray

from armtempo.arrays import Floats
from armtempo.envs.bodies._bullet import pybullet, quiet
from armtempo.envs.bodies._bullet_scene import BulletScene, display_available, quat_xyzw
from armtempo.errors import RenderError, brief
from armtempo.planners import Cell
from armtempo.robots import Arm, Shape

PICTURE_WIDTH, PICTURE_HEIGHT = 640, 480
COLOURS = ((0.00, 0.45, 0.70, 1.0), (0.84, 0.37, 0.00, 1.0), (0.00, 0.62, 0.45, 1.0), (0.80, 0.47, 0.65, 1.0))
GREY = (0.6, 0.6, 0.6, 1.0)
BEADS_PER_PATH = 40
BEAD_RADIUS = 0.004  # [m]
POSE_BEAD_RADIUS = 0.008  # [m] the same where poses are followed: it is seen from farther away
TARGET_AXIS_LENGTH = 0.15  # [m] of a target
VIEW_TILT = 0.35  # [rad] of the view from straight down
TALL_VIEW_TILT = 1.15  # [rad] the same where arms reach up and down
FLAT = 0.45  # of its width: what the arms sweep is looked at from above where it is not higher
VIEW_DEG = 40.0  # vertical
BORDER_SHARE = 0.12  # of the picture, free around the arms
_PROBE = """
import importlib.util
import pybullet
pybullet.connect(pybullet.DIRECT)
spec = importlib.util.find_spec("eglRenderer")
plugin = pybullet.loadPlugin(spec.origin, "_eglRendererPlugin") if spec else -1
if plugin < 0:
    raise SystemExit(1)
pybullet.getCameraImage(8, 8, renderer=pybullet.ER_BULLET_HARDWARE_OPENGL)
"""


def check_render_mode(mode: str | None) -> None:
    """Raise RenderError for a mode that does not exist."""
    if not (mode is None or (isinstance(mode, str) and mode in ("human", "rgb_array"))):
        raise RenderError(f"unknown render_mode {brief(mode)}", remedy="use 'human', 'rgb_array' or None", mode=mode)


@functools.cache
def egl_available() -> bool:
    """Whether PyBullet's EGL renderer works here, tried in a process of its own: where it does not, it may end it."""
    if not sys.platform.startswith("linux"):
        return False
    try:
        probe = subprocess.run(  # noqa: S603 (our own text)
            [sys.executable, "-c", _PROBE], capture_output=True, timeout=60, check=False
        )
    except (OSError, subprocess.TimeoutExpired):
        return False
    return probe.returncode == 0


@final
class Renderer:
    """Draws the arms of a cell at given joint positions.

    Args:
        cell: Whose arms.
        mode: ``rgb_array`` or ``human``.
        size: Width and height of images.

    Raises:
        RenderError: ``human`` without a display.
    """

    def __init__(self, cell: Cell, mode: str, size: tuple[int, int] = (PICTURE_WIDTH, PICTURE_HEIGHT)) -> None:
        if mode == "human" and not display_available():
            raise RenderError(
                "render_mode 'human' needs a display and none was found",
                remedy="set DISPLAY, run under xvfb-run, or use render_mode 'rgb_array'",
                mode=mode,
            )
        self.mode, self.size = mode, size
        egl = mode == "rgb_array" and egl_available()
        self._scene = BulletScene(cell, visible=True, window=mode == "human", egl=egl)
        if mode == "human":
            pybullet.configureDebugVisualizer(pybullet.COV_ENABLE_GUI, 0, physicsClientId=self._scene.client)
        self._beads = self._paint(POSE_BEAD_RADIUS if cell.follows_poses else BEAD_RADIUS)
        self._axes = self._draw_axes() if cell.follows_poses else []
        for obstacle in cell.obstacles:
            self._stand(obstacle)
        self.show(cell)

    def show(self, cell: Cell) -> None:
        """Show the paths of ``cell``, another than so far but with the same arms and obstacles, and look at them."""
        points = [arm.T_world_base[:3, 3] for arm in cell.arms]
        for arm, row, (q, beads) in zip(cell.arms, self._beads, cell.sweeps(BEADS_PER_PATH), strict=True):
            for bead, place in zip(row, beads.tolist(), strict=True):
                pybullet.resetBasePositionAndOrientation(
                    bead, place, [0.0, 0.0, 0.0, 1.0], physicsClientId=self._scene.client
                )
            points += [*arm.link_poses(q)[..., :3, 3].reshape(-1, 3), *beads, *outline(arm, q)]
        self._aim(np.array(points))

    def _paint(self, size: float) -> list[Sequence[int]]:
        """Every arm in a colour of its own; beads for its path, ``BEADS_PER_PATH`` each."""
        client, rows = self._scene.client, []
        for i, body in enumerate(self._scene.bodies):
            colour = COLOURS[i % len(COLOURS)]
            for link in range(-1, pybullet.getNumJoints(body, physicsClientId=client)):
                pybullet.changeVisualShape(body, link, rgbaColor=colour, physicsClientId=client)
            pale = [*(0.5 + 0.5 * c for c in colour[:3]), 1.0]
            bead = pybullet.createVisualShape(pybullet.GEOM_SPHERE, radius=size, rgbaColor=pale, physicsClientId=client)
            rows.append(
                pybullet.createMultiBody(
                    baseMass=0.0, baseVisualShapeIndex=bead, batchPositions=[[0.0, 0.0, 0.0]] * BEADS_PER_PATH,
                    physicsClientId=client,
                )
            )  # fmt: skip
        return rows

    def _draw_axes(self) -> list[int]:
        """Three rods for the axes of a target: red, green, blue for its x, y, z."""
        client, rods = self._scene.client, []
        for k in range(3):
            shape = pybullet.createVisualShape(
                pybullet.GEOM_CYLINDER, radius=0.006, length=TARGET_AXIS_LENGTH,
                visualFramePosition=[0.0, 0.0, 0.5 * TARGET_AXIS_LENGTH], rgbaColor=[*(0.8 * np.eye(3)[k]), 1.0],
                physicsClientId=client,
            )  # fmt: skip
            rods.append(pybullet.createMultiBody(baseMass=0.0, baseVisualShapeIndex=shape, physicsClientId=client))
        return rods

    def show_target(self, position: Floats, rotation: Floats) -> None:
        """Put the target's axes at a pose: (3,) [m], (3, 3)."""
        for k, rod in enumerate(self._axes):  # each rod lies along its own z
            turned = np.roll(rotation, 2 - k, axis=1)
            pybullet.resetBasePositionAndOrientation(
                rod, position.tolist(), quat_xyzw(turned), physicsClientId=self._scene.client
            )

    def _stand(self, obstacle: Shape) -> None:
        """An obstacle, in grey."""
        client, size = self._scene.client, obstacle.size
        form: dict[str, Any]
        if obstacle.kind == "box":
            form = {"shapeType": pybullet.GEOM_BOX, "halfExtents": [0.5 * side for side in size]}
        elif obstacle.kind == "sphere":
            form = {"shapeType": pybullet.GEOM_SPHERE, "radius": size[0]}
        elif obstacle.vertices is None or obstacle.faces is None:
            kind = pybullet.GEOM_CAPSULE if obstacle.kind == "capsule" else pybullet.GEOM_CYLINDER
            form = {"shapeType": kind, "radius": size[0], "length": size[1]}
        else:
            form = {"vertices": obstacle.vertices.tolist(), "indices": obstacle.faces.ravel().tolist()}
            form["shapeType"] = pybullet.GEOM_MESH
        T = obstacle.T_link_shape
        pybullet.createMultiBody(
            baseMass=0.0,
            baseVisualShapeIndex=pybullet.createVisualShape(**form, rgbaColor=GREY, physicsClientId=client),
            basePosition=T[:3, 3].tolist(),
            baseOrientation=quat_xyzw(T[:3, :3]),
            physicsClientId=client,
        )

    def _aim(self, points: Floats) -> None:
        """Look at everything the arms sweep from as near as shows it all: from above where it is flat."""
        across = np.ptp(points, axis=0)
        tilt = VIEW_TILT if across[2] < FLAT * np.hypot(across[0], across[1]) else TALL_VIEW_TILT
        width, height_px = self.size
        centre = 0.5 * (points.min(axis=0) + points.max(axis=0))
        back = np.array([0.0, -np.sin(tilt), np.cos(tilt)])  # from the scene to the eye
        up = np.array([0.0, np.cos(tilt), np.sin(tilt)])
        height = np.tan(0.5 * np.radians(VIEW_DEG)) * (1.0 - BORDER_SHARE)
        right, above, nearer = np.stack([[1.0, 0.0, 0.0], up, back]) @ (points - centre).T
        wide = np.abs(right) * height_px / width
        distance = max(0.2, float(np.max(nearer + np.maximum(wide, np.abs(above)) / height)))
        eye = centre + distance * back
        self._view = pybullet.computeViewMatrix(eye.tolist(), centre.tolist(), up.tolist())
        self._projection = pybullet.computeProjectionMatrixFOV(
            VIEW_DEG, width / height_px, 0.1 * distance, 10.0 * distance
        )
        if self.mode == "human":
            pybullet.resetDebugVisualizerCamera(
                distance, 0.0, np.degrees(tilt) - 90.0, centre.tolist(), physicsClientId=self._scene.client
            )

    def render(self, q: Floats) -> NDArray[np.uint8] | None:
        """Draw the arms at ``q`` (A, n): an image (height, width, 3) uint8, or None in a window."""
        width, height = self.size
        self._scene.put_joints(q, np.zeros_like(q))
        if self.mode == "human":
            return None
        with quiet() if self._scene.hardware else nullcontext():  # EGL names its vendor
            _, _, pixels, _, bodies = pybullet.getCameraImage(
                width,
                height,
                self._view,
                self._projection,
                shadow=0,
                lightDirection=(0.3, -0.4, 1.0),
                renderer=pybullet.ER_BULLET_HARDWARE_OPENGL if self._scene.hardware else pybullet.ER_TINY_RENDERER,
                physicsClientId=self._scene.client,
            )
        rgba = np.array(pixels, dtype=np.uint8).reshape(height, width, 4)
        background = np.reshape(bodies, (height, width, 1)) < 0
        np.putmask(rgba.view(np.uint32), background, 0xFFFFFFFF)  # on white, whichever renderer
        return np.ascontiguousarray(rgba[..., :3])

    def close(self) -> None:
        """Close window and client; may be called twice."""
        self._scene.close()


def outline(arm: Arm, q: Floats) -> Floats:
    """Points (N, 3) around an arm at ``q`` (K, n) [m]: nothing of its shapes is outside their hull."""
    fixed = np.broadcast_to(arm.T_world_base, (len(q), 1, 4, 4))
    frames = np.concatenate([arm.link_poses(q), fixed], axis=1)  # link -1 is the base
    sides = 2.0 * np.array(list(np.ndindex(2, 2, 2))) - 1.0
    found = [np.zeros((0, 3))]
    for shape in arm.shapes:
        T, points = frames[:, shape.link], shape.points
        corners = points @ T[:, :3, :3].swapaxes(1, 2) + T[:, None, :3, 3]
        radius = shape.capsule[2] if shape.exact else 0.0  # of capsules and spheres the points are the axis
        found.append((corners[:, :, None] + radius * sides[: 1 if radius == 0.0 else None]).reshape(-1, 3))
    return np.concatenate(found)


def render_modes() -> list[str]:
    """The modes that work here: a window needs a display."""
    return ["rgb_array", "human"] if display_available() else ["rgb_array"]

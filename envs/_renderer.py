"""Pictures of a cell: PyBullet's window, or images without a display.

The renderer has a PyBullet client of its own, with the paths drawn as beads: the physics stays as lean and as exact with
pictures as without.
"""

from __future__ import annotations

import functools
import importlib.util
import subprocess
import sys
from typing import Any, final

import numpy as np
import pybullet
from numpy.typing import NDArray

from armtempo.envs._scene import Scene, display_available
from armtempo.errors import RenderError
from armtempo.planners import Cell

Array = NDArray[np.float64]

WIDTH, HEIGHT = 640, 480
COLOURS = ((0.00, 0.45, 0.70, 1.0), (0.84, 0.37, 0.00, 1.0), (0.00, 0.62, 0.45, 1.0), (0.80, 0.47, 0.65, 1.0))
BEADS = 24  # per path
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
    if mode not in (None, "human", "rgb_array"):
        raise RenderError(f"unknown render_mode {mode!r}", remedy="use 'human', 'rgb_array' or None", mode=mode)


@functools.cache
def egl_available() -> bool:
    """Whether PyBullet's EGL renderer works here, tried in a process of its own: where it does not, it may end it."""
    if not sys.platform.startswith("linux"):
        return False
    try:
        probe = subprocess.run([sys.executable, "-c", _PROBE], capture_output=True, timeout=60, check=False)
    except (OSError, subprocess.TimeoutExpired):
        return False
    return probe.returncode == 0


@final
class Renderer:
    """Draws the arms of a cell at given joint positions.

    Raises:
        RenderError: ``human`` without a display.
    """

    def __init__(self, cell: Cell, mode: str) -> None:
        if mode == "human" and not display_available():
            raise RenderError(
                "render_mode 'human' needs a display and none was found",
                remedy="set DISPLAY, run under xvfb-run, or use render_mode 'rgb_array'",
                mode=mode,
            )
        self.mode = mode
        self._scene = Scene(cell, window=mode == "human")
        client = self._scene.client
        self._plugin = -1
        if mode == "rgb_array" and egl_available():
            spec = importlib.util.find_spec("eglRenderer")
            if spec is not None and spec.origin is not None:
                self._plugin = pybullet.loadPlugin(spec.origin, "_eglRendererPlugin", physicsClientId=client)
        if mode == "human":
            pybullet.configureDebugVisualizer(pybullet.COV_ENABLE_GUI, 0, physicsClientId=client)
        self._paint(cell)
        self._aim(cell)

    def _paint(self, cell: Cell) -> None:
        client = self._scene.client
        for i, (body, path) in enumerate(zip(self._scene.bodies, cell.paths, strict=True)):
            colour = COLOURS[i % len(COLOURS)]
            for link in range(-1, pybullet.getNumJoints(body, physicsClientId=client)):
                pybullet.changeVisualShape(body, link, rgbaColor=colour, physicsClientId=client)
            bead = pybullet.createVisualShape(
                pybullet.GEOM_SPHERE, radius=0.006, rgbaColor=(*(0.5 + 0.5 * c for c in colour[:3]), 1.0), physicsClientId=client
            )
            tips = cell.arms[i].tip_pose(path.evaluate(np.linspace(0.0, path.length, BEADS))[0])[:, :3, 3]
            pybullet.createMultiBody(
                baseMass=0.0, baseVisualShapeIndex=bead, batchPositions=tips.tolist(), basePosition=tips[0].tolist(),
                physicsClientId=client,
            )  # fmt: skip

    def _aim(self, cell: Cell) -> None:
        """Look down on everything the arms sweep."""
        points = [arm.T_world_base[:3, 3] for arm in cell.arms]
        for arm, path in zip(cell.arms, cell.paths, strict=True):
            q = path.evaluate(np.linspace(0.0, path.length, BEADS))[0]
            points += [*arm.link_poses(q)[..., :3, 3].reshape(-1, 3), *arm.tip_pose(q)[:, :3, 3]]
        low, high = np.min(points, axis=0), np.max(points, axis=0)
        centre, size = 0.5 * (low + high), max(float(np.max(high - low)), 0.2)
        eye = centre + size * np.array([0.0, -0.45, 0.95])
        self._view = pybullet.computeViewMatrix(eye.tolist(), centre.tolist(), [0.0, 1.0, 0.0])
        self._projection = pybullet.computeProjectionMatrixFOV(55.0, WIDTH / HEIGHT, 0.05 * size, 10.0 * size)
        if self.mode == "human":
            pybullet.resetDebugVisualizerCamera(
                1.1 * size, 0.0, -65.0, centre.tolist(), physicsClientId=self._scene.client
            )

    def render(self, q: Array) -> NDArray[np.uint8] | None:
        """Draw the arms at ``q`` (A, n): an image (480, 640, 3) uint8, or None in a window."""
        self._scene.place(q)
        if self.mode == "human":
            return None
        options: dict[str, Any] = {
            "renderer": pybullet.ER_BULLET_HARDWARE_OPENGL if self._plugin >= 0 else pybullet.ER_TINY_RENDERER,
            "shadow": 1,
            "lightDirection": (0.3, -0.4, 1.0),
        }
        picture = pybullet.getCameraImage(
            WIDTH, HEIGHT, self._view, self._projection, physicsClientId=self._scene.client, **options
        )[2]
        return np.ascontiguousarray(np.reshape(np.asarray(picture, dtype=np.uint8), (HEIGHT, WIDTH, 4))[..., :3])

    def close(self) -> None:
        """Close window and client; may be called twice."""
        self._scene.close()


def render_modes() -> list[str]:
    """The modes that work here: a window needs a display."""
    return ["rgb_array", "human"] if display_available() else ["rgb_array"]


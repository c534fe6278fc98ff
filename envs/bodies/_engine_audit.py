"""What another physics engine makes of a recorded episode, tick by tick."""

from __future__ import annotations

from typing import Any

import numpy as np

from armtempo.envs.bodies._controller import Physics, make_scene
from armtempo.envs.bodies._trace import Trace
from armtempo.planners import Cell

OTHER_ENGINE: dict[Physics, Physics] = {"bullet": "mujoco", "mujoco": "bullet"}


def engine_difference(
    cell: Cell, trace: Trace[Any], physics: Physics, *, model_error: float = 0.0, friction_error: float = 0.0
) -> float:
    """How far the arms are after a tick in one engine from where they were after it in another, at most [rad, m].

    From every recorded state, the speeds being those of the last tick, the recorded torques are applied for one tick.
    Differences do not add up: an error of an engine is seen where it is made.

    Args:
        cell: Whose arms.
        trace: An episode with physics, recorded in the other engine.
        physics: The engine to ask.
        model_error: As in the episode.
        friction_error: Likewise.

    Raises:
        RobotError: The engine refuses the arms.
        InputError: It is not installed.
    """
    q, torque = (_stacked(rows) for rows in (trace.q, trace.torque))
    qd = np.diff(q, axis=0, prepend=q[:1]) / cell.physics_tick  # episodes begin at rest
    scene = make_scene(cell, physics, model_error=model_error, friction_error=friction_error)
    after, worst = np.zeros_like(q[:2]), 0.0
    try:
        for k in range(len(q) - 1):
            scene.put_joints(q[k], qd[k])
            scene.apply_torque(torque[k + 1])
            scene.read_joints(*after)
            worst = max(worst, float(np.abs(after[0] - q[k + 1]).max()))
    finally:
        scene.close()
    return worst


def _stacked(rows: Any) -> Any:
    """(T+1, A, n) of one (T+1, n) per arm, or of that of the only one, padded with zeros."""
    own = rows if isinstance(rows, tuple) else (rows,)
    width = max(one.shape[1] for one in own)
    return np.stack([np.pad(one, ((0, 0), (0, width - one.shape[1]))) for one in own], axis=1)

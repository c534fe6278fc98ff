"""Pages of ik cells: errors of position and orientation, joint speeds, how near to singular the arm is."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from armtempo.arrays import Floats
from armtempo.commands.console import significant
from armtempo.commands.figures._ik import SMALLEST_M, SMALLEST_RAD
from armtempo.commands.viewer._kind_view import KindView, Told
from armtempo.commands.viewer._panels import Band, Line, Mark, Panel
from armtempo.planners import IKCell

if TYPE_CHECKING:
    from armtempo.agents import IKResult
    from armtempo.envs import IKTrace

__all__ = ["IK_VIEW"]


def panels(cell: IKCell, traces: Sequence[IKTrace]) -> list[Panel]:
    """Errors, joint speeds, singular value."""
    position, orientation = cell.error_scales
    return [
        Panel(
            title="Distance from the target",
            label="error [mm]",
            unit="mm",
            lines=(Line(column="position_error", scale=1e3),),
            marks=(Mark(at=1e3 * position, label="scale of the reward"),),
            others=True,
            log=True,
            floor=1e3 * SMALLEST_M,
        ),
        Panel(
            title="Rotation that is left",
            label="error [rad]",
            unit="rad",
            lines=(Line(column="orientation_error"),),
            marks=(Mark(at=orientation, label="scale of the reward"),),
            others=True,
            log=True,
            floor=SMALLEST_RAD,
        ),
        Panel(
            title="Joint speeds",
            label="% of the cap, by joint",
            unit="%",
            digits=0,
            lines=tuple(
                Line(column="speed", index=j, label=f"{j + 1}", joint=j, scale=100.0) for j in range(cell.arm.dof)
            ),
            marks=(Mark(at=-100.0), Mark(at=100.0)),
            largest=True,
        ),
        Panel(
            title="Smallest singular value",
            label="of the task's Jacobian",
            lines=(Line(column="singular_value"),),
            low=0.0,
            bands=(Band(low=0.0, high=cell.damping, label="damped", bad=False),),
            others=True,
        ),
    ]


def columns(cell: IKCell, trace: IKTrace) -> Mapping[str, Floats]:
    """Errors, speeds as shares of their caps, singular value, and the target's pose (T, 12) by rows."""
    rows = slice(0, 2 * len(trace.time) - 1, 2)
    pose = np.concatenate([cell.target.rotation[rows], cell.target.position[rows][..., None]], axis=-1)
    return {
        "position_error": trace.position_error,
        "orientation_error": trace.orientation_error,
        "speed": trace.joint_speed / cell.arm.speed_max,
        "singular_value": trace.singular_value,
        "target": pose.reshape(-1, 12),
    }


def told(cell: IKCell, result: IKResult) -> Told:
    """Root mean square of both errors of the first episode."""
    position, orientation = (
        float(np.sqrt(np.mean(error**2))) for error in (result.trace.position_error, result.trace.orientation_error)
    )
    said = f"{significant(1e3 * position)} mm"
    return Told(said, f"rms {said}, {significant(orientation)} rad")


IK_VIEW: KindView[IKCell, IKTrace, IKResult] = KindView(panels=panels, columns=columns, told=told)

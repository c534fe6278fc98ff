"""``armtempo fk`` and ``armtempo ik``: where a robot's tip is, and the joint positions that put it somewhere."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
import tyro

from armtempo.commands.console import JsonFile, Output, Seed, check_count, check_seed, new_table, number
from armtempo.errors import InputError

if TYPE_CHECKING:
    from armtempo.arrays import Floats
    from armtempo.robots import Arm

RobotName = Annotated[tyro.conf.Positional[str], tyro.conf.arg(metavar="ROBOT")]
TipLink = Annotated[
    str | None, tyro.conf.arg(metavar="LINK", help_behavior_hint="(default: the end of the longest chain of joints)")
]
Triple = tuple[float, float, float]


def fk(
    robot: RobotName,
    joints: Annotated[tyro.conf.Positional[tuple[float, ...]], tyro.conf.arg(metavar="Q ...")],
    *,
    tip_link: TipLink = None,
    json_file: JsonFile = None,
) -> None:
    """Say where a robot's tip is at joint positions, and what it is like there.

    Args:
        robot: A URDF or xacro file, a bundled robot, "pybullet_data/...", or CELL:ARM for an arm of a cell.
        joints: One per joint, from the base on [rad, m].
        tip_link: Link that carries the tool.
        json_file: Write the figures there as JSON, units in the keys; "-" for nothing but JSON on stdout.
    """
    output = Output(json_file)
    arm = _load(robot, tip_link)
    if len(joints) != arm.dof:
        raise InputError(f"{len(joints)} joint positions for {robot}", remedy=f"give {arm.dof}, from the base on")
    _tell(arm, robot, np.array([joints]), "Posture", output)


def ik(
    robot: RobotName,
    *,
    position_m: Annotated[Triple, tyro.conf.arg(metavar="X Y Z")],
    rpy_rad: Annotated[Triple | None, tyro.conf.arg(metavar="R P Y", help_behavior_hint="(default: any)")] = None,
    count: Annotated[int, tyro.conf.arg(metavar="N")] = 8,
    seed: Seed = 0,
    tip_link: TipLink = None,
    json_file: JsonFile = None,
) -> None:
    """Find joint positions that put a robot's tip at a pose, those first that are farthest from their limits.

    Args:
        robot: A URDF or xacro file, a bundled robot, "pybullet_data/...", or CELL:ARM for an arm of a cell.
        position_m: Of the tip in the world (a robot by itself stands at its origin) [m].
        rpy_rad: Its roll, pitch and yaw there, as a cell file has them.
        count: So many postures at most.
        seed: Of the random starts, where there is no closed form.
        tip_link: Link that carries the tool.
        json_file: Write the figures there as JSON, units in the keys; "-" for nothing but JSON on stdout.
    """
    output = Output(json_file)
    check_count("--count", count, 8)
    check_seed(seed)
    arm = _load(robot, tip_link)
    from armtempo.planners import find_postures  # late: compiled loops
    from armtempo.planners.geometry import rpy_matrix

    rotation = None if rpy_rad is None else rpy_matrix(rpy_rad)
    _tell(arm, robot, find_postures(arm, position_m, rotation, count=count, seed=seed), "Postures", output)


def _load(robot: str, tip_link: str | None) -> Arm:
    from armtempo.planners import load_robot  # late: compiled loops

    return load_robot(robot, tip_link=tip_link)


def _tell(arm: Arm, robot: str, postures: Floats, what: str, output: Output) -> None:
    found = [_described(arm, q) for q in postures]
    caption = "margin: to the nearest limit, of the joint's range; singular: 0 where the tip cannot go somewhere; "
    table = new_table(f"{what} of {robot}", caption + "holding: torque at rest, of the limit")
    for joint in range(arm.dof):
        table.add_column(f"joint {joint + 1}\n\\[{'m' if arm.model.prismatic[joint] else 'rad'}]", justify="right")
    for head in ("margin\n\\[%]", "singular", "holding\n\\[%]", "self\n\\[mm]"):
        table.add_column(head, justify="right")
    for one in found:
        rest = (one["margin_share"], 0, 100.0), (one["singular_value"], 3), (one["holding_share"], 0, 100.0)
        clearance = number(one["self_clearance_m"], 1, 1e3)
        table.add_row(*(f"{value:.4f}" for value in one["joints"]), *(number(*each) for each in rest), clearance)
    output.table(table)
    x, y, z = found[0]["tip_position_m"]
    roll, pitch, yaw = found[0]["tip_rpy_rad"]
    output.say(f"Tip at {x:.4f}, {y:.4f}, {z:.4f} m, roll, pitch, yaw {roll:.4f}, {pitch:.4f}, {yaw:.4f} rad.")
    output.json({"robot": robot, "arm": arm.name, "urdf": str(arm.urdf), "postures": found})


def _described(arm: Arm, q: Floats) -> dict[str, Any]:
    """A posture in numbers, units in the keys; None where something has no limits, or nothing to hit."""
    from scipy.spatial.transform import Rotation

    from armtempo.robots import Clearance

    T = arm.tip_pose(q)
    with np.errstate(invalid="ignore", divide="ignore"):
        margin = np.minimum(q - arm.position_min, arm.position_max - q) / (arm.position_max - arm.position_min)
        holding = np.abs(arm.inverse_dynamics(q, np.zeros_like(q), np.zeros_like(q), friction=False)) / arm.torque_max
    near = Clearance([arm]).self_collision(0, q).distance
    return {
        "joints": q.tolist(),
        "tip_position_m": T[:3, 3].tolist(),
        "tip_rpy_rad": Rotation.from_matrix(T[:3, :3]).as_euler("xyz").tolist(),
        "margin_share": float(np.min(margin[np.isfinite(margin)])) if np.isfinite(margin).any() else None,
        "singular_value": float(np.linalg.svd(arm.jacobian(q), compute_uv=False)[: min(6, arm.dof)].min()),
        "holding_share": float(np.max(holding)) if np.isfinite(holding).all() else None,
        "self_clearance_m": float(near) if np.isfinite(near) else None,
    }

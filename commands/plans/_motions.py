"""Motions of the joints, sampled: along a path, and of a run of inverse kinematics."""

from __future__ import annotations

import math

import numpy as np

from armtempo.arrays import Floats
from armtempo.errors import InputError
from armtempo.planners import AbstractJointPath
from armtempo.planners.exports import RobotMotion, check_rest
from armtempo.planners.ik import IKRun
from armtempo.planners.topp import JointTrajectory
from armtempo.robots import Arm

MOST_ROWS = 10_000_000
TICK_ROUNDING = 1e-6  # of a tick: periods that are as near to whole ticks are taken for them


def instants(duration: float, period: float) -> Floats:
    """Every ``period`` [s] from 0, and exactly ``duration`` [s].

    Raises:
        InputError: Far too many.
    """
    steps = duration / period
    if steps > MOST_ROWS:
        raise InputError(f"a period of {period} s gives {steps:.3g} rows", remedy="give a longer period")
    time: Floats = period * np.arange(math.ceil(steps * (1.0 - 1e-12)), dtype=np.float64)
    return np.append(time[time < duration], duration)


def joint_motion(arm: Arm, path: AbstractJointPath, time: Floats, s: Floats, v: Floats, a: Floats) -> JointTrajectory:
    """The motion along a path, from place, speed and acceleration (T,) on it; torques from the arm's own model."""
    q, dq, ddq = path.evaluate(s)
    qd = dq * v[:, None]
    qdd = ddq * v[:, None] ** 2 + dq * a[:, None]
    return JointTrajectory(
        joint_names=arm.joint_names, time=time, q=q, qd=qd, qdd=qdd, torque=arm.inverse_dynamics(q, qd, qdd)
    )


def _ticks(run: IKRun, period: float) -> int:
    """How many steps of a run a period [s] is."""
    step = float(run.time[1] - run.time[0])
    every = round(period / step)
    if not (every >= 1 and abs(period / step - every) <= TICK_ROUNDING):
        raise InputError(
            f"--rate-hz {1.0 / period:g} is not one row every so many ticks of {step:g} s, at which this law runs",
            remedy=f"try {1.0 / step:g}, or a whole part of it",
        )
    return every


def run_motion(arm: Arm, run: IKRun, period: float | None = None) -> JointTrajectory:
    """What a run of inverse kinematics does, at its own samples or every ``period`` [s], and at its end.

    Accelerations are the steps of its joint speeds from row to row; the last row keeps the one before.

    Raises:
        InputError: ``period`` is not a whole number of its steps.
    """
    last, every = len(run.time) - 1, 1 if period is None else _ticks(run, period)
    rows = np.unique(np.append(np.arange(0, last, every), last))
    time, q, qd = run.time[rows], run.q[rows], run.qd[rows]
    qdd = np.diff(qd, axis=0) / np.diff(time)[:, None]
    qdd = np.concatenate([qdd, qdd[-1:]])
    return JointTrajectory(
        joint_names=arm.joint_names, time=time, q=q, qd=qd, qdd=qdd, torque=arm.inverse_dynamics(q, qd, qdd)
    )


def run_for_robots(arm: Arm, run: IKRun, rate_hz: float) -> RobotMotion:
    """A run of inverse kinematics at a rate, at rest after its end until the next whole period.

    Raises:
        InputError: The period is not a whole number of its steps, or the arm moves at its start or end.
    """
    ticks = run_motion(arm, run)
    every = _ticks(run, 1.0 / rate_hz)
    check_rest(arm, ticks)
    step = float(run.time[1] - run.time[0])
    missing = -(len(run.time) - 1) % every
    rows = np.minimum(np.arange(len(run.time) + missing), len(run.time) - 1)
    moves = (np.arange(len(rows)) < len(run.time) - 1)[:, None]
    q, qd, qdd = ticks.q[rows], ticks.qd[rows] * moves, ticks.qdd[rows] * moves
    columns = {
        "time": run.time[0] + step * np.arange(len(rows)), "q": q, "qd": qd, "qdd": qdd,
        "torque": arm.inverse_dynamics(q, qd, qdd),
    }  # fmt: skip
    finer = JointTrajectory(joint_names=arm.joint_names, **columns)
    points = JointTrajectory(joint_names=arm.joint_names, **{name: column[::every] for name, column in columns.items()})
    return RobotMotion(arms=(arm,), motions=(points,), finer=(finer,))

"""Episodes of an IK cell, tick by tick: joint references from speeds or from the law, physics or none, pose errors.

It knows the arm and time, not spaces or rewards. References are held back to what torques can follow: a period is run
as asked for only if its torques fit, and if there is a way to stop after it that fits, too. Otherwise it is drawn, all
joints in one ratio, to the way to stop that the period before had: that one always fits.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, final

import numpy as np

from armtempo.arrays import Bools, Floats
from armtempo.envs.bodies import Controller, End, Recorder, Trace
from armtempo.envs.ik._braking import BRAKING_HARDNESSES, hardest_stop
from armtempo.envs.ik._kernels import brake, pose_errors
from armtempo.envs.ik._options import IKOptions
from armtempo.envs.ik._periods import ask_period, cut_shares, make_drive, sum_up
from armtempo.planners import IKCell
from armtempo.planners.ik.kernels import Targets as IKTargets
from armtempo.state import Stateful


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class IKTrace(Trace[Floats]):
    """An episode at its ticks, T + 1 rows (row 0 is the start; torques of row k act from tick k - 1 to k).

    Attributes:
        cell: Where it was; of another target where one was drawn.
        time: (T+1,) [s].
        q: (T+1, n) joint positions: measured, or the reference without physics [rad, m].
        reference: (T+1, n) what they should be.
        tip: (T+1, 3) where they put the tip [m].
        target: (T+1, 3) where it should be [m].
        error: (T+1, 6) from the tip to the target, world axes: [m], and rotation vector [rad].
        capped: (T+1,) whether limits of speed, acceleration, position or torque cut what was asked for.
        singular_value: (T+1,) smallest one at ``q``, of the task's Jacobian, lengths in units of the arm's.
        torque: (T+1, n) applied [N m, N]; demand: before clipping at the limits.
        torque_max: (n,) the limits.
    """

    cell: IKCell
    reference: Floats
    tip: Floats
    target: Floats
    error: Floats
    capped: Bools
    singular_value: Floats

    @property
    def position_error(self) -> Floats:
        """(T+1,) [m]."""
        return np.asarray(np.linalg.norm(self.error[:, :3], axis=1))

    @property
    def orientation_error(self) -> Floats:
        """(T+1,) angle [rad]."""
        return np.asarray(np.linalg.norm(self.error[:, 3:], axis=1))

    @property
    def joint_speed(self) -> Floats:
        """(T+1, n) of the joints themselves [rad/s, m/s], from tick to tick."""
        return np.diff(self.q, axis=0, prepend=self.q[:1]) / self.cell.physics_tick

    @property
    def damped(self) -> Bools:
        """(T+1,) whether it was nearer to singular than where the cell's law is damped."""
        return np.asarray(self.singular_value < self.cell.damping)


@final
class IKSimulation(Stateful):
    """One arm that follows a pose over time, run in control periods.

    Args:
        cell: The arm and its target.
        options: Of its episodes; the family of targets and the time limit are not its business.
        record: Keep a trace.

    Attributes:
        cell: Of this episode.
        joint_speeds: (n,) of the reference now [rad/s, m/s].
        measured_speeds: (n,) of the joints themselves.
        tip, error: Where the tip is (3,), and from there to the target (6,): [m], rotation vector [rad].
        squares: (2,) of the errors of position and orientation, sums over all ticks so far [m^2, rad^2].
        shares: (4,) means over the last step: x / (1 + x) of the errors x of position and orientation in units of the
            cell's scales, the square of the torques as shares of their limits, what limits cut from the speeds asked
            for as a share of the caps.
        singular_value: The smallest one, of the task's Jacobian, lengths in units of the arm's.
    """

    changing = (
        "cell", "_hardness", "_ticks", "joint_speeds", "squares", "shares", "tip", "error", "singular_value",
        "_controller", "_recorder",
    )  # fmt: skip

    def __init__(self, cell: IKCell, options: IKOptions, *, record: bool = False) -> None:
        self.physics, self.record = options.physics, record
        self._model = cell.arm.model
        self._drive = make_drive(cell, by_gains=options.action_mode == "gains")
        self._controller = Controller(cell, options.physics, model_error=options.model_error)
        self._recorder = Recorder(wanted=record, tick=cell.physics_tick)
        self.reset(cell)

    def reset(self, cell: IKCell) -> None:
        """To the start of ``cell`` (the arm is the same), at rest."""
        self._take(cell)
        self._hardness = 1.0  # share of the braking accelerations at which it can stop
        self._ticks = 0
        self.joint_speeds: Floats = np.zeros(cell.arm.dof)
        self.squares: Floats = np.zeros(2)
        self.shares: Floats = np.zeros(4)
        controller = self._controller
        controller.reset(cell.start)
        self._recorder.clear()
        rows = np.stack([controller.q, controller.torque, controller.demand], axis=1)
        self._measure(controller.q.copy(), rows, np.zeros(1))

    def _take(self, cell: IKCell) -> None:
        """The target of ``cell``, copied, so not read-only: the law is compiled for one kind of arrays."""
        self.cell, target = cell, cell.target
        self._targets = IKTargets(
            target.position.copy(), target.rotation.copy(), target.velocity.copy(), target.angular_velocity.copy(), 2,
            cell.physics_tick,
        )  # fmt: skip

    def _go_on(self, state: Mapping[str, Any]) -> None:
        if state["cell"] is not self.cell:
            self._take(state["cell"])
        super()._go_on(state)

    @property
    def time(self) -> float:
        """Instant [s]."""
        return self._ticks * self.cell.physics_tick

    @property
    def tick(self) -> int:
        """Ticks since the start: the target is at its row ``2 tick``."""
        return self._ticks

    @property
    def done(self) -> bool:
        """Whether the target has ended."""
        return self._ticks >= self.cell.ticks

    @property
    def end(self) -> End:
        """When the target ended; nothing is forbidden."""
        return End(self.time if self.done else math.nan, False)

    @property
    def reference(self) -> Floats:
        """(n,) joint positions asked for."""
        return np.array(self._controller.reference[2, 0])

    @property
    def position_error(self) -> float:
        """Distance of the tip from its target [m]."""
        return float(np.linalg.norm(self.error[:3]))

    @property
    def orientation_error(self) -> float:
        """Angle of the rotation that is left [rad]."""
        return float(np.linalg.norm(self.error[3:]))

    @property
    def demand(self) -> Floats:
        """(n,) torques asked for in the last tick, before clipping."""
        return np.array(self._controller.demand[0])

    def joint_positions(self) -> Floats:
        """(1, n) joint positions now."""
        return self._controller.q.copy()

    @property
    def measured_speeds(self) -> Floats:
        """(n,) joint speeds now, the arm's own [rad/s, m/s]."""
        return np.array(self._controller.qd[0])

    def pose_errors(self, q: Floats, rows: list[int]) -> Floats:
        """From the tip at ``q`` (n,) to the target at each of its ``rows`` (two a tick): (K, 6), as ``error``."""
        target, errors = self.cell.target, np.empty((len(rows), 6))
        pose_errors(
            self._model, np.repeat(q[None], len(rows), axis=0), target.position[rows], target.rotation[rows], 1,
            np.empty((len(rows), 3)), errors,
        )  # fmt: skip
        return errors

    def step(self, action: Floats) -> None:
        """Run one control period with an action in [-1, 1]: (n,) ``speeds`` at its end, or (4,) ``gains``."""
        cell, drive, controller = self.cell, self._drive, self._controller
        reference = controller.reference[:, 0]
        ticks, n = cell.ticks_per_period, cell.arm.dof
        joints, cuts, after, rows = np.empty((ticks, n)), np.empty(ticks), np.empty((3, n)), np.empty((ticks, 3, n))
        asked, speeds = np.empty((2, ticks if drive.by_gains else 1, n))
        self._hardness = ask_period(
            drive, action, self._targets, 2 * self._ticks, reference[2], self.joint_speeds, reference,
            self._hardness, joints, asked, speeds, after, rows,
        )  # fmt: skip
        self.joint_speeds = speeds[-1].copy()
        cut_shares(asked, speeds, drive.speed_max, cuts)
        if self.physics == "ideal":
            reference[:] = after
            controller.put(*rows[-1][:, None])
        else:
            rows = self._follow(joints, asked, cuts)
        self._ticks += ticks
        errors = self._measure(joints, rows, cuts)
        sum_up(errors, rows[:, 1], cuts, drive.torque_max, drive.scales, self.squares, self.shares)

    def _follow(self, joints: Floats, asked: Floats, cuts: Floats) -> Floats:
        """In PyBullet; where torques are clipped, as of bodies heavier than believed, the rest of ``joints`` brakes."""
        ticks, rows = len(joints), self._track(joints)
        while self._controller.clipped:
            k = len(rows)
            self._start_over()
            if k == ticks:
                break
            braking = self._brake(joints[k:])
            cut_shares(np.repeat(asked[-1:], ticks - k, axis=0), braking, self._drive.speed_max, cuts[k:])
            rows = np.concatenate([rows, self._track(joints[k:])])
        return rows

    def _track(self, joints: Floats) -> Floats:
        """Ticks in PyBullet towards references ``joints`` (K, n): q, torques and demand after each, (K, 3, n).

        They end with the first in which torques were clipped: then there are fewer rows.
        """
        controller, rows = self._controller, np.empty((len(joints), 3, joints.shape[1]))
        for k, wanted in enumerate(joints):
            controller.track(wanted[None])
            rows[k, 0], rows[k, 1], rows[k, 2] = controller.q[0], controller.torque[0], controller.demand[0]
            if controller.clipped:
                return rows[: k + 1]
        return rows

    def _start_over(self) -> None:
        """The reference goes on from where the arm is, and as fast."""
        drive, controller = self._drive, self._controller
        q = np.clip(controller.q[0], drive.position_min, drive.position_max)
        v = np.clip(controller.qd[0], -drive.speed_max, drive.speed_max)
        controller.reference[:, 0] = q - self.cell.physics_tick * np.array([[2.0], [1.0], [0.0]]) * v
        self.joint_speeds = v
        period = drive.tick if drive.by_gains else drive.period
        hardness = hardest_stop(
            drive.model, q, v, drive.braking, period, drive.position_min, drive.position_max, drive.coulomb,
            drive.torque_max,
        )  # fmt: skip
        self._hardness = float(hardness or BRAKING_HARDNESSES[-1])

    def _brake(self, joints: Floats) -> Floats:
        """References ``joints`` (K, n) towards a stop; their speeds (K, n)."""
        drive, speeds = self._drive, np.empty_like(joints)
        brake(
            self._controller.reference[2, 0], self.joint_speeds, drive.tick, 1.0, self._hardness * drive.braking,
            drive.speed_max, drive.position_min, drive.position_max, joints, speeds,
        )  # fmt: skip
        self.joint_speeds = speeds[-1].copy()
        return speeds

    def _measure(self, joints: Floats, rows: Floats, cuts: Floats) -> Floats:
        """Pose errors (K, 6) at the last K ticks, of which ``rows`` are known."""
        target, first = self.cell.target, 2 * (self._ticks + 1 - len(rows))
        tips, errors = np.empty((len(rows), 3)), np.empty((len(rows), 6))
        q = np.ascontiguousarray(rows[:, 0])
        pose_errors(self._model, q, target.position[first:], target.rotation[first:], 2, tips, errors)
        self.tip, self.error = tips[-1], errors[-1]
        self.singular_value = float(self.cell.singular_value(q[-1]))
        if self.record:
            self._recorder.extend(
                q=rows[:, 0], torque=rows[:, 1], demand=rows[:, 2], reference=joints, tip=tips, error=errors,
                capped=cuts > 0.0,
            )  # fmt: skip
        return errors

    def trace(self) -> IKTrace:
        """What happened so far.

        Raises:
            InputError: Nothing was recorded.
        """
        columns = self._recorder.columns()
        return IKTrace(
            **columns,
            cell=self.cell,
            target=self.cell.target.position[: 2 * len(columns["q"]) : 2].copy(),
            singular_value=self.cell.singular_value(columns["q"]),
            torque_max=self.cell.arm.torque_max,
        )

    def close(self) -> None:
        """Leave PyBullet; may be called twice."""
        self._controller.close()

"""Episodes of an IK cell, tick by tick: joint references from speeds or from the law, physics or none, pose errors.

It knows the arm and time, not spaces or rewards. References are held back to what torques can follow: a period is run
as asked for only if its torques fit, and if there is a way to stop after it that fits, too. Otherwise it is drawn, all
joints in one ratio, to the way to stop that the period before had: that one always fits.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, final, get_args

import numpy as np

from armtempo.arrays import Bools, Floats
from armtempo.envs.bodies import Physics, TrackedArm
from armtempo.envs.ik._braking import HARDNESS, hardest_stop
from armtempo.envs.ik._kernels import brake, pose_errors
from armtempo.envs.ik._periods import ask_period, cut_shares, drive_of, sum_up
from armtempo.errors import InputError, UnknownNameError
from armtempo.planners import IKCell
from armtempo.planners.ik.kernels import Targets as IKTargets

ActionMode = Literal["speeds", "gains"]
ACTION_MODES: tuple[ActionMode, ...] = get_args(ActionMode)


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class IKTrace:
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
    time: Floats
    q: Floats
    reference: Floats
    tip: Floats
    target: Floats
    error: Floats
    capped: Bools
    singular_value: Floats
    torque: Floats
    demand: Floats
    torque_max: Floats

    def __post_init__(self) -> None:
        for name in self.__slots__:
            value = getattr(self, name)
            if isinstance(value, np.ndarray):
                value.setflags(write=False)

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
        return np.asarray(self.singular_value < self.cell.config.law.damping)


@final
class IKSimulation:
    """One arm that follows a pose over time, run in control periods.

    Args:
        cell: The arm and its target.
        physics: ``bullet``: torque-controlled in PyBullet. ``ideal``: always on its reference.
        action_mode: ``speeds`` or ``gains``: what ``step`` is given.
        record: Keep a trace.
        model_error: The bodies in PyBullet are heavier by this share than the controller believes.

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

    def __init__(
        self, cell: IKCell, *, physics: Physics, action_mode: ActionMode, record: bool = False, model_error: float = 0.0
    ) -> None:
        if action_mode not in ACTION_MODES:
            raise UnknownNameError("action mode", str(action_mode), ACTION_MODES)
        self._arm = TrackedArm(cell, physics=physics, model_error=model_error)
        self._drive = drive_of(cell, by_gains=action_mode == "gains")
        self.physics, self.record = physics, record
        self._scene = self._arm.scene
        self.reset(cell)

    def reset(self, cell: IKCell) -> None:
        """To the start of ``cell`` (the arm is the same), at rest."""
        self.cell, arm = cell, cell.arm
        self._hardness = 1.0  # share of the braking accelerations at which it can stop
        target = cell.target  # copied, so not read-only: the law is compiled for one kind of arrays
        self._targets = IKTargets(
            target.position.copy(), target.rotation.copy(), target.velocity.copy(), target.angular_velocity.copy(), 2,
            cell.physics_tick,
        )  # fmt: skip
        self._ticks = 0
        self.joint_speeds: Floats = np.zeros(arm.dof)
        self.squares: Floats = np.zeros(2)
        self.shares: Floats = np.zeros(4)
        self._arm.place(cell.start)
        rows = np.stack([self._arm.q, self._arm.torque, self._arm.demand], axis=1)
        self._blocks: list[tuple[Floats, Floats, Floats, Floats, Bools]] = []
        self._measure(self._arm.q.copy(), rows, np.zeros(1))

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
    def reference(self) -> Floats:
        """(n,) joint positions asked for."""
        return np.array(self._arm.reference[2])

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
        return np.array(self._arm.demand[0])

    def joint_positions(self) -> Floats:
        """(1, n) joint positions now."""
        return self._arm.q.copy()

    @property
    def measured_speeds(self) -> Floats:
        """(n,) joint speeds now, the arm's own [rad/s, m/s]."""
        return np.array(self._arm.qd[0])

    def pose_errors(self, q: Floats, rows: list[int]) -> Floats:
        """From the tip at ``q`` (n,) to the target at each of its ``rows`` (two a tick): (K, 6), as ``error``."""
        target, errors = self.cell.target, np.empty((len(rows), 6))
        pose_errors(
            self._arm.model, np.repeat(q[None], len(rows), axis=0), target.position[rows], target.rotation[rows], 1,
            np.empty((len(rows), 3)), errors,
        )  # fmt: skip
        return errors

    def step(self, action: Floats) -> None:
        """Run one control period with an action in [-1, 1]: (n,) ``speeds`` at its end, or (4,) ``gains``."""
        cell, drive, held = self.cell, self._drive, self._arm
        ticks, n = cell.ticks_per_period, cell.arm.dof
        joints, cuts, after, rows = np.empty((ticks, n)), np.empty(ticks), np.empty((3, n)), np.empty((ticks, 3, n))
        asked, speeds = np.empty((2, ticks if drive.by_gains else 1, n))
        self._hardness = ask_period(
            drive, action, self._targets, 2 * self._ticks, held.reference[2], self.joint_speeds, held.reference,
            self._hardness, joints, asked, speeds, after, rows,
        )  # fmt: skip
        self.joint_speeds = speeds[-1].copy()
        cut_shares(asked, speeds, drive.speed_max, cuts)
        if self.physics == "ideal":
            held.stay(after, rows[-1])
        else:
            rows = self._follow(joints, asked, cuts)
        self._ticks += ticks
        errors = self._measure(joints, rows, cuts)
        sum_up(errors, rows[:, 1], cuts, drive.torque_max, drive.scales, self.squares, self.shares)

    def _follow(self, joints: Floats, asked: Floats, cuts: Floats) -> Floats:
        """In PyBullet; where torques are clipped, as of bodies heavier than believed, the rest of ``joints`` brakes."""
        ticks, held = len(joints), self._arm
        rows = held.follow(joints)
        while held.clipped:
            k = len(rows)
            self._start_over()
            if k == ticks:
                break
            braking = self._brake(joints[k:])
            cut_shares(np.repeat(asked[-1:], ticks - k, axis=0), braking, self._drive.speed_max, cuts[k:])
            rows = np.concatenate([rows, held.follow(joints[k:])])
        return rows

    def _start_over(self) -> None:
        """The reference goes on from where the arm is, and as fast."""
        drive, held = self._drive, self._arm
        q = np.clip(held.q[0], drive.position_min, drive.position_max)
        v = np.clip(held.qd[0], -drive.speed_max, drive.speed_max)
        held.reference[:] = q - self.cell.physics_tick * np.array([[2.0], [1.0], [0.0]]) * v
        self.joint_speeds = v
        period = drive.tick if drive.by_gains else drive.period
        hardness = hardest_stop(
            drive.model, q, v, drive.braking, period, drive.position_min, drive.position_max, drive.coulomb,
            drive.torque_max,
        )  # fmt: skip
        self._hardness = float(hardness or HARDNESS[-1])

    def _brake(self, joints: Floats) -> Floats:
        """References ``joints`` (K, n) towards a stop; their speeds (K, n)."""
        drive, speeds = self._drive, np.empty_like(joints)
        brake(
            self._arm.reference[2], self.joint_speeds, drive.tick, 1.0, self._hardness * drive.braking, drive.speed_max,
            drive.position_min, drive.position_max, joints, speeds,
        )  # fmt: skip
        self.joint_speeds = speeds[-1].copy()
        return speeds

    def _measure(self, joints: Floats, rows: Floats, cuts: Floats) -> Floats:
        """Pose errors (K, 6) at the last K ticks, of which ``rows`` are known."""
        target, first = self.cell.target, 2 * (self._ticks + 1 - len(rows))
        tips, errors = np.empty((len(rows), 3)), np.empty((len(rows), 6))
        q = np.ascontiguousarray(rows[:, 0])
        pose_errors(self._arm.model, q, target.position[first:], target.rotation[first:], 2, tips, errors)
        self.tip, self.error = tips[-1], errors[-1]
        self.singular_value = float(self.cell.singular_value(q[-1]))
        if self.record:
            self._blocks.append((joints, rows, tips, errors, cuts > 0.0))
        return errors

    def trace(self) -> IKTrace:
        """What happened so far.

        Raises:
            InputError: Nothing was recorded.
        """
        if not self.record:
            raise InputError("this environment keeps no trace", remedy="make it with record=True")
        reference, rows, tip, error, capped = (np.concatenate(blocks) for blocks in zip(*self._blocks, strict=True))
        return IKTrace(
            cell=self.cell,
            time=np.asarray(self.cell.physics_tick * np.arange(len(rows)), dtype=np.float64),
            q=rows[:, 0].copy(),
            reference=reference,
            tip=tip,
            target=self.cell.target.position[: 2 * len(rows) : 2].copy(),
            error=error,
            capped=capped,
            singular_value=self.cell.singular_value(rows[:, 0]),
            torque=rows[:, 1].copy(),
            demand=rows[:, 2].copy(),
            torque_max=self._arm.torque_max.copy(),
        )

    def close(self) -> None:
        """Leave PyBullet; may be called twice."""
        self._arm.close()

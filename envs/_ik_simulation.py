"""Episodes of an IK cell, tick by tick: joint references from speeds or from the law, physics or none, pose errors.

It knows the arm and time, not spaces or rewards. References are held back to what torques can follow: a period is run
as asked for only if its torques fit, and if there is a way to stop after it that fits, too. Otherwise it is drawn, all
joints in one ratio, to the way to stop that the period before had: that one always fits.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, final, get_args

import numpy as np
from numpy.typing import NDArray

from armtempo.envs._ik_braking import HARDNESS, hardest_stop, hold_back
from armtempo.envs._ik_kernels import allowed_speeds, brake, pose_errors, ramp, run_law
from armtempo.envs._simulation import Physics
from armtempo.envs._tracked_arm import TrackedArm
from armtempo.errors import InputError, UnknownNameError
from armtempo.planners import IKCell, IKGains, IKTargets

Array = NDArray[np.float64]
Bools = NDArray[np.bool_]
ActionMode = Literal["speeds", "gains"]
ACTION_MODES: tuple[ActionMode, ...] = get_args(ActionMode)

GAIN_RATIO = 4.0
"""By which an action of 1 multiplies a gain, and one of -1 divides it."""
DAMPING_MAX = 0.9
CUT = 1e-9  # of the caps, mean of the joints: less is rounding
UNLIMITED = 10  # control periods in which a joint without a limit of its acceleration is planned to stop


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
    time: Array
    q: Array
    reference: Array
    tip: Array
    target: Array
    error: Array
    capped: Bools
    singular_value: Array
    torque: Array
    demand: Array
    torque_max: Array

    def __post_init__(self) -> None:
        for name in self.__slots__:
            value = getattr(self, name)
            if isinstance(value, np.ndarray):
                value.setflags(write=False)

    @property
    def position_error(self) -> Array:
        """(T+1,) [m]."""
        return np.asarray(np.linalg.norm(self.error[:, :3], axis=1))

    @property
    def orientation_error(self) -> Array:
        """(T+1,) angle [rad]."""
        return np.asarray(np.linalg.norm(self.error[:, 3:], axis=1))

    @property
    def joint_speed(self) -> Array:
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
        mean_position_share, mean_orientation_share: x / (1 + x) of the errors x in units of the cell's scales, mean
            over the last step.
        squares: (2,) of the errors of position and orientation, sums over all ticks so far [m^2, rad^2].
        effort: Mean square of the torques as shares of their limits, over the last step.
        singular_value: The smallest one, of the task's Jacobian, lengths in units of the arm's.
        cut: What limits cut from the speeds asked for, as a share of the caps, mean over the last step.
    """

    def __init__(
        self, cell: IKCell, *, physics: Physics, action_mode: ActionMode, record: bool = False, model_error: float = 0.0
    ) -> None:
        if action_mode not in ACTION_MODES:
            raise UnknownNameError("action mode", str(action_mode), ACTION_MODES)
        self._arm = TrackedArm(cell, physics=physics, model_error=model_error)
        self.physics, self.record, self.action_mode = physics, record, action_mode
        self._scene = self._arm.scene
        self.reset(cell)

    def reset(self, cell: IKCell) -> None:
        """To the start of ``cell`` (the arm is the same), at rest."""
        self.cell, arm = cell, cell.arm
        self._limits = (arm.speed_max, arm.acceleration_max, arm.position_min, arm.position_max)
        unlimited = arm.speed_max / (UNLIMITED * cell.control_period)
        self._braking: Array = np.where(np.isfinite(arm.acceleration_max), arm.acceleration_max, unlimited)
        self._hardness = 1.0  # share of these at which it can stop
        target = cell.target  # copied, so not read-only: the law is compiled for one kind of arrays
        self._targets = IKTargets(
            target.position.copy(), target.rotation.copy(), target.velocity.copy(), target.angular_velocity.copy(), 2,
            cell.physics_tick,
        )  # fmt: skip
        self._ticks = 0
        self.joint_speeds: Array = np.zeros(arm.dof)
        self.squares: Array = np.zeros(2)
        self.mean_position_share = self.mean_orientation_share = self.effort = self.cut = 0.0
        self._arm.place(cell.start)
        rows = np.stack([self._arm.q, self._arm.torque, self._arm.demand], axis=1)
        self._blocks: list[tuple[Array, Array, Array, Array, Bools]] = []
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
    def reference(self) -> Array:
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
    def demand(self) -> Array:
        """(n,) torques asked for in the last tick, before clipping."""
        return np.array(self._arm.demand[0])

    def joint_positions(self) -> Array:
        """(1, n) joint positions now."""
        return self._arm.q.copy()

    @property
    def measured_speeds(self) -> Array:
        """(n,) joint speeds now, the arm's own [rad/s, m/s]."""
        return np.array(self._arm.qd[0])

    def pose_errors(self, q: Array, rows: list[int]) -> Array:
        """From the tip at ``q`` (n,) to the target at each of its ``rows`` (two a tick): (K, 6), as ``error``."""
        target, errors = self.cell.target, np.empty((len(rows), 6))
        pose_errors(
            self._arm.model, np.repeat(q[None], len(rows), axis=0), target.position[rows], target.rotation[rows], 1,
            np.empty((len(rows), 3)), errors,
        )  # fmt: skip
        return errors

    def step(self, action: Array) -> None:
        """Run one control period with an action in [-1, 1]: (n,) ``speeds`` at its end, or (4,) ``gains``."""
        ticks = self.cell.ticks_per_period
        joints = np.empty((ticks, self.cell.arm.dof))
        asked, speeds = (self._ramp if self.action_mode == "speeds" else self._run_law)(action, joints)
        cuts = np.repeat(self._cut(asked, speeds), ticks // len(speeds))
        rows = self._arm.follow(joints)
        while self._arm.clipped and self.physics == "bullet":  # as bodies heavier than believed make them
            k = len(rows)
            self._start_over()
            if k == ticks:
                break
            cuts[k:] = self._cut(asked[-1:], self._brake(joints[k:]))
            rows = np.concatenate([rows, self._arm.follow(joints[k:])])
        self._ticks += ticks
        errors = self._measure(joints, rows, cuts)
        config = self.cell.config
        squares = np.stack([(errors[:, :3] ** 2).sum(axis=1), (errors[:, 3:] ** 2).sum(axis=1)])
        self.squares += squares.sum(axis=1)
        position, orientation = np.sqrt(squares)
        position, orientation = position / config.error_scale_m, orientation / config.error_scale_rad
        self.mean_position_share = float((position / (1.0 + position)).mean())
        self.mean_orientation_share = float((orientation / (1.0 + orientation)).mean())
        self.effort = float(((rows[:, 1] / self._arm.torque_max) ** 2).mean())
        self.cut = float(cuts.mean())

    def _cut(self, asked: Array, speeds: Array) -> Array:
        """What limits cut from speeds, both (L, n): (L,) shares of the caps, mean of the joints."""
        shares = np.minimum(np.abs(asked - speeds) / self.cell.arm.speed_max, 1.0).mean(axis=1)
        return np.where(shares > CUT, shares, 0.0)

    def _start_over(self) -> None:
        """The reference goes on from where the arm is, and as fast."""
        arm, held = self.cell.arm, self._arm
        q, v = (
            np.clip(held.q[0], arm.position_min, arm.position_max),
            np.clip(held.qd[0], -arm.speed_max, arm.speed_max),
        )
        held.reference[:] = q - self.cell.physics_tick * np.array([[2.0], [1.0], [0.0]]) * v
        self.joint_speeds = v
        hardness = hardest_stop(
            arm.model, q, v, self._braking, self._period[0], arm.position_min, arm.position_max, held.coulomb,
            held.torque_max,
        )  # fmt: skip
        self._hardness = float(hardness or HARDNESS[-1])

    def _brake(self, joints: Array) -> Array:
        """References ``joints`` (K, n) towards a stop; their speeds (K, n)."""
        arm, speeds = self.cell.arm, np.empty_like(joints)
        brake(
            self._arm.reference[2], self.joint_speeds, self.cell.physics_tick, 1.0, self._hardness * self._braking,
            arm.speed_max, arm.position_min, arm.position_max, joints, speeds,
        )  # fmt: skip
        self.joint_speeds = speeds[-1].copy()
        return speeds

    @property
    def _period(self) -> tuple[float, float]:
        """Time from one speed to the next, and how late in it a speed holds, as ``allowed_speeds`` has it."""
        return (self.cell.control_period, 0.5) if self.action_mode == "speeds" else (self.cell.physics_tick, 1.0)

    def _ramp(self, action: Array, joints: Array) -> tuple[Array, Array]:
        """References of a period from speeds at its end, as shares of the caps: those speeds, and what they are."""
        cell, reference = self.cell, self._arm.reference[2]
        asked, speeds = (action * cell.arm.speed_max)[None], np.empty((1, cell.arm.dof))
        allowed_speeds(reference, self.joint_speeds, asked[0], *self._period, *self._limits, speeds[0])
        ramp(reference, self.joint_speeds, speeds[0], cell.physics_tick, *self._limits[2:], joints)
        self._hold_back(joints, speeds)
        return asked, speeds

    def _run_law(self, action: Array, joints: Array) -> tuple[Array, Array]:
        """References of a period from the law at every tick, its gains and its damping multiplied; its speeds."""
        cell, law = self.cell, self.cell.config.law
        base = np.array([law.position_gain_1_s, law.approach_gain_1_s, law.normal_gain_1_s, law.damping])
        position, approach, normal, damping = (GAIN_RATIO**action * base).tolist()
        gains = IKGains(position=position, approach=approach, normal=normal)
        compiled = cell.solver.retuned(gains, min(damping, DAMPING_MAX)).law
        asked, speeds = np.empty_like(joints), np.empty_like(joints)
        run_law(
            cell.arm.model, compiled, self._targets, 2 * self._ticks, self._arm.reference[2], self.joint_speeds,
            cell.arm.acceleration_max, joints, asked, speeds,
        )  # fmt: skip
        self._hold_back(joints, speeds)
        return asked, speeds

    def _hold_back(self, joints: Array, speeds: Array) -> None:
        """Draw the references of a period, and their speeds, to where torques can follow; they are this period's."""
        arm, held, period = self.cell.arm, self._arm, self._period
        stopping, slower = np.empty_like(joints), np.empty_like(speeds)
        brake(
            held.reference[2], self.joint_speeds, *period, self._hardness * self._braking, arm.speed_max,
            arm.position_min, arm.position_max, stopping, slower,
        )  # fmt: skip
        hardness = float(hold_back(
            arm.model, joints, speeds, stopping, slower, held.reference, self._braking, period[0], arm.position_min,
            arm.position_max, held.coulomb, held.torque_max, self.cell.physics_tick,
        ))  # fmt: skip
        self._hardness = hardness or self._hardness
        self.joint_speeds = speeds[-1].copy()

    def _measure(self, joints: Array, rows: Array, cuts: Array) -> Array:
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

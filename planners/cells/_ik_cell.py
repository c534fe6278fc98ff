"""An IK cell: one arm whose tip follows a pose over time, and the feedback law that goes with it."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import ClassVar, final

import numpy as np
from numpy.typing import ArrayLike

from armtempo.arrays import Floats
from armtempo.configs import FeedbackLawConfig, IKCellConfig
from armtempo.errors import CollisionError, InfeasibleError, InputError
from armtempo.planners.cells._arm_from_config import arm_from, located
from armtempo.planners.cells._cell import OneArmCell, Sweep
from armtempo.planners.geometry import Motion, PoseTarget, floats, harmonic, pose_matrix, rpy_matrix, through_poses
from armtempo.planners.ik import FeedbackIK, IKGains, IKRun
from armtempo.robots import Arm, Clearance

CHECKED_POSTURES = 200  # postures of the nominal run that are looked at


@dataclass(frozen=True, kw_only=True, eq=False)
@final
class IKCell(OneArmCell[IKCellConfig]):
    """One arm and the pose that its tip is to follow. Make one with ``load_cell`` or ``build_cell``; it never changes.

    Attributes:
        name: The cell's name.
        config: What it was built from; a ``variant`` has another target and start.
        arm: The arm.
        start: (n,) where it starts [rad or m].
        target: What its tip is to follow, sampled at the physics tick; as long as whole control periods.
        solver: The feedback law of the cell.
    """

    config_type: ClassVar = IKCellConfig

    start: Floats
    target: PoseTarget
    solver: FeedbackIK

    @classmethod
    def from_config(cls, config: IKCellConfig) -> IKCell:
        """Build the arm, its target and law, and look at postures of the nominal run; raises as ``load_cell``."""
        with located(f"{config.source}, arm"):
            cell = cls.of(config, arm_from(config, config.arm))
            cell.certify()
        return cell

    @classmethod
    def of(cls, config: IKCellConfig, arm: Arm) -> IKCell:
        """Sample the target and set the law up, as ``config`` says.

        Raises:
            InputError: The start has another number of joints than the arm, or breaks a position limit.
        """
        law = config.law
        solver = FeedbackIK(
            arm,
            IKGains(position=law.position_gain_1_s, approach=law.approach_gain_1_s, normal=law.normal_gain_1_s),
            error=law.error,
            feed_forward=law.feed_forward,
            task=law.task,
            damping=law.damping,
        )
        start = _checked_start(arm, config.arm.start_rad)
        motion, duration = _given_motion(config)
        return cls(
            name=config.name,
            config=config,
            arm=arm,
            start=start,
            target=sample_periods(config, motion, duration),
            solver=solver,
        )

    def variant(self, motion: Motion, duration: float, start: ArrayLike) -> IKCell:
        """The same arm and law with another target: ``motion`` over ``duration`` [s], from ``start`` (n,).

        Raises:
            InputError: As ``of``, or as ``PoseTarget.sample``; the duration is not > 0.
        """
        return replace(
            self, start=_checked_start(self.arm, start), target=sample_periods(self.config, motion, duration)
        )

    @property
    def follows_poses(self) -> bool:
        """Yes."""
        return True

    def sweeps(self, count: int) -> tuple[Sweep]:
        """So many postures of the nominal run, and where the target is meanwhile, for pictures."""
        rows = np.linspace(0, self.ticks, count).round().astype(int)
        return (Sweep(self.nominal.q[rows], self.target.position[2 * rows]),)

    @property
    def ticks(self) -> int:
        """How many the target lasts."""
        return (len(self.target.position) - 1) // 2

    @property
    def duration(self) -> float:
        """How long the target lasts [s]."""
        return self.ticks * self.physics_tick

    @cached_property
    def nominal(self) -> IKRun:
        """The law's own run along the target, tick by tick, without an arm that has to move."""
        return self.solver.track(self.target, self.start)

    def singular_value(self, q: ArrayLike) -> Floats:
        """Smallest singular value (...) of the task's Jacobian at ``q`` (..., n): the ``solver``'s."""
        return self.solver.singular_value(q)

    @property
    def error_scales(self) -> tuple[float, float]:
        """What errors of position [m] and orientation [rad] are measured in."""
        return self.config.error_scale_m, self.config.error_scale_rad

    @property
    def law(self) -> FeedbackLawConfig:
        """Gains, errors and damping of the cell's feedback law."""
        return self.config.law

    @property
    def damping(self) -> float:
        """Smallest singular value from which on the law is not damped."""
        return self.law.damping

    def certify(self) -> None:
        """Look at postures of the nominal run; nothing between them is certified.

        Raises:
            InfeasibleError: The drives cannot hold the arm there.
            CollisionError: It touches itself.
        """
        arm, run = self.arm, self.nominal
        rows = np.unique(np.linspace(0, len(run.q) - 1, CHECKED_POSTURES).round().astype(int))
        q = run.q[rows]
        share = np.abs(arm.inverse_dynamics(q, np.zeros_like(q), np.zeros_like(q))) / arm.torque_max
        k, joint = np.unravel_index(int(share.argmax()), share.shape)
        if not share[k, joint] <= 1.0:
            raise InfeasibleError(
                f"arm {arm.name!r} cannot hold still where the target has it at {run.time[rows[k]]:.4g} s: joint "
                f"{arm.joint_names[joint]!r} needs {share[k, joint]:.4g} times its limit",
                remedy="raise that limit, or move the target or the base",
                time=float(run.time[rows[k]]),
                joint=int(joint),
            )
        clearance = Clearance([arm], ())
        if not clearance.self_pairs(0):
            return
        for row in rows:
            nearest = clearance.self_collision(0, run.q[row])
            if not nearest.distance > 0.0:
                raise CollisionError(
                    f"arm {arm.name!r} touches itself where the target has it at {run.time[row]:.4g} s: "
                    f"{nearest.body_a} and {nearest.body_b}",
                    remedy="start from another posture (arm.start_rad), or move the target",
                    time=float(run.time[row]),
                    bodies=(nearest.body_a, nearest.body_b),
                )


def sample_periods(config: IKCellConfig, motion: Motion, duration: float) -> PoseTarget:
    """A motion at the cell's ticks, over ``duration`` [s] rounded up to whole control periods."""
    if not 0.0 < duration < np.inf:
        raise InputError(f"duration {duration} s", remedy="give a finite duration > 0")
    period = config.control_period_s
    return PoseTarget.sample(motion, max(1, math.ceil(duration / period - 1e-6)) * period, config.physics_tick_s)


def _checked_start(arm: Arm, start: ArrayLike) -> Floats:
    q = floats(start, "start_rad")
    if q.shape != (arm.dof,):
        raise InputError(
            f"start_rad has {q.size} values, and arm {arm.name!r} has {arm.dof} joints", remedy="give one per joint"
        )
    out = np.flatnonzero(~((q >= arm.position_min) & (q <= arm.position_max) & np.isfinite(q)))
    if len(out):
        j = out[0]
        raise InputError(
            f"start_rad: {q[j]:.6g} of joint {arm.joint_names[j]!r} is outside its range "
            f"{arm.position_min[j]:.6g} to {arm.position_max[j]:.6g}",
            remedy="start inside the limits",
        )
    q.setflags(write=False)
    return q


def _given_motion(config: IKCellConfig) -> tuple[Motion, float]:
    given = config.target.harmonic
    if given is not None:
        motion = harmonic(given.center_m, given.amplitude_m, given.rate_rad_s, rpy_matrix(given.rpy_rad))
        return motion, given.duration_s
    poses = config.target.poses
    assert poses is not None  # by the schema
    T = np.array([pose_matrix(pose) for pose in poses])
    times = [pose.time_s for pose in poses]
    return through_poses(times, T[:, :3, 3], T[:, :3, :3]), times[-1]

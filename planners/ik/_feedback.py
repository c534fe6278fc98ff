r"""Inverse kinematics by feedback: a solver that is a dynamical system which tracks (Chung, Ryu, Park).

    q' = J^# [ v; omega ],   v = K_p (P_d - P) + P_d',   omega = K_a a x a_d + K_n a (a . (n x n_d)) + omega_d

P, and the axes n, s, a of the tip come from the forward kinematics of the solver's own state q. The paper's eqs.
(2.10)-(2.16) with both feed-forwards; omega_d is fed as it is, which is exact for any error (a_d + a_d'/K_a, as the
paper's trick would have it, is exact at none only). J^# is damped near singularities: see ``FeedbackIK``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal, TypedDict, Unpack, final

import numpy as np
from numpy.typing import ArrayLike

from armtempo.arrays import Floats, Ints
from armtempo.errors import InputError, RobotError, brief, check_keywords
from armtempo.planners.geometry import PoseTarget, floats, number
from armtempo.planners.ik._law import Law, Targets, law_at
from armtempo.planners.ik._spherical_wrist import SphericalWristIK
from armtempo.planners.ik._track import track_many
from armtempo.robots import Arm, ArmModel

__all__ = [
    "INTEGRATORS",
    "FeedbackIK",
    "IKBounds",
    "IKCaps",
    "IKGains",
    "IKRun",
    "Integrator",
    "TaskName",
    "ranges_near_zero",
]

Integrator = Literal["euler", "heun", "rk4"]
TaskName = Literal["auto", "pose", "position"]
INTEGRATORS: tuple[Integrator, ...] = ("euler", "heun", "rk4")


@dataclass(frozen=True, kw_only=True, slots=True)
class IKGains:
    """Gains [1/s]; by default the paper's. With ``quaternion`` errors ``approach`` serves all axes."""

    position: float = 50.9
    approach: float = 20.0
    normal: float = 25.5

    def __post_init__(self) -> None:
        for name in ("position", "approach", "normal"):
            value = floats(getattr(self, name), f"gain {name}")
            if value.shape or not 0.0 < value < np.inf:
                raise InputError(f"gain {name} = {getattr(self, name)}", remedy="give a gain > 0")


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class IKCaps:
    """What keeps speeds finite: see ``FeedbackIK``."""

    damping: float = 0.02
    """Singular value of the scaled Jacobian below which it is damped; in (0, 1)."""
    linear_speed_max: float = np.inf
    """[m/s]."""
    angular_speed_max: float = np.inf
    """[rad/s]."""
    joint_speed_max: ArrayLike | None = None
    """(n,) [rad/s or m/s]; None: the arm's."""

    def __post_init__(self) -> None:
        for name in ("damping", "linear_speed_max", "angular_speed_max"):
            value = number(getattr(self, name), name)
            if not value > 0.0:
                raise InputError(f"{name} = {value}", remedy="give a number > 0")
        if self.damping >= 1.0:
            raise InputError(f"damping = {self.damping}", remedy="give a damping < 1")
        if self.joint_speed_max is not None and (floats(self.joint_speed_max, "joint_speed_max") <= 0.0).any():
            raise InputError("joint_speed_max is not > 0", remedy="give speeds > 0")


class IKCapKeywords(TypedDict, total=False):
    """``IKCaps`` as keywords."""

    damping: float
    linear_speed_max: float
    angular_speed_max: float
    joint_speed_max: ArrayLike | None


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class IKBounds:
    """Upper bounds of a run's errors and speeds; what they stand on is said in ``FeedbackIK``."""

    position: Floats
    """(T,) [m]."""
    approach: Floats
    """(T,) angle between the approach axes [rad]; pi: none."""
    orientation: Floats
    """(T,) angle of the whole rotation [rad]; pi: none."""
    position_between: Floats
    """(T,) [m] from each sample to the next, at every instant, if the joints move evenly there."""
    joint_speed: Floats
    """(n,) [rad/s or m/s]."""
    ultimate_position: float
    """[m] limit of the law's own error, after a long time and without an integrator: max |P_d'| / K_p, 0 if fed."""
    ultimate_approach: float
    """[rad] asin(w/K_a) for a target that turns at w [rad/s]; pi for w > K_a, where lock is lost; 0 if fed.

    With ``quaternion`` errors 2 asin(w/2K_a), and pi for w > 2K_a."""
    ultimate_orientation: float
    """[rad] likewise for the whole rotation."""
    rounding: float
    """[m] positions so far from the origin are no nearer than this to what they stand for; ``held`` allows for it."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class IKRun:
    """A finished run; arrays are read-only."""

    time: Floats
    """(T,) [s]."""
    q: Floats
    """(T, n) [rad or m]."""
    qd: Floats
    """(T, n) the law's joint speeds at the samples; steps are made at ``diff(q) / step``, which keep the caps, too."""
    position_error: Floats
    """(T,) [m]."""
    approach_error: Floats
    """(T,) [rad]."""
    orientation_error: Floats
    """(T,) angle of the whole rotation [rad]."""
    flags: Ints
    """(T,) bits of what a step did beyond the plain law; ``share`` counts them."""
    bounds: IKBounds

    @property
    def held(self) -> dict[str, bool]:
        """Did each bound hold, up to rounding."""
        b, step = self.bounds, self.time[1] - self.time[0]
        moved = np.abs(np.diff(self.q, axis=0)).max(axis=0, initial=0.0) / step
        moved = moved - 4 * np.finfo(float).eps * np.abs(self.q).max(axis=0) / step
        return {
            "position": bool((self.position_error <= b.position * (1 + 1e-9) + 1e-12 + b.rounding).all()),
            "approach": bool((self.approach_error <= b.approach * (1 + 1e-9) + 1e-12).all()),
            "orientation": bool((self.orientation_error <= b.orientation * (1 + 1e-9) + 1e-12).all()),
            "joint_speed": bool((np.maximum(moved, np.abs(self.qd).max(axis=0)) <= b.joint_speed * (1 + 1e-9)).all()),
        }

    @property
    def share(self) -> dict[str, float]:
        """Fraction of the samples where the law was damped, capped in twist or joint speed, at a limit, in escape.

        In escape it leaves a half turn, or a dead end.
        ``projected``, ``stray``: the task leaves out a part of the turning, or of the velocity, that was asked for.
        The classical solvers cap nothing: there ``speed`` and ``limit`` say that it went beyond, and ``unreached``
        that a sample was not reached.
        """
        names = ("damped", "twist", "speed", "limit", "escape", "projected", "stray", "unreached")
        return {name: float(np.mean(self.flags & (1 << bit) != 0)) for bit, name in enumerate(names)}


@final
class FeedbackIK:
    """The tracker for one arm: ``track`` follows a sampled pose from a posture.

    *Damping.* Velocities are divided by the arm's ``length`` (its reach), so that singular values s have one unit.
    Directions with s above ``damping`` are inverted exactly, those below with 2 s / (damping^2 + s^2): hence
    ``|q'| <= |x'| / damping`` for any twist x', and what spare joints are drawn with beside it.
    Directions that the feedback alone would overshoot within a step are damped more (damping >= sqrt(2 dt |K e|)): no
    chatter at the edge of the workspace. An arm that is pulled straight stops just short of it, so that it comes back
    with its elbow on the same side.
    *Caps.* The twist's halves are shortened to ``linear_speed_max`` and ``angular_speed_max``, then all joint speeds in
    one ratio, to the arm's ``speed_max`` or the one given: never exceeded, in no stage of any integrator. Joints stop
    at their position limits, and the others make up for them as they can.
    *Dead ends.* A run that makes no headway towards a target at rest for 10 / K (a straight elbow, a joint at its
    limit, a singular wrist) looks for a posture that has the pose: by bounded least squares from where the arm is, then
    from other postures, the same each time. It goes there on a straight line of joints, inside the caps, and the law
    takes over again. If there is none nothing changes. ``joint_speeds``, which remembers nothing, is the law alone.
    *180 degrees.* Where the law sees no error in a half turn, it is told one of 0.02: it leaves in about 4/K.

    *Bounds.* The law by itself, exactly: the approach axes' angle d obeys ``d' = -K_a sin d + w``; the whole rotation's
    angle ``d' <= -K sin d + K_n / sqrt(27) (1 - cos d) + w`` with K = min(K_a, K_n) (the gains' product of axes couples
    the paper's two angles: its eq. 3.5 is no bound); the position error ``e' = -K_p e``, or is within |P_d'| / K_p of
    that without feed-forward. w is the target's turning, or 0 if fed forward. With ``quaternion`` errors
    ``d' = -2 K_a sin(d/2) + w``. These give the ultimate bounds.

    The bounds of a run go from sample to sample, from the error at the start on: what the law leaves of the bound
    before, and what the step did beyond the law's feedback. That is the target's step less the tip's, with the tip's
    worked out from the joints' step, the Jacobian and the next derivatives of its place (two) and turning (one), and
    the ones after these bounded over all postures. No pose of the tip enters after the start, except through the
    feedback that the law asked for, so that poses are what they can be checked with; the joints' steps do, so that they
    are true in all steps, damped or capped or not, but are known after the run only. Between samples they add an eighth
    of the greatest accelerations; the target's is that of ``PoseTarget``. Joint speeds: the caps, always.

    Args:
        arm: Any serial arm.
        gains: K_p, K_a, K_n.
        error: ``axes``: approach and normal, the paper's; ``quaternion``: 2 K sin(angle/2) about the shortest way.
        feed_forward: Of both velocities, where the target has them.
        task: ``pose``, ``position`` (orientation is left alone), or ``auto``: of the pose, what the arm can control
            (SCARA: position and turning about its axis; fewer joints than that: position); or (m, 6) orthonormal rows
            that pick linear (first three) or angular components in world axes.
        point: ``wrist``: K_p pulls the wrist's centre, P_w = P - r a (the paper's eq. 4.2), of an arm that
            ``SphericalWristIK`` knows; targets stay the tip's. Turning the tool then leaves the first three joints
            alone. Position errors and bounds are the centre's: the tip is off by 2 |r| sin(angle / 2) more at most,
            with the angle of the whole rotation. The same thing where the tip is the centre.
        posture: (n,) [rad or m] that spare joints are drawn to; the middle of their ranges by default (without one,
            what is nearest to zero).
        posture_gain: [1/s]; 0: none. It acts where the arm has more joints than the task has rows.
        **caps: ``damping`` (0.02): singular value of the scaled Jacobian below which it is damped, in (0, 1).
            ``linear_speed_max`` [m/s], ``angular_speed_max`` [rad/s]: none by default.
            ``joint_speed_max`` (n,) [rad/s or m/s]: the arm's by default.

    Attributes:
        task: (m, 6) orthonormal rows of what is controlled.
        length: [m] that velocities are divided by.
        law: The same constants for compiled loops (``law_within``).

    Raises:
        InputError: A number that cannot be used; the message names it.
        UnknownNameError: There is no such keyword; the message names the nearest one.
        RobotError: ``wrist``, and the arm has no spherical one; a joint slides without limits behind one that turns.
    """

    def __init__(
        self,
        arm: Arm,
        gains: IKGains | None = None,
        *,
        error: Literal["axes", "quaternion"] = "axes",
        feed_forward: bool = True,
        task: TaskName | ArrayLike = "auto",
        point: Literal["tip", "wrist"] = "tip",
        posture: ArrayLike | None = None,
        posture_gain: float = 1.0,
        **caps: Unpack[IKCapKeywords],
    ) -> None:
        check_keywords(FeedbackIK, caps, IKCapKeywords.__annotations__)
        limits = IKCaps(**caps)
        if not 0.0 <= number(posture_gain, "posture_gain") < np.inf:
            raise InputError(f"posture_gain = {posture_gain}", remedy="give a gain >= 0")
        if error not in ("axes", "quaternion"):
            raise InputError(f"error {brief(error)}", remedy="use 'axes' or 'quaternion'")
        if point not in ("tip", "wrist"):
            raise InputError(f"point {brief(point)}", remedy="use 'tip' or 'wrist'")
        self.arm = arm
        self.gains = gains or IKGains()
        self._offset = SphericalWristIK(arm).wrist_in_tip if point == "wrist" else np.zeros(3)
        tip = arm.model.tip_p + arm.model.tip_R @ self._offset
        tip.setflags(write=False)  # as the arm's own: the loops are compiled once only
        self._model = arm.model._replace(tip_p=tip)
        levers, self.length = _levers_of(arm, self._model)
        self.task = _task(arm, task)
        rest = self._joints(_middle_of(arm) if posture is None else posture, "posture")
        if not np.isfinite(rest).all():
            raise InputError(f"posture {rest} is not finite", remedy="give finite joint positions")
        given = limits.joint_speed_max
        speed = self._joints(arm.speed_max if given is None else given, "joint_speed_max")
        turning = ~arm.model.prismatic
        self.law = Law(
            position_gain=float(self.gains.position),
            approach_gain=float(self.gains.approach),
            normal_gain=float(self.gains.normal),
            quaternion=error == "quaternion",
            feed_forward=bool(feed_forward),
            task=self.task,
            length=self.length,
            damping=float(limits.damping),
            pull_max=float(speed[turning].min()) if turning.any() else np.inf,
            linear_max=float(limits.linear_speed_max),
            angular_max=float(limits.angular_speed_max),
            speed_max=speed,
            position_min=arm.position_min,
            position_max=arm.position_max,
            posture=rest,
            posture_gain=float(posture_gain) if arm.dof > len(self.task) else 0.0,
            levers=levers,
        )

    def singular_value(self, q: ArrayLike) -> Floats:
        """Smallest singular value (...) at ``q`` (..., n) of what ``damping`` is compared with: the scaled Jacobian.

        Its rows are the task's, of the point that is tracked; lengths are in units of the arm's.
        """
        J = self.arm.jacobian(q)
        if self._offset.any():
            lever = self.arm.tip_pose(q)[..., :3, :3] @ self._offset
            J[..., :3, :] += np.cross(J[..., 3:, :], lever[..., None], axis=-2)
        J[..., :3, :] /= self.length
        return np.asarray(np.linalg.svd(self.task @ J, compute_uv=False)[..., -1], dtype=np.float64)

    def _joints(self, values: ArrayLike, what: str) -> Floats:
        array = floats(values, what)
        if array.shape != (self.arm.dof,) or np.isnan(array).any():
            raise InputError(f"{what} has shape {array.shape} or NaN", remedy=f"give ({self.arm.dof},) numbers")
        array.setflags(write=False)
        return array

    def track(self, target: PoseTarget, start: ArrayLike, *, integrator: Integrator = "rk4") -> IKRun:
        """Follow ``target`` from the posture ``start`` (n,).

        Raises:
            InputError: Unknown integrator; ``start`` has the wrong shape or breaks a position limit.
        """
        return self.track_many([target], floats(start, "start")[None], integrator=integrator)[0]

    def track_many(
        self, targets: Sequence[PoseTarget], starts: ArrayLike, *, integrator: Integrator = "rk4"
    ) -> tuple[IKRun, ...]:
        """``track`` for targets and starts (B, n) in pairs, in one compiled loop; targets of one step and length.

        Raises:
            InputError: As of ``track``; targets whose steps or lengths differ.
        """
        if integrator not in INTEGRATORS:
            raise InputError(f"integrator {brief(integrator)}", remedy=f"use one of {', '.join(INTEGRATORS)}")
        arm, law = self.arm, self.law
        first = floats(starts, "starts")
        if not targets or first.shape != (len(targets), arm.dof) or not np.isfinite(first).all():
            raise InputError(
                f"{len(targets)} targets, starts of shape {first.shape} or not finite",
                remedy=f"give one start of {arm.dof} joints for each target",
            )
        out = np.argwhere((first < arm.position_min) | (first > arm.position_max))
        if len(out):
            row, joint = out[0]
            raise InputError(
                f"start {first[row, joint]:.6g} of joint {arm.joint_names[joint]!r} is outside its range",
                remedy="start inside the limits",
            )
        h, differentiated = targets[0].step, targets[0].differentiated
        if any(t.step != h or len(t.position) != len(targets[0].position) for t in targets):
            raise InputError("the targets differ in step or length", remedy="sample them alike")
        if any(t.differentiated != differentiated for t in targets):
            raise InputError("some targets have rates, some have none", remedy="give rates for all or none")
        if differentiated:
            law = law._replace(feed_forward=False)
        targets = [self._of_point(t) for t in targets]
        samples = Targets(
            position=np.stack([t.position for t in targets]),
            rotation=np.stack([t.rotation for t in targets]),
            velocity=np.stack([t.velocity for t in targets]),
            angular_velocity=np.stack([t.angular_velocity for t in targets]),
            stride=2,
            step=h,
        )
        lead = (len(targets), (len(targets[0].position) + 1) // 2)
        q, qd, flags = np.empty((*lead, arm.dof)), np.empty((*lead, arm.dof)), np.zeros(lead, dtype=np.int64)
        errors, bounds = np.empty((*lead, 3)), np.empty((*lead, 4))
        q[:, 0] = first
        track_many(self._model, law, INTEGRATORS.index(integrator), samples, q, qd, errors, bounds, flags)
        for array in (q, qd, errors, bounds, flags):
            array.setflags(write=False)
        return tuple(
            IKRun(
                time=target.time,
                q=q[b],
                qd=qd[b],
                position_error=errors[b, :, 0],
                approach_error=errors[b, :, 1],
                orientation_error=errors[b, :, 2],
                flags=flags[b],
                bounds=_bounds(law, target, bounds[b]),
            )
            for b, target in enumerate(targets)
        )

    def _of_point(self, target: PoseTarget) -> PoseTarget:
        """The target of the point that is tracked."""
        if not self._offset.any():
            return target
        arm = target.rotation @ self._offset
        turning = np.linalg.norm(target.angular_velocity, axis=1).max()
        turning += 0.25 * target.step * target.angular_acceleration  # between the rows
        return replace(
            target,
            position=target.position + arm,
            velocity=target.velocity + np.cross(target.angular_velocity, arm),
            acceleration=target.acceleration
            + float(np.linalg.norm(self._offset) * (target.angular_acceleration + turning**2)),
        )

    def joint_speeds(self, q: ArrayLike, target: PoseTarget, index: int) -> tuple[Floats, int]:
        """The law once, at the posture q (n,): joint speeds (n,) for row ``index`` of the target, and its flags.

        For use on line: a loop that moves at these speeds for one step of the target is ``track`` with ``euler``, on
        every second row, if it comes to no dead end.

        Raises:
            InputError: q has the wrong shape, or is not finite; there is no such row.
        """
        q = self._joints(q, "q")
        if not np.isfinite(q).all() or not 0 <= index < len(target.position):
            raise InputError(
                f"q = {q}, row {index} of a target of {len(target.position)}", remedy="give finite q, an existing row"
            )
        law = self.law._replace(feed_forward=False) if target.differentiated else self.law
        # Copies, which are writable as a run's own arrays are: the law is compiled once only.
        whole = (target.position, target.rotation, target.velocity, target.angular_velocity)
        p, R, v, w = (a[index : index + 1].copy() for a in whole)
        if self._offset.any():
            p, v = p + R @ self._offset, v + np.cross(w, R @ self._offset)
        qd = np.empty(self.arm.dof)
        here = Targets(position=p, rotation=R, velocity=v, angular_velocity=w, stride=2, step=target.step)
        return qd, int(law_at(self._model, law, q.copy(), here, 0, qd))


def _bounds(law: Law, target: PoseTarget, bounds: Floats) -> IKBounds:
    v = w = 0.0
    if not law.feed_forward:  # rates between the rows: from a row at most a quarter of a step away
        v, w = (float(np.linalg.norm(rate, axis=1).max()) for rate in (target.velocity, target.angular_velocity))
        v, w = v + 0.25 * target.step * target.acceleration, w + 0.25 * target.step * target.angular_acceleration
    between = bounds[:, 3] + 0.125 * target.step**2 * target.acceleration
    between.setflags(write=False)
    return IKBounds(
        position=bounds[:, 0],
        approach=bounds[:, 1],
        orientation=bounds[:, 2],
        position_between=between,
        joint_speed=law.speed_max,
        ultimate_position=v / law.position_gain,
        ultimate_approach=_ultimate(law, w, whole=False),
        ultimate_orientation=_ultimate(law, w, whole=True),
        rounding=8 * float(np.finfo(float).eps * np.linalg.norm(target.position, axis=1).max()),
    )


def _ultimate(law: Law, w: float, *, whole: bool) -> float:
    """Where ``d' = -K sin d + cross (1 - cos d) + w`` comes to rest [rad]; pi: nowhere."""
    if law.quaternion:
        return 2 * float(np.arcsin(0.5 * w / law.approach_gain)) if w <= 2 * law.approach_gain else np.pi
    gain = min(law.approach_gain, law.normal_gain) if whole else law.approach_gain
    cross = law.normal_gain / np.sqrt(27.0) if whole else 0.0
    size = np.hypot(gain, cross)
    if w + cross > size:
        return np.pi
    return float(np.arcsin((w + cross) / size) - np.arctan2(cross, gain))


def ranges_near_zero(arm: Arm, widest: ArrayLike) -> tuple[Floats, Floats]:
    """Lowest and highest (n,) of each joint, at most ``widest`` from zero, or from the limit that is nearest to it."""
    centre = np.clip(0.0, arm.position_min, arm.position_max)
    return np.maximum(arm.position_min, centre - widest), np.minimum(arm.position_max, centre + widest)


def _reach_of(arm: Arm) -> tuple[Floats, Floats]:
    """Orthonormal rows (r, 3) of the velocities, and of the angular ones, that the tip can have in some posture."""
    low, high = ranges_near_zero(arm, 3.0)
    J = arm.jacobian(np.random.default_rng(0).uniform(low, high, (20, arm.dof)))
    return _span(J[:, :3].transpose(1, 0, 2).reshape(3, -1)), _span(J[:, 3:].transpose(1, 0, 2).reshape(3, -1))


def _span(columns: Floats) -> Floats:
    """Orthonormal rows (r, 3) that span columns (3, k); all of space as unit axes."""
    U, s, _ = np.linalg.svd(columns, full_matrices=False)
    rank = int((s > 1e-9 * max(s[0], 1e-12)).sum())
    return np.eye(3) if rank == 3 else np.asarray(U[:, :rank].T)


def _middle_of(arm: Arm) -> Floats:
    """(n,) of the joints' ranges; of those without one, what is nearest to zero."""
    low, high = arm.position_min, arm.position_max
    finite = np.isfinite(low) & np.isfinite(high)
    return np.clip(0.5 * (np.where(finite, low, 0.0) + np.where(finite, high, 0.0)), low, high)


def _levers_of(arm: Arm, model: ArmModel) -> tuple[Floats, float]:
    """(n,) how far a unit of each joint moves the model's tip at most [m]; its reach: the longest of turning joints.

    Raises:
        RobotError: A joint slides without limits behind one that turns.
    """
    steps = np.linalg.norm(np.vstack([model.placement_p[1:], model.tip_p]), axis=1)
    extent = np.maximum(np.abs(arm.position_min), np.abs(arm.position_max))
    steps[:-1] += np.where(model.prismatic[1:], extent[1:], 0.0)
    beyond = np.cumsum(steps[::-1])[::-1]  # from each joint to the tip, at most
    turning = ~model.prismatic
    reach = float(beyond[turning].max()) if turning.any() else 1.0
    if not np.isfinite(reach):
        raise RobotError(
            f"arm {arm.name!r} has no reach: a joint slides without limits behind one that turns",
            remedy="give the sliding joint position limits",
            element=arm.name,
        )
    return np.where(model.prismatic, 1.0, beyond), reach


def _task(arm: Arm, task: TaskName | ArrayLike) -> Floats:
    """(m, 6) orthonormal rows."""
    if isinstance(task, str):
        if task not in ("auto", "pose", "position"):
            raise InputError(f"task {brief(task)}", remedy="use 'auto', 'pose', 'position' or (m, 6) rows")
        rows = np.eye(6)[: 3 if task == "position" else 6]
        if task == "auto":
            linear, angular = _reach_of(arm)
            if len(linear) + len(angular) > arm.dof:
                angular = angular[:0]
            rows = np.zeros((len(linear) + len(angular), 6))
            rows[: len(linear), :3], rows[len(linear) :, 3:] = linear, angular
    else:
        rows = floats(task, "task")
        if rows.ndim != 2 or rows.shape[1] != 6 or not 1 <= len(rows) <= 6 or not np.isfinite(rows).all():
            raise InputError(f"task of shape {rows.shape}", remedy="give (m, 6) finite numbers, m = 1 to 6")
        mixed = rows[:, :3].any(axis=1) & rows[:, 3:].any(axis=1)
        if mixed.any() or np.abs(rows @ rows.T - np.eye(len(rows))).max() > 1e-9:
            raise InputError(
                "task rows are not orthonormal, or mix metres and radians", remedy="give unit rows of one kind each"
            )
    rows = np.ascontiguousarray(rows)
    rows.setflags(write=False)
    return rows

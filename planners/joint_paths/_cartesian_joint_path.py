r"""The joint path of any arm whose tip follows a Cartesian path, by feedback inverse kinematics.

``FeedbackIK`` tracks the poses along a fine grid, with lambda for time; Newton's method takes its samples onto the path
(the task's error goes to rounding), and between them it starts on the quintics through the samples. So the joints are
those of the pose at any lambda, and their derivatives are exact:

    q' = J^-1 t        q'' = J^-1 (t' - J' q')          t = (p', w), the twist by lambda

A redundant arm moves in its spare directions as the tracker had it: between two samples ``N^T (q - r(lambda)) = 0`` is
added to the task, with r the quintic and N the null space of the task's Jacobian at the first of them. r meets the path
at the samples in value, slope and second derivative, so the joints are C2 there for any N.

Where a piece meets singular postures it is walked through, if it can be: see ``SingularWalk``.
"""

from __future__ import annotations

import logging
from typing import final

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from armtempo.arrays import Bools, Floats, Ints
from armtempo.errors import InputError, PathError, RobotError, brief
from armtempo.planners.geometry import PoseTarget, RangeMax, floats
from armtempo.planners.ik import FeedbackIK, IKGains, IKRun, SphericalWristIK
from armtempo.planners.ik.kernels import LIMIT
from armtempo.planners.joint_paths import _cartesian_joint_kernels as loops
from armtempo.planners.joint_paths._joint_path import AbstractJointPath
from armtempo.planners.joint_paths._planar_pair import check_position_limits
from armtempo.planners.joint_paths._pose_path import PosePath, TipSegments, as_pose_path
from armtempo.planners.joint_paths._singular_walk import SINGULAR_ZONE, SingularWalk, Walk, crossed
from armtempo.robots import Arm

__all__ = ["CartesianJointPath"]

LOG = logging.getLogger("armtempo")

FIRST_INTERVALS = 512  # of a path at first, and
INTERVALS_MIN, INTERVALS_MAX = 8, 2**13  # of one of its pieces
MIDDLE_ERROR_MAX = 1e-5  # [rad, m] of quintics in the middle of intervals: one step of Newton from the path
NEAR_START = 0.25  # [rad, m] how far a joint may be moved onto the start of the path, and
START_ROUNDING = 1e-3  # how far without a word
LEFT_OUT_ERROR_MAX = 1e-6  # [rad, m] of the tip, where the task leaves that out of the pose
SINGULAR_DISTANCE = 1e-3  # [rad, length] a tip so near its goal needs more than NEAR_START of a joint next to one only
SPEED_BOUND_SLACK = 0.05  # of the fastest joint's speed: what bounds may exceed speeds in an interval's middle by
SPEED_BOUND_HALVINGS = 14  # of an interval, for such bounds
WALKED_START_ERROR_MAX = 1e-6  # [rad, m] of joints from where a walk through a singular posture begins to the start
WALKED_SLOPE_ERROR_MAX = 1e-5  # of the fastest joint's slope, where one piece goes on from another
WALKED_ERROR_MAX = 1e-12  # [rad, m] of the tip along such a walk
TRACKER_GAIN = 0.25  # per step
SETTLING_STEPS = 2000  # to get to a pose, if that can be
FALLING_SHARE = 1e-3  # of what is left then, over the last tenth of them: it goes on. Measured: > 5e-2, or < 1e-5
POSTURE_GAIN = 2.0  # [1/m] at which a redundant arm is drawn to its posture


@final
class CartesianJointPath(AbstractJointPath):
    """Joints whose tip follows a Cartesian path: lines, arcs, chains of them, blended corners, or poses of your own.

    An arm with six joints keeps position and orientation. One with more also moves its spare joints, as little as it
    can (least squares) while it is drawn towards ``posture``. One with fewer keeps what it can: the position, and the
    turning about its axis if it is a SCARA (``task="auto"``); what is spare then is spare, too.

    Args:
        arm: Any serial arm.
        cartesian: Where the tip goes [m]. Its orientation is the path's own, if it has one (``BlendedPath`` with
            ``orientation``, ``PosePath``: in world axes), or that of ``start``, kept.
        start: (n,) joint positions at its start [rad or m]; they choose the branch. They may be off by rounding, or a
            little more: no joint is moved by more than 0.25 onto the path, and by more than 0.001 not without a warning
            in the log (``moved``).
        task: ``auto``, ``pose`` or ``position``, as of ``FeedbackIK``.
        speed_min: Lambda per second [m/s] that the joints' speed limits must allow everywhere. Where they do not, the
            path is refused: it passes too near a singularity (or turns the tool too far in too short a way).
        posture: (n,) that spare joints are drawn to; ``start`` by default.

    Attributes:
        station: (M + 1,) grid [m].
        moved: (n,) what ``start`` was moved by onto the path [rad or m].

    Raises:
        InputError: A number that cannot be used; the message names it.
        PathError: ``start`` is not on the path; the path leaves the workspace, comes too near a singularity that it
            cannot pass, or breaks a joint's position limit; it turns the tool as the arm cannot. The message names the
            station and the reason (``data``: arm, station, reason), and the two postures between which the joints would
            have to jump (``before``, ``after``).
    """

    def __init__(
        self,
        arm: Arm,
        cartesian: TipSegments | PosePath,
        start: ArrayLike,
        *,
        task: str = "auto",
        speed_min: float = 0.02,
        posture: ArrayLike | None = None,
    ) -> None:
        if not 0.0 < speed_min < np.inf:
            raise InputError(f"speed_min = {speed_min}", remedy="give a speed > 0")
        if not isinstance(task, str) or task not in ("auto", "pose", "position"):
            raise InputError(f"task {brief(task)}", remedy="use 'auto', 'pose' or 'position'")
        first, rest = floats(start, "start"), floats(start if posture is None else posture, "posture")
        for name, q in (("start", first), ("posture", rest)):
            if q.shape != (arm.dof,) or not np.isfinite(q).all():
                raise InputError(
                    f"{name} of shape {q.shape} or not finite", remedy=f"give one position for each of {arm.dof} joints"
                )
        self.arm, self.cartesian, self.dof = arm, cartesian, arm.dof
        self._poses = as_pose_path(cartesian, arm.tip_pose(first)[:3, :3])
        self.length = float(self._poses.length)
        self.breakpoints = np.array(self._poses.breakpoints, dtype=np.float64)
        self.breakpoints.setflags(write=False)
        self._tracker = FeedbackIK(
            arm,
            # per metre: as stiff as the coarsest step allows, so that Newton is left with little
            IKGains(**dict.fromkeys(("position", "approach", "normal"), TRACKER_GAIN * FIRST_INTERVALS / self.length)),
            error="quaternion",
            task=task,
            damping=1e-3,
            joint_speed_max=np.full(arm.dof, np.inf),
            posture=rest,
            posture_gain=POSTURE_GAIN,
        )
        self._task, self._speed_min = self._tracker.task, speed_min
        if len(self._task) > arm.dof:
            raise PathError(
                f"arm {arm.name!r} has {arm.dof} joints, its task {len(self._task)} rows",
                remedy="use task='auto' or 'position'",
                arm=arm.name,
                reason="task",
            )
        self._check_turning()
        self._track(self._on_start(first))
        self._check_beside(self.station, self._nodes[0])
        self._check_speed(self.station, self._nodes[1])
        self._bound_speeds()
        check_position_limits(arm, self, self.station)

    # -- building

    def _refuse(self, station: float, reason: str, what: str, remedy: str, **data: object) -> PathError:
        return PathError(
            f"path of arm {self.arm.name!r} {what} (station {station:.4g} m)",
            remedy=remedy,
            arm=self.arm.name,
            station=float(station),
            reason=reason,
            **data,
        )

    def _check_turning(self) -> None:
        """Refuse a path that turns the tool about axes that the task leaves out, unless it leaves out them all."""
        rows = self._task[:, 3:]
        rows = rows[rows.any(axis=1)]
        if len(rows) in (0, 3):
            return
        s = np.union1d(np.linspace(0.0, self.length, 257), self.breakpoints)
        turning = self._poses.poses(s).turning
        left = np.linalg.norm(turning - turning @ rows.T @ rows, axis=1)
        k = int(left.argmax())
        if left[k] > 1e-9 * (1.0 + np.abs(turning).max()):
            axis = np.round(rows[0], 6).tolist()
            raise self._refuse(
                s[k],
                "turning",
                f"turns the tool by {left[k]:.4g} rad/m about axes that the arm has not: it turns it about {axis} only",
                "give orientations that differ by a turn about that axis",
            )

    def _on_start(self, first: Floats) -> Floats:
        """The start, moved onto the path."""
        arm = self.arm
        self._check_range(first)
        curve = np.zeros((1, 6, self.dof))
        curve[0, 0] = first
        still = self._reference_of(np.array([0.0, self.length]), curve, self._null_space(first[None]))
        if self.dof == len(self._task) and self._tracker.singular_value(first) < SINGULAR_ZONE:
            still = self._with_lost(still, np.array([True]), first[None])
        q, _, _, off = self._follow(still, np.zeros(1), np.zeros(1, dtype=np.int64), False)
        missed = self._miss(np.zeros(1), q if off[0] <= NEAR_START else first[None])
        away, turned = np.linalg.norm(missed.reshape(2, 3), axis=1).tolist()
        if off[0] <= NEAR_START:
            self._check_beside(np.zeros(1), q)
        elif away <= SINGULAR_DISTANCE * self._tracker.length and turned <= SINGULAR_DISTANCE:
            raise self._singular(0.0, first, None)
        if not off[0] <= NEAR_START or turned > 1.0:  # Newton takes half a turn for none
            raise self._refuse(
                0.0,
                "start",
                f"does not begin at the start posture, whose tip is {away:.4g} m and {turned:.4g} rad from it",
                "give joint positions that put the tip there",
            )
        self._check_range(q[0])
        on_path = np.asarray(np.clip(q[0], arm.position_min, arm.position_max))
        self.moved = on_path - first
        self.moved.setflags(write=False)
        joint = int(np.abs(self.moved).argmax())
        if abs(self.moved[joint]) > START_ROUNDING:
            LOG.warning(
                "start of arm %r is off its path: joint %r was moved by %.4g from %.6g onto it",
                arm.name, arm.joint_names[joint], self.moved[joint], first[joint],
            )  # fmt: skip
        return on_path

    def _miss(self, station: Floats, q: Floats) -> Floats:
        """What the tip at joints q (S, n) lacks to the poses (S, 6) [m, rad]; no turning where the task has none."""
        tip, poses = self.arm.tip_pose(q), self._poses.poses(station)
        turned = Rotation.from_matrix(poses.rotation @ tip[:, :3, :3].transpose(0, 2, 1)).as_rotvec()
        return np.concatenate([poses.position - tip[:, :3, 3], turned * self._task[:, 3:].any()], axis=1)

    def _check_beside(self, station: Floats, q: Floats) -> None:
        """Refuse joints q (S, n) whose tip is off the poses where the task leaves that out."""
        missed = self._miss(station, q)
        beside = (missed - missed @ self._task.T @ self._task).reshape(-1, 2, 3)
        k, part = np.unravel_index(int(np.linalg.norm(beside, axis=2).argmax()), beside.shape[:2])
        off = float(np.linalg.norm(beside[k, part]))
        if off <= LEFT_OUT_ERROR_MAX:
            return
        where = float(station[k])
        if part == 0:
            what = f"leaves the workspace: it is {off:.4g} m beside all that the tip can reach"
            raise self._refuse(where, "workspace", what, "move the path or the base", distance_m=off)
        what = f"turns the tool by {off:.4g} rad about axes that the arm has not"
        raise self._refuse(where, "turning", what, "give the orientation at start, or turns of it about the arm's axis")

    def _check_range(self, start: Floats) -> None:
        arm, beyond = self.arm, 1e-9
        out = np.flatnonzero((start < arm.position_min - beyond) | (start > arm.position_max + beyond))
        if len(out):
            raise self._refuse(
                0.0,
                "limit",
                f"starts outside the range of joint {arm.joint_names[out[0]]!r}: {start[out[0]]:.4g}",
                "start inside the limits",
                joint=int(out[0]),
            )

    def _null_space(self, q: Floats) -> Floats:
        """N (K, n, spare) at joints q (K, n)."""
        spare = self.dof - len(self._task)
        if not spare:
            return np.empty((len(q), self.dof, 0))
        rows = np.linalg.svd(self._task @ self.arm.jacobian(q))[2]
        return np.ascontiguousarray(rows[:, len(self._task) :].transpose(0, 2, 1))

    def _reference_of(self, station: Floats, curve: Floats, null: Floats) -> loops.Reference:
        """Without rows that are lost."""
        count = len(curve)
        return loops.Reference(
            station=station,
            curve=curve,
            null=null,
            lost=np.zeros((count, len(self._task))),
            idle=np.zeros((count, self.dof)),
        )

    def _with_lost(self, reference: loops.Reference, where: Bools, q: Floats) -> loops.Reference:
        """The reference with a row lost in the intervals (M,) ``where`` so, as it is at joints q (M, n)."""
        walk = self._walk_over(np.zeros(2), np.zeros((3, 6)))
        lost, idle = reference.lost.copy(), reference.idle.copy()
        for k in np.flatnonzero(where):
            lost[k], idle[k] = walk.lost(q[k])
        return reference._replace(lost=lost, idle=idle)

    def _walk_over(self, station: Floats, twist: Floats) -> SingularWalk:
        def solve(k: int, near: tuple[Floats, Floats, Floats], lost: bool) -> tuple[Floats, Floats, Floats, float]:
            curve = np.zeros((1, 6, self.dof))
            curve[0, 0], curve[0, 1], curve[0, 2] = near[0], near[1], 0.5 * near[2]
            s = station[k]
            one = self._reference_of(np.array([s, s + 1.0]), curve, np.empty((1, self.dof, 0)))
            if lost:
                one = self._with_lost(one, np.array([True]), near[0][None])
            q, dq, ddq, off = self._follow(one, station[k : k + 1], np.zeros(1, dtype=np.int64), k == len(station) - 1)
            return q[0], dq[0], ddq[0], float(off[0])

        return SingularWalk(self.arm, self._task, self._tracker.length, station, twist, solve)

    def _track(self, q: Floats) -> None:
        """Samples on the path piece by piece, on grids that are fine enough: the reference."""
        stations, nodes, references = [np.zeros(1)], [], []
        rate: Floats | None = None
        for k in range(len(self.breakpoints) - 1):
            low, high = self.breakpoints[k : k + 2]
            count = max(INTERVALS_MIN, int(np.ceil(FIRST_INTERVALS * (high - low) / self.length)))
            while True:
                s, values, reference, fits = self._sampled(low, high, count, q, rate)
                if fits:
                    break
                count *= 2
            q, rate = values[0, -1], values[1, -1]
            stations.append(s[1:])
            nodes.append(values if k == 0 else values[:, 1:])
            references.append(reference)
        self.station = np.concatenate(stations)
        self._nodes = np.concatenate(nodes, axis=1)
        # Its arrays are writable, all of them, so that the loops are compiled once only.
        self._reference = loops.Reference(
            self.station.copy(), *(np.concatenate(rows) for rows in zip(*(one[1:] for one in references), strict=True))
        )
        self.station.setflags(write=False)

    def _sampled(
        self, low: float, high: float, count: int, start: Floats, rate: Floats | None
    ) -> tuple[Floats, Floats, loops.Reference, bool]:
        """Stations (count + 1,), q and both derivatives there (3, count + 1, n), the reference; was that fine enough.

        rate: the slope at the end of the piece before, whose spare part goes on.
        """
        step = (high - low) / count
        s = np.linspace(low, high, count + 1)
        half = np.linspace(low, high, 2 * count + 1)
        after, before = self._poses.poses(half), self._poses.poses(half[-1:], before=True)
        after = type(after)(*(np.concatenate([a[:-1], b]) for a, b in zip(after, before, strict=True)))
        target = PoseTarget.sample(
            lambda _: (after.position, after.rotation, after.tangent, after.turning), count * step, step
        )
        run = self._tracker.track(target, start)
        null = self._null_space(run.q)
        curve = np.zeros((count + 1, 6, self.dof))
        curve[:, 0] = run.q
        curve[0, 0] = start
        still = self._reference_of(np.append(s, s[-1] + step), curve, null)
        index = np.arange(count + 1)
        last = index == count
        q, dq, _, off = self._follow(still, s, index, last)
        good = (off <= MIDDLE_ERROR_MAX) & (run.flags & LIMIT == 0)
        if self.dof == len(self._task) and (not good.all() or crossed(self._tracker.singular_value(run.q)).any()):
            walked = self._walked(s, np.concatenate([after.tangent, after.turning], axis=1), start, rate)
            if walked is not None:
                return walked
        if not good.all():
            bad = int(good.argmin())
            self._check_reach(bad, s, run, target)
            if count < INTERVALS_MAX:
                return s, np.empty(0), still, False
            beyond = bad + int(good[bad:].argmax())
            then = q[beyond] if good[beyond] else run.q[-1]
            raise self._singular(s[bad], q[bad - 1] if bad else start, None, then)
        # The slope: of its spare part, what the tracker had.
        curve[:, 1] = run.qd * step
        if rate is not None:
            curve[0, 1] = rate * step
        curve[:, 0] = q
        dq = self._follow(still, s, index, last)[1]
        curve[:, 2] = 0.5 * step * np.gradient(dq, axis=0, edge_order=2)
        q, dq, ddq, _ = self._follow(still, s, index, last)
        reference = self._reference_of(s, _quintics(step, q, dq, ddq), null[:-1])
        middle = self._follow(reference, 0.5 * (s[1:] + s[:-1]), index[:-1], False)
        fits = bool(middle[3].max() <= MIDDLE_ERROR_MAX)
        if not fits and count >= INTERVALS_MAX:
            k = int(middle[3].argmax())
            raise self._singular(s[k], run.q[k], None)
        return s, np.stack([q, dq, ddq]), reference, fits

    def _walked(
        self, s: Floats, twist: Floats, start: Floats, rate: Floats | None
    ) -> tuple[Floats, Floats, loops.Reference, bool] | None:
        """``_sampled`` by a walk through singular postures; None: there is no way."""
        walk = self._walk_over(s, twist).find(start)
        if walk is None:
            return None
        q, dq, ddq = self._on_path(s, walk)
        if np.abs(q[0] - start).max() > WALKED_START_ERROR_MAX:
            raise self._singular(s[0], start, None, q[0])
        if rate is not None and not np.abs(dq[0] - rate).max() <= WALKED_SLOPE_ERROR_MAX * (1.0 + np.abs(rate).max()):
            return None
        step = s[1] - s[0]
        reference = self._reference_of(s, _quintics(step, q, dq, ddq), np.empty((len(s) - 1, self.dof, 0)))
        x = 0.5 ** np.arange(6)
        near = crossed(walk.singular) | walk.inside[1:] | walk.inside[:-1]
        reference = self._with_lost(reference, near, np.einsum("i,kij->kj", x, reference.curve))
        middles, interval = 0.5 * (s[1:] + s[:-1]), np.arange(len(s) - 1)
        there, _, _, off = self._follow(reference, middles, interval, False)
        tip_off = np.abs(self._miss(middles, there) @ self._task.T).max()
        on_path = np.abs(self._miss(s, q) @ self._task.T).max()
        if not on_path <= WALKED_ERROR_MAX or (len(s) > INTERVALS_MAX and not tip_off <= WALKED_ERROR_MAX):
            return None
        fits = bool(off.max() <= MIDDLE_ERROR_MAX and tip_off <= WALKED_ERROR_MAX)
        return s, np.stack([q, dq, ddq]), reference, fits

    def _on_path(self, s: Floats, walk: Walk) -> tuple[Floats, Floats, Floats]:
        """Joints and both derivatives (K + 1, n) of a walk, those in its zones on the path but for what is lost."""
        step = s[1] - s[0]
        curve = np.zeros((len(s), 6, self.dof))
        curve[:, 0], curve[:, 1], curve[:, 2] = walk.q, step * walk.dq, 0.5 * step**2 * walk.ddq
        reference = self._reference_of(np.append(s, s[-1] + step), curve, np.empty((len(s), self.dof, 0)))
        reference = self._with_lost(reference, walk.inside, walk.q)
        index = np.arange(len(s))
        q, dq, ddq, _ = self._follow(reference, s, index, index == len(s) - 1)
        return q, dq, ddq

    def _check_reach(self, k: int, s: Floats, run: IKRun, target: PoseTarget) -> None:
        """The tracker could not follow at sample k: refuse if a joint's limit or the arm's reach is the reason."""
        arm, q, flags = self.arm, run.q, run.flags
        if (flags[: k + 1] & LIMIT).any():
            k = int(np.flatnonzero(flags & LIMIT)[0])
            room = np.minimum(q[k] - arm.position_min, arm.position_max - q[k])
            joint = int(room.argmin())
            raise self._refuse(
                s[k],
                "limit",
                f"breaks the limit of joint {arm.joint_names[joint]!r}: at {q[k, joint]:.4g} it cannot go on, its "
                f"range is [{arm.position_min[joint]:.4g}, {arm.position_max[joint]:.4g}]",
                "start in another posture, move the path, or widen limits.position_rad",
                joint=joint,
            )
        # Let the arm reach for what it misses most from there on: it gets there, or it stops where it is nearest.
        length, oriented = self._tracker.length, len(self._task) == 6
        far = k + int((run.position_error[k:] / length + oriented * run.orientation_error[k:]).argmax())
        rows, step = 2 * SETTLING_STEPS + 1, self.length / FIRST_INTERVALS
        p, R = (np.repeat(a[2 * far : 2 * far + 1], rows, axis=0) for a in (target.position, target.rotation))
        still = np.zeros((rows, 3))
        held = PoseTarget.sample(lambda _: (p, R, still, still), SETTLING_STEPS * step, step)
        run = self._tracker.track(held, q[far])
        missed = run.position_error / length + oriented * run.orientation_error
        falling = missed[-1] < (1.0 - FALLING_SHARE) * missed[-SETTLING_STEPS // 10]
        if missed[-1] > 1e-5 and not falling and not (oriented and self._in_closed_form(p[0], R[0])):
            away = float(run.position_error[-1])
            raise self._refuse(
                s[k],
                "workspace",
                f"leaves the workspace: reaching for it the arm stops {away:.4g} m and "
                f"{oriented * run.orientation_error[-1]:.4g} rad short",
                "move the path or the base",
                distance_m=away,
            )

    def _in_closed_form(self, position: Floats, rotation: Floats) -> bool:
        """There is a closed form, and it reaches the pose."""
        try:
            closed = SphericalWristIK(self.arm)
        except RobotError:
            return False
        T = np.eye(4)
        T[:3, :3], T[:3, 3] = rotation, position
        return bool(np.isfinite(closed.within_limits(closed.solve(T))).all(axis=-1).any())

    def _singular(self, station: float, q: Floats, speed: float | None, then: Floats | None = None) -> PathError:
        least = float(self._tracker.singular_value(q))
        so = "its joints would have to jump" if speed is None else f"its joints' limits allow {speed:.4g} m/s only"
        postures: dict[str, object] = {}
        if then is not None:
            so += " from {} to {}".format(*((np.round(posture, 4) + 0.0).tolist() for posture in (q, then)))
            postures = {"before": q.tolist(), "after": then.tolist()}
        return self._refuse(
            station,
            "singular",
            f"passes too near a singularity, or turns the tool too quickly: {so}; the smallest singular value of the "
            f"Jacobian, over the arm's length, is {least:.3g}",
            "move the path, turn the tool over a longer way, start in another posture, or lower speed_min",
            singular_value=least,
            **postures,
        )

    def _check_speed(self, station: Floats, slope: Floats) -> None:
        with np.errstate(divide="ignore"):
            speed = (self.arm.speed_max / np.abs(slope)).min(axis=1)
        k = int(speed.argmin())
        if speed[k] < self._speed_min:
            raise self._singular(station[k], self.evaluate(station[k])[0], float(speed[k]))

    def _bound_speeds(self) -> None:
        """Bounds of the joints' speeds on cells that cover the path; and the joints go from cell to cell, no jump."""
        reference = self._reference
        low, high = self.station[:-1], self.station[1:]
        interval = np.arange(len(low))
        piece = np.searchsorted(self.breakpoints, 0.5 * (low + high)) - 1
        size = np.diff(self.station)
        # |r''| on an interval: no larger than the greatest coefficient of Bernstein's form, of degree 3
        second = reference.curve[:, 2:] * np.array([2.0, 6.0, 12.0, 20.0])[None, :, None]
        to_bernstein = np.array([[1, 0, 0, 0], [1, 1 / 3, 0, 0], [1, 2 / 3, 1 / 3, 0], [1, 1, 1, 1]])
        most = np.linalg.norm(to_bernstein @ second, axis=2).max(axis=1) / size**2
        bend = np.column_stack([np.asarray(self._poses.bends)[piece], most])
        done: list[tuple[Floats, Floats, Floats]] = []
        for _ in range(SPEED_BOUND_HALVINGS):
            middle, half = 0.5 * (low + high), 0.5 * (high - low)
            q, dq, _, _ = self._follow(reference, middle, interval, False)
            self._check_speed(middle, dq)
            bound, kept = np.empty_like(q), np.empty(len(q), dtype=np.bool_)
            loops.speed_bounds(
                self.arm.model,
                self._task,
                reference,
                interval,
                q,
                dq,
                half,
                bend[interval],
                SPEED_BOUND_SLACK,
                bound,
                kept,
            )
            done.append((low[kept], bound[kept], q[kept]))
            low, high, interval = low[~kept], high[~kept], interval[~kept]
            if not len(low):
                break
            middle = 0.5 * (low + high)
            low, high = np.concatenate([low, middle]), np.concatenate([middle, high])
            interval = np.concatenate([interval, interval])
        else:
            raise self._singular(low[0], self.evaluate(low[0])[0], None)
        edge, bound, q = (np.concatenate(rows) for rows in zip(*done, strict=True))
        order = np.argsort(edge)
        self._edge, bound, q = np.append(edge[order], self.length), bound[order], q[order]
        self._fastest = RangeMax(bound)
        ends = self.evaluate(self._edge)[0]
        reach = 0.5 * np.diff(self._edge)[:, None] * bound + 1e-9
        jump = ((np.abs(ends[:-1] - q) > reach) | (np.abs(ends[1:] - q) > reach)).any(axis=1)
        if jump.any():
            k = int(jump.argmax())
            raise self._singular(self._edge[k], q[k], None)

    # -- use

    def _follow(
        self,
        reference: loops.Reference,
        lam: Floats,
        interval: Ints,
        before: bool | Bools,
        position: Floats | None = None,
    ) -> tuple[Floats, Floats, Floats, Floats]:
        """Joints (S, n), both derivatives, and how far Newton went (S,), at stations (S,) of these intervals."""
        if isinstance(before, bool):
            poses = self._poses.poses(lam, before=before)
        else:
            both = (self._poses.poses(lam), self._poses.poses(lam, before=True))
            poses = type(both[0])(
                *(np.where(before.reshape(-1, *[1] * (a.ndim - 1)), b, a) for a, b in zip(*both, strict=True))
            )
        q, dq, ddq = np.empty((3, len(lam), self.dof))
        off = np.empty(len(lam))
        loops.follow(
            self.arm.model,
            self._task,
            reference,
            interval,
            np.array(lam),
            np.array(poses.position if position is None else position, order="C"),
            np.array(poses.rotation, order="C"),
            np.concatenate([poses.tangent, poses.turning], axis=1),
            np.concatenate([poses.curvature, poses.turning_change], axis=1),
            q,
            dq,
            ddq,
            off,
        )
        return q, dq, ddq, off

    def _at(
        self, lam: ArrayLike, before: bool, position: Floats | None = None
    ) -> tuple[tuple[int, ...], tuple[Floats, Floats, Floats, Floats]]:
        given = np.clip(np.asarray(lam, dtype=np.float64), 0.0, self.length)
        flat = given.reshape(-1)
        interval = np.searchsorted(self.station, flat, side="left" if before else "right") - 1
        interval = np.clip(interval, 0, len(self.station) - 2)
        rows = None if position is None else np.asarray(position, dtype=np.float64).reshape(-1, 3)
        found = self._follow(self._reference, flat, interval, before, rows)
        if not found[3].max(initial=0.0) <= (100.0 * MIDDLE_ERROR_MAX if position is None else NEAR_START):
            k = int(found[3].argmax())
            raise self._refuse(flat[k], "workspace", "is lost", "give a position nearer to the path")
        return (*given.shape, self.dof), found

    def evaluate(self, lam: ArrayLike, *, before: bool = False) -> tuple[Floats, Floats, Floats]:
        """Joint positions [rad, m] and their first and second derivatives by length [m], each (..., n)."""
        shape, (q, dq, ddq, _) = self._at(lam, before)
        return q.reshape(shape), dq.reshape(shape), ddq.reshape(shape)

    def inverse(self, position: Floats, lam: ArrayLike) -> Floats:
        """Joint positions (..., n) with the tip at ``position`` (..., 3) [m], turned as at station ``lam``, near it.

        Raises:
            PathError: A joint would have to move by more than 0.25 from where it is at that station.
        """
        shape, (q, _, _, _) = self._at(lam, False, position)
        return q.reshape(shape)

    def speed_bound(self, low: ArrayLike, high: ArrayLike) -> Floats:
        """Upper bounds of ``|f'|`` over the intervals [low, high], (..., n) [rad/m, 1]."""
        low, high = np.broadcast_arrays(np.asarray(low, dtype=np.float64), np.asarray(high, dtype=np.float64))
        last = len(self._edge) - 2
        first = np.clip(np.searchsorted(self._edge, low, side="right") - 1, 0, last)
        return self._fastest.over(first, np.clip(np.searchsorted(self._edge, high, side="left") - 1, first, last))


def _quintics(step: float, q: Floats, dq: Floats, ddq: Floats) -> Floats:
    """(M, 6, n) coefficients of the Hermite quintics between M + 1 even samples, by rising powers on [0, 1]."""
    v0, v1, a0, a1 = step * dq[:-1], step * dq[1:], step**2 * ddq[:-1], step**2 * ddq[1:]
    rise, slope, bend = q[1:] - q[:-1] - v0 - 0.5 * a0, v1 - v0 - a0, a1 - a0
    return np.stack(
        [
            q[:-1],
            v0,
            0.5 * a0,
            10.0 * rise - 4.0 * slope + 0.5 * bend,
            -15.0 * rise + 7.0 * slope - bend,
            6.0 * rise - 3.0 * slope + 0.5 * bend,
        ],
        axis=1,
    )

"""What ``FeedbackIK`` is compared with: Newton's iteration, the integrated inverse Jacobian, and closed forms.

All track a sampled pose from a posture and return an ``IKRun``. None of them looks at caps of speed, none states a
bound (theirs are infinite, or pi); flags say where a run went beyond the arm's limits, or did not get there.
"""

from __future__ import annotations

import math
from typing import Literal, final

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from armtempo.arrays import Floats, Ints
from armtempo.errors import InputError, brief
from armtempo.planners.geometry import PoseTarget, floats
from armtempo.planners.ik import _law as loops
from armtempo.planners.ik._feedback import FeedbackIK, IKBounds, IKGains, IKRun, TaskName
from armtempo.planners.ik._spherical_wrist import SphericalWristIK
from armtempo.robots import Arm, ArmModel, njit

__all__ = ["ClosedFormIK", "NewtonIK", "ResolvedRateIK"]

NEWTON_ERROR_MAX = 1e-13  # scaled error
NEWTON_STEPS_MAX = 100


@final
class NewtonIK:
    """Newton-Raphson on the pose: ``q += J^#(q) (x_d - x(q))``, from the sample before.

    Where it has not converged it goes on from where it came to. Run until converged, it flags such samples
    ``unreached``; with a count of steps nothing is flagged, and the errors tell.

    Args:
        arm: Any serial arm.
        iterations: Steps for each sample; None: until converged, 100 at most.
        damping: As of ``FeedbackIK``; by default as good as none, as Newton had it.
        task: As of ``FeedbackIK``.

    Raises:
        InputError: A number that cannot be used.
    """

    def __init__(
        self,
        arm: Arm,
        *,
        iterations: int | None = 1,
        damping: float = 1e-9,
        task: TaskName | ArrayLike = "auto",
    ) -> None:
        if iterations is not None and (not isinstance(iterations, int | np.integer) or iterations < 1):
            raise InputError(f"iterations = {iterations}", remedy="give a whole number >= 1, or None")
        self.arm, self.iterations = arm, iterations
        self._law = _unit_law(arm, damping, task)

    def track(self, target: PoseTarget, start: ArrayLike) -> IKRun:
        """Follow ``target`` from the posture ``start`` (n,), which is the run's first row.

        Raises:
            InputError: ``start`` has the wrong shape, or is not finite.
        """
        q, flags = _first(self.arm, target, start)
        _newton(self.arm.model, self._law, self.iterations or 0, target.position[::2], target.rotation[::2], q, flags)
        return _finished(self.arm, target, q, flags)


@final
class ResolvedRateIK:
    """The inverse Jacobian, integrated: ``q += J^#(q) dx_d``, with the differences of the target's samples.

    D. Whitney, "Resolved motion rate control of manipulators and human prostheses", 1969: what the paper argues
    against. Nothing pulls it back, so that its errors add up; noise of the samples moves the joints by itself.

    Args:
        arm: Any serial arm.
        position_noise: [m] standard deviation of each coordinate of each sample as it is measured.
        angle_noise: [rad] likewise, of a small turn about each axis.
        seed: Of the noise.
        damping: As of ``FeedbackIK``; by default as good as none.
        task: As of ``FeedbackIK``.

    Raises:
        InputError: A number that cannot be used.
    """

    def __init__(
        self,
        arm: Arm,
        *,
        position_noise: float = 0.0,
        angle_noise: float = 0.0,
        seed: int = 0,
        damping: float = 1e-9,
        task: TaskName | ArrayLike = "auto",
    ) -> None:
        if not (0.0 <= position_noise < np.inf and 0.0 <= angle_noise < np.inf):
            raise InputError(f"noise of {position_noise} m, {angle_noise} rad", remedy="give deviations >= 0")
        if not isinstance(seed, int | np.integer) or seed < 0:
            raise InputError(f"seed {brief(seed)}", remedy="give a whole number >= 0")
        self.arm, self.position_noise, self.angle_noise, self.seed = arm, position_noise, angle_noise, seed
        self._law = _unit_law(arm, damping, task)

    def track(self, target: PoseTarget, start: ArrayLike) -> IKRun:
        """Follow ``target`` from the posture ``start`` (n,); errors are those to the target, without its noise.

        Raises:
            InputError: ``start`` has the wrong shape, or is not finite.
        """
        q, flags = _first(self.arm, target, start)
        noise = np.random.default_rng(self.seed).normal(size=(2, len(q), 3))
        p = target.position[::2] + self.position_noise * noise[0]
        R = Rotation.from_rotvec(self.angle_noise * noise[1]) * Rotation.from_matrix(target.rotation[::2])
        moves = np.concatenate([np.diff(p, axis=0), (R[1:] * R[:-1].inv()).as_rotvec()], axis=1)
        _follow(self.arm.model, self._law, moves, q)
        return _finished(self.arm, target, q, flags)


@final
class ClosedFormIK:
    """All answers of ``SphericalWristIK`` for each sample, and one of them: exact, for arms that have a closed form.

    A sample that no answer reaches, or none within the joint limits, is held out in the posture before, and flagged
    ``unreached``. In a straight wrist joint 4 is put to zero, and jumps.

    Args:
        arm: Of the geometry that ``SphericalWristIK`` asks for.
        choice: ``nearest``: the answer whose greatest joint step is least; ``branch``: on the start's branch only.
            A straight wrist or elbow is on either of two; which, rounding decides: start aside of it.

    Raises:
        InputError: Unknown choice.
        RobotError: The arm has another geometry.
    """

    def __init__(self, arm: Arm, *, choice: Literal["nearest", "branch"] = "nearest") -> None:
        if choice not in ("nearest", "branch"):
            raise InputError(f"choice {brief(choice)}", remedy="use 'nearest' or 'branch'")
        self.arm, self.choice, self._inverse = arm, choice, SphericalWristIK(arm)

    def track(self, target: PoseTarget, start: ArrayLike) -> IKRun:
        """Follow ``target`` from the posture ``start`` (n,), which is the run's first row.

        Raises:
            InputError: ``start`` has the wrong shape, or is not finite.
        """
        q, flags = _first(self.arm, target, start)
        T = np.zeros((len(q), 4, 4))
        T[:, :3, :3], T[:, :3, 3], T[:, 3, 3] = target.rotation[::2], target.position[::2], 1.0
        only = int(self._inverse.branch(q[0])) if self.choice == "branch" else -1
        _choose(self._inverse.solve(T), only, self.arm.position_min, self.arm.position_max, q, flags)
        return _finished(self.arm, target, q, flags)


def _unit_law(arm: Arm, damping: float, task: TaskName | ArrayLike) -> loops.Law:
    """The feedback law with gains 1: what is asked for is the error."""
    gains = IKGains(position=1.0, approach=1.0, normal=1.0)
    return FeedbackIK(arm, gains, error="quaternion", feed_forward=False, damping=damping, task=task).law


def _first(arm: Arm, target: PoseTarget, start: ArrayLike) -> tuple[Floats, Ints]:
    first = floats(start, "start")
    if first.shape != (arm.dof,) or not np.isfinite(first).all():
        raise InputError(f"start of shape {first.shape} or not finite", remedy=f"give {arm.dof} joint positions")
    q = np.empty((len(target.time), arm.dof))
    q[0] = first
    return q, np.zeros(len(q), dtype=np.int64)


def _finished(arm: Arm, target: PoseTarget, q: Floats, flags: Ints) -> IKRun:
    T = arm.tip_pose(q)
    E = np.einsum("kji,kjl->kil", T[:, :3, :3], target.rotation[::2])  # the target's axes along the tip's
    sine = 0.5 * np.linalg.norm(
        np.stack([E[:, 2, 1] - E[:, 1, 2], E[:, 0, 2] - E[:, 2, 0], E[:, 1, 0] - E[:, 0, 1]]), axis=0
    )
    qd = np.diff(q, axis=0) / target.step
    qd = np.concatenate([qd, qd[-1:]])
    beyond = ((q < arm.position_min) | (q > arm.position_max)).any(axis=1)
    fast = (np.abs(qd) > arm.speed_max).any(axis=1)
    flags |= loops.LIMIT * beyond + loops.SPEED * fast
    for array in (q, qd, flags):
        array.setflags(write=False)
    none = np.full(len(q), np.inf)
    half_turn = np.full(len(q), np.pi)
    return IKRun(
        time=target.time,
        q=q,
        qd=qd,
        position_error=np.linalg.norm(target.position[::2] - T[:, :3, 3], axis=1),
        approach_error=np.arctan2(np.hypot(E[:, 0, 2], E[:, 1, 2]), E[:, 2, 2]),
        orientation_error=np.arctan2(sine, 0.5 * (np.trace(E, axis1=1, axis2=2) - 1.0)),
        flags=flags,
        bounds=IKBounds(
            position=none,
            approach=half_turn,
            orientation=half_turn,
            position_between=none,
            joint_speed=np.full(arm.dof, np.inf),
            ultimate_position=np.inf,
            ultimate_approach=np.pi,
            ultimate_orientation=np.pi,
            rounding=0.0,
        ),
    )


@njit
def _moved(law: loops.Law, w: loops.Scratch, x: Floats, q: Floats) -> float:
    """Adds J^# x to q, the Jacobian being in w.J; the size of the scaled x within the task."""
    m, n = w.A.shape
    loops.scale_jacobian(law, w)
    size = 0.0
    loops.task_part(law.task, law.length, x, w.y)
    for i in range(m):
        w.z[i] = 0.0
        size += w.y[i] * w.y[i]
    for k in range(n):
        w.free[k] = True
    loops.damped_inverse(w, law.damping, np.inf, 0.0)
    for k in range(n):
        for i in range(m):
            q[k] += w.A[i, k] * w.y[i]
    return math.sqrt(size)


@njit
def _newton(
    model: ArmModel, law: loops.Law, iterations: int, position: Floats, rotation: Floats, q: Floats, flags: Ints
) -> None:
    """Into q (T, n) from q[0]; iterations 0: until converged."""
    w = loops.scratch(q.shape[1], law.task.shape[0])
    for k in range(1, q.shape[0]):
        q[k] = q[k - 1]
        size, count = np.inf, 0
        while count < (iterations if iterations > 0 else NEWTON_STEPS_MAX):
            loops.tip_and_jacobian(model, q[k], w)
            loops.feedback_turning(law, w, rotation[k])
            for r in range(3):
                w.x[r] = position[k, r] - w.tip[0, r]
            before = size
            size = _moved(law, w, w.x, q[k])
            count += 1
            if iterations == 0 and (size <= NEWTON_ERROR_MAX or (size < 1e-9 and size >= 0.5 * before)):
                break  # the second: as far as rounding lets it
        if iterations == 0 and size >= 1e-9:
            flags[k] |= loops.UNREACHED


@njit
def _follow(model: ArmModel, law: loops.Law, moves: Floats, q: Floats) -> None:
    """Into q (T, n) from q[0], by displacements (T - 1, 6) of the tip."""
    w = loops.scratch(q.shape[1], law.task.shape[0])
    for k in range(moves.shape[0]):
        q[k + 1] = q[k]
        loops.tip_and_jacobian(model, q[k], w)
        _moved(law, w, moves[k], q[k + 1])


@njit
def _choose(answers: Floats, only: int, low: Floats, high: Floats, q: Floats, flags: Ints) -> None:
    """Into q (T, n) from q[0]: of answers (T, b, n) the nearest, by whole turns; ``only`` one branch, or -1."""
    n = q.shape[1]
    near = np.empty(n)
    for k in range(1, q.shape[0]):
        least = np.inf
        for b in range(answers.shape[1]):
            if only >= 0 and b != only:
                continue
            far = 0.0
            for i in range(n):
                near[i] = answers[k, b, i] + 2.0 * math.pi * round((q[k - 1, i] - answers[k, b, i]) / (2.0 * math.pi))
                if near[i] > high[i]:
                    near[i] -= 2.0 * math.pi
                elif near[i] < low[i]:
                    near[i] += 2.0 * math.pi
                if not low[i] <= near[i] <= high[i]:  # NaN, too
                    far = np.inf
                    break
                far = max(far, abs(near[i] - q[k - 1, i]))
            if far < least:
                least = far
                for i in range(n):
                    q[k, i] = near[i]
        if least == np.inf:
            flags[k] |= loops.UNREACHED
            for i in range(n):
                q[k, i] = q[k - 1, i]

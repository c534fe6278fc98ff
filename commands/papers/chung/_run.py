"""The runs of ``reproduce chung``: the simulation of Chung, Ryu, Park, and targets that show what it leaves out.

The paper prints its inputs and pictures, but neither a result nor where its arm stands and starts.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from armtempo.arrays import Floats
from armtempo.configs import IKCellConfig, load_cell_config
from armtempo.planners import FeedbackIK, IKCell, IKGains, PoseTarget, ResolvedRateIK, load_cell
from armtempo.planners.ik import INTEGRATORS, IKRun, Integrator, SphericalWristIK
from armtempo.robots import Arm

Rates = tuple[Floats, Floats, Floats, Floats]
Motion = Callable[[Floats], Rates]

MM = 1e3  # per metre
CELL = load_cell_config("chung", IKCellConfig)  # the paper's gains and path
KP, KA, KN = CELL.law.position_gain_1_s, CELL.law.approach_gain_1_s, CELL.law.normal_gain_1_s  # [1/s]
PATH = CELL.target.harmonic
assert PATH is not None
MIDDLE, AMPLITUDE = np.array(PATH.center_m), np.array(PATH.amplitude_m)  # [m]
RATE, PERIOD = PATH.rate_rad_s, PATH.duration_s  # [rad/s], [s]
UPRIGHT = Rotation.from_euler("xyz", PATH.rpy_rad).as_matrix().round(12)  # columns n_d, s, a_d
ASIDE = np.array([0.10, -0.08, 0.10, 0.50, -0.60, 0.60])  # [rad] the start beside the path's; ours, see above
SETTLED = 1.0  # [s] 20 time constants of the slowest error
UNCAPPED = np.full(6, 1e4)  # [rad/s] the paper caps nothing
SWING = 0.6  # [rad/s] greatest turning of the swinging tool
POSTURE = np.array([0.2, 0.5, -0.6, 0.3, 0.9, 0.1])  # far from all singularities
SHOULDER = np.array([0.0, 0.0, 0.66])  # [m]
REACH = math.hypot(0.55 + 0.45, 0.13)  # [m] of the wrist centre from the shoulder
NOISE = 1e-4  # [m] standard deviation of each coordinate of a measured target
SHIFTS: tuple[str, str] = ("no rates", "rates fed")
SCHEMES = ("differentiated", "fed back", "fed back, true rates")


def papers_path(t: Floats) -> Rates:
    """The paper's path at times (N,) [s]: positions, rotations, velocities, angular velocities."""
    c, s = np.cos(RATE * t)[:, None], np.sin(RATE * t)[:, None]
    return MIDDLE + AMPLITUDE * c, _fixed(UPRIGHT, t), -RATE * AMPLITUDE * s, np.zeros((len(t), 3))


def papers_law(arm: Arm, **options: Any) -> FeedbackIK:
    """The law with the paper's gains; ``options`` of ``FeedbackIK``."""
    return FeedbackIK(arm, IKGains(position=KP, approach=KA, normal=KN), **options)


def swinging(t: Floats) -> Rates:
    """The paper's path with a tool that swings about x, at ``SWING`` at most."""
    p, R, v, _ = papers_path(t)
    x = np.array([1.0, 0.0, 0.0])
    turn = Rotation.from_rotvec(SWING * np.sin(t)[:, None] * x).as_matrix()
    return p, turn @ R, v, SWING * np.cos(t)[:, None] * x


def _fixed(value: Floats, t: Floats) -> Floats:
    return np.broadcast_to(value, (len(t), *value.shape))


def still(T: Floats) -> Motion:
    return lambda t: (_fixed(T[:3, 3], t), _fixed(T[:3, :3], t), np.zeros((len(t), 3)), np.zeros((len(t), 3)))


def turning(T: Floats, w: Floats) -> Motion:
    """The pose T, turning at w [rad/s] about its position."""

    def motion(t: Floats) -> Rates:
        turned = Rotation.from_rotvec(t[:, None] * w).as_matrix() @ T[:3, :3]
        return _fixed(T[:3, 3], t), turned, np.zeros((len(t), 3)), _fixed(w, t)

    return motion


def _outwards(T: Floats, way: Floats) -> Motion:
    """From the pose T along ``way`` [m] within 1 s, 1 s there, and back within 1 s."""

    def motion(t: Floats) -> Rates:
        u, back = np.clip(t, 0, 1)[:, None], np.clip(t - 2.0, 0, 1)[:, None]
        x = u**3 * (10 - 15 * u + 6 * u * u) - back**3 * (10 - 15 * back + 6 * back**2)
        v = 30 * ((u * (1 - u)) ** 2 - (back * (1 - back)) ** 2)
        return T[:3, 3] + x * way, _fixed(T[:3, :3], t), v * way, np.zeros((len(t), 3))

    return motion


class Hard(NamedTuple):
    """A target that no inverse follows: the printed law beside the damped and capped one."""

    target: PoseTarget
    plain_qd: Floats  # (T, 6) [rad/s]
    plain_error: Floats  # (T, 2) position [m], orientation [rad]
    ours: IKRun


class Follower(NamedTuple):
    """A scheme that follows a measured target; errors are those against the true one."""

    qd: Floats  # (T, 6) [rad/s]
    error: Floats  # (T,) [m]


class Chung(NamedTuple):
    """All runs that the table and the figures show."""

    arm: Arm
    target: PoseTarget  # the paper's, each 1 ms
    entry: dict[str, IKRun]  # by ``SHIFTS``: from a start beside the path, RK4, 1 ms
    steady: dict[tuple[bool, Integrator, float], IKRun]  # by feed-forward, integrator, step [s]; tool swinging
    outside: Hard
    singular: Hard
    noisy: dict[str, Follower]  # by ``SCHEMES``


def run() -> Chung:
    """Track all targets."""
    cell = load_cell("chung", IKCell)
    arm, target, on_path = cell.arm, cell.target, cell.start
    laws = {fed: papers_law(arm, feed_forward=fed, joint_speed_max=UNCAPPED) for fed in (False, True)}
    entry = {name: laws[fed].track(target, on_path + ASIDE) for name, fed in zip(SHIFTS, laws, strict=True)}
    steady = {}
    for step, share in ((1e-2, 1.0), (1e-3, 0.5)):  # half a period has all speeds and accelerations; one is drawn
        swung = PoseTarget.sample(swinging, share * PERIOD, step)
        for fed, law in laws.items():
            # Where the lag is all of the error, the integrators differ in nothing.
            for integrator in INTEGRATORS if fed or step == 1e-2 else ("rk4",):
                steady[fed, integrator, step] = law.track(swung, on_path, integrator=integrator)
    return Chung(arm, target, entry, steady, _outside(arm), _singular(arm), _noisy(arm, target, on_path))


def _outside(arm: Arm) -> Hard:
    T = arm.tip_pose(POSTURE)
    way = T[:3, 3] - SHOULDER
    way *= (REACH + 0.28) / np.linalg.norm(way) - 1.0
    return _hard(arm, PoseTarget.sample(_outwards(T, way), 4.0, 1e-3), POSTURE)


def _singular(arm: Arm) -> Hard:
    """The tool turns so that the wrist passes its straight posture at 0.01 rad."""
    straight = POSTURE * [1, 1, 1, 1, 0, 1]
    T = arm.tip_pose(straight)
    lost = np.linalg.svd(arm.jacobian(straight))[0][3:, -1]
    lost /= np.linalg.norm(lost)
    beside = np.cross(lost, [0.0, 0.0, 1.0])
    beside *= 0.01 / np.linalg.norm(beside)
    T[:3, :3] = Rotation.from_rotvec(-0.6 * lost).as_matrix() @ Rotation.from_rotvec(beside).as_matrix() @ T[:3, :3]
    answers = SphericalWristIK(arm).solve(T)
    start = answers[np.nanargmin(np.abs(answers - straight).max(axis=1))]
    return _hard(arm, PoseTarget.sample(turning(T, 0.6 * lost), 2.0, 1e-3), start)


def _hard(arm: Arm, target: PoseTarget, start: Floats) -> Hard:
    return Hard(target, *_printed_law(arm, target, start), papers_law(arm).track(target, start))


def _printed_law(arm: Arm, target: PoseTarget, start: Floats) -> tuple[Floats, Floats]:
    """Eqs. (2.12), (2.16) with the plain inverse, by Euler: joint speeds, and errors as ``Hard`` has them."""
    q, qd = start, np.empty((len(target.time), arm.dof))
    p, R = target.position[::2], target.rotation[::2]
    rates = np.concatenate([target.velocity, target.angular_velocity], axis=1)[::2]
    T = np.empty((len(qd), 4, 4))
    for k in range(len(qd)):
        T[k] = arm.tip_pose(q)
        E = T[k, :3, :3].T @ R[k]  # the target's axes along the tip's: n x n_d and a x a_d stand in it
        turn = T[k, :3, :3] @ (-KA * E[1, 2], KA * E[0, 2], KN * E[1, 0])
        qd[k] = np.linalg.solve(arm.jacobian(q), np.concatenate([KP * (p[k] - T[k, :3, 3]), turn]) + rates[k])
        q = q + target.step * qd[k]
    turned = Rotation.from_matrix(T[:, :3, :3].transpose(0, 2, 1) @ R).magnitude()
    return qd, np.stack([np.linalg.norm(p - T[:, :3, 3], axis=1), turned], axis=1)


def _noisy(arm: Arm, target: PoseTarget, start: Floats) -> dict[str, Follower]:
    clean, R, h = target.position[::2], target.rotation[::2], target.step
    differentiated = ResolvedRateIK(arm, position_noise=NOISE).track(target, start)
    measured = clean + NOISE * np.random.default_rng(0).normal(size=(2, len(clean), 3))[0]  # what that one sees
    bare = PoseTarget.through(measured, R, h)
    fed = PoseTarget.through(
        measured, R, h, velocity=target.velocity[::2], angular_velocity=target.angular_velocity[::2]
    )
    runs = (differentiated, *(papers_law(arm).track(each, start, integrator="euler") for each in (bare, fed)))
    return {
        name: Follower(done.qd, np.linalg.norm(arm.tip_pose(done.q)[:, :3, 3] - clean, axis=1))
        for name, done in zip(SCHEMES, runs, strict=True)
    }


def ordered_angles(arm: Arm, done: IKRun, target: PoseTarget) -> Floats:
    """(T, 3) the paper's alpha_1, alpha_2, alpha_3: turns from the target to the tip, about n, s and a [rad]."""
    turn = target.rotation[::2].transpose(0, 2, 1) @ arm.tip_pose(done.q)[:, :3, :3]
    return np.asarray(Rotation.from_matrix(turn).as_euler("XYZ"))


def least_error(hard: Hard) -> Floats:
    """(T,) the distance of the target from what the wrist centre can reach [m]."""
    far = np.linalg.norm(hard.target.position[::2] - SHOULDER, axis=1)
    return np.asarray(np.maximum(far - REACH, 0.0))

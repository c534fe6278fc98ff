"""The simulation of Chung, Ryu, Park, its claims and what they leave out, beside ours. SI inside, mm in the table.

The paper prints its inputs and pictures, but no result and not where its arm starts. Reference values are its
equations', or of a computation independent of this code; what a value is, its note says.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from armtempo.commands._reproduction import Quantity

if TYPE_CHECKING:
    from armtempo.planners import IKRun, Integrator, PoseTarget
    from armtempo.robots import Arm

Array = NDArray[np.float64]
Rates = tuple[Array, Array, Array, Array]
Motion = Callable[[Array], Rates]

MM = 1e3  # per metre
KP, KA, KN = 50.9, 20.0, 25.5  # [1/s] the paper's gains
MIDDLE, AMPLITUDE = np.array([0.45, -0.05, 0.55]), np.array([0.25, 0.45, 0.45])  # [m]
UPRIGHT = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])  # columns n_d, s, a_d
PERIOD = 4.0 * math.pi  # [s] of cos(t/2)
ASIDE = np.array([0.10, -0.08, 0.10, 0.50, -0.60, 0.60])  # [rad] the start beside the path's; ours, see above
SETTLED = 1.0  # [s] 20 time constants of the slowest error
UNCAPPED = np.full(6, 1e4)  # [rad/s] the paper caps nothing
SWING = 0.6  # [rad/s] greatest turning of the swinging tool
POSTURE = np.array([0.2, 0.5, -0.6, 0.3, 0.9, 0.1])  # far from all singularities
SHOULDER = np.array([0.0, 0.0, 0.66])  # [m]
REACH = math.hypot(0.55 + 0.45, 0.13)  # [m] of the wrist centre from the shoulder
NOISE = 1e-4  # [m] standard deviation of each coordinate of a measured target
SHIFTS = ("no rates", "rates fed")
SCHEMES = ("differentiated", "fed back", "fed back, true rates")
STARTS_DEG = (10.0, 30.0, 60.0, 90.0, 120.0)
CAPTION = (
    "reference: what the paper's equations say, or a computation independent of this code;"
    " the paper prints no result. – : none"
)


def papers_path(t: Array) -> Rates:
    """The paper's path at times (N,) [s]: positions, rotations, velocities, angular velocities."""
    c, s = np.cos(0.5 * t)[:, None], np.sin(0.5 * t)[:, None]
    return MIDDLE + AMPLITUDE * c, _fixed(UPRIGHT, t), -0.5 * AMPLITUDE * s, np.zeros((len(t), 3))


def swinging(t: Array) -> Rates:
    """The paper's path with a tool that swings about x, at ``SWING`` at most."""
    p, R, v, _ = papers_path(t)
    x = np.array([1.0, 0.0, 0.0])
    turn = Rotation.from_rotvec(SWING * np.sin(t)[:, None] * x).as_matrix()
    return p, turn @ R, v, SWING * np.cos(t)[:, None] * x


def _fixed(value: Array, t: Array) -> Array:
    return np.broadcast_to(value, (len(t), *value.shape))


def _held(T: Array) -> Motion:
    return lambda t: (_fixed(T[:3, 3], t), _fixed(T[:3, :3], t), np.zeros((len(t), 3)), np.zeros((len(t), 3)))


def _turning(T: Array, w: Array) -> Motion:
    """The pose T, turning at w [rad/s] about its position."""

    def motion(t: Array) -> Rates:
        turned = Rotation.from_rotvec(t[:, None] * w).as_matrix() @ T[:3, :3]
        return _fixed(T[:3, 3], t), turned, np.zeros((len(t), 3)), _fixed(w, t)

    return motion


def _outwards(T: Array, way: Array) -> Motion:
    """From the pose T along ``way`` [m] within 1 s, 1 s there, and back within 1 s."""

    def motion(t: Array) -> Rates:
        u, back = np.clip(t, 0, 1)[:, None], np.clip(t - 2.0, 0, 1)[:, None]
        x = u**3 * (10 - 15 * u + 6 * u * u) - back**3 * (10 - 15 * back + 6 * back**2)
        v = 30 * ((u * (1 - u)) ** 2 - (back * (1 - back)) ** 2)
        return T[:3, 3] + x * way, _fixed(T[:3, :3], t), v * way, np.zeros((len(t), 3))

    return motion


class Hard(NamedTuple):
    """A target that no inverse follows: the printed law beside the damped and capped one."""

    target: PoseTarget
    plain_qd: Array  # (T, 6) [rad/s]
    plain_error: Array  # (T, 2) position [m], orientation [rad]
    ours: IKRun


class Follower(NamedTuple):
    """A scheme that follows a measured target; errors are those against the true one."""

    qd: Array  # (T, 6) [rad/s]
    error: Array  # (T,) [m]


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
    from armtempo.configs import data_path
    from armtempo.planners import INTEGRATORS, FeedbackIK, PoseTarget, SphericalWristIK
    from armtempo.robots import Arm

    arm = Arm.from_urdf(data_path("robots/puma560_chung.urdf"))
    on_path = SphericalWristIK(arm).solve(_pose(papers_path(np.zeros(1))))[0]  # the best-conditioned of 8 branches
    target = PoseTarget.sample(papers_path, PERIOD, 1e-3)
    laws = {fed: FeedbackIK(arm, feed_forward=fed, joint_speed_max=UNCAPPED) for fed in (False, True)}
    entry = {name: laws[fed].track(target, on_path + ASIDE) for name, fed in zip(SHIFTS, laws, strict=True)}
    steady = {}
    for step in (1e-3, 1e-2):
        swung = PoseTarget.sample(swinging, PERIOD, step)
        for fed, law in laws.items():
            for integrator in INTEGRATORS:
                steady[fed, integrator, step] = law.track(swung, on_path, integrator=integrator)
    return Chung(arm, target, entry, steady, _outside(arm), _singular(arm), _noisy(arm, target, on_path))


def _pose(rates: Rates) -> Array:
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = rates[1][0], rates[0][0]
    return T


def _outside(arm: Arm) -> Hard:
    from armtempo.planners import PoseTarget

    T = arm.tip_pose(POSTURE)
    way = T[:3, 3] - SHOULDER
    way *= (REACH + 0.28) / np.linalg.norm(way) - 1.0
    return _hard(arm, PoseTarget.sample(_outwards(T, way), 4.0, 1e-3), POSTURE)


def _singular(arm: Arm) -> Hard:
    """The tool turns so that the wrist passes its straight posture at 0.01 rad."""
    from armtempo.planners import PoseTarget, SphericalWristIK

    straight = POSTURE * [1, 1, 1, 1, 0, 1]
    T = arm.tip_pose(straight)
    lost = np.linalg.svd(arm.jacobian(straight))[0][3:, -1]
    lost /= np.linalg.norm(lost)
    beside = np.cross(lost, [0.0, 0.0, 1.0])
    beside *= 0.01 / np.linalg.norm(beside)
    T[:3, :3] = Rotation.from_rotvec(-0.6 * lost).as_matrix() @ Rotation.from_rotvec(beside).as_matrix() @ T[:3, :3]
    answers = SphericalWristIK(arm).solve(T)
    start = answers[np.nanargmin(np.abs(answers - straight).max(axis=1))]
    return _hard(arm, PoseTarget.sample(_turning(T, 0.6 * lost), 2.0, 1e-3), start)


def _hard(arm: Arm, target: PoseTarget, start: Array) -> Hard:
    from armtempo.planners import FeedbackIK

    return Hard(target, *_printed_law(arm, target, start), FeedbackIK(arm).track(target, start))


def _printed_law(arm: Arm, target: PoseTarget, start: Array) -> tuple[Array, Array]:
    """Eqs. (2.12), (2.16) with the plain inverse, by Euler: joint speeds, and errors as ``Hard`` has them."""
    q, h = start.copy(), target.step
    speeds, errors = [], []
    for p, R, v, w in zip(
        target.position[::2], target.rotation[::2], target.velocity[::2], target.angular_velocity[::2], strict=True
    ):
        T = arm.tip_pose(q)
        n, a = T[:3, 0], T[:3, 2]
        turn = KA * np.cross(a, R[:, 2]) + KN * a * (a @ np.cross(n, R[:, 0])) + w
        qd = np.linalg.solve(arm.jacobian(q), np.concatenate([KP * (p - T[:3, 3]) + v, turn]))
        speeds.append(qd)
        errors.append((np.linalg.norm(p - T[:3, 3]), Rotation.from_matrix(R.T @ T[:3, :3]).magnitude()))
        q = q + h * qd
    return np.array(speeds), np.array(errors)


def _noisy(arm: Arm, target: PoseTarget, start: Array) -> dict[str, Follower]:
    from armtempo.planners import FeedbackIK, PoseTarget

    clean, R, h = target.position[::2], target.rotation[::2], target.step
    measured = clean + np.random.default_rng(0).normal(scale=NOISE, size=clean.shape)
    rates = {"velocity": target.velocity[::2], "angular_velocity": target.angular_velocity[::2]}
    bare, fed = PoseTarget.through(measured, R, h), PoseTarget.through(measured, R, h, **rates)
    q, qd = [start], []
    for p, ahead in zip(measured[:-1], measured[1:], strict=True):
        qd.append(np.linalg.solve(arm.jacobian(q[-1]), np.concatenate([(ahead - p) / h, np.zeros(3)])))
        q.append(q[-1] + h * qd[-1])
    back = [FeedbackIK(arm).track(seen, start, integrator="euler") for seen in (bare, fed)]
    both = [(np.array(q), np.array([*qd, qd[-1]])), *((done.q, done.qd) for done in back)]
    return {
        name: Follower(speeds, np.linalg.norm(arm.tip_pose(each)[:, :3, 3] - clean, axis=1))
        for name, (each, speeds) in zip(SCHEMES, both, strict=True)
    }


def compare(found: Chung) -> list[Quantity]:
    """Every claim of the paper, and what it leaves out, beside ours."""
    return [
        *_steady(found),
        *_law(found.arm),
        *_papers_bounds(found.arm),
        *_our_bounds(found),
        *_failures(found),
        *_reading(found),
    ]


def _row(
    section: str, what: str, unit: str, reference: float | None, ours: float, note: str = "", digits: int = 3
) -> Quantity:
    return Quantity(section, what, unit, reference, ours, digits, note, significant=True)


def _late(errors: Array, time: Array) -> float:
    return float(errors[time > SETTLED].max())


def _steady(found: Chung) -> list[Quantity]:
    section = "Errors once settled"
    rows = []
    printed: dict[tuple[bool, Integrator, float], tuple[float | None, str]] = {
        (False, "rk4", 1e-3): (6.716, "eq. (2.15): |A ω| / √(K_p² + ω²)"),
        (True, "euler", 1e-3): (3.04e-3, "eq. (2.19) says 0: in continuous time"),
        (True, "euler", 1e-2): (3.04e-2, "first order in the step"),
        (True, "heun", 1e-2): (1.0e-2, ""),
        (True, "rk4", 1e-2): (1.1e-4, ""),
        (True, "rk4", 1e-3): (None, "fourth order"),
    }
    for (fed, integrator, step), (reference, note) in printed.items():
        done = found.steady[fed, integrator, step]
        how = "with P_d'" if fed else "without P_d'"
        what = f"position, {how}, {integrator}, {1e3 * step:g} ms"
        rows.append(_row(section, what, "mm", reference, MM * _late(done.position_error, done.time), note, 4))
    for fed, integrator, step in printed:
        done = found.steady[fed, integrator, step]
        how = "with ω_d" if fed else "without ω_d"
        what = f"orientation, {how}, {integrator}, {1e3 * step:g} ms"
        note = "" if fed else f"the tool swings, at most {SWING:g} rad/s"
        rows.append(_row(section, what, "rad", None, _late(done.orientation_error, done.time), note))
    for integrator, order in (("euler", 1), ("heun", 2), ("rk4", 4)):
        coarse, fine = (found.steady[True, integrator, step] for step in (1e-2, 1e-3))
        for what, name in (("position", "position_error"), ("orientation", "orientation_error")):
            ratio = _late(getattr(coarse, name), coarse.time) / _late(getattr(fine, name), fine.time)
            rows.append(_row(section, f"order of {integrator} in {what}", "1", order, math.log10(ratio)))
    time, falling = found.target.time, found.entry["rates fed"]
    around = ordered_angles(found.arm, falling, found.target)[:, 2]
    errors = (falling.position_error, falling.approach_error, np.abs(around))
    for name, gain, error in zip(("position", "axis a", "angle about a"), (KP, KA, KN), errors, strict=True):
        early, late = (int(np.searchsorted(time, t)) for t in ((0.05, 0.25) if gain == KP else (0.4, 0.6)))
        constant = (time[late] - time[early]) / math.log(error[early] / error[late])
        rows.append(_row(section, f"time constant, {name}", "ms", round(1e3 / gain, 1), 1e3 * constant, "1 / K", 4))
    fastest = float(np.abs(falling.qd[time > SETTLED]).max())
    least = float(np.linalg.svd(found.arm.jacobian(falling.q[time > SETTLED]), compute_uv=False)[:, -1].min())
    return [
        *rows,
        _row(section, "fastest joint", "rad/s", 0.706, fastest),
        _row(section, "smallest singular value", "1", 0.193, least, "of the Jacobian in m and rad, on the path"),
    ]


def ordered_angles(arm: Arm, done: IKRun, target: PoseTarget) -> Array:
    """(T, 3) the paper's alpha_1, alpha_2, alpha_3: turns from the target to the tip, about n, s and a [rad]."""
    turn = target.rotation[::2].transpose(0, 2, 1) @ arm.tip_pose(done.q)[:, :3, :3]
    return np.asarray(Rotation.from_matrix(turn).as_euler("XYZ"))


def _law(arm: Arm) -> list[Quantity]:
    from armtempo.planners import FeedbackIK, IKGains, PoseTarget

    section = "What the law does"
    T = arm.tip_pose(POSTURE)
    aside = T.copy()
    aside[0, 3] += 1e-6
    still = PoseTarget.sample(_held(aside), 20.0, 0.01)
    low, high = 1.5, 2.5  # K_p dt, stable and not
    while high - low > 1e-4:
        middle = 0.5 * (low + high)
        ik = FeedbackIK(arm, IKGains(position=middle / 0.01), joint_speed_max=UNCAPPED)
        error = ik.track(still, POSTURE, integrator="euler").position_error
        low, high = (middle, high) if error[-1] < error[0] else (low, middle)
    rows = [_row(section, "Euler is stable up to K_p dt", "1", 2.0, low, "found by bisection", 5)]
    off = 0.0
    for start in STARTS_DEG:
        done = _approach(arm, math.radians(start))
        exact = math.tan(0.5 * math.radians(start)) * np.exp(-KA * done.time)
        off = max(off, float(np.abs(np.tan(0.5 * done.approach_error) / exact - 1.0).max()))
    rows.append(_row(section, "tan(δ/2) off tan(δ₀/2) e^(−K_a t)", "1", 0.0, off, "relative; δ₀ = 10 to 120°"))
    wide = arm.from_urdf(arm.urdf, position_limits=[[-1e4, 1e4]] * 6)
    both = IKGains(approach=KA, normal=KA)
    for w in (5.0, 10.0, 19.0, 21.0):
        ik = FeedbackIK(wide, both, feed_forward=False, joint_speed_max=UNCAPPED, damping=1e-6)
        error = ik.track(PoseTarget.sample(_turning(T, w * T[:3, 2]), 6.0, 1e-3), POSTURE).orientation_error
        held = w < KA
        reference, ours = (math.asin(w / KA), error[-1]) if held else (math.pi, error.max())
        note = "asin(w/K), K = 20" if held else "w > K: lock is lost"
        rows.append(_row(section, f"error behind a target turning at {w:g}/s", "rad", reference, ours, note, 4))
    return rows


def _approach(arm: Arm, angle: float) -> IKRun:
    """A fixed target that the approach axis starts ``angle`` [rad] away from."""
    return _fixed_run(arm, Rotation.from_euler("X", -angle))


def _fixed_run(arm: Arm, turned: Rotation) -> IKRun:
    """A fixed target from which the tip starts turned, in the target's axes."""
    from armtempo.planners import FeedbackIK

    ik = FeedbackIK(arm, joint_speed_max=UNCAPPED, damping=1e-6)
    return ik.track(_fixed_target(arm, turned), POSTURE)


def _fixed_target(arm: Arm, turned: Rotation) -> PoseTarget:
    from armtempo.planners import PoseTarget

    T = arm.tip_pose(POSTURE)
    T[:3, :3] = T[:3, :3] @ turned.as_matrix().T
    return PoseTarget.sample(_held(T), 0.4, 2e-4)


def _papers_bounds(arm: Arm) -> list[Quantity]:
    section = "The paper's bounds"
    rows = []
    for start in STARTS_DEG:
        done = _approach(arm, math.radians(start))
        chord = 2.0 * np.sin(0.5 * done.approach_error)
        over = float((chord / (chord[0] * np.exp(-KA * done.time))).max())
        reference = 1.0 / math.cos(0.5 * math.radians(start))
        note = "1 / cos(δ₀/2): it is of first order"
        rows.append(_row(section, f"|a_e| / bound (3.4), δ₀ = {start:g}°", "1", reference, over, note, 4))
    # To leading order alpha_3' = -K_n alpha_3 + K_a alpha_1 alpha_2, whose last factor decays at 2 K_a.
    peak = math.log(2.0 * KA / KN) / (2.0 * KA - KN)
    lead = KA / (2.0 * KA - KN) * (math.exp(-KN * peak) - math.exp(-2.0 * KA * peak))
    worst = 0.0
    for first, second in ((0.02, 0.02), (0.1, 0.1), (0.3, 0.3), (1.0, 1.0), (0.0, 1.0)):
        turned = Rotation.from_euler("XYZ", [first, second, 0.0])
        done = _fixed_run(arm, turned)
        angles = ordered_angles(arm, done, _fixed_target(arm, turned))
        chord_a = 2.0 * np.sin(0.5 * done.approach_error)
        chord_n = np.sqrt(np.maximum(2.0 - 2.0 * np.cos(angles[:, 1]) * np.cos(angles[:, 2]), 0.0))
        worst = max(worst, float((chord_n / np.hypot(chord_a, angles[:, 2])).max()))
        if first == 0.0:
            continue
        over = float((np.abs(angles[:, 2]) - np.abs(angles[0, 2]) * np.exp(-KN * done.time)).max())
        name, note = f"|α₃| − bound (3.5), α₁ = α₂ = {first:g}", "α₁ α₂ feeds α₃; reference: leading term"
        rows.append(_row(section, name, "rad", lead * first * second, over, note))
    return [*rows, _row(section, "|n_e| / bound (3.9), at most", "1", 1.0, worst, "exact: never exceeded", 5)]


def _our_bounds(found: Chung) -> list[Quantity]:
    section = "Our bounds"
    runs = [*found.entry.values(), *found.steady.values(), found.outside.ours, found.singular.ours]
    held = sum(all(done.held.values()) for done in runs)
    rows = [_row(section, "runs whose bounds all hold", "1", float(len(runs)), float(held))]
    for fed, integrator, step in (
        (False, "rk4", 1e-3),
        (True, "euler", 1e-3),
        (True, "euler", 1e-2),
        (True, "rk4", 1e-2),
    ):
        done = found.steady[fed, integrator, step]
        for what, error, bound in (
            ("position", done.position_error, done.bounds.position),
            ("orientation", done.orientation_error, done.bounds.orientation),
        ):
            name = f"{what}, {SHIFTS[fed]}, {integrator}, {1e3 * step:g} ms"
            ratio = _late(bound, done.time) / _late(error, done.time)
            rows.append(_row(section, name, "1", None, ratio, "bound / error"))
    return rows


def _failures(found: Chung) -> list[Quantity]:
    section = "Where inverting fails"
    settled = found.target.time > SETTLED
    rows = []
    for name, scheme in found.noisy.items():
        spread = float(np.diff(scheme.qd[settled], axis=0).std() / math.sqrt(2.0))
        note = f"target measured to {MM * NOISE:g} mm each 1 ms" if name == SCHEMES[0] else ""
        error = MM * _late(scheme.error, found.target.time)
        rows.append(_row(section, f"noise of speeds, {name}", "rad/s", None, spread, note))
        note = {0: "wanders on: nothing takes it back", 1: "the lag of (2.15)"}.get(SCHEMES.index(name), "")
        rows.append(_row(section, f"position error, {name}", "mm", None, error, note))
    cap = found.arm.speed_max
    for hard, where in ((found.outside, "out of reach"), (found.singular, "straight wrist")):
        for name, qd in (("plain inverse", hard.plain_qd), ("damped, capped", hard.ours.qd)):
            fastest = float(np.abs(qd).max())
            rows.append(_row(section, f"fastest joint, {where}, {name}", "rad/s", None, fastest))
        share = float(np.abs(hard.ours.qd / cap).max())
        rows.append(_row(section, f"fastest joint / its cap, {where}", "1", 1.0, share, "damped, capped"))
    out, past = found.outside, found.singular
    least, note = round(MM * _while_held(out, least_error(out)), 1), "reference: no posture is nearer"
    ours, plain = (MM * _while_held(out, e) for e in (out.ours.position_error, out.plain_error[:, 0]))
    return [
        *rows,
        _row(section, "error out of reach, plain inverse", "mm", least, plain, "it chatters: by chance", 4),
        _row(section, "error out of reach, damped, capped", "mm", least, ours, note, 4),
        _row(section, "error after the return", "mm", None, MM * float(out.ours.position_error[-1])),
        _row(
            section, "straight wrist: greatest position error", "mm", None, MM * float(past.ours.position_error.max())
        ),
        _row(section, "straight wrist: greatest turning error", "rad", None, float(past.ours.orientation_error.max())),
    ]


def _while_held(hard: Hard, error: Array) -> float:
    """The error at the end of the second outside [m]."""
    return float(error[round(2.0 / hard.target.step)])


def least_error(hard: Hard) -> Array:
    """(T,) the distance of the target from what the wrist centre can reach [m]."""
    return np.maximum(np.linalg.norm(hard.target.position[::2] - SHOULDER, axis=1) - REACH, 0.0)


def _reading(found: Chung) -> list[Quantity]:
    from armtempo.configs import data_path
    from armtempo.planners import SphericalWristIK
    from armtempo.robots import Arm

    section = "Where its arm stands"
    ik = SphericalWristIK(found.arm)
    p = papers_path(np.linspace(0.0, 0.5 * PERIOD, 1001))[0]  # half a period: the other half is the way back
    T = np.tile(np.eye(4), (len(p), 1, 1))
    T[:, :3, :3] = UPRIGHT

    def share(height: float) -> float:
        T[:, :3, 3] = p + SHOULDER - [0.0, 0.0, height]
        return float(np.isfinite(ik.solve(T)).all(axis=-1).any(axis=-1).mean())

    heights = []
    note = "by bisection; reference: the circle about it"
    for inside, out in ((SHOULDER[2], 0.2), (SHOULDER[2], 1.2)):
        while abs(inside - out) > 1e-4:
            middle = 0.5 * (inside + out)
            inside, out = (middle, out) if share(middle) == 1.0 else (inside, middle)
        heights.append(inside)
    lower, upper = (float(p[at, 2] + way * math.sqrt(REACH**2 - p[at, 0] ** 2 - p[at, 1] ** 2)) for at, way in ((0, -1), (-1, 1)))
    real = Arm.from_urdf(data_path("robots/puma560.urdf"))
    T[:, :3, 3] = p
    own = SphericalWristIK(real)
    answers = own.solve(T)
    best = float(np.isfinite(own.within_limits(answers)).all(axis=-1).mean(axis=0).max())
    values = np.linalg.svd(real.jacobian(answers[0][np.isfinite(answers[0]).all(axis=-1)]), compute_uv=False)
    return [
        _row(section, "path in reach, shoulder in the base", "%", 68.4, 100.0 * share(0.0)),
        _row(section, "path in reach, shoulder 0.66 m up", "%", 100.0, 100.0 * share(SHOULDER[2]), "used here"),
        _row(section, "lowest shoulder that reaches all", "m", lower, heights[0], note, 4),
        _row(section, "highest shoulder that reaches all", "m", upper, heights[1], note, 4),
        _row(section, "real PUMA 560: path in reach", "%", 100.0,
             100.0 * float(np.isfinite(answers).all(axis=-1).any(axis=-1).mean())),
        _row(section, "real PUMA 560: smallest singular value", "1", 0.04, float(values[:, -1].max()),
             "at t = 0: its elbow is almost straight"),
        _row(section, "real PUMA 560: path in joint limits", "%", None, 100.0 * best, "best branch"),
    ]  # fmt: skip

"""The claims of Chung, Ryu, Park and what they leave out, beside ours. SI inside, mm in the table."""

from __future__ import annotations

import math

import numpy as np
from scipy.spatial.transform import Rotation

from armtempo.arrays import Floats
from armtempo.commands.papers._reproduction import Quantity
from armtempo.commands.papers.chung._run import (
    KA,
    KN,
    KP,
    MM,
    NOISE,
    PERIOD,
    POSTURE,
    REACH,
    SCHEMES,
    SETTLED,
    SHIFTS,
    SHOULDER,
    SWING,
    UNCAPPED,
    UPRIGHT,
    Chung,
    Hard,
    least_error,
    ordered_angles,
    papers_law,
    papers_path,
    still,
    turning,
)
from armtempo.configs import data_path
from armtempo.planners import FeedbackIK, IKGains, NewtonIK, PoseTarget, ResolvedRateIK
from armtempo.planners.ik import INTEGRATORS, IKRun, Integrator, SphericalWristIK
from armtempo.robots import Arm

Turned = dict[float, "IKRun"]  # at a fixed target, by how far the approach axis starts from it [deg]
STARTS_DEG = (10.0, 30.0, 60.0, 90.0, 120.0)
CAPTION = (
    "reference: what the paper's equations say, or a computation independent of this code;"
    " the paper prints no result. – : none"
)


def compare(found: Chung) -> list[Quantity]:
    """Every claim of the paper, and what it leaves out, beside ours."""
    turned = {start: _fixed_run(found.arm, Rotation.from_euler("X", -math.radians(start))) for start in STARTS_DEG}
    return [
        *_steady(found),
        *_law(found.arm, turned),
        *_papers_bounds(found.arm, turned),
        *_our_bounds(found),
        *_failures(found),
        *_reading(found),
    ]


def _row(
    section: str, what: str, unit: str, reference: float | None, ours: float, note: str = "", digits: int = 3
) -> Quantity:
    return Quantity(section, what, unit, reference, ours, digits, note, significant=True)


def _late(errors: Floats, time: Floats) -> float:
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
    newton = NewtonIK(found.arm).track(found.target, found.steady[True, "rk4", 1e-3].q[0])
    left = MM * _late(newton.position_error, newton.time)
    rows.append(_row(section, "position, a Newton step each, 1 ms", "mm", None, left, "beats Euler, not RK4"))
    for fed, integrator, step in printed:
        done = found.steady[fed, integrator, step]
        how = "with ω_d" if fed else "without ω_d"
        what = f"orientation, {how}, {integrator}, {1e3 * step:g} ms"
        note = "" if fed else f"the tool swings, at most {SWING:g} rad/s"
        rows.append(_row(section, what, "rad", None, _late(done.orientation_error, done.time), note))
    for integrator, order in zip(INTEGRATORS, (1, 2, 4), strict=True):
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


def _law(arm: Arm, turned: Turned) -> list[Quantity]:
    section = "What the law does"
    T = arm.tip_pose(POSTURE)
    aside = T.copy()
    aside[0, 3] += 1e-6
    target = PoseTarget.sample(still(aside), 10.0, 0.01)
    low, high = 1.5, 2.5  # K_p dt, stable and not
    while high - low > 1e-4:
        middle = 0.5 * (low + high)
        ik = FeedbackIK(arm, IKGains(position=middle / 0.01), joint_speed_max=UNCAPPED)
        error = ik.track(target, POSTURE, integrator="euler").position_error
        low, high = (middle, high) if error[-1] < error[0] else (low, middle)
    rows = [_row(section, "Euler is stable up to K_p dt", "1", 2.0, 0.5 * (low + high), "found by bisection", 5)]
    off = 0.0
    for start, done in turned.items():
        exact = math.tan(0.5 * math.radians(start)) * np.exp(-KA * done.time)
        off = max(off, float(np.abs(np.tan(0.5 * done.approach_error) / exact - 1.0).max()))
    rows.append(_row(section, "tan(δ/2) off tan(δ₀/2) e^(−K_a t)", "1", 0.0, off, "relative; δ₀ = 10 to 120°"))
    wide = arm.from_urdf(arm.urdf, position_limits=[[-1e4, 1e4]] * 6)
    both = IKGains(approach=KA, normal=KA)
    for w in (5.0, 10.0, 19.0, 21.0):
        ik = FeedbackIK(wide, both, feed_forward=False, joint_speed_max=UNCAPPED, damping=1e-6)
        error = ik.track(PoseTarget.sample(turning(T, w * T[:3, 2]), 3.0, 5e-4), POSTURE).orientation_error
        locked = w < KA
        reference, ours = (math.asin(w / KA), error[-1]) if locked else (math.pi, error.max())
        note = "asin(w/K), K = 20" if locked else "w > K: lock is lost"
        rows.append(_row(section, f"error behind a target turning at {w:g}/s", "rad", reference, ours, note, 4))
    return rows


def _fixed_run(arm: Arm, turned: Rotation) -> IKRun:
    """A fixed target from which the tip starts turned, in the target's axes."""
    ik = papers_law(arm, joint_speed_max=UNCAPPED, damping=1e-6)
    return ik.track(_fixed_target(arm, turned), POSTURE)


def _fixed_target(arm: Arm, turned: Rotation) -> PoseTarget:
    T = arm.tip_pose(POSTURE)
    T[:3, :3] = T[:3, :3] @ turned.as_matrix().T
    return PoseTarget.sample(still(T), 0.4, 2e-4)


def _papers_bounds(arm: Arm, turned: Turned) -> list[Quantity]:
    section = "The paper's bounds"
    rows = []
    for start, done in turned.items():
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
        beside = Rotation.from_euler("XYZ", [first, second, 0.0])
        done = _fixed_run(arm, beside)
        angles = ordered_angles(arm, done, _fixed_target(arm, beside))
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
    kept = sum(all(done.held.values()) for done in runs)
    rows = [
        _row(
            section,
            "runs whose bounds all hold",
            "1",
            float(len(runs)),
            float(kept),
            "of the joints' steps, without a pose",
        )
    ]
    shown: tuple[tuple[bool, Integrator, float], ...] = (
        (False, "rk4", 1e-3),
        (True, "euler", 1e-3),
        (True, "euler", 1e-2),
        (True, "rk4", 1e-2),
    )
    for fed, integrator, step in shown:
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
    falling = found.entry["rates fed"]
    adrift = ResolvedRateIK(found.arm).track(found.target, falling.q[0])
    beside = f"after a start {MM * falling.position_error[0]:.0f} mm beside the path, no noise"
    for name, done in ((SCHEMES[0], adrift), (SCHEMES[2], falling)):
        rows.append(_row(section, f"error left, {name}", "mm", None, MM * float(done.position_error[-1]), beside))
    cap = found.arm.speed_max
    chatter, law = "the paper's law chatters: of no certain value", "the paper's law"
    for hard, where, plainly in ((found.outside, "out of reach", chatter), (found.singular, "straight wrist", law)):
        for name, qd in (("plain", hard.plain_qd), ("damped", hard.ours.qd)):
            fastest, how = float(np.abs(qd).max()), plainly if name == "plain" else "and capped"
            rows.append(_row(section, f"{where}: fastest joint, {name}", "rad/s", None, fastest, how))
        share = float(np.abs(hard.ours.qd / cap).max())
        rows.append(_row(section, f"{where}: fastest joint / its cap", "1", 1.0, share))
    out, past = found.outside, found.singular
    least, note = round(MM * _while_held(out, least_error(out)), 1), "reference: no posture is nearer"
    ours, plain = (MM * _while_held(out, e) for e in (out.ours.position_error, out.plain_error[:, 0]))
    return [
        *rows,
        _row(section, "out of reach: error, plain", "mm", least, plain, chatter, 4),
        _row(section, "out of reach: error, damped", "mm", least, ours, note, 4),
        _row(section, "out of reach: error after the return", "mm", None, MM * float(out.ours.position_error[-1])),
        _row(
            section,
            "straight wrist: position error",
            "mm",
            None,
            MM * float(past.ours.position_error.max()),
            "greatest",
        ),
        _row(
            section, "straight wrist: turning error", "rad", None, float(past.ours.orientation_error.max()), "greatest"
        ),
    ]


def _while_held(hard: Hard, error: Floats) -> float:
    """The error at the end of the second outside [m]."""
    return float(error[round(2.0 / hard.target.step)])


def _reading(found: Chung) -> list[Quantity]:
    section = "Where its arm stands"
    ik = SphericalWristIK(found.arm)
    p = papers_path(np.linspace(0.0, 0.5 * PERIOD, 1001))[0]  # half a period: the other half is the way back
    T = np.tile(np.eye(4), (len(p), 1, 1))
    T[:, :3, :3] = UPRIGHT

    def share(height: float, every: int = 1) -> float:
        T[:, :3, 3] = p + SHOULDER - [0.0, 0.0, height]
        return float(np.isfinite(ik.solve(T[::every])).all(axis=-1).any(axis=-1).mean())

    heights = []
    note = "by bisection; reference: the circle about it"
    for inside, out in ((SHOULDER[2], 0.2), (SHOULDER[2], 1.2)):
        while abs(inside - out) > 1e-5:
            middle = 0.5 * (inside + out)
            inside, out = (middle, out) if share(middle, 50) == 1.0 else (inside, middle)
        heights.append(inside)
    lower, upper = (
        float(p[at, 2] + way * math.sqrt(REACH**2 - p[at, 0] ** 2 - p[at, 1] ** 2)) for at, way in ((0, -1), (-1, 1))
    )
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

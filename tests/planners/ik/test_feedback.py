"""FeedbackIK: the paper's run and its figures, the law's exact solutions, bounds, caps, singularities, other arms."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
import pybullet_data
import pytest
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation

from armtempo.arrays import Floats
from armtempo.configs import data_path
from armtempo.errors import InputError, RobotError, UnknownNameError
from armtempo.planners import FeedbackIK, IKGains, PoseTarget
from armtempo.planners.ik import IKRun, Integrator, SphericalWristIK
from armtempo.planners.ik._feedback import IKCapKeywords, IKCaps, ranges_near_zero
from armtempo.planners.ik._law import law_at, law_speeds, scaled, scratch, tip_and_jacobian
from armtempo.planners.ik._track import track_many
from armtempo.robots import Arm, Tool

DATA = Path(pybullet_data.getDataPath())
FAST = np.full(6, 1e4)
Q = np.array([0.2, 0.5, -0.6, 0.3, 0.9, 0.1])  # far from all singularities

# The paper's path and orientation (a_d = y, n_d = z), from rest at t = 0.
MIDDLE, AMPLITUDE = np.array([0.45, -0.05, 0.55]), np.array([0.25, 0.45, 0.45])
UPRIGHT = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
PERIOD = 4 * np.pi


def paper(t: Floats) -> tuple[Floats, Floats, Floats, Floats]:
    c, s = np.cos(0.5 * t)[:, None], np.sin(0.5 * t)[:, None]
    return MIDDLE + AMPLITUDE * c, fixed(UPRIGHT, t), -0.5 * AMPLITUDE * s, np.zeros((len(t), 3))


def fixed(value: Floats, t: Floats) -> Floats:
    return np.broadcast_to(value, (len(t), *value.shape))


def held_pose(T: Floats) -> Callable[[Floats], tuple[Floats, Floats, Floats, Floats]]:
    return lambda t: (fixed(T[:3, 3], t), fixed(T[:3, :3], t), np.zeros((len(t), 3)), np.zeros((len(t), 3)))


def turning(T: Floats, w: Floats) -> Callable[[Floats], tuple[Floats, Floats, Floats, Floats]]:
    """The position of T, and its orientation turning at w."""

    def motion(t: Floats) -> tuple[Floats, Floats, Floats, Floats]:
        R = Rotation.from_rotvec(t[:, None] * w).as_matrix() @ T[:3, :3]
        return fixed(T[:3, 3], t), R, np.zeros((len(t), 3)), fixed(w, t)

    return motion


def joint_motion(arm: Arm, start: Floats, end: Floats, duration: float) -> Callable[[Floats], Any]:
    """The poses of a smooth motion in joint space, and their exact rates."""

    def motion(t: Floats) -> tuple[Floats, Floats, Floats, Floats]:
        u = np.clip(t / duration, 0.0, 1.0)[:, None]
        q = start + u**3 * (10 - 15 * u + 6 * u * u) * (end - start)
        qd = 30 * (u * (1 - u)) ** 2 / duration * (end - start)
        T, J = arm.tip_pose(q), arm.jacobian(q)
        twist = np.einsum("kij,kj->ki", J, qd)
        return T[:, :3, 3], T[:, :3, :3], twist[:, :3], twist[:, 3:]

    return motion


@pytest.fixture(scope="module")
def puma() -> Arm:
    return Arm.from_urdf(data_path("robots/puma560_chung.urdf"))


@pytest.fixture(scope="module")
def start(puma: Arm) -> Floats:
    """The best-conditioned branch at the start of the paper's path."""
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = UPRIGHT, MIDDLE + AMPLITUDE
    return np.asarray(SphericalWristIK(puma).solve(T)[0])


def check(run: IKRun, arm: Arm) -> None:
    """What every run keeps: finite numbers, caps, limits, bounds."""
    assert np.isfinite(run.q).all()
    moved = np.abs(np.diff(run.q, axis=0)) / run.time[1]
    assert (moved <= run.bounds.joint_speed * (1 + 1e-9)).all()
    assert (np.abs(run.qd) <= run.bounds.joint_speed).all()
    assert (run.q >= arm.position_min).all()
    assert (run.q <= arm.position_max).all()
    assert all(run.held.values()), run.held


@pytest.mark.parametrize(
    ("feed_forward", "integrator", "step", "low_mm", "high_mm", "turned"),
    [
        (False, "rk4", 0.001, 6.716 * 0.999, 6.716 * 1.001, 1e-4),
        (True, "euler", 0.001, 3.03e-3, 3.05e-3, 1e-4),
        (True, "euler", 0.01, 3.03e-2, 3.05e-2, 1e-3),
        (True, "heun", 0.01, 0.9e-2, 1.1e-2, 1e-4),
        (True, "rk4", 0.01, 0.5e-4, 2e-4, 1e-7),
        (True, "rk4", 0.001, 0.0, 2e-8, 1e-11),
    ],
)
def test_the_papers_run(
    puma: Arm,
    start: Floats,
    feed_forward: bool,
    integrator: Integrator,
    step: float,
    low_mm: float,
    high_mm: float,
    turned: float,
) -> None:
    target = PoseTarget.sample(paper, PERIOD, step)
    run = FeedbackIK(puma, feed_forward=feed_forward).track(target, start, integrator=integrator)
    check(run, puma)
    assert not any(run.share.values())
    late = run.time > 1.0
    assert low_mm <= 1e3 * run.position_error[late].max() <= high_mm
    assert run.orientation_error[late].max() < turned
    assert run.bounds.position[late].max() < 1.05 * run.position_error[late].max() + 1e-12
    np.testing.assert_allclose(np.abs(run.qd[late]).max(), 0.7057, atol=2e-3)
    assert SphericalWristIK(puma).branch(run.q).max() == 0


@pytest.mark.parametrize(("integrator", "order"), [("euler", 1), ("heun", 2), ("rk4", 4)])
def test_order_of_the_integrators(puma: Arm, integrator: Integrator, order: int) -> None:
    """Against targets that move and turn, both fed forward."""
    motion = joint_motion(puma, Q, Q + np.array([0.4, -0.3, 0.5, 0.4, -0.3, 0.5]), 2.0)
    ik = FeedbackIK(puma)
    errors = []
    for step in (0.008, 0.004):
        run = ik.track(PoseTarget.sample(motion, 1.8, step), Q, integrator=integrator)
        check(run, puma)
        late = run.time > 0.9
        errors.append((run.position_error[late].max(), run.orientation_error[late].max()))
    rates = np.log2(np.divide(errors[0], errors[1]))
    assert (np.abs(rates - order) < 0.35).all(), (rates, errors)


def test_euler_is_one_newton_step_at_gain_1_and_unstable_beyond_2(puma: Arm) -> None:
    T = puma.tip_pose(Q)
    T[:3, 3] += 1e-3
    for rate, steady in ((1.9, True), (2.1, False)):
        gains = IKGains(position=rate / 0.01)
        ik = FeedbackIK(puma, gains, joint_speed_max=FAST)
        run = ik.track(PoseTarget.sample(held_pose(T), 1.0, 0.01), Q, integrator="euler")
        assert (run.position_error[-1] < 1e-6) == steady
        if not steady:
            np.testing.assert_allclose(run.position_error[5] / run.position_error[4], 1.1, rtol=1e-2)
    newton = FeedbackIK(puma, IKGains(position=100.0), joint_speed_max=FAST).track(
        PoseTarget.sample(held_pose(T), 0.05, 0.01), Q, integrator="euler"
    )
    assert newton.position_error[2] < 30 * newton.position_error[1] ** 2  # quadratic


@pytest.mark.parametrize("angle", [0.2, 1.0, 2.5])
def test_a_fixed_target_is_approached_as_the_exact_law_has_it(puma: Arm, angle: float) -> None:
    T = puma.tip_pose(Q)
    T[:3, :3] = Rotation.from_rotvec(angle * T[:3, 0]).as_matrix() @ T[:3, :3]  # about n: tilts a
    ik = FeedbackIK(puma, joint_speed_max=FAST, damping=1e-6)
    run = ik.track(PoseTarget.sample(held_pose(T), 0.3, 2e-4), Q)
    law = 2 * np.arctan(np.tan(0.5 * angle) * np.exp(-20.0 * run.time))
    np.testing.assert_allclose(np.tan(0.5 * run.approach_error), np.tan(0.5 * law), rtol=1e-6, atol=1e-12)
    paper_bound = angle * np.exp(-20.0 * run.time)  # its eq. (3.4), a first-order one
    np.testing.assert_allclose((run.approach_error / paper_bound)[-1], 2 * np.tan(0.5 * angle) / angle, rtol=1e-3)


def test_a_turning_target_is_followed_at_arcsine_or_lost(puma: Arm) -> None:
    T = puma.tip_pose(Q)
    wide = Arm.from_urdf(puma.urdf, position_limits=[[-100.0, 100.0]] * 6)
    ik = FeedbackIK(wide, IKGains(approach=20.0, normal=20.0), feed_forward=False, joint_speed_max=FAST, damping=1e-6)
    for w in (5.0, 10.0, 19.0):
        target = PoseTarget.sample(turning(T, w * T[:3, 2]), 3.0, 1e-3)  # about a: the wrist's last axis
        run = ik.track(target, Q)
        np.testing.assert_allclose(run.orientation_error[-1], np.arcsin(w / 20.0), rtol=5e-3)
        np.testing.assert_allclose(run.bounds.ultimate_approach, np.arcsin(w / 20.0), rtol=1e-6)
        assert run.bounds.ultimate_orientation >= run.orientation_error[-1]
        check(run, wide)
    lost = ik.track(PoseTarget.sample(turning(T, 22.0 * T[:3, 2]), 2.0, 1e-3), Q)
    assert lost.orientation_error.max() > 3.0
    assert lost.bounds.ultimate_approach == np.pi
    check(lost, wide)
    fed = FeedbackIK(wide, joint_speed_max=FAST).track(PoseTarget.sample(turning(T, 22.0 * T[:3, 2]), 0.5, 1e-3), Q)
    assert fed.orientation_error.max() < 1e-9


def test_the_rate_of_the_whole_rotation_angle_is_bounded_as_the_docstring_says() -> None:
    """For any error: u . omega >= K sin d - K_n / sqrt(27) (1 - cos d); without the second term it is not true."""
    random = np.random.default_rng(3)
    rotvec = random.normal(size=(20000, 3))
    angle = random.uniform(0.0, np.pi, 20000)
    u = rotvec / np.linalg.norm(rotvec, axis=1, keepdims=True)
    target = Rotation.from_rotvec(angle[:, None] * u).as_matrix()  # the tip's axes are the world's
    n, a = np.eye(3)[0], np.eye(3)[2]
    for Ka, Kn in ((20.0, 20.0), (20.0, 25.5), (25.5, 10.0)):
        omega = Ka * np.cross(a, target[:, :, 2]) + Kn * np.outer(np.cross(n, target[:, :, 0]) @ a, a)
        rate = (u * omega).sum(axis=1)
        plain = min(Ka, Kn) * np.sin(angle)
        assert (rate >= plain - Kn / np.sqrt(27) * (1 - np.cos(angle)) - 1e-12).all()
        assert (rate < plain - 0.5 * Kn / np.sqrt(27) * (1 - np.cos(angle))).any()


@pytest.mark.parametrize("error", ["axes", "quaternion"])
def test_a_half_turn_is_no_trap(puma: Arm, error: Any) -> None:
    T = puma.tip_pose(Q)
    for axis in np.eye(3):
        for short in (0.0, 1e-12, 1e-6):
            goal = T.copy()
            goal[:3, :3] = Rotation.from_rotvec((np.pi - short) * (T[:3, :3] @ axis)).as_matrix() @ T[:3, :3]
            run = FeedbackIK(puma, error=error).track(PoseTarget.sample(held_pose(goal), 3.0, 2e-3), Q)
            assert run.orientation_error[0] > 3.1
            assert run.orientation_error[-1] < 1e-6
            check(run, puma)
            # As much from one sample to the next.
            R = np.repeat([T[:3, :3], goal[:3, :3]], 25, axis=0)
            jump = FeedbackIK(puma, error=error).track(PoseTarget.through(np.tile(T[:3, 3], (50, 1)), R, 1e-3), Q)
            assert jump.orientation_error[25] > 3.1
            check(jump, puma)


def nearest(arm: Arm, point: Floats, q: Floats, bounds: Any) -> float:
    """The least distance of the tip from a point, searched from q [m]."""

    def distance(q: Floats) -> float:
        return float(np.linalg.norm(arm.tip_pose(q)[:3, 3] - point))

    return float(minimize(distance, q, method="L-BFGS-B", bounds=bounds, options={"ftol": 1e-15, "gtol": 1e-10}).fun)


def outwards(p: Floats, R: Floats, direction: Floats) -> Callable[[Floats], tuple[Floats, Floats, Floats, Floats]]:
    """0.8 m along ``direction`` within 1 s, 1 s there, and back within 1 s."""

    def motion(t: Floats) -> tuple[Floats, Floats, Floats, Floats]:
        u, back = np.clip(t, 0, 1)[:, None], np.clip(t - 2.0, 0, 1)[:, None]
        x = 0.8 * (u**3 * (10 - 15 * u + 6 * u * u) - back**3 * (10 - 15 * back + 6 * back**2))
        v = 0.8 * 30 * ((u * (1 - u)) ** 2 - (back * (1 - back)) ** 2)
        return p + x * direction, fixed(R, t), v * direction, np.zeros((len(t), 3))

    return motion


@pytest.mark.parametrize("task", ["position", "pose"])
@pytest.mark.parametrize(("integrator", "step"), [("euler", 0.001), ("rk4", 0.01)])
def test_out_of_the_workspace_and_back(puma: Arm, task: Any, integrator: Integrator, step: float) -> None:
    T = puma.tip_pose(Q)
    direction = T[:3, 3] - [0.0, 0.0, 0.66]
    direction /= np.linalg.norm(direction)
    target = PoseTarget.sample(outwards(T[:3, 3], T[:3, :3], direction), 4.0, step)
    run = FeedbackIK(puma, task=task).track(target, Q, integrator=integrator)
    check(run, puma)
    outside = round(2.0 / step)  # the target has been held for 1 s
    far = T[:3, 3] + 0.8 * direction
    least = nearest(puma, far, run.q[outside], None)
    assert least > 0.5
    assert run.position_error[outside] < 1.01 * least
    assert run.position_error[-1] < 1e-9
    assert len(set(SphericalWristIK(puma).branch(run.q))) == 1  # the elbow stays on its side
    if task == "pose":
        assert np.abs(run.q[-1] - Q).max() < 1e-4
        assert run.orientation_error[-1] < 1e-6


def test_past_the_wrist_singularity(puma: Arm) -> None:
    """The tool turns so that the wrist passes its straight posture at 0.01 rad: an exact inverse would spin."""
    straight = Q * [1, 1, 1, 1, 0, 1]
    T = puma.tip_pose(straight)
    worst = np.linalg.svd(puma.jacobian(straight))[0][3:, -1]
    worst /= np.linalg.norm(worst)
    aside = np.cross(worst, [0.0, 0.0, 1.0])
    T[:3, :3] = Rotation.from_rotvec(0.01 * aside / np.linalg.norm(aside)).as_matrix() @ T[:3, :3]
    before = T.copy()
    before[:3, :3] = Rotation.from_rotvec(-0.6 * worst).as_matrix() @ T[:3, :3]
    answers = SphericalWristIK(puma).solve(before)
    first = answers[np.nanargmin(np.abs(answers - straight).max(axis=1))]
    runs: list[tuple[Integrator, float]] = [("euler", 0.001), ("rk4", 0.01)]
    for integrator, step in runs:
        target = PoseTarget.sample(turning(before, 0.6 * worst), 3.0, step)
        run = FeedbackIK(puma).track(target, first, integrator=integrator)
        check(run, puma)
        assert run.share["damped"] > 0.05
        assert run.orientation_error.max() < 0.02
        assert run.position_error.max() < 0.01
        assert run.position_error[-1] < 1e-9


ARMS: dict[str, tuple[Path, str | None]] = {
    "panda": (DATA / "franka_panda" / "panda.urdf", "panda_hand"),
    "iiwa": (DATA / "kuka_iiwa" / "model.urdf", None),
    "ur5e": (data_path("robots/ur5e_like.urdf"), None),
    "puma": (data_path("robots/puma560.urdf"), None),
    "scara": (data_path("robots/scara_800.urdf"), "tool"),
    "planar": (data_path("robots/planar_two_link.urdf"), None),
}
ROWS = {"panda": 6, "iiwa": 6, "ur5e": 6, "puma": 6, "scara": 4, "planar": 2}
LOADED: dict[str, Arm] = {}


def loaded(name: str) -> Arm:
    if name not in LOADED:
        urdf, tip = ARMS[name]
        LOADED[name] = Arm.from_urdf(urdf, tip_link=tip)
    return LOADED[name]


def postures(arm: Arm, random: np.random.Generator) -> tuple[Floats, Floats]:
    low, high = np.maximum(arm.position_min, -2.5), np.minimum(arm.position_max, 2.5)
    first = random.uniform(0.9 * low + 0.1 * high, 0.1 * low + 0.9 * high)
    return first, np.clip(first + random.uniform(-0.15, 0.15, arm.dof) * (high - low), low, high)


def leaving(arm: Arm, first: Floats, last: Floats, duration: float) -> Callable[[Floats], Any]:
    """``joint_motion``, and away from it along the arm, out of the workspace, in the middle third."""
    inside = joint_motion(arm, first, last, duration)
    away = arm.tip_pose(0.5 * (first + last))[:3, 3]
    away = 1.5 * away / max(float(np.linalg.norm(away)), 0.1)

    def motion(t: Floats) -> tuple[Floats, Floats, Floats, Floats]:
        p, R, v, w = inside(t)
        u = np.clip(3 * t / duration - 1, 0.0, 1.0)[:, None]
        return p + 64 * (u * (1 - u)) ** 3 * away, R, v + 576 / duration * (u * (1 - u)) ** 2 * (1 - 2 * u) * away, w

    return motion


def flipped(motion: Callable[[Floats], Any], time: float, turn: Rotation) -> Callable[[Floats], Any]:
    """The motion, turned at once at ``time``."""

    def turned(t: Floats) -> tuple[Floats, Floats, Floats, Floats]:
        p, R, v, w = motion(t)
        return p, np.where(t[:, None, None] < time, R, R @ turn.as_matrix()), v, w

    return turned


def random_run(seed: int) -> tuple[Arm, FeedbackIK, Callable[[Floats], Any], IKRun, str]:
    """A run of random arm, gains, step, integrator, start and target.

    A third of them singular, a sixth unreachable, a sixth with a half turn from one sample to the next, a sixth with
    gains of 1 to 3 a step, too high for some integrators.
    """
    random, more = np.random.default_rng(seed), np.random.default_rng([seed, 1])
    arm = loaded(sorted(ARMS)[seed % len(ARMS)])
    first, last = postures(arm, random)
    if random.random() < 1 / 3:  # through a posture with straight joints, where most arms are singular
        middle = np.where(random.random(arm.dof) < 0.4, 0.0, 0.5 * (first + last))
        first, last = (
            np.clip(q - 0.5 * (first + last) + middle, arm.position_min, arm.position_max) for q in (first, last)
        )
    gain = 10.0 ** random.uniform(0.3, 1.8)
    integrator: Integrator = ("euler", "heun", "rk4")[random.integers(3)]
    fed, step = bool(random.integers(2)), float(random.choice([0.001, 0.002, 0.004, 0.01]))
    stiff = more.random() < 1 / 6
    if stiff:
        gain = more.uniform(1.0, 3.0) / step
    gains = IKGains(position=gain, approach=gain * random.uniform(0.3, 1.0), normal=gain * random.uniform(0.3, 1.0))
    ik = FeedbackIK(arm, gains, error=("axes", "quaternion")[random.integers(2)], feed_forward=fed)
    away = np.clip(first + random.uniform(-0.4, 0.4, arm.dof), arm.position_min, arm.position_max)
    motion = (leaving if random.random() < 1 / 6 else joint_motion)(arm, first, last, 2.0)
    if more.random() < 1 / 6:
        axis = more.normal(size=3) if more.random() < 0.5 else np.eye(3)[more.integers(3)]
        short = more.choice([0.0, 0.0, 1e-12, 1e-8, 1e-7])
        half = Rotation.from_rotvec((np.pi - short) * axis / np.linalg.norm(axis))
        motion = flipped(motion, step * more.integers(1, round(1.0 / step)), half)
    target = PoseTarget.sample(motion, 2.0, step)
    run = ik.track(target, away if random.random() < 0.5 else first, integrator=integrator)
    return arm, ik, motion, run, f"{integrator}{' fed' if fed else ''}{' stiff' if stiff else ''}"


def check_random_run(seed: int) -> dict[tuple[str, str], float]:
    """All that any run keeps; the medians of bound / error over the run's second half, by error and class."""
    arm, ik, motion, run, kind = random_run(seed)
    check(run, arm)
    # Between the samples, by the arm's own kinematics.
    rows = np.random.default_rng(seed).integers(0, len(run.time) - 1, 40)
    part = np.linspace(0.1, 0.9, 5)
    q = run.q[rows, None] + part[:, None] * (run.q[rows + 1] - run.q[rows])[:, None]
    p = motion((run.time[rows, None] + run.time[1] * part).ravel())[0].reshape(*q.shape[:2], 3)
    miss = np.linalg.norm(arm.tip_pose(q)[..., :3, 3] - p, axis=-1)
    assert (miss <= run.bounds.position_between[rows, None] * (1 + 1e-6) + 1e-12).all(), (seed, kind)
    found = {}
    half = len(run.time) // 2
    for name in ("position", "approach", "orientation", "position_between"):
        measured = getattr(run, f"{name}_error", None)
        bound = getattr(run.bounds, name)
        assert np.isfinite(bound).all()
        if measured is None:
            found[name, kind] = float(np.median(run.bounds.position_between[rows] / miss.max(axis=1)))
            continue
        late = measured[half:] > 1e-11
        if late.any() and (name == "position" or len(ik.task) > 3):
            found[name, kind] = float(np.median(bound[half:][late] / measured[half:][late]))
    return found


def test_caps_limits_and_bounds_hold_whatever_is_asked() -> None:
    found = [check_random_run(seed) for seed in range(150)]
    for name in ("position", "approach", "orientation", "position_between"):
        ratios = [r for one in found for (error, _), r in one.items() if error == name]
        assert len(ratios) > 50
        assert np.median(ratios) <= 3.0, (name, np.median(ratios))


@pytest.mark.parametrize("name", ["panda", "scara", "planar", "ur5e"])
def test_other_arms_follow_exactly(name: str) -> None:
    arm = loaded(name)
    first = {
        "panda": [0.1, -0.5, 0.3, -2.0, 0.2, 1.6, 0.4],
        "scara": [0.3, 1.2, -0.1, 0.5],
        "planar": [0.4, 1.1],
        "ur5e": [0.2, -1.2, 1.5, -0.6, 1.0, 0.3],
    }[name]
    start = np.array(first)
    end = start + 0.3 * np.where(arm.model.prismatic, 0.2, 1.0)
    run = FeedbackIK(arm).track(PoseTarget.sample(joint_motion(arm, start, end, 1.0), 1.2, 0.002), start)
    check(run, arm)
    assert run.position_error.max() < 1e-8
    if name != "planar":
        assert run.orientation_error.max() < 1e-8


def test_spare_joints_go_to_the_posture_without_moving_the_tool() -> None:
    panda = loaded("panda")
    start = np.array([0.1, -0.5, 0.3, -2.0, 0.2, 1.6, 0.4])
    rest = start + np.array([0.3, 0.2, -0.4, 0.0, 0.1, 0.0, 0.0])
    target = PoseTarget.sample(held_pose(panda.tip_pose(start)), 4.0, 0.004)
    still = FeedbackIK(panda, posture_gain=0.0).track(target, start)
    moved = FeedbackIK(panda, posture=rest, posture_gain=2.0).track(target, start)
    assert np.abs(still.q - start).max() < 1e-9
    assert moved.position_error.max() < 1e-6
    assert moved.orientation_error.max() < 1e-6
    assert np.linalg.norm(moved.q[-1] - rest) < 0.8 * np.linalg.norm(start - rest)
    # Where it rests, what the posture still wants the task forbids.
    J = panda.jacobian(moved.q[-1])
    left = rest - moved.q[-1]
    assert np.linalg.norm(left - np.linalg.pinv(J) @ (J @ left)) < 2e-3


def test_joint_limits_stop_a_joint_and_the_others_go_on(puma: Arm) -> None:
    """The waist may not turn far enough; in a position task the tip gets as near as the rest can."""
    arm = Arm.from_urdf(puma.urdf, position_limits=[[-0.5, 0.5], *[[-6.0, 6.0]] * 5])
    far = arm.tip_pose(Q)
    far[:3, 3] = Rotation.from_rotvec([0.0, 0.0, 0.8]).as_matrix() @ far[:3, 3]
    run = FeedbackIK(arm, task="position").track(PoseTarget.sample(held_pose(far), 4.0, 0.004), Q)
    check(run, arm)
    assert run.share["limit"] > 0.5
    assert run.q[-1, 0] == 0.5
    least = nearest(arm, far[:3, 3], run.q[-1], np.stack([arm.position_min, arm.position_max], axis=1))
    assert run.position_error[-1] < 1.01 * least


def test_the_wrist_is_tracked_for_the_tip(puma: Arm) -> None:
    """A tool of 0.2 m along a; with the tip in the wrist's centre it is the same law."""
    T = np.eye(4)
    T[:3, 3] = 0.02, 0.0, 0.2
    tooled = Arm.from_urdf(puma.urdf, position_limits=[[-6.0, 6.0]] * 6, tool=Tool(T_link_tool=T))
    motion = joint_motion(tooled, Q, Q + np.array([0.4, -0.3, 0.5, 0.4, -0.3, 0.5]), 1.0)
    target = PoseTarget.sample(motion, 1.2, 0.004)
    compiled: list[Any] = [track_many, law_at, law_speeds]  # each takes a while
    bare = FeedbackIK(puma, point="wrist")
    bare.track(target, Q + 0.05)
    bare.joint_speeds(Q, target, 14)
    before = [set(loop.signatures) for loop in compiled]
    ik = FeedbackIK(tooled, point="wrist")
    run = ik.track(target, Q + 0.05)
    check(run, tooled)
    miss = np.linalg.norm(tooled.tip_pose(run.q)[:, :3, 3] - target.position[::2], axis=1)
    most = run.position_error + 2 * np.linalg.norm(T[:3, 3]) * np.sin(0.5 * run.orientation_error)
    assert (miss <= most + 1e-12).all()
    assert miss[0] > 0.01
    assert miss[-1] < 1e-8
    assert np.array_equal(ik.joint_speeds(run.q[7], target, 14)[0], run.qd[7])
    assert [set(loop.signatures) for loop in compiled] == before
    models_and_laws = [{types[:2] for types in loop.signatures} for loop in compiled[:2]]
    assert models_and_laws[1] <= models_and_laws[0]
    J = puma.jacobian(run.q)  # its tip is the wrist's centre
    J[:, :3] /= ik.length
    np.testing.assert_allclose(ik.singular_value(run.q), np.linalg.svd(J, compute_uv=False)[:, -1], rtol=1e-10)
    # An acceleration that is given counts for the wrist, too.
    rough = ik.track(PoseTarget.sample(motion, 1.2, 0.004, acceleration=9.0), Q + 0.05)
    more = 0.125 * 0.004**2 * (9.0 - target.acceleration)
    np.testing.assert_allclose(rough.bounds.position_between - run.bounds.position_between, more, rtol=1e-6)
    # Turning the tool about its tip's wrist moves the wrist's joints alone.
    turned = tooled.tip_pose(Q + np.array([0.0, 0.0, 0.0, 0.2, 0.2, 0.2]))
    spun = ik.track(PoseTarget.sample(held_pose(turned), 1.0, 0.002), Q)
    assert np.abs(spun.q[:, :3] - Q[:3]).max() < 1e-9
    assert spun.orientation_error[-1] < 1e-6
    plain = PoseTarget.sample(joint_motion(puma, Q, Q + 0.3, 0.5), 0.5, 0.01)
    same = FeedbackIK(puma, point="wrist").track(plain, Q + 0.05)
    np.testing.assert_allclose(same.q, FeedbackIK(puma).track(plain, Q + 0.05).q, atol=1e-12)
    with pytest.raises(RobotError, match="closed form"):
        FeedbackIK(loaded("panda"), point="wrist")
    with pytest.raises(InputError, match="point"):
        FeedbackIK(puma, point="elbow")  # type: ignore[arg-type]


def test_ranges_far_from_zero_and_without_end(puma: Arm) -> None:
    far = Arm.from_urdf(puma.urdf, position_limits=[[4.0, 6.0], [-9.0, -5.0], *[[-np.inf, np.inf]] * 4])
    low, high = ranges_near_zero(far, 3.0)
    assert (low[:3].tolist(), high[:3].tolist()) == ([4.0, -8.0, -3.0], [6.0, -5.0, 3.0])
    start = Q + 2 * np.pi * np.array([0, -1, 0, 5, 0, 0]) + [4.5, 0, 0, 0, 0, 0]
    target = PoseTarget.sample(held_pose(far.tip_pose(start + 0.05)), 1.0, 0.01)
    run = FeedbackIK(far).track(target, start)
    check(run, far)
    assert max(run.position_error[-1], run.orientation_error[-1]) < 1e-6
    scara = loaded("scara")
    slides = scara.model.prismatic[:, None]
    near = np.where(slides, [3.5, 4.0], [-2.0, 2.0])
    assert len(FeedbackIK(Arm.from_urdf(scara.urdf, tip_link="tool", position_limits=near.tolist())).task) == 4
    endless = np.where(slides, [-np.inf, np.inf], [-2.0, 2.0])
    with pytest.raises(RobotError, match="slides without limits behind one that turns"):
        FeedbackIK(Arm.from_urdf(scara.urdf, tip_link="tool", position_limits=endless.tolist()))


def test_bounds_hold_to_rounding(puma: Arm) -> None:
    """Rotations of ten digits, a base far from the origin, a step of a microsecond under a low cap."""
    T = puma.tip_pose(Q)
    T[:3, :3] = np.round(T[:3, :3], 10)
    check(FeedbackIK(puma).track(PoseTarget.sample(held_pose(T), 3.0, 2e-3), Q), puma)
    base = np.eye(4)
    base[:3, 3] = 1e4, 3e3, 0.0
    away = Arm.from_urdf(puma.urdf, T_world_base=base)
    check(FeedbackIK(away).track(PoseTarget.sample(joint_motion(away, Q, Q + 0.2, 1.0), 1.5, 2e-3), Q), away)
    T[:3, 3] += 0.1
    slow = FeedbackIK(puma, joint_speed_max=np.full(6, 0.01)).track(PoseTarget.sample(held_pose(T), 1e-4, 1e-6), Q)
    assert all(slow.held.values())


def test_samples_alone_and_samples_with_rates(puma: Arm) -> None:
    motion = joint_motion(puma, Q, Q + 0.4, 1.0)
    exact = PoseTarget.sample(motion, 1.0, 0.01)
    p, R, v, w = (np.asarray(values)[::2] for values in motion(np.linspace(0.0, 1.0, 201)))
    cubic = PoseTarget.through(p, R, 0.01, velocity=v, angular_velocity=w)
    bare = PoseTarget.through(p, R, 0.01)
    assert np.abs(cubic.position - exact.position).max() < 1e-7
    assert np.abs(cubic.rotation - exact.rotation).max() < 1e-7
    assert np.abs(cubic.angular_velocity - exact.angular_velocity).max() < 1e-4
    ik = FeedbackIK(puma)
    assert np.abs(ik.track(cubic, Q).q - ik.track(exact, Q).q).max() < 1e-6
    lag = ik.track(bare, Q)
    check(lag, puma)
    assert 1e-4 < lag.position_error.max() <= lag.bounds.ultimate_position
    unrated = PoseTarget.sample(lambda t: (*motion(t)[:2], None, None), 1.0, 0.01, angular_acceleration=7.0)
    assert unrated.differentiated
    assert unrated.angular_acceleration == 7.0
    assert np.array_equal(unrated.position, exact.position)  # the middles, too
    assert np.abs(unrated.velocity - exact.velocity).max() < 2e-3
    assert np.abs(unrated.angular_velocity - exact.angular_velocity).max() < 2e-3
    assert len(PoseTarget.sample(motion, 0.005, 0.01).time) == 2
    with pytest.raises(InputError, match="one of velocity and angular velocity is missing"):
        PoseTarget.through(p, R, 0.01, velocity=v)
    for wrong in (np.nan, -1.0):
        with pytest.raises(InputError, match="accelerations"):
            PoseTarget.sample(motion, 1.0, 0.01, acceleration=wrong)


def test_a_batch_is_its_runs(puma: Arm) -> None:
    ik = FeedbackIK(puma)
    targets = [PoseTarget.sample(joint_motion(puma, Q, Q + x, 0.3), 0.3, 0.01) for x in (0.1, 0.2, 0.3)]
    starts = np.stack([Q, Q + 0.01, Q - 0.01])
    for run, target, first in zip(ik.track_many(targets, starts), targets, starts, strict=True):
        assert np.array_equal(run.q, ik.track(target, first).q)


def test_the_law_on_line_is_the_eulers_run() -> None:
    for name in ("puma", "panda", "scara"):
        arm = loaded(name)
        first, last = postures(arm, np.random.default_rng(4))
        ik, target = FeedbackIK(arm), PoseTarget.sample(joint_motion(arm, first, last, 0.2), 0.2, 0.004)
        run, q = ik.track(target, first, integrator="euler"), first.copy()
        for k in range(len(run.time) - 1):
            qd, flags = ik.joint_speeds(q, target, 2 * k)
            assert np.array_equal(qd, run.qd[k])
            assert flags == run.flags[k]
            q = np.clip(q + target.step * qd, arm.position_min, arm.position_max)
            assert np.array_equal(q, run.q[k + 1])
        with pytest.raises(InputError, match="row 101"):
            ik.joint_speeds(first, target, 101)
        with pytest.raises(InputError, match="shape"):
            ik.joint_speeds(first[:-1], target, 0)


def test_the_loops_own_jacobian_and_pose_are_the_arms() -> None:
    for name in ARMS:
        arm = loaded(name)
        room = scratch(arm.dof, 6)
        for q in (postures(arm, np.random.default_rng(seed))[0] for seed in range(5)):
            tip_and_jacobian(arm.model, q, room)
            T = arm.tip_pose(q)
            np.testing.assert_allclose(room.J, arm.jacobian(q), atol=1e-14)
            np.testing.assert_allclose(room.tip, np.vstack([T[:3, 3], T[:3, :3].T]), atol=1e-14)


def test_a_scaled_law_differs_in_its_gains_and_its_damping_only(puma: Arm) -> None:
    law = FeedbackIK(puma).law
    other = scaled(law, (2.0, 3.0, 4.0, 10.0), 0.9)
    assert (other.position_gain, other.approach_gain, other.normal_gain) == (2 * 50.9, 3 * 20.0, 4 * 25.5)
    assert other.damping == 10.0 * law.damping
    assert scaled(law, (1.0, 1.0, 1.0, 100.0), 0.9).damping == 0.9
    changed = {"position_gain", "approach_gain", "normal_gain", "damping"}
    assert all(np.array_equal(getattr(other, name), getattr(law, name)) for name in set(law._fields) - changed)


def test_caps_as_a_record_and_as_keywords_have_the_same_names() -> None:
    assert [field.name for field in fields(IKCaps)] == list(IKCapKeywords.__annotations__)


def test_what_cannot_be_used_is_named(puma: Arm) -> None:
    target = PoseTarget.sample(held_pose(puma.tip_pose(Q)), 0.1, 0.01)
    with pytest.raises(InputError, match="gain approach"):
        IKGains(approach=0.0)
    with pytest.raises(InputError, match="gain position must be numbers"):
        IKGains(position="a")  # type: ignore[arg-type]
    with pytest.raises(InputError, match="posture"):
        FeedbackIK(puma, posture=np.full(6, np.inf))
    with pytest.raises(InputError, match="task must be numbers"):
        FeedbackIK(puma, task=[[1.0], [1.0, 2.0]])
    with pytest.raises(InputError, match="starts must be numbers"):
        FeedbackIK(puma).track_many([target, target], [Q, Q[:5]])
    with pytest.raises(InputError, match=r"damping = 0.0 \(give a number > 0\)"):
        FeedbackIK(puma, damping=0.0)
    with pytest.raises(InputError, match=r"damping = 1.5 \(give a damping < 1\)"):
        FeedbackIK(puma, damping=1.5)
    with pytest.raises(InputError, match=r"angular_speed_max = -1.0 \(give a number > 0\)"):
        FeedbackIK(puma, angular_speed_max=-1.0)
    with pytest.raises(InputError, match=r"posture_gain = -1.0 \(give a gain >= 0\)"):
        FeedbackIK(puma, posture_gain=-1.0)
    with pytest.raises(InputError, match="joint_speed_max is not > 0"):
        FeedbackIK(puma, joint_speed_max=np.zeros(6))
    with pytest.raises(InputError, match=r"joint_speed_max has shape \(5,\)"):
        FeedbackIK(puma, joint_speed_max=np.ones(5))
    with pytest.raises(UnknownNameError, match=r"unknown keyword 'dampening' .*did you mean 'damping'"):
        FeedbackIK(puma, dampening=0.1)  # type: ignore[call-arg]
    with pytest.raises(InputError, match="task rows"):
        FeedbackIK(puma, task=np.ones((1, 6)))
    with pytest.raises(InputError, match="integrator"):
        FeedbackIK(puma).track(target, Q, integrator="rk5")  # type: ignore[arg-type]
    with pytest.raises(InputError, match="joint 'waist_joint' is outside"):
        FeedbackIK(puma).track(target, Q + 7.0)
    with pytest.raises(InputError, match="rotations"):
        PoseTarget.through(np.zeros((3, 3)), np.ones((3, 3, 3)), 0.01)
    with pytest.raises(InputError, match="step"):
        PoseTarget.sample(held_pose(np.eye(4)), 1.0, 0.0)

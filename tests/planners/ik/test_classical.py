"""NewtonIK, ResolvedRateIK, ClosedFormIK: the paper's path with each, noise, and what they do out of reach."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from armtempo.arrays import Floats
from armtempo.configs import data_path
from armtempo.errors import InputError, RobotError
from armtempo.planners import ClosedFormIK, FeedbackIK, NewtonIK, PoseTarget, ResolvedRateIK
from armtempo.planners.ik import SphericalWristIK
from armtempo.robots import Arm

MIDDLE, AMPLITUDE = np.array([0.45, -0.05, 0.55]), np.array([0.25, 0.45, 0.45])
UPRIGHT = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])


def paper(t: Floats) -> tuple[Floats, Floats, Floats, Floats]:
    c, s = np.cos(0.5 * t)[:, None], np.sin(0.5 * t)[:, None]
    return (
        MIDDLE + AMPLITUDE * c,
        np.broadcast_to(UPRIGHT, (len(t), 3, 3)),
        -0.5 * AMPLITUDE * s,
        np.zeros((len(t), 3)),
    )


def outwards(t: Floats) -> tuple[Floats, Floats, Floats, Floats]:
    """From the paper's first point 0.5 m out of the workspace and back, within 2 s."""
    away = np.array([0.25, 0.45, 0.45]) / np.linalg.norm([0.25, 0.45, 0.45])
    u, rate = np.sin(0.5 * np.pi * t) ** 2, 0.5 * np.pi * np.sin(np.pi * t)
    still = np.broadcast_to(UPRIGHT, (len(t), 3, 3))
    return MIDDLE + AMPLITUDE + 0.5 * u[:, None] * away, still, 0.5 * rate[:, None] * away, np.zeros((len(t), 3))


@pytest.fixture(scope="module")
def puma() -> Arm:
    """Without its joint limits: the paper's path needs more than they leave."""
    return Arm.from_urdf(data_path("robots/puma560_chung.urdf"), position_limits=[[-20.0, 20.0]] * 6)


@pytest.fixture(scope="module")
def start(puma: Arm) -> Floats:
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = UPRIGHT, MIDDLE + AMPLITUDE
    return np.asarray(SphericalWristIK(puma).solve(T)[0])


@pytest.fixture(scope="module")
def path() -> PoseTarget:
    return PoseTarget.sample(paper, 4 * np.pi, 0.001)


def test_newton_on_the_papers_path(puma: Arm, start: Floats, path: PoseTarget) -> None:
    """One step for each sample leaves half the second derivative of FK along it; iterated it is exact."""
    one, iterated = NewtonIK(puma).track(path, start), NewtonIK(puma, iterations=None).track(path, start)
    assert 1e-8 < one.position_error.max() < 3e-7
    assert iterated.position_error.max() < 1e-13
    assert iterated.orientation_error.max() < 1e-13
    coarse = NewtonIK(puma).track(PoseTarget.sample(paper, 4 * np.pi, 0.01), start)
    np.testing.assert_allclose(coarse.position_error.max() / one.position_error.max(), 100.0, rtol=0.05)
    assert not any(iterated.share.values())


def test_closed_form_is_exact_and_says_what_it_does_not_reach(puma: Arm, start: Floats, path: PoseTarget) -> None:
    run = ClosedFormIK(puma).track(path, start)
    assert run.position_error.max() < 1e-12
    assert run.orientation_error.max() < 1e-12
    assert np.array_equal(run.q, ClosedFormIK(puma, choice="branch").track(path, start).q)
    out = ClosedFormIK(puma).track(PoseTarget.sample(outwards, 2.0, 0.002), start)
    assert 0.3 < out.share["unreached"] < 0.9
    held = out.flags[1:] & 128 != 0
    assert (np.diff(out.q, axis=0)[held] == 0.0).all()
    assert out.position_error[1:][held].min() > 1e-9
    assert out.position_error[1:][~held].max() < 1e-12
    with pytest.raises(RobotError, match="closed form"):
        ClosedFormIK(Arm.from_urdf(data_path("robots/ur5e_like.urdf")))


def test_resolved_rate_drifts_and_noise_adds_up_where_feedback_stays(
    puma: Arm, start: Floats, path: PoseTarget
) -> None:
    clean = ResolvedRateIK(puma).track(path, start)
    assert clean.position_error[-1] > 100 * NewtonIK(puma).track(path, start).position_error.max()
    feedback = FeedbackIK(puma).track(path, start)
    assert feedback.position_error[-1] < 1e-9
    noisy = [ResolvedRateIK(puma, position_noise=s, angle_noise=s, seed=2).track(path, start) for s in (1e-4, 1e-3)]
    late = path.time > 6.0
    drift = [run.position_error[late].mean() for run in (clean, *noisy)]
    assert drift[0] < drift[1] < 0.2 * drift[2]
    # Feedback on the same samples: noise of 1e-3 is smoothed, and nothing adds up.
    noise = np.random.default_rng(2).normal(size=(2, len(path.time), 3))
    turned = Rotation.from_rotvec(1e-3 * noise[1]).as_matrix() @ path.rotation[::2]
    measured = PoseTarget.through(path.position[::2] + 1e-3 * noise[0], turned, path.step)
    run = FeedbackIK(puma).track(measured, start)
    miss = np.linalg.norm(puma.tip_pose(run.q)[:, :3, 3] - path.position[::2], axis=1)
    lag = FeedbackIK(puma, feed_forward=False).track(path, start).position_error
    assert miss[late].mean() < 1.1 * lag[late].mean()
    assert np.abs(run.qd).max() < 0.2 * np.abs(noisy[1].qd).max()


def test_out_of_reach_newton_flies_off_and_damping_holds_it(puma: Arm, start: Floats) -> None:
    target = PoseTarget.sample(outwards, 2.0, 0.002)
    wild, damped = NewtonIK(puma).track(target, start), NewtonIK(puma, damping=0.1).track(target, start)
    assert wild.share["speed"] > 0.2
    moved, most = (np.linalg.norm(np.diff(run.q, axis=0), axis=1).max() for run in (damped, wild))
    assert moved < 0.1 * most
    assert damped.position_error[-1] < 1e-6
    assert np.isfinite(wild.q).all()
    assert NewtonIK(puma, iterations=None).track(target, start).share["unreached"] > 0.3
    assert wild.share["unreached"] == 0.0  # with a count of steps the errors tell
    assert wild.bounds.ultimate_position == np.inf


def test_other_arms_and_what_cannot_be_used(puma: Arm) -> None:
    scara = Arm.from_urdf(data_path("robots/scara_800.urdf"), tip_link="tool")
    first = np.array([0.3, 1.2, -0.1, 0.5])
    T = scara.tip_pose(first + 0.02)
    held = PoseTarget.sample(
        lambda t: (
            np.broadcast_to(T[:3, 3], (len(t), 3)),
            np.broadcast_to(T[:3, :3], (len(t), 3, 3)),
            np.zeros((len(t), 3)),
            np.zeros((len(t), 3)),
        ),
        0.02,
        0.01,
    )
    np.testing.assert_allclose(NewtonIK(scara, iterations=None).track(held, first).q[-1], first + 0.02, atol=1e-12)
    with pytest.raises(InputError, match="iterations"):
        NewtonIK(puma, iterations=0)
    with pytest.raises(InputError, match="iterations"):
        NewtonIK(puma, iterations=1.5)  # type: ignore[arg-type]
    with pytest.raises(InputError, match="seed"):
        ResolvedRateIK(puma, seed=-1)
    with pytest.raises(InputError, match="noise"):
        ResolvedRateIK(puma, position_noise=-1.0)
    with pytest.raises(InputError, match="choice"):
        ClosedFormIK(puma, choice="best")  # type: ignore[arg-type]
    with pytest.raises(InputError, match="start"):
        NewtonIK(puma).track(held, np.zeros(5))

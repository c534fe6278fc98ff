"""The feedback law where it is stuck: it arrives wherever bounded least squares does, and stays as it was elsewhere."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.optimize import lsq_linear
from scipy.spatial.transform import Rotation

from armtempo.arrays import Floats
from armtempo.configs import data_path
from armtempo.planners import CoordinationCell, FeedbackIK, IKCell, PoseTarget, load_cell
from armtempo.planners.ik import IKRun, SphericalWristIK
from armtempo.planners.ik._feedback import ranges_near_zero
from armtempo.robots import Arm

PAIRS, ORACLE_PAIRS = 40, 3


def arms() -> dict[str, Arm]:
    return {
        "ur5e": Arm.from_urdf(data_path("robots/ur5e_like.urdf")),
        "panda": load_cell("panda-poses", IKCell).arm,
        "puma": Arm.from_urdf(data_path("robots/puma560.urdf")),
        "iiwa": load_cell("iiwa-pair", CoordinationCell).arms[0],
        "scara": Arm.from_urdf(data_path("robots/scara_800.urdf")),
    }


ARMS = arms()


def resting(T: Floats, duration: float = 10.0, step: float = 0.004) -> PoseTarget:
    def motion(t: Floats) -> tuple[Floats, Floats, Floats, Floats]:
        zero = np.zeros((len(t), 3))
        return zero + T[:3, 3], np.broadcast_to(T[:3, :3], (len(t), 3, 3)), zero, zero

    return PoseTarget.sample(motion, duration, step)


def arrived(ik: FeedbackIK, run: IKRun) -> bool:
    return bool(run.position_error[-1] < 1e-7 and (len(ik.task) < 6 or run.orientation_error[-1] < 1e-7))


def bounded_least_squares_arrives(arm: Arm, q: Floats, T: Floats, task: Floats) -> bool:
    """Differential IK with bounds on joints and steps: shares no code with the library but the Jacobian."""
    for _ in range(1500):
        here = arm.tip_pose(q)
        e = np.r_[T[:3, 3] - here[:3, 3], Rotation.from_matrix(T[:3, :3] @ here[:3, :3].T).as_rotvec()]
        e = task @ e
        if np.linalg.norm(e) < 1e-9:
            return True
        A = np.vstack([task @ arm.jacobian(q), 1e-3 * np.eye(arm.dof)])
        b = np.r_[e * min(1.0, 0.1 / np.linalg.norm(e)), np.zeros(arm.dof)]
        low, high = np.maximum(arm.position_min - q, -0.01) - 1e-12, np.minimum(arm.position_max - q, 0.01) + 1e-12
        step = lsq_linear(A, b, (low, high)).x
        if np.abs(step).max() < 1e-6:
            return False
        q = np.clip(q + step, arm.position_min, arm.position_max)
    return False


def keeps_its_caps(run: IKRun, arm: Arm) -> None:
    assert np.isfinite(run.q).all()
    moved = np.abs(np.diff(run.q, axis=0)) / run.time[1]
    assert (moved <= run.bounds.joint_speed * (1 + 1e-9)).all()
    assert (np.abs(run.qd) <= run.bounds.joint_speed).all()
    assert (run.q >= arm.position_min).all()
    assert (run.q <= arm.position_max).all()
    assert all(run.held.values()), run.held


UR_GOAL = [0.4, -0.9, 1.1, -1.2, -1.3, 0.5]
PANDA_GOAL = [0.4, 0.5, 0.1, -1.8, 0.2, 2.1, 0.5]


@pytest.mark.parametrize("error", ["axes", "quaternion"])
@pytest.mark.parametrize(
    ("name", "start", "goal"),
    [
        ("ur5e", [0, 0, 0.05, 0, 0, 0], UR_GOAL),  # an elbow almost straight, wrist singular
        ("ur5e", [0, 0, 0, 0, 0, 0], UR_GOAL),  # straight altogether
        ("ur5e", [0, 0, -1e-9, 0, 0, 0], UR_GOAL),
        ("ur5e", [0.4, -0.9, 1.1, -1.2, 0.0, 0.5], UR_GOAL),  # a straight wrist
        ("ur5e", [0.4, -0.9, 1.1, -1.2, 1.3, 0.5], UR_GOAL),  # the wrist turned over
        ("panda", [0, 0, 0, -0.3, 0, 0.1, 0], PANDA_GOAL),
        ("panda", [0, 0, 0, -0.1, 0, 0.1, 0], PANDA_GOAL),
        ("panda", [0, 0, 0, -0.0698, 0, 0.1, 0], PANDA_GOAL),  # at the elbow's limit
        ("panda", [2.89, 1.76, 2.89, -0.0698, 2.89, 3.75, 2.89], PANDA_GOAL),  # all joints at limits
        ("puma", [0.2, -0.5, 0.3, 0.0, 0.0, 0.0], [0.5, -0.9, 0.9, 0.6, -0.9, 0.4]),
        ("iiwa", [0, 0, 0, 0, 0, 0, 0], [0.4, 0.5, 0.1, -1.2, 0.2, 1.1, 0.5]),  # a candle
        ("scara", [0.3, 0.0, 0.0, 0.0], [0.6, 1.2, -0.05, 0.4]),
    ],
)
def test_it_arrives_from_postures_without_a_way_out(
    name: str, start: list[float], goal: list[float], error: Any
) -> None:
    arm = ARMS[name]
    q = np.clip(np.array(start, float), arm.position_min, arm.position_max)
    ik = FeedbackIK(arm, error=error)
    run = ik.track(resting(arm.tip_pose(np.clip(goal, arm.position_min, arm.position_max))), q)
    keeps_its_caps(run, arm)
    assert arrived(ik, run)


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("error", ["axes", "quaternion"])
def test_axes_at_180_degrees(axis: int, error: Any) -> None:
    """Half a turn away from the start about each axis of the tool; the closed form tells which of them can be."""
    arm, rng = ARMS["puma"], np.random.default_rng(axis)
    closed, ik = SphericalWristIK(arm), FeedbackIK(arm, error=error)
    low, high = ranges_near_zero(arm, 3.0)
    turned = 0
    while turned < 5:
        start = rng.uniform(low, high)
        T = arm.tip_pose(start)
        T[:3, :3] = T[:3, :3] @ Rotation.from_rotvec(np.pi * np.eye(3)[axis]).as_matrix()
        if np.isfinite(closed.within_limits(closed.solve(T))).all(axis=-1).any():
            turned += 1
            run = ik.track(resting(T), start)
            keeps_its_caps(run, arm)
            assert arrived(ik, run)


@pytest.mark.parametrize("name", list(ARMS))
@pytest.mark.parametrize("error", ["axes", "quaternion"])
def test_random_reachable_pairs_fail_no_oftener_than_bounded_least_squares(name: str, error: Any) -> None:
    arm, rng = ARMS[name], np.random.default_rng(17)
    low, high = ranges_near_zero(arm, 3.0)
    ik = FeedbackIK(arm, error=error)
    failed, of_oracle = 0, 0
    for k in range(PAIRS):
        start, goal = rng.uniform(low, high, (2, arm.dof))
        T = arm.tip_pose(goal)
        run = ik.track(resting(T), start)
        keeps_its_caps(run, arm)
        there = arrived(ik, run)
        failed += not there
        if not there or k < ORACLE_PAIRS:
            of_oracle += not bounded_least_squares_arrives(arm, start, T, ik.task)
    assert failed <= of_oracle


def test_on_the_way_out_twists_and_joints_stay_below_their_caps() -> None:
    arm = ARMS["panda"]
    caps = {"linear_speed_max": 0.2, "angular_speed_max": 0.5}
    run = FeedbackIK(arm, **caps).track(  # type: ignore[arg-type]
        resting(arm.tip_pose(np.array(PANDA_GOAL)), 30.0), np.array([0, 0, 0, -0.3, 0, 0.1, 0])
    )
    keeps_its_caps(run, arm)
    assert run.share["escape"] > 0.0
    assert run.position_error[-1] < 1e-7
    twist = np.einsum("kij,kj->ki", arm.jacobian(run.q[:-1]), np.diff(run.q, axis=0) / run.time[1])
    out = (run.flags[:-1] & 16) > 0
    assert np.linalg.norm(twist[out, :3], axis=1).max() <= 0.2 * (1 + 1e-6)
    assert np.linalg.norm(twist[out, 3:], axis=1).max() <= 0.5 * (1 + 1e-6)


def test_a_target_out_of_reach_changes_nothing() -> None:
    """The arm stays as near as the law brings it, elbow on its side, and never leaves it."""
    arm = ARMS["ur5e"]
    start = np.array(UR_GOAL)
    T = arm.tip_pose(start)
    T[:3, 3] *= 3.0
    run = FeedbackIK(arm).track(resting(T), start)
    keeps_its_caps(run, arm)
    assert run.share["escape"] == 0.0
    assert np.abs(np.diff(run.q[-100:], axis=0)).max() < 1e-3


def test_runs_are_the_same_each_time_and_in_batches() -> None:
    arm = ARMS["ur5e"]
    ik = FeedbackIK(arm)
    targets = [resting(arm.tip_pose(np.array(UR_GOAL))), resting(arm.tip_pose(np.array(UR_GOAL) + 0.2))]
    starts = np.array([[0, 0, 0.05, 0, 0, 0], [0, 0, 0.04, 0, 0, 0]])
    both = ik.track_many(targets, starts)
    assert both[0].share["escape"] > 0.0
    for target, start, run in zip(targets, starts, both, strict=True):
        np.testing.assert_array_equal(ik.track(target, start).q, run.q)

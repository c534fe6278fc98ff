"""One tracking step against roboticstoolbox's ``ik_LM``, pin-pink and a damped Pinocchio loop, for a PUMA and a Panda.

The first two are in no extra of ours: ``pip install roboticstoolbox-python pin-pink quadprog`` beside the package, in
an environment of its own (they want other versions of what else is here). Without them their rows are left out.
"""

from __future__ import annotations

import importlib
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pybullet_data
import pytest
from rich.console import Console
from rich.table import Table

from armtempo.arrays import Floats
from armtempo.configs import data_path
from armtempo.planners import FeedbackIK, NewtonIK, PoseTarget
from armtempo.planners.ik import INTEGRATORS, IKRun
from armtempo.robots import Arm

STEP, STEPS = 0.002, 500
ARMS: dict[str, tuple[Path, str | None, list[float]]] = {
    "puma": (data_path("robots/puma560.urdf"), None, [0.2, 0.5, -0.6, 0.3, 0.9, 0.1]),
    "panda": (
        Path(pybullet_data.getDataPath()) / "franka_panda" / "panda.urdf",
        "panda_hand",
        [0.1, -0.5, 0.3, -2.0, 0.2, 1.6, 0.4],
    ),
}


def _path(arm: Arm, start: Floats) -> PoseTarget:
    """A smooth motion of the joints by 0.3 rad within 1 s, as poses."""

    def motion(t: Floats) -> tuple[Floats, Floats, Floats, Floats]:
        u = np.clip(t, 0.0, 1.0)[:, None]
        q = start + 0.3 * u**3 * (10 - 15 * u + 6 * u * u)
        T, J = arm.tip_pose(q), arm.jacobian(q)
        twist = (J @ (9.0 * (u * (1 - u)) ** 2 * np.ones(arm.dof))[..., None])[..., 0]
        return T[:, :3, 3], T[:, :3, :3], twist[:, :3], twist[:, 3:]

    return PoseTarget.sample(motion, STEP * STEPS, STEP)


Solver = Callable[[Floats, Floats], Floats]
"""The next posture from the one before and the pose (4, 4) to be reached."""


def _toolbox(arm: Arm) -> Solver:
    rtb: Any = importlib.import_module("roboticstoolbox")
    robot = rtb.models.Puma560() if arm.dof == 6 else rtb.models.Panda()
    chain = robot.ets()  # its own model of the arm, that is asked for its own poses
    return lambda q, T: np.asarray(chain.ik_LM(T, q0=q, tol=1e-12, k=0.1, joint_limits=False)[0])


def _pinocchio(arm: Arm, tip: str) -> Solver:
    pin: Any = importlib.import_module("pinocchio")
    model, data, frame = _reduced(pin, arm, tip)

    def solve(q: Floats, T: Floats) -> Floats:
        goal = pin.SE3(T)
        for _ in range(100):
            pin.framesForwardKinematics(model, data, q)
            error = pin.log6(data.oMf[frame].actInv(goal)).vector
            if np.linalg.norm(error) < 1e-12:
                break
            J = pin.computeFrameJacobian(model, data, q, frame, pin.ReferenceFrame.LOCAL)
            q = q + J.T @ np.linalg.solve(J @ J.T + 1e-12 * np.eye(6), error)
        return q

    return solve


def _pink(arm: Arm, tip: str) -> Solver:
    pin: Any = importlib.import_module("pinocchio")
    pink: Any = importlib.import_module("pink")
    tasks: Any = importlib.import_module("pink.tasks")
    model, data, _ = _reduced(pin, arm, tip)
    task = tasks.FrameTask(tip, position_cost=1.0, orientation_cost=1.0)

    def solve(q: Floats, T: Floats) -> Floats:
        configuration = pink.Configuration(model, data, q)
        task.set_target(pin.SE3(T))
        return np.asarray(q + STEP * pink.solve_ik(configuration, [task], STEP, solver="quadprog"))

    return solve


def _reduced(pin: Any, arm: Arm, tip: str) -> tuple[Any, Any, int]:
    model = pin.buildModelFromUrdf(str(arm.urdf))
    others = [model.getJointId(name) for name in model.names[1:] if name not in arm.joint_names]
    model = pin.buildReducedModel(model, others, pin.neutral(model))
    return model, model.createData(), model.getFrameId(tip)


def _timed(solve: Solver, start: Floats, poses: Floats) -> float:
    """[us] for a step, the best of three runs."""
    best = np.inf
    for _ in range(3):
        q, begin = start, time.perf_counter()
        for T in poses[1:]:
            q = solve(q, T)
        best = min(best, time.perf_counter() - begin)
    return 1e6 * best / (len(poses) - 1)


@pytest.mark.parametrize("name", list(ARMS))
def test_one_tracking_step(name: str) -> None:
    urdf, tip, first = ARMS[name]
    arm, start = Arm.from_urdf(urdf, tip_link=tip), np.array(first)
    target = _path(arm, start)
    T = np.tile(np.eye(4), (STEPS + 1, 1, 1))
    T[:, :3, 3], T[:, :3, :3] = target.position[::2], target.rotation[::2]

    ik = FeedbackIK(arm)
    ours: dict[str, Callable[[], IKRun]] = {
        f"FeedbackIK {integrator}, with bounds": partial(ik.track, target, start, integrator=integrator)
        for integrator in INTEGRATORS
    }
    ours["NewtonIK, one step"] = partial(NewtonIK(arm).track, target, start)
    rows: list[tuple[str, float, float]] = []
    for label, run in ours.items():
        error, best = float(run().position_error.max()), np.inf
        for _ in range(5):
            begin = time.perf_counter()
            run()
            best = min(best, time.perf_counter() - begin)
        rows.append((label, 1e6 * best / STEPS, error))

    makers: list[tuple[str, Callable[[], Solver]]] = [
        ("Pinocchio, damped, to 1e-12", lambda: _pinocchio(arm, arm.tip_link)),
        ("pin-pink, one QP", lambda: _pink(arm, arm.tip_link)),
    ]
    for label, make in makers:
        try:
            solve = make()
        except ImportError:
            continue
        spent, q, worst = _timed(solve, start, T), start, 0.0
        for pose in T[1:]:
            q = solve(q, pose)
            worst = max(worst, float(np.linalg.norm(arm.tip_pose(q)[:3, 3] - pose[:3, 3])))
        assert worst < 1e-4, label
        rows.append((label, spent, worst))
    try:
        solve = _toolbox(arm)
        rtb: Any = importlib.import_module("roboticstoolbox")
        robot = rtb.models.Puma560() if arm.dof == 6 else rtb.models.Panda()
        t = np.linspace(0.0, 1.0, STEPS + 1)[:, None]
        q0 = start if arm.dof == 7 else np.array([0.2, 0.5, -0.6 + np.pi / 2, 0.3, 0.9, 0.1])
        poses = np.stack([robot.ets().eval(q) for q in q0 + 0.3 * t**3 * (10 - 15 * t + 6 * t * t)])
        spent, q, worst = _timed(solve, q0, poses), q0, 0.0
        for pose in poses[1:]:
            q = solve(q, pose)
            worst = max(worst, float(np.linalg.norm(robot.ets().eval(q)[:3, 3] - pose[:3, 3])))
        rows.append(("roboticstoolbox ik_LM, tol 1e-12", spent, worst))
    except ImportError:
        pass

    table = Table("solver", "us", "to FeedbackIK rk4", "worst error [mm]", title=f"{name}: one step of {STEP} s")
    unit = next(us for label, us, _ in rows if "rk4" in label)
    for label, us, error in rows:
        table.add_row(label, f"{us:.1f}", f"{us / unit:.2f}", f"{1e3 * error:.2g}")
    Console(width=100).print(table)
    for label, us, _ in rows:
        if "FeedbackIK" not in label and "Newton" not in label:
            assert us > unit, label

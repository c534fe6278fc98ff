"""Times of the robots' kernels against their peers, in the same run. ``make bench``; not part of the default run."""

from __future__ import annotations

import importlib
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pybullet_data
import pytest

from armtempo.planners import JointPath, PathDynamics
from armtempo.robots import Arm, kernels

IIWA = Path(pybullet_data.getDataPath()) / "kuka_iiwa" / "model.urdf"
STATIONS = 1001


def best(function: Callable[[], object], repeat: int = 30) -> float:
    """Smallest time of a call [ms]: the machine is shared."""
    times = []
    for _ in range(repeat):
        start = time.perf_counter()
        function()
        times.append(time.perf_counter() - start)
    return 1e3 * min(times)


def test_path_coefficients_against_pinocchio(benchmark: Any, capsys: pytest.CaptureFixture[str]) -> None:
    """M, Q, R, S of a 7-dof arm at N = 1000: one pass, three passes of our own Newton-Euler, Pinocchio's."""
    pin: Any = importlib.import_module("pinocchio")
    arm = Arm.from_urdf(IIWA)
    generator = np.random.default_rng(0)
    path = JointPath.through(generator.uniform(-1.0, 1.0, (6, 7)))
    q, dq, ddq = path.evaluate(np.linspace(0.0, path.length, STATIONS))
    M, Q, R, S = (np.empty_like(q) for _ in range(4))
    zero = np.zeros_like(q)
    model = pin.buildModelFromUrdf(str(IIWA))
    data = model.createData()
    theirs = np.empty((3, *q.shape))

    def one_pass() -> None:
        kernels.path_coefficients(arm.model, q, dq, ddq, M, Q, R, S)

    def three_passes() -> None:
        for speed, acceleration, out in ((zero, dq, M), (dq, ddq, Q), (zero, zero, S)):
            kernels.batch_inverse_dynamics(arm.model, q, speed, acceleration, out)

    def pinocchio() -> None:
        for k in range(STATIONS):
            theirs[2, k] = pin.rnea(model, data, q[k], zero[k], zero[k])
            theirs[0, k] = pin.rnea(model, data, q[k], zero[k], dq[k]) - theirs[2, k]
            theirs[1, k] = pin.rnea(model, data, q[k], dq[k], ddq[k]) - theirs[2, k]

    one_pass()
    pinocchio()
    np.testing.assert_allclose(np.stack([M, Q, S]), theirs, atol=1e-9)
    three_passes()
    ours, separate, peer = best(one_pass), best(three_passes), best(pinocchio, 5)
    whole = best(lambda: PathDynamics.from_path(arm, path, intervals=STATIONS - 1))
    benchmark.extra_info.update(ours_ms=ours, three_passes_ms=separate, pinocchio_ms=peer, from_path_ms=whole)
    benchmark(one_pass)
    with capsys.disabled():
        print(  # noqa: T201
            f"\n7 joints, 1001 stations: path coefficients {ours:.2f} ms; three passes {separate:.2f} ms; Pinocchio "
            f"from Python {peer:.1f} ms, {peer / ours:.0f} times slower; PathDynamics.from_path {whole:.2f} ms"
        )
    assert separate / ours > 1.2
    assert peer / ours > 4.0

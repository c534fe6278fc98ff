"""Joint paths along Cartesian paths: how long they take to build and to evaluate; minimum times against toppra."""

from __future__ import annotations

import importlib.util
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from armtempo.planners import PathDynamics, minimum_time
from armtempo.planners.joint_paths import CartesianJointPath

_spec = importlib.util.spec_from_file_location(
    "cartesian_joint_path", Path(__file__).parents[1] / "planners" / "joint_paths" / "test_cartesian_joint_path.py"
)
assert _spec is not None
assert _spec.loader is not None
paths: Any = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(paths)


def _least(work: Callable[[], object]) -> float:
    times = []
    for _ in range(7):
        start = time.perf_counter()
        work()
        times.append(time.perf_counter() - start)
    return min(times)


@pytest.mark.parametrize("name", ["puma", "panda", "iiwa"])
def test_building_and_evaluating(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    arm, cartesian, start = paths.robot(name), paths.corners(name, turned=True), paths.STARTS[name]
    path = CartesianJointPath(arm, cartesian, start)
    lam = np.linspace(0.0, path.length, 10_000)
    build = _least(lambda: CartesianJointPath(arm, cartesian, start))
    evaluate = _least(lambda: path.evaluate(lam))
    with capsys.disabled():
        print(f"\n{name}: built in {1e3 * build:.0f} ms, 10 000 stations in {1e3 * evaluate:.0f} ms")  # noqa: T201
    assert build < 1.0
    assert evaluate < 0.2


@pytest.mark.parametrize("name", ["puma", "panda"])
def test_minimum_time_is_toppras_on_a_fine_grid(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    arm, path = paths.robot(name), paths.followed(name, turned=True)
    ours = minimum_time(PathDynamics.from_path(arm, path, intervals=6000)).duration
    theirs = paths.toppra_duration(arm, path, 6000)
    with capsys.disabled():
        print(f"\n{name}: {ours:.6f} s, toppra {theirs:.6f} s, {1e2 * (ours / theirs - 1.0):+.4f} %")  # noqa: T201
    assert ours == pytest.approx(theirs, rel=3e-4)

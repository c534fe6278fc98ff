"""``armtempo reproduce chung``: what the paper's equations say, to their digits; its bounds; all its pictures."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from armtempo.commands import main
from armtempo.commands.papers.chung._run import POSTURE, UNCAPPED, _noisy, _printed_law, papers_path, still
from armtempo.configs import data_path
from armtempo.planners import FeedbackIK, IKCell, PoseTarget
from armtempo.planners.ik import SphericalWristIK
from armtempo.robots import Arm

Rows = dict[str, dict[str, Any]]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("chung")
    assert main(["reproduce", "chung", "--out", str(folder), "--json", str(folder / "r.json")]) == 0
    return folder


@pytest.fixture(scope="module")
def rows(folder: Path) -> Rows:
    listed = json.loads((folder / "r.json").read_text(encoding="utf-8"))
    by_name = {row["quantity"].strip(): row for row in listed}
    assert len(by_name) == len(listed)
    return by_name


def test_the_run_has_the_errors_that_the_equations_say(rows: Rows) -> None:
    lag = math.hypot(0.25, 0.45, 0.45) * 0.5 / math.hypot(50.9, 0.5)  # eq. (2.15) for the paper's cosine [m]
    wanted = {
        "position, without P_d', rk4, 1 ms": (1e3 * lag, 1e-3),
        "position, with P_d', euler, 1 ms": (3.04e-3, 5e-3),
        "position, with P_d', euler, 10 ms": (3.04e-2, 5e-3),
        "position, with P_d', heun, 10 ms": (1.0e-2, 0.05),
        "position, with P_d', rk4, 10 ms": (1.1e-4, 0.05),
        "orientation, without ω_d, rk4, 1 ms": (math.asin(0.6 / 20.0), 5e-3),
        "time constant, position": (1e3 / 50.9, 1e-4),
        "time constant, axis a": (50.0, 1e-4),
        "time constant, angle about a": (1e3 / 25.5, 1e-4),
        "fastest joint": (0.706, 1e-3),
        "smallest singular value": (0.1934, 1e-3),
    }
    for name, (value, error) in wanted.items():
        assert rows[name]["ours"] == pytest.approx(value, rel=error), name
    assert rows["position, with P_d', rk4, 1 ms"]["ours"] < 2e-8
    assert rows["orientation, with ω_d, rk4, 1 ms"]["ours"] < 1e-11
    assert rows["orientation, with ω_d, rk4, 10 ms"]["ours"] < 1e-7
    for integrator, order in (("euler", 1), ("heun", 2), ("rk4", 4)):
        for what in ("position", "orientation"):
            assert rows[f"order of {integrator} in {what}"]["ours"] == pytest.approx(order, abs=0.15)


def test_the_law_is_what_it_is(rows: Rows) -> None:
    assert rows["Euler is stable up to K_p dt"]["ours"] == pytest.approx(2.0, abs=1e-3)
    assert rows["tan(δ/2) off tan(δ₀/2) e^(−K_a t)"]["ours"] < 1e-6
    for w in (5, 10, 19):
        ours = rows[f"error behind a target turning at {w}/s"]["ours"]
        assert ours == pytest.approx(math.asin(w / 20.0), rel=1e-6)
    assert rows["error behind a target turning at 21/s"]["ours"] > 3.1


def test_the_papers_bounds_are_broken_as_they_must_be_and_ours_hold(rows: Rows) -> None:
    for degrees in (10, 30, 60, 90, 120):
        ours = rows[f"|a_e| / bound (3.4), δ₀ = {degrees}°"]["ours"]
        assert ours == pytest.approx(1.0 / math.cos(math.radians(degrees / 2)), rel=1e-3)
    for start, error in ((0.02, 2e-3), (0.1, 1e-2), (0.3, 5e-2)):
        row = rows[f"|α₃| − bound (3.5), α₁ = α₂ = {start:g}"]
        assert row["ours"] == pytest.approx(row["paper"], rel=error)
    assert rows["|n_e| / bound (3.9), at most"]["ours"] == pytest.approx(1.0, abs=1e-9)
    kept = rows["runs whose bounds all hold"]
    assert kept["ours"] == kept["paper"] > 0
    ratios = [row["ours"] for row in rows.values() if row.get("note") == "bound / error"]
    assert min(ratios) >= 1.0
    assert len(ratios) == 8


def test_inverting_fails_where_feedback_does_not(rows: Rows) -> None:
    noise = [rows[f"noise of speeds, {name}"]["ours"] for name in ("differentiated", "fed back")]
    assert noise[0] / noise[1] == pytest.approx(math.sqrt(2.0) / (50.9 * 1e-3), rel=0.25)  # of P' against K_p P
    assert rows["error left, differentiated"]["ours"] > 50.0
    assert rows["error left, fed back, true rates"]["ours"] < 1e-6
    for where in ("out of reach", "straight wrist"):
        assert rows[f"{where}: fastest joint, plain"]["ours"] > 50.0
        assert rows[f"{where}: fastest joint / its cap"]["ours"] <= 1.0
    row = rows["out of reach: error, damped"]
    assert row["paper"] <= row["ours"] < 1.01 * row["paper"]
    assert rows["out of reach: error after the return"]["ours"] < 1e-6


def test_the_arm_reaches_the_path_from_the_heights_of_geometry(rows: Rows) -> None:
    assert rows["path in reach, shoulder in the base"]["ours"] == pytest.approx(68.4, abs=0.1)
    for name in ("path in reach, shoulder 0.66 m up", "real PUMA 560: path in reach"):
        assert rows[name]["ours"] == 100.0
    for name in ("lowest shoulder that reaches all", "highest shoulder that reaches all"):
        assert rows[name]["ours"] == pytest.approx(rows[name]["paper"], abs=1e-4)


def test_every_figure_is_drawn(folder: Path) -> None:
    drawn = sorted(file.stem.split("_")[0] for file in folder.glob("*.png"))
    assert drawn == sorted([*(f"fig{k}" for k in range(7, 14)), "errors", "noise", "singular"])
    assert all(file.stat().st_size > 10_000 for file in folder.glob("*.png"))


def test_the_printed_law_is_that_of_the_solver() -> None:
    """Far from singularities the plain inverse takes the Euler steps of ``FeedbackIK``."""
    arm = Arm.from_urdf(data_path("robots/puma560_chung.urdf"))
    T = arm.tip_pose(POSTURE + 0.1)
    target = PoseTarget.sample(still(T), 0.3, 1e-3)
    speeds, errors = _printed_law(arm, target, POSTURE)
    ours = FeedbackIK(arm, joint_speed_max=UNCAPPED, damping=1e-6).track(target, POSTURE, integrator="euler")
    np.testing.assert_allclose(speeds, ours.qd, atol=1e-9)
    np.testing.assert_allclose(errors[:, 0], ours.position_error, atol=1e-12)
    np.testing.assert_allclose(errors[:, 1], ours.orientation_error, atol=1e-9)


def test_the_same_bits_twice(chung: IKCell) -> None:
    first, second = (_noisy(chung.arm, chung.target, chung.start) for _ in range(2))
    for name, follower in first.items():
        np.testing.assert_array_equal(follower.qd, second[name].qd)
        np.testing.assert_array_equal(follower.error, second[name].error)


def test_path_and_start_are_the_cells(chung: IKCell) -> None:
    p, R, v, _ = papers_path(np.linspace(0.0, chung.duration, len(chung.target.position), dtype=np.float64))
    np.testing.assert_allclose(chung.target.position, p, atol=1e-14)
    np.testing.assert_allclose(chung.target.rotation, R, atol=1e-12)
    np.testing.assert_allclose(chung.target.velocity, v, atol=1e-14)
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = R[0], p[0]
    np.testing.assert_allclose(chung.start, SphericalWristIK(chung.arm).solve(T)[0], atol=1e-12)  # the best of 8

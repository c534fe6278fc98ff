"""Tools that keep a speed: limits of cells and of their segments, planned, coordinated, simulated, and in the bound."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
import pytest

from armtempo.agents import ExecutionPolicy, run_episode
from armtempo.arrays import Floats
from armtempo.configs import data_path
from armtempo.envs import CoordinationEnv
from armtempo.errors import ConfigError
from armtempo.planners import CoordinationCell, PhaseTrajectory, execution_of, load_cell, schedule
from armtempo.robots import Arm

POSTURE = [2.5, -1.4, 2.0, -2.17, -1.57, 0.0]  # the tip in front of the arm, pointing down
SEAM = ", tool_speed_m_s: 0.02"


def arm(name: str, base: float, turn: float, seam: str, limits: str) -> str:
    """An arm that goes along y: to a seam that rises, along it, and on."""
    x, y, z = Arm.from_urdf(data_path("robots/ur5e_like.urdf")).tip_pose(np.array(POSTURE))[:3, 3]
    x, y = base + np.cos(turn) * x, np.cos(turn) * y
    way = -np.sign(y)
    places = [
        [float(x), float(y + way * along), float(z + up)]
        for along, up in ((0, 0), (0.15, 0), (0.25, 0.06), (0.4, 0.06))
    ]
    lines = "".join(f"\n        - {{line: {{to_m: {place}}}{seam * (k == 1)}}}" for k, place in enumerate(places[1:]))
    return f"""
  - name: {name}
    urdf: ur5e_like.urdf
    base: {{position_m: [{base}, 0, 0], rpy_rad: [0, 0, {turn}]}}
    limits: {{{limits}}}
    path:
      start_m: {places[0]}
      start_rad: {POSTURE}
      blend: {{curve: quintic, tolerance_m: 0.01}}
      segments:{lines}"""


def weld(folder: Path, limits: str = "") -> CoordinationCell:
    file = folder / "weld.yaml"
    head = "kind: coordination\nname: weld\nd_min_m: 0.02\nphysics_tick_s: 0.002\ncontrol_period_s: 0.02\n"
    arms = arm("left", 0.0, 0.0, SEAM, limits) + arm("right", 1.25, np.pi, "", "")
    file.write_text(f"{head}chart_tolerance_m: 0.002\narms:{arms}\n")
    return load_cell(str(file))


@pytest.fixture(scope="module")
def cell(tmp_path_factory: pytest.TempPathFactory) -> CoordinationCell:
    return weld(tmp_path_factory.mktemp("weld"))


def tip_speed(cell: CoordinationCell, i: int, lam: Floats, mu: Floats) -> Floats:
    """(K,) [m/s] by differences of the tip's places, beside the path."""
    h = 1e-6
    low, high = (cell.arms[i].tip_pose(cell.paths[i].evaluate(lam + s)[0])[:, :3, 3] for s in (-h, h))
    return np.asarray(np.linalg.norm(high - low, axis=1) / (2.0 * h) * mu)


def run(motion: PhaseTrajectory) -> tuple[Floats, Floats]:
    """Places and rates (K,) at many instants."""
    lam, mu, _ = motion.at(np.linspace(0.0, motion.duration, 4001)[1:-1])
    return lam, mu


def test_a_seam_is_welded_at_its_speed_and_the_rest_at_full_speed(cell: CoordinationCell) -> None:
    low, high = cell.paths[0].breakpoints[2:4]
    lam, mu = run(cell.fastest[0])
    speed = tip_speed(cell, 0, lam, mu)
    seam = (lam > low + 1e-4) & (lam < high - 1e-4)
    assert seam.sum() > 1000
    np.testing.assert_allclose(speed[seam], 0.02, rtol=1e-3)
    assert speed[lam < cell.paths[0].breakpoints[1]].max() > 0.2
    assert cell.fastest[0].certificate.excess < 1e-3


def test_every_method_and_the_bound_keep_it(cell: CoordinationCell) -> None:
    for method in ("delay", "vci", "optimal"):
        plan = schedule(cell, method)
        assert plan.makespan > 0.1 / 0.02  # 0.12 m at 20 mm/s, less its blends
        assert plan.certificate.torque_ratio_max < 1.001
        assert plan.gap_percent < 2.0  # the bound knows of it
        for motion in plan.trajectories:
            assert motion.dynamics.tool_speed_ratio(*run(motion)).max() < 1.001


def test_it_is_simulated(cell: CoordinationCell) -> None:
    plan = schedule(cell, "delay")
    env = CoordinationEnv(cell, physics="ideal", record=True)
    trace, _ = run_episode(env, ExecutionPolicy(partial(execution_of, plan)))
    low, high = cell.paths[0].breakpoints[2:4]
    on = (trace.lam[:, 0] > low + 1e-3) & (trace.lam[:, 0] < high - 1e-3)
    assert on.sum() > 100
    np.testing.assert_allclose(tip_speed(cell, 0, trace.lam[on, 0], trace.mu[on, 0]), 0.02, rtol=1e-3)
    assert trace.violations == 0
    env.close()


def test_a_limit_of_the_arm_holds_all_along(tmp_path: Path, cell: CoordinationCell) -> None:
    slow = weld(tmp_path, limits="tool_speed_m_s: 0.1")
    assert tip_speed(slow, 0, *run(slow.fastest[0])).max() == pytest.approx(0.1, rel=1e-3)
    assert slow.fastest[0].duration > cell.fastest[0].duration


def test_elsewhere_it_is_refused(tmp_path: Path) -> None:
    for name, old, new in (
        ("chung", "  limits:\n", "  limits:\n    tool_speed_m_s: 0.1\n"),
        ("lee2006", "path:\n", "limits: {tool_speed_m_s: 0.1}\n  path:\n"),
    ):
        text = data_path(f"cells/{name}.yaml").read_text()
        assert old in text
        file = tmp_path / f"{name}.yaml"
        file.write_text(text.replace(old, new, 1))
        with pytest.raises(ConfigError, match="tool_speed_m_s is for coordination cells"):
            load_cell(str(file))

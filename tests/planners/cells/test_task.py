"""Tasks: paths through their places with their speeds and dwells, rules, the bundled cell to PyBullet, and refusals."""

from __future__ import annotations

import copy
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from armtempo.agents import evaluate
from armtempo.arrays import Floats
from armtempo.configs import TaskCellConfig, data_path, parse_cell_config
from armtempo.envs import CoordinationEnv
from armtempo.errors import ArmtempoError, ConfigError, InfeasibleError, InputError, PathError
from armtempo.planners import CoordinationCell, build_cell, load_cell, schedule
from armtempo.planners.joint_paths import SequencePath, Wait
from armtempo.testing import check_cell

DATA = yaml.safe_load(data_path("cells/scara-pair.yaml").read_text())
Change = Callable[[dict[str, Any]], object]


@pytest.fixture(scope="module")
def scara_pair() -> CoordinationCell:
    return load_cell("scara-pair")


def told(change: Change) -> TaskCellConfig:
    """What a changed copy of the bundled file says."""
    data = copy.deepcopy(DATA)
    change(data)
    return parse_cell_config(data, Path("mine.yaml"), TaskCellConfig)


def built(change: Change) -> CoordinationCell:
    return build_cell(told(change))


def only_left(*steps: dict[str, Any], **arm: Any) -> Change:
    """The left arm alone, with these steps."""

    def change(data: dict[str, Any]) -> None:
        data["arms"] = [{**data["arms"][0], "task": list(steps), **arm}]
        del data["zones"]

    return change


def path_of(cell: CoordinationCell, arm: int = 0) -> SequencePath:
    path = cell.paths[arm]
    assert isinstance(path, SequencePath)
    return path


def tips(cell: CoordinationCell, lam: Floats, arm: int = 0) -> Floats:
    return np.asarray(cell.arms[arm].tip_pose(cell.paths[arm].evaluate(lam)[0])[:, :3, 3])


def test_the_arm_stands_where_the_file_says(scara_pair: CoordinationCell) -> None:
    for arm, (feeder, above) in enumerate((("feeder_l", "above_l"), ("feeder_r", "above_r"))):
        path = path_of(scara_pair, arm)
        exact = [part for part in path.standing if part.exact]
        assert [part.seconds for part in exact] == [0.15, 0.1]
        at = np.array([0.0, *(part.middle for part in exact), 1.0])
        wanted = [DATA["places"][name]["position_m"] for name in (above, feeder, "centre", above)]
        np.testing.assert_allclose(tips(scara_pair, at, arm), wanted, atol=1e-9)


def test_plans_are_clean_and_near_the_bound(scara_pair: CoordinationCell) -> None:
    for method in ("delay", "vci", "optimal"):
        plan = schedule(scara_pair, method)
        certificate = plan.certificate
        assert certificate.torque_ratio_max < 1.0 + 1e-3
        assert certificate.speed_ratio_max < 1.0 + 1e-3  # tool speeds, too
        assert certificate.min_clearance > scara_pair.d_min
        assert certificate.certified_free
        assert certificate.rules_broken == ()
        assert certificate.dwell_error_max < 1e-6
        assert -0.1 < plan.gap_percent < 2.0


def test_lines_are_lines_at_their_speeds(scara_pair: CoordinationCell) -> None:
    """Down to the feeder at 0.2 m/s, by differences over time."""
    motion, border = scara_pair.fastest[0], path_of(scara_pair).border
    t = np.linspace(0.0, float(motion.time_at(border[1])), 400)
    tip = tips(scara_pair, motion.at(t)[0])
    assert np.ptp(tip[:, :2], axis=0).max() < 1e-9
    speed = np.linalg.norm(np.diff(tip, axis=0), axis=1) / np.diff(t)
    assert speed.max() == pytest.approx(0.2, rel=1e-3)
    t = np.linspace(0.0, motion.duration, 4001)
    fast = np.linalg.norm(np.diff(tips(scara_pair, motion.at(t)[0]), axis=0), axis=1) / np.diff(t)
    assert fast.max() > 1.0  # elsewhere it is not so slow


def test_the_zone_holds_one_arm_and_the_second_waits(scara_pair: CoordinationCell) -> None:
    plan = schedule(scara_pair, "optimal")
    t = np.linspace(0.0, plan.makespan, 3000)
    inside = []
    for arm, motion in enumerate(plan.trajectories):
        tip = tips(scara_pair, motion.at(np.minimum(t, motion.duration))[0], arm)
        inside.append((np.abs(tip - [0.0, 0.35, 0.15]) < [0.1, 0.1, 0.15]).all(axis=1))
    assert inside[0].any()
    assert inside[1].any()
    assert not (inside[0] & inside[1]).any()
    placed = next(rule for rule in scara_pair.exclusions if "placed" in rule.rule)
    assert placed.rule == "'right' waits before task[3] (line to centre_up) until 'left' has done 'placed'"
    first, second = plan.trajectories
    assert second.last_time_at(placed.part_b[0]) >= first.time_at(placed.part_a[1])


def test_from_the_file_to_pybullet(scara_pair: CoordinationCell) -> None:
    check_cell(scara_pair)
    results = evaluate(scara_pair, ["optimal", "phase-plane"], shield=True).results
    for result in results.values():
        assert result.violations == 0
        assert result.torque_demand_ratio_max < 1.0 + 1e-6
        assert result.gap_percent is not None
        assert result.gap_percent < 2.0  # all arrive, or there were none


@pytest.mark.parametrize("disturbance", [None, "all-any"])
def test_shielded_episodes_keep_all_rules(scara_pair: CoordinationCell, disturbance: str | None) -> None:
    env = CoordinationEnv(scara_pair, physics="ideal", shield=True, disturbance=disturbance, record=True)
    generator = np.random.default_rng(5)
    for seed in range(8):
        env.reset(seed=seed)
        while env.agents:
            share = [1.0] if seed % 2 else generator.uniform(-1.0, 1.0, 1)
            env.step({agent: np.array(share, dtype=np.float32) for agent in env.agents})
        trace = env.trace
        assert trace.violations == 0
        assert np.isfinite(trace.arrival).all()
        first, second = trace.lam.T
        for rule in scara_pair.exclusions:
            (a0, a1), (b0, b1) = rule.part_a, rule.part_b
            assert not ((a0 < first) & (first < a1) & (b0 < second) & (second < b1)).any()


def test_moves_arcs_and_repeats(scara_pair: CoordinationCell) -> None:
    cell = built(
        only_left(
            {"arc": {"to": {"position_m": [-0.55, 0.40, 0.12]}, "via_m": [-0.60, 0.35, 0.12], "blend": "stop"}},
            {"line": {"by_m": [0.0, -0.1, 0.0], "blend": "stop"}},
            {"repeat": {"times": 3, "steps": [{"line": {"by_m": [0.1, 0.0, 0.0]}}, {"dwell_s": 0.05},
                                              {"move": {"to": "above_l"}}]}},
            {"move": {"to": {"joints_rad": [0.5, -1.5, -0.05, 0.3]}}},
        )
    )  # fmt: skip
    path = path_of(cell)
    assert [part.seconds for part in path.standing if part.exact] == [0.05] * 3
    arc = tips(cell, np.linspace(0.0, path.border[1], 50))
    np.testing.assert_allclose(np.linalg.norm(arc[:, :2] - [-0.55, 0.35], axis=1), 0.05, atol=1e-9)
    np.testing.assert_allclose(path.evaluate(1.0)[0], [0.5, -1.5, -0.05, 0.3])
    for part in path.standing:
        np.testing.assert_allclose(tips(cell, np.array([part.middle])), [[-0.45, 0.30, 0.12]], atol=1e-8)
    assert schedule(cell, "delay").makespan == cell.fastest[0].duration


def test_blended_corners_are_passed(scara_pair: CoordinationCell) -> None:
    path = path_of(scara_pair)
    lifted = tips(scara_pair, np.linspace(path.border[4], path.border[5], 2000))  # up, over, down: one chain
    corner = np.array(DATA["places"]["above_l"]["position_m"])
    assert np.linalg.norm(lifted - corner, axis=1).min() == pytest.approx(0.02, rel=0.05)
    assert scara_pair.fastest[0].mu[np.searchsorted(scara_pair.fastest[0].lam, np.mean(path.border[4:6]))] > 0.0


def together(data: dict[str, Any]) -> None:
    """Both hand something over, at two places; the left arm has more to do before."""
    left, right = data["arms"]
    left["task"][5]["event"]["with"] = {"arm": "right", "event": "picked"}
    del right["task"][3]["line"]["after"]
    del data["zones"]


def test_with_means_both_stand_while_either_is_inside() -> None:
    cell = built(together)
    plan = schedule(cell, "optimal")
    assert plan.certificate.rules_broken == ()
    spans = []
    for arm, which in ((0, 1), (1, 0)):
        path, motion = path_of(cell, arm), plan.trajectories[arm]
        part = [part for part in path.standing if part.exact][which]
        k = int(path.step_at(part.middle))
        assert isinstance(path.steps[k - 1], Wait)
        assert isinstance(path.steps[k + 1], Wait)
        inner = float(motion.last_time_at(part.start)), float(motion.time_at(part.stop))
        outer = float(motion.time_at(path.border[k - 1])), float(motion.last_time_at(path.border[k + 2]))
        spans.append((inner, outer))
    for (inner, _), (_, outer) in (spans, spans[::-1]):
        assert outer[0] <= inner[0] + 1e-9
        assert inner[1] <= outer[1] + 1e-9


def circle(data: dict[str, Any]) -> None:
    data["arms"][0]["task"][0]["line"]["after"] = {"arm": "right", "event": "placed"}


def test_a_circle_is_refused_with_arms_and_steps() -> None:
    with pytest.raises(InfeasibleError) as caught:
        built(circle)
    message = str(caught.value)
    assert message.startswith(
        "mine.yaml: arms wait for each other for ever: 'left' waits before task[0] (line to feeder_l)"
    )
    assert "'right' waits before task[3] (line to centre_up) until 'left' has done 'placed'" in message


def at(arm: int, step: int, kind: str, **said: Any) -> Change:
    """Other keys of one step; None takes one away."""

    def change(data: dict[str, Any]) -> None:
        own = data["arms"][arm]["task"][step][kind]
        own.update(said)
        for key in [key for key, value in said.items() if value is None]:
            del own[key]

    return change


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (at(0, 0, "line", to="feeder"), "yaml: arms[0].task[0].line.to: there is no place 'feeder'; did you mean"),
        (at(1, 3, "line", after={"arm": "left", "event": "put"}), "has no event or step 'put'; known: picked, placed"),
        (at(1, 3, "line", after={"arm": "right", "event": "placed"}), "there is no other arm 'right'; known: left"),
        (at(1, 3, "line", after={"arm": "left", "event": "placed", "when": "soon"}), "arms[1].task[3].line.after"),
        (at(0, 0, "line", to=None), "a line or an arc needs exactly one of to, by_m; got none"),
        (at(0, 0, "line", tool_speed_m_s=0.0), "arms[0].task[0].line.tool_speed_m_s"),
        (at(0, 1, "event", holds="part"), "arms[0].task[1].event.holds"),
        (lambda data: data["arms"][0]["task"].append({"dwell_s": 1.0, "move": {"to": "above_l"}}), "a step needs"),
        (lambda data: data["arms"][0]["task"].append({"dwell_s": -1.0}), "arms[0].task[8].dwell_s"),
        (lambda data: data["arms"][0].pop("task"), "arms[0].task"),
        (lambda data: data["places"]["centre"].update(joints_rad=[0.0]), "exactly one of joints_rad, position_m"),
        (lambda data: data["arms"][0]["task"].append(data["arms"][0]["task"][5]), "does 'placed' 2 times"),
        (lambda data: data["zones"].append(data["zones"][0]), "zones: each needs a name of its own"),
        (only_left({"repeat": {"times": 2000, "steps": [{"dwell_s": 1.0}] * 2}}), "has 4000 steps, repeats unrolled"),
    ],
)  # fmt: skip
def test_files_that_cannot_be_are_refused_by_key(change: Change, words: str) -> None:
    with pytest.raises(ConfigError) as caught:
        told(change)
    assert words in str(caught.value), str(caught.value)
    assert "mine.yaml" in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("change", "error", "words"),
    [
        (lambda data: data["places"]["centre"].update(position_m=[3.0, 0.0, 0.1]), PathError, "arms[0].task[4]"),
        (at(1, 2, "line", blend={"tolerance_m": 0.01}), PathError, "task[2]: a corner is blended where"),
        (only_left({"move": {"to": {"joints_rad": [0.0, 0.1]}}}), InputError, "2 joint positions, arm 'left' has 4"),
        (only_left({"move": {"to": {"position_m": [-0.55, 0.3, 0.4]}}}), PathError, "joint 'joint_z' would be at"),
        (only_left({"move": {"to": {"position_m": [-2.0, 0.3, 0.1]}}}), PathError, "does not get to place on"),
        (only_left({"line": {"to": {"joints_rad": [0.0] * 4}}}), InputError, "a line ends where"),
        (only_left({"line": {"to": {"position_m": [0, 0, 0.1], "rpy_rad": [0, 0, 1]}}}), ArmtempoError, "is turned by"),
        (only_left({"dwell_s": 1.0}), ArmtempoError, "arms[0].task: a sequence of 1 steps has no move"),
        (only_left({"move": {"to": "above_l"}}, posture_rad=None), InputError, "start: place 'above_l' is reached"),
        (only_left({"move": {"to": "above_l"}}), PathError, "arms[0].task[0]: waypoints 0 and 1 are the same"),
    ],
)  # fmt: skip
def test_steps_that_cannot_be_done_are_named(change: Change, error: type[ArmtempoError], words: str) -> None:
    with pytest.raises(error) as caught:
        built(change)
    assert words in str(caught.value), str(caught.value)
    assert "mine.yaml" in str(caught.value)
    assert "\n" not in str(caught.value)

"""Policies compared over several cells: what is counted, and what is divided by what."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from armtempo.agents import CellComparison, SplitComparison, compare_on
from armtempo.agents.policies import Agent, AgentHeader, save_agent
from armtempo.commands import main
from armtempo.envs import COORDINATION_ENTRIES
from armtempo.errors import InputError, UnknownNameError
from armtempo.planners import load_cell, schedule


def comparison(**makespans: tuple[float | None, ...]) -> CellComparison:
    return CellComparison(
        cell="a", priority_class="uniform", arms=2, makespans_s=makespans, violations=dict.fromkeys(makespans, 0),
        clairvoyant_s=(1.0,) * len(next(iter(makespans.values()))), time_limit_s=10.0,
    )  # fmt: skip


def test_ratios_are_to_the_best_classical_policy_of_each_cell() -> None:
    one = comparison(delay=(2.0, 2.0), vci=(1.0, 4.0), own=(1.0, 1.0))
    other = comparison(vci=(4.0, 4.0), own=(3.0, None))
    compared = SplitComparison(cells=(one, other, comparison(own=(9.0, 9.0))), seed=0)
    assert (one.best_online, other.best_online) == ("delay", "vci")
    own, best = compared.pairs("own", "best_online")  # where both are there; the time limit where one did not arrive
    assert (own.tolist(), best.tolist()) == ([[1.0, 1.0], [3.0, 10.0]], [[2.0, 2.0], [4.0, 4.0]])
    ratio, (low, high) = compared.ratio("own", "best_online") or (0.0, (0.0, 0.0))
    assert ratio == pytest.approx(15.0 / 12.0)
    assert (low, high) == pytest.approx((0.5, 33.0 / 16.0))  # both cells the one; both the other, and one time a 3
    figures = compared.figures("own")
    assert (figures["cells"], figures["episodes"], figures["finished"], figures["unfinished"]) == (3, 6, 5, 1)
    assert figures["makespan_s"] == pytest.approx(33.0 / 6.0)
    assert (figures["best_in_cells"], figures["best_online_in_cells"]) == (2, 0)
    assert compared.figures("vci")["best_in_cells"] == 1
    assert compared.figures("nobody")["makespan_s"] is None


def test_who_never_finished_has_no_mean_and_no_ratio() -> None:
    compared = SplitComparison(cells=(comparison(delay=(2.0,), own=(None,)),), seed=0)
    figures = compared.figures("own")
    assert (figures["finished"], figures["unfinished"], figures["makespan_s"]) == (0, 1, None)
    assert figures["ratio_to_best_online"] is None


def test_the_best_of_each_cell_is_told() -> None:
    one = comparison(vci=(2.0, 2.0), own=(1.0, None), optimal=(1.5, 1.5), delay=(2.0, 2.0))
    assert (one.best, one.best_online) == ("optimal", "delay")
    assert (one.mean_of("optimal"), one.mean_of("own"), one.mean_of(None)) == (1.5, None, None)
    assert comparison(own=(2.0,), vci=(2.0,)).best == "vci"  # of equals the rule
    assert comparison(own=(None,)).best is None
    record = one.record()
    assert (record["best"], record["best_online"]) == ("optimal", "delay")
    assert CellComparison.from_record(json.loads(json.dumps(record))) == one


def test_who_did_not_always_finish_is_not_the_best() -> None:
    assert comparison(delay=(1.0, None), vci=(2.0, 2.0)).best_online == "vci"
    assert comparison(delay=(1.0, None)).best_online is None


def test_two_cells_run_under_the_shield() -> None:
    cells = [load_cell("lee1991"), load_cell("mixed-priority")]
    compared = compare_on(cells, ["delay", "vci", "phase-plane", "optimal"])
    lee, mixed = compared.cells
    assert "delay" not in mixed.makespans_s  # no start delay works there
    assert lee.clairvoyant_s == (schedule(cells[0], "optimal").makespan,)
    for name in ("vci", "phase-plane", "optimal"):
        figures = compared.figures(name)
        assert figures["finished"] == 2
        assert figures["violations"] == 0
        assert figures["ratio_to_clairvoyant"][0] > 0.999
    assert lee.makespans_s["phase-plane"][0] == pytest.approx(1.06 * (lee.makespans_s["optimal"][0] or 0.0), rel=0.02)


def test_a_disturbed_first_arm_is_the_same_for_all() -> None:
    compared = compare_on([load_cell("lee1991")], ["delay", "phase-plane"], episodes=3, disturbance="stop-and-go")
    one = compared.cells[0]
    assert one.clairvoyant_s is not None
    assert len(set(one.clairvoyant_s)) == 3
    for times in one.makespans_s.values():
        assert all(
            time is not None and time > 0.97 * known for time, known in zip(times, one.clairvoyant_s, strict=True)
        )


def test_agents_act_in_the_form_that_they_were_trained_with(tmp_path: Path) -> None:
    """One that asks for full speed and for no priority beside rules that give speeds alone."""
    file = tmp_path / "first.npz"
    header = AgentHeader(
        name="first", algorithm="ppo", activation="tanh", environment="coordination", learners="all", steps=0, seed=0,
        settings={"physics": "ideal", "mode": "speed", "shield": True, "action": "speed+priority"},
        entries=[entry.name for entry in COORDINATION_ENTRIES], cells=[], command="", config="", curve=[], armtempo="",
    )  # fmt: skip
    weight = np.zeros((2, len(COORDINATION_ENTRIES)), dtype=np.float32)
    save_agent(file, Agent(header=header, layers=((weight, np.array([1.0, 0.0], dtype=np.float32)),)))
    policies = ["phase-plane", f"ppo:{file}"]
    compared = compare_on([load_cell("lee1991")], policies, episodes=2, disturbance="all-late")
    times = compared.cells[0].makespans_s
    assert times[policies[1]] == times["phase-plane"]  # with no priority it is full speed
    assert compared.cells[0].best == "phase-plane"


def test_what_is_refused() -> None:
    with pytest.raises(UnknownNameError, match="unknown policy"):
        compare_on([], ["nobody"])
    with pytest.raises(InputError, match="at least 1"):
        compare_on([], ["delay"], episodes=0)


def test_the_command_writes_what_it_shows(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "agents.json"
    line = ["bench", "agents", "--class", "mixed", "--split", "validation", "--policies"]
    assert main([*line, "phase-plane", "--json", str(file)]) == 0
    said = capsys.readouterr().out
    assert "phase-plane" in said
    assert "best in each" in said
    told = json.loads(file.read_text())
    assert told["policies"]["phase-plane"]["violations"] == 0
    assert all(one["best"] == one["best_online"] == "phase-plane" for one in told["cells"])
    assert told["policies"]["phase-plane"]["best_in_cells"] == len(told["cells"])
    assert main([*line, "nobody"]) == 2

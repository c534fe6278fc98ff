"""Policies compared over several cells: what is counted, and what is divided by what."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from armtempo.agents import CellComparison, SplitComparison, compare_on
from armtempo.commands import main
from armtempo.errors import InputError, UnknownNameError
from armtempo.planners import load_cell, schedule


def comparison(**makespans: tuple[float | None, ...]) -> CellComparison:
    return CellComparison(
        cell="a", priority_class="uniform", arms=2, makespans_s=makespans, violations=dict.fromkeys(makespans, 0),
        clairvoyant_s=(1.0,) * len(next(iter(makespans.values()))),
    )  # fmt: skip


def test_ratios_are_to_the_best_classical_policy_of_each_cell() -> None:
    one = comparison(delay=(2.0, 2.0), vci=(1.0, 4.0), own=(1.0, 1.0))
    other = comparison(vci=(4.0, 4.0), own=(3.0, None))
    compared = SplitComparison(cells=(one, other, comparison(own=(9.0, 9.0))), seed=0)
    assert (one.best_online, other.best_online) == ("delay", "vci")
    assert compared.pairs("own", "best_online") == [(1.0, 2.0), (1.0, 2.0), (3.0, 4.0)]  # both there, both finished
    ratio, (low, high) = compared.ratio("own", "best_online") or (0.0, (0.0, 0.0))
    assert ratio == pytest.approx(5.0 / 8.0)
    assert low <= ratio <= high
    figures = compared.figures("own")
    assert (figures["cells"], figures["episodes"], figures["finished"]) == (3, 6, 5)


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


def test_what_is_refused() -> None:
    with pytest.raises(UnknownNameError, match="unknown policy"):
        compare_on([], ["nobody"])
    with pytest.raises(InputError, match="at least 1"):
        compare_on([], ["delay"], episodes=0)


def test_the_command_writes_what_it_shows(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "agents.json"
    line = ["bench", "agents", "--class", "mixed", "--split", "validation", "--policies"]
    assert main([*line, "phase-plane", "--json", str(file)]) == 0
    assert "phase-plane" in capsys.readouterr().out
    told = json.loads(file.read_text())
    assert told["policies"]["phase-plane"]["violations"] == 0
    assert main([*line, "nobody"]) == 2

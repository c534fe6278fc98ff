"""Commands that are interrupted, and those that could not write what they are to compute."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from armtempo.agents.evaluation import Runner
from armtempo.commands import main
from armtempo.commands.console import Kept
from armtempo.planners import benchmark_instances
from tests.agents.trained import trained

EVALUATE = [
    "evaluate",
    "lee1991",
    "--physics",
    "ideal",
    "--policies",
    "phase-plane",
    "random",
    trained("lee1991"),
    "delay",
]
DISTURBED = [*EVALUATE, "--episodes", "3", "--disturbance", "late", "--shield", "--json", "e.json"]
KILLED = """
import os, signal, sys
from armtempo.commands import main
from armtempo.commands.console import Kept

def put(kept, unit, value, put=Kept.put):
    value = put(kept, unit, value)
    if kept.count == int(sys.argv[1]):
        os.kill(os.getpid(), int(sys.argv[2]))
    return value

Kept.put = put
sys.exit(main(sys.argv[3:]))
"""


def put_and_stop(at: int) -> Callable[[Kept, str, Any], Any]:
    """``Kept.put`` that presses Ctrl-C behind so many results."""
    whole = Kept.put

    def put(kept: Kept, unit: str, value: Any) -> Any:
        value = whole(kept, unit, value)
        if kept.count == at:
            signal.raise_signal(signal.SIGINT)
        return value

    return put


@pytest.fixture(autouse=True)
def _ctrl_c() -> Any:
    before = signal.signal(signal.SIGINT, signal.default_int_handler)  # shells let background jobs ignore it
    yield
    signal.signal(signal.SIGINT, before)


def without_times(value: Any) -> Any:
    """JSON without what a clock measured."""
    if isinstance(value, dict):
        return {key: without_times(one) for key, one in value.items() if not key.startswith("planning_time")}
    return [without_times(one) for one in value] if isinstance(value, list) else value


@pytest.mark.parametrize("figures", [True, False])
def test_an_evaluation_goes_on_behind_what_it_has(
    figures: bool, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    line = [*DISTURBED, "--out", "pictures"] if figures else [*DISTURBED, "--no-figures"]
    assert main(line) == 0
    whole, table = Path("e.json").read_text(), capsys.readouterr().out
    Path("e.json").unlink()
    with monkeypatch.context() as patch:
        patch.setattr(Kept, "put", put_and_stop(3))
        assert main(line) == 130
    told = capsys.readouterr().err
    assert told.startswith("armtempo: interrupted: 3 results are kept in results/partial/evaluate-")
    assert told.endswith("; the same line goes on with them\n")
    assert not Path("e.json").exists()
    episodes: list[int] = []
    monkeypatch.setattr("armtempo.agents.coordination._kind.CoordinationRunner.run", counted(episodes))
    assert main(line) == 0
    assert len(episodes) == (3 + 3 if figures else 3)  # first episodes again for their pictures; all of the last policy
    captured = capsys.readouterr()
    assert captured.out == table
    assert "Going on behind 3 results of results/partial/evaluate-" in captured.err
    assert without_times(json.loads(Path("e.json").read_text())) == without_times(json.loads(whole))
    assert not Path("results").exists()


def counted(calls: list[int]) -> Callable[..., Any]:
    from armtempo.agents.coordination._kind import CoordinationRunner

    run = CoordinationRunner.run

    def one(self: Runner[Any], seed: int, *rest: Any) -> Any:
        calls.append(seed)
        return run(self, seed, *rest)  # type: ignore[arg-type]

    return one


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM])
def test_an_evaluation_that_is_killed_goes_on_to_the_same_bytes(number: signal.Signals) -> None:
    line = ["evaluate", "lee1991", "--policies", "phase-plane", "random", "--no-figures", "--json"]
    assert main([*line, "whole.json"]) == 0
    ended = subprocess.run(
        [sys.executable, "-c", KILLED, "1", str(int(number)), *line, "killed.json"],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert ended.returncode == (143 if number == signal.SIGTERM else -number)
    assert ended.stderr.count("\n") == (number == signal.SIGTERM)
    assert len(list(Path("results/partial").iterdir())) == 1
    assert main([*line, "killed.json"]) == 0
    assert Path("killed.json").read_bytes() == Path("whole.json").read_bytes()


def test_other_arguments_or_another_cell_take_nothing_over(
    cell_file: Callable[..., str], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    file = cell_file()
    line = ["evaluate", file, "--physics", "ideal", "--policies", "phase-plane", "random", "--no-figures"]
    with monkeypatch.context() as patch:
        patch.setattr(Kept, "put", put_and_stop(1))
        assert main(line) == 130
    for other in ([*line, "--seed", "1"], [*line, "--episodes", "2"], [*line, "--shield"]):
        assert main(other) == 0
    text = Path(file).read_text(encoding="utf-8")
    Path(file).write_text(text.replace("control_period_s: 0.004", "control_period_s: 0.002"), encoding="utf-8")
    assert main(line) == 0
    assert "Going on" not in capsys.readouterr().err
    Path(file).write_text(text, encoding="utf-8")
    assert main(line) == 0
    assert "Going on behind 1 results" in capsys.readouterr().err


BENCHES = {
    "agents": (["bench", "agents", "--policies", "phase-plane", "vci", "--episodes", "2"], "cells"),
    "coordination": (["bench", "coordination", "--methods", "sequential", "delay", "--audit", "none"], "results"),
    "arms": (["bench", "arms", "--arms", "2", "--count", "2", "--methods", "delay", "--out", "arms.png"], "cells"),
}


@pytest.mark.parametrize("name", BENCHES)
def test_a_bench_goes_on_behind_what_it_has(
    name: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    line, rows = BENCHES[name]
    two = [one for one in benchmark_instances("test", family="planar") if one.labels.status == "feasible"][:2]
    monkeypatch.setattr("armtempo.planners.benchmark_instances", lambda *_, **__: tuple(two))
    assert main([*line, "--json", "whole.json"]) == 0
    with monkeypatch.context() as patch:
        patch.setattr(Kept, "put", put_and_stop(1))
        assert main([*line, "--json", "e.json"]) == 130
    (file,) = Path("results/partial").iterdir()
    kept = json.loads(file.read_text().splitlines()[1].partition(" ")[2])[1]
    assert main([*line, "--json", "e.json"]) == 0
    assert "Going on behind 1 results" in capsys.readouterr().err
    whole, outcome = (json.loads(Path(file).read_text()) for file in ("whole.json", "e.json"))
    assert without_times(outcome) == without_times(whole)
    first = {"agents": [kept], "coordination": kept.get("results"), "arms": [kept.get("entry")]}[name]
    assert outcome[rows][: len(first)] == first  # with what the clock measured then
    assert not Path("results").exists()


def test_generated_cells_are_taken_over_unless_they_have_been_changed(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    line = ["cells", "generate", "--count", "2", "--first", "1", "--out", "cells", "--json", "cells.json"]

    def stop(*given: Any, **how: Any) -> Any:
        signal.raise_signal(signal.SIGINT)

    assert main([*line[:3], "1", *line[4:]]) == 0
    with monkeypatch.context() as patch:
        patch.setattr("armtempo.planners.generate_cell", stop)
        assert main(line) == 130
    assert capsys.readouterr().err == "armtempo: interrupted: 1 cells are in cells; the same line goes on with them\n"
    files = sorted(Path("cells").iterdir())
    assert [file.name for file in files] == [f"planar-1-0001{end}" for end in (".labels.json", ".npz", ".yaml")]
    for file in files:
        whole = file.read_bytes()
        for place in range(0, len(whole), max(1, len(whole) // 20)):
            file.write_bytes(whole[:place] + bytes([whole[place] ^ 4]) + whole[place + 1 :])
            assert main([*line[:3], "1", *line[4:]]) == 2
            assert "is not as it was drawn (move planar-1-0001.* away" in capsys.readouterr().err
        file.write_bytes(whole)
    labels = json.loads(files[0].read_text())
    del labels["digests"]  # as earlier versions wrote them
    files[0].write_text(json.dumps(labels))
    assert main([*line[:3], "1", *line[4:]]) == 0
    assert json.loads(Path("cells.json").read_text())["cells"] == [labels]


@pytest.mark.parametrize(
    "line",
    [
        ["cells", "--json", "taken/x.json"],
        ["cells", "generate", "--out", "taken"],
        ["plan", "lee1991", "--export", "taken/motions"],
        ["plan", "lee1991", "--json", "taken/x.json"],
        ["plot", "lee1991", "--out", "taken"],
        ["record", "lee1991", "--out", "taken/film.gif"],
        ["record", "lee1991", "--out", "taken/pictures"],
        ["record", "lee1991", "--out", "folder.mp4"],
        ["view", "lee1991", "--html", "taken/page.html"],
        ["evaluate", "lee1991", "--html", "folder.mp4"],
        ["evaluate", "lee1991", "--out", "taken"],
        ["evaluate", "lee1991", "--no-figures", "--json", "folder.mp4"],
        ["reproduce", "lee1991", "--out", "taken"],
        ["reproduce", "lee1991", "--json", "taken/x.json"],
        ["bench", "agents", "--json", "taken/x.json"],
        ["bench", "arms", "--out", "taken/x.png"],
        ["bench", "coordination", "--json", "taken/x.json"],
        ["train", "lee1991", "--output", "taken"],
        ["train", "lee1991", "--json", "taken/x.json"],
        ["sweep", "lee1991", "--storage", "taken/s"],
    ],
    ids=" ".join,
)
def test_an_output_that_cannot_be_written_is_told_before_the_work(
    line: list[str], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def work(*given: Any, **how: Any) -> Any:
        raise AssertionError("the work has begun")

    for where in ("load_cell", "generate_cell", "build_cell"):
        monkeypatch.setattr(f"armtempo.planners.{where}", work)
    Path("taken").write_text("")
    Path("folder.mp4").mkdir()
    assert main(line) == 2
    err = capsys.readouterr().err
    assert err.startswith("armtempo: error: cannot write ")
    assert ("taken is no folder" in err) or ("it is a folder" in err)
    assert err.count("\n") == 1
    assert sorted(file.name for file in Path.cwd().iterdir()) == ["folder.mp4", "taken"]

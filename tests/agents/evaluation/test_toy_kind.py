"""A fourth kind of cell, made here: one room's worth of classes and a line in each table, and evaluations take it."""

from __future__ import annotations

import io
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, ClassVar

import gymnasium
import numpy as np
import pytest
from gymnasium.spaces import Box
from rich.console import Console

from armtempo.agents import KINDS, Evaluation, Kind, Policy, RandomPolicy, evaluate, figure
from armtempo.agents.evaluation import play
from armtempo.arrays import Floats, Floats32
from armtempo.commands import _evaluate as command
from armtempo.commands import main
from armtempo.commands.console import table_of
from armtempo.commands.reports import REPORTS, Report, labelled
from armtempo.envs import Physics
from armtempo.errors import InfeasibleError, UnknownNameError
from armtempo.planners.cells import CellBase
from armtempo.robots import Arm, Shape

RIGHT = np.float32(0.25)


@dataclass(frozen=True, kw_only=True, eq=False)
class ToyCell(CellBase[Any]):
    """A number that is to be met."""

    config_type: ClassVar = SimpleNamespace

    goal: float

    @classmethod
    def from_config(cls, config: Any) -> ToyCell:
        return cls(name=config.name, config=config, goal=config.goal)

    @property
    def arms(self) -> tuple[Arm, ...]:
        return ()

    @property
    def obstacles(self) -> tuple[Shape, ...]:
        return ()

    def certify(self) -> None:
        """Nothing can go wrong."""


@dataclass(frozen=True, kw_only=True)
class ToyOptions:
    """Options of the toy's episodes."""

    physics: Physics = "ideal"
    """There is no other."""

    push_m: float = 0.0
    """How far the goal is moved [m]."""

    steps: float = 4.0
    """Decisions of an episode."""


class ToyEnv(gymnasium.Env[Floats32, Floats32]):
    """Pays for being near the goal."""

    observation_space = Box(-1.0, 1.0, (1,))
    action_space = Box(-1.0, 1.0, (1,))

    def __init__(self, cell: ToyCell, options: ToyOptions) -> None:
        self.cell, self.options = cell, options
        self.closed = False

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Floats32, dict[str, Any]]:
        super().reset(seed=seed)
        self.errors: list[float] = []
        return np.zeros(1, np.float32), {}

    def step(self, action: Floats32) -> tuple[Floats32, float, bool, bool, dict[str, Any]]:
        self.errors.append(abs(float(action[0]) - self.cell.goal - self.options.push_m))
        over = len(self.errors) >= self.options.steps
        return action, -self.errors[-1], over, False, {}

    @property
    def trace(self) -> Floats:
        return np.array(self.errors)

    def render(self) -> Any:
        return np.full((48, 64, 3), 50 * len(self.errors), dtype=np.uint8)

    def close(self) -> None:
        self.closed = True


class Known:
    """Knows what is right, or not quite."""

    def __init__(self, off: float) -> None:
        self.off = np.float32(off)

    def reset(self, seed: int | None = None) -> None:
        """Nothing to forget."""

    def act(self, observation: Floats32, env: ToyEnv) -> Floats32:
        return np.array([RIGHT + self.off], np.float32)


@dataclass(frozen=True, kw_only=True, eq=False)
class ToyResult:
    error_max_m: float = figure("error\n[mm]", digits=1, scale=1e3, limit=0.5)
    error_small_m: float = figure("least\n[mm]", scale=1e3, form="small")
    best_m: float | None = figure("{what}\n[m]", known=True)
    error_mean_m: float = figure("mean\n[m]", digits=5, roomy=True, several=False)
    error_total_m: float = figure("total\n[m]", digits=5, several=True)
    finished: int = figure("done", form="episodes")
    reward: float = figure()
    trace: Floats = field(repr=False)


@dataclass(frozen=True, kw_only=True, eq=False)
class ToyRunner:
    env: ToyEnv
    policy: Policy[Floats32, Floats32]

    def run(self, seed: int, on_step: Callable[[], None] | None = None) -> tuple[Floats, float]:
        reward, _ = play(self.env, self.policy, seed, on_step=on_step)
        return self.env.trace, reward

    def close(self) -> None:
        self.env.close()


class ToyKind(Kind[ToyCell, ToyOptions, tuple[Floats, float], ToyResult]):
    name = "toy"
    options_type = ToyOptions
    result_type = ToyResult
    settled = ("steps",)
    always_told = ("physics",)
    may_refuse = True
    policies = ("known", "off", "random", "nobody")

    def __init__(self) -> None:
        self.opened: list[ToyEnv] = []

    def open(self, cell: ToyCell, policy: str, options: ToyOptions, *, before: Any = None) -> ToyRunner:
        if policy == "nobody":
            raise InfeasibleError("there is no such motion")
        made: dict[str, Policy[Floats32, Floats32]] = {
            "known": Known(0.0), "off": Known(2.0**-23), "random": RandomPolicy(),
        }  # fmt: skip
        self.opened.append(ToyEnv(cell, options))
        return ToyRunner(env=self.opened[-1], policy=made[policy])

    def measure(self, cell: ToyCell, runs: Sequence[tuple[Floats, float]], seed: int) -> ToyResult:
        errors = np.concatenate([trace for trace, _ in runs])
        return ToyResult(
            error_max_m=float(errors.max()),
            error_small_m=float(errors.min()),
            best_m=None,
            error_mean_m=float(errors.mean()),
            error_total_m=float(errors.sum()),
            finished=sum(bool(trace.max() < 1e-3) for trace, _ in runs),
            reward=float(np.mean([reward for _, reward in runs])),
            trace=runs[0][0],
        )

    def head(self, cell: ToyCell) -> Mapping[str, object]:
        return {"goal_m": cell.goal, "what": "best"}


@pytest.fixture
def toy(monkeypatch: pytest.MonkeyPatch) -> ToyCell:
    config = SimpleNamespace(
        name="tiny", built_as="toy", kind="toy", goal=float(RIGHT), physics_tick_s=0.001, control_period_s=0.01,
        ticks_per_period=10, gravity_m_s2=(0.0, 0.0, 0.0),
    )  # fmt: skip
    report: Report[Any] = Report(
        title_suffix=lambda evaluation: "; a toy",
        caption=lambda evaluation: f"goal {evaluation.cell.goal:g} m",
        summary_sentence=lambda evaluation: f"{len(evaluation.results)} policies met the goal or not.",
        figures=lambda evaluation: {},
        best=lambda evaluation: ["known"],
    )
    monkeypatch.setitem(KINDS, "toy", ToyKind())
    monkeypatch.setitem(REPORTS, "toy", report)
    return ToyCell.from_config(config)


def evaluated(cell: ToyCell, *policies: str, **keywords: Any) -> Evaluation[ToyCell, ToyOptions, ToyResult]:
    run: Any = evaluate  # its overloads are the kinds that come with armtempo
    result: Evaluation[ToyCell, ToyOptions, ToyResult] = run(cell, policies or None, **keywords)
    return result


def test_it_is_evaluated_to_json(toy: ToyCell) -> None:
    calls: list[tuple[str, int]] = []
    result = evaluated(toy, episodes=2, seed=5, on_episode=lambda name, k: calls.append((name, k)))
    assert calls == [(name, k) for name in ("known", "off", "random") for k in range(2)]
    content = json.loads(json.dumps(result.to_dict(), allow_nan=False))
    assert set(content) == {"cell", "physics", "episodes", "seed", "goal_m", "what", "policies", "refused"}
    assert content["refused"] == {"nobody": "there is no such motion"}
    assert content["policies"]["known"] == {
        "error_max_m": 0.0, "error_small_m": 0.0, "best_m": None, "error_mean_m": 0.0, "error_total_m": 0.0,
        "finished": 2, "reward": 0.0,
    }  # fmt: skip
    again = evaluated(toy, "random", episodes=1, seed=6)
    assert again.results["random"].reward != result.results["random"].reward
    kind = KINDS["toy"]
    assert isinstance(kind, ToyKind)
    assert all(env.closed for env in kind.opened)


def test_its_options_are_keywords(toy: ToyCell) -> None:
    pushed = evaluated(toy, "known", push_m=0.5)
    assert pushed.results["known"].error_max_m == 0.5
    assert pushed.to_dict()["push_m"] == 0.5
    for wrong in ("shield", "steps"):  # one that it does not have, one that is settled
        with pytest.raises(
            UnknownNameError, match=rf"option of evaluations in toy cells '{wrong}'.*known: physics, push_m"
        ):
            evaluated(toy, "known", **{wrong: 1})
    with pytest.raises(InfeasibleError):
        evaluated(toy, "nobody")
    with pytest.raises(UnknownNameError, match="unknown policy 'vci'"):
        evaluated(toy, "vci")


def test_the_command_takes_it_with_flags_table_and_report(
    toy: ToyCell, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Only reading its file is stood in for: a schema of its own would be a line in another table."""
    monkeypatch.setattr("armtempo.configs.load_cell_config", lambda name: toy.config)
    monkeypatch.setattr(command, "open_cell", lambda name, output: toy)
    monkeypatch.chdir(tmp_path)
    line = ["evaluate", "tiny", "--push", "0.5", "--no-figures", "--json", "toy.json"]
    assert main(line) == 0
    out = capsys.readouterr().out
    assert "tiny in simulation (ideal, tick 1 ms, decision every 10 ms; a toy)" in " ".join(out.split())
    rows = {words[0]: words[1:] for words in (text.split() for text in reversed(out.splitlines())) if words}
    assert rows["policy"] == ["[mm]", "[mm]", "[m]", "done"]  # nobody has a best_m, and the reward has no column
    assert rows["known"] == ["500.0", "500.000", "0.50000", "0/1"]
    assert rows["nobody"] == ["none", "–", "–", "–"]
    assert "goal 0.25 m" in out
    assert "3 policies met the goal or not." in out
    assert "nobody has no plan: there is no such motion" in out
    assert json.loads(Path("toy.json").read_text())["push_m"] == 0.5
    assert main(["evaluate", "tiny", "--policies", "off", "--no-figures"]) == 0
    assert "1e-04" in capsys.readouterr().out  # not 0.000: how small it is
    assert main(["evaluate", "tiny", "--help"]) == 0
    out = capsys.readouterr().out
    assert "--push M" in out
    assert "How far the goal is moved [m]." in out
    assert "--steps" not in out
    assert main(["evaluate", "tiny", "--shield"]) == 2
    assert "unknown option of armtempo evaluate in toy cells '--shield'" in capsys.readouterr().err


@pytest.mark.parametrize("line", [["record", "tiny", "--out", "film"], ["view", "tiny", "--html", "toy.html"]])
def test_what_has_no_arms_cannot_be_seen(
    toy: ToyCell, line: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("armtempo.configs.load_cell_config", lambda name: toy.config)
    monkeypatch.setattr(f"armtempo.commands._{line[0]}.open_cell", lambda name, output: toy)
    monkeypatch.chdir(tmp_path)
    assert main(line) == 2
    assert "Trace" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(("episodes", "width", "heads"), [
    (1, 118, ["policy", "error", "least", "mean", "done"]),
    (1, 80, ["policy", "error", "least", "done"]),
    (2, 80, ["policy", "error", "least", "total", "done"]),
])  # fmt: skip
def test_columns_are_for_several_episodes_or_one_and_for_wide_tables(
    toy: ToyCell, episodes: int, width: int, heads: list[str]
) -> None:
    table = table_of(evaluated(toy, "off", episodes=episodes), title="", caption="", width=width, bold=["off"])
    assert [str(column.header).split("\n")[0] for column in table.columns] == heads
    assert next(iter(table.columns[1].cells)) == "0.0"
    if episodes == 2:
        assert list(table.columns[3].cells) == ["0.000"]  # narrow: three digits
    assert [row.style for row in table.rows] == ["bold"]


def test_long_names_cut_no_number(toy: ToyCell) -> None:
    runs = evaluated(toy, "known", "off")
    name = "ppo:results/train/a-training-with-a-long-name-0/best-of-all-that-were-tried.npz"
    runs = replace(runs, results={name: runs.results["known"], "off": runs.results["off"]})
    written = io.StringIO()
    Console(width=40, file=written).print(table_of(runs, title="", caption="", width=40))
    text = written.getvalue()
    assert "…" not in text
    assert "1/1" in text
    label = labelled(runs)
    assert list(label.results) == ["ppo-best-of-all-that-were-tried", "off"]
    assert label.results["ppo-best-of-all-that-were-tried"] is runs.results[name]

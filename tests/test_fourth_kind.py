"""A fourth kind of cell from file to film: one room's worth of classes per floor, made here, and a line in each table.

An arm turns its first joint to an angle; the agent sets the joint's speed.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar, Literal, TypedDict, Unpack

import numpy as np
import pytest
from gymnasium.spaces import Box
from gymnasium.utils.env_checker import check_env

from armtempo.agents import KINDS, Kind, Policy, RandomPolicy, figure, load_agent, train
from armtempo.agents.evaluation import CurveEvaluator, TrainingTask, keywords_of, play
from armtempo.agents.policies import is_agent_name, learned_policy
from armtempo.agents.training import TASKS
from armtempo.arrays import Floats, Floats32
from armtempo.commands import main
from armtempo.commands.reports import REPORTS, Report
from armtempo.configs import CellFileConfig, EnvironmentTraining, MountedArmConfig, PPOConfig, TrainConfig
from armtempo.configs.schema import CELL_CONFIGS, Real
from armtempo.envs import Physics
from armtempo.envs.bodies import End, Recorder, Trace
from armtempo.envs.common import (
    Entry,
    SingleAgentEnv,
    action_space,
    check_names,
    observation_space,
    options_of,
    read_actions,
)
from armtempo.planners import load_cell
from armtempo.planners.cells import CELLS, OneArmCell, Sweep, arm_from, as_cell
from armtempo.state import Stateful
from armtempo.testing import check_environment, check_kind, check_policy

ENTRIES = (Entry("error", -1.0, 1.0, "goal minus angle, as a share of pi"),)

# configs: a schema


class TurnCellConfig(CellFileConfig):
    """An arm and the angle that its first joint is to have."""

    kind: Literal["turn"]  # pyright: ignore[reportIncompatibleVariableOverride] (models are frozen)
    arm: MountedArmConfig
    goal_rad: Real

    @property
    def arms(self) -> tuple[MountedArmConfig]:
        return (self.arm,)


class TurnTraining(EnvironmentTraining):
    """Trainings of this kind."""

    cell: str


class TurnTrainConfig(TrainConfig):
    """A training file with one more key."""

    turn: TurnTraining | None = None


# planners: a cell


@dataclass(frozen=True, kw_only=True, eq=False)
class TurnCell(OneArmCell[TurnCellConfig]):
    """See ``TurnCellConfig``."""

    config_type: ClassVar = TurnCellConfig

    goal: float

    @classmethod
    def from_config(cls, config: TurnCellConfig) -> TurnCell:
        return cls(name=config.name, config=config, arm=arm_from(config, config.arm), goal=config.goal_rad)

    def __reduce__(self) -> tuple[object, tuple[TurnCellConfig]]:
        return type(self).from_config, (self.config,)

    def certify(self) -> None:
        """Nothing is in the way."""

    def sweeps(self, count: int) -> tuple[Sweep, ...]:
        q = np.zeros((count, self.arm.dof))
        q[:, 0] = np.linspace(0.0, self.goal, count)
        return (Sweep(q, self.arm.tip_pose(q)[:, :3, 3]),)


# envs: options, simulation, environment


@dataclass(frozen=True, kw_only=True)
class TurnOptions:
    """Options of the episodes."""

    physics: Physics = "ideal"
    """There is no other."""

    from_rad: float = 0.0
    """Where the joint starts [rad]."""

    def __post_init__(self) -> None:
        check_names(("physics", self.physics, ("ideal",)))


class TurnKeywords(TypedDict, total=False):
    physics: Physics
    from_rad: float


class TurnSimulation(Stateful):
    """The joint goes where it is told."""

    changing = ("angle", "steps", "recorder")

    def __init__(self, cell: TurnCell, options: TurnOptions, *, record: bool) -> None:
        self.cell, self.options = cell, options
        self.recorder = Recorder(wanted=record, tick=cell.control_period)
        self.reset()

    def reset(self) -> None:
        self.angle, self.steps = self.options.from_rad, 0
        self.recorder.clear()
        self._keep()

    def _keep(self) -> None:
        rest = np.zeros(self.cell.arm.dof)
        self.recorder.add(q=self.joint_positions()[0], torque=rest, demand=rest)

    @property
    def time(self) -> float:
        return self.steps * self.cell.control_period

    @property
    def end(self) -> End:
        met = abs(self.angle - self.cell.goal) < 0.01
        return End(self.time if met else float("nan"), violated=False)

    def step(self, command: Floats, /) -> None:
        self.angle += float(command[0]) * 2.0 * self.cell.control_period
        self.steps += 1
        self._keep()

    def joint_positions(self) -> Floats:
        q = np.zeros((1, self.cell.arm.dof))
        q[0, 0] = self.angle
        return q

    def trace(self) -> Trace[Floats]:
        return Trace(**self.recorder.columns(), torque_max=self.cell.arm.torque_max)

    def close(self) -> None:
        """Nothing is open."""


class TurnEnv(SingleAgentEnv[TurnSimulation]):
    """Pays for being near the goal."""

    metadata = {"render_modes": ["rgb_array"], "render_fps": 25}  # noqa: RUF012 (as Gymnasium declares it)
    reset_options = ()

    def __init__(
        self,
        cell: TurnCell | str | Path,
        *,
        render_mode: str | None = None,
        record: bool = False,
        **options: Unpack[TurnKeywords],
    ) -> None:
        super().__init__(render_mode)
        self.cell = as_cell(cell, TurnCell)
        self.options = options_of(TurnOptions, options)
        self.simulation = TurnSimulation(self.cell, self.options, record=record)
        self.observation_space: Box = observation_space(ENTRIES)  # type: ignore[assignment]
        self.action_space: Box = action_space()  # type: ignore[assignment]

    @property
    def trace(self) -> Trace[Floats]:
        return self.simulation.trace()

    def _begin(self, options: Mapping[str, Any], seeded: bool) -> tuple[Floats32, dict[str, Any]]:
        self.simulation.reset()
        return self._seen(), {}

    def _run(self, action: Floats32) -> tuple[Floats32, float, bool, bool, dict[str, Any]]:
        self.simulation.step(read_actions(action, 1, "turn"))
        met = bool(np.isfinite(self.simulation.end.arrived))
        over = self.simulation.steps >= 100
        return self._seen(), -abs(self.simulation.angle - self.cell.goal), met, over and not met, {"is_success": met}

    def _seen(self) -> Floats32:
        share = (self.cell.goal - self.simulation.angle) / np.pi
        return np.array([min(max(share, -1.0), 1.0)], np.float32)


# agents: a policy, a result, a kind, a training


class Straight:
    """Goes there."""

    def reset(self, seed: int | None = None) -> None:
        """Nothing to forget."""

    def act(self, observation: Floats32, env: TurnEnv) -> Floats32:
        return np.array(np.clip(20.0 * observation, -1.0, 1.0), np.float32)


@dataclass(frozen=True, kw_only=True, eq=False)
class TurnResult:
    error_max_rad: float = figure("error\n[rad]", digits=3)
    reward: float = figure("reward", digits=3)
    trace: Trace[Floats] = field(repr=False)


@dataclass(frozen=True, kw_only=True, eq=False)
class TurnRunner:
    env: TurnEnv
    policy: Policy[Floats32, Floats32]

    def run(self, seed: int, on_step: Callable[[], None] | None = None) -> tuple[Trace[Floats], float]:
        reward, _ = play(self.env, self.policy, seed, on_step=on_step)
        return self.env.trace, reward

    def close(self) -> None:
        self.env.close()


Episode = tuple[Trace[Floats], float]


class TurnKind(Kind[TurnCell, TurnOptions, Episode, TurnResult]):
    name = "turn"
    options_type = TurnOptions
    result_type = TurnResult
    always_told = ("physics",)
    policies = ("straight", "random")

    def open(self, cell: TurnCell, policy: str, options: TurnOptions, *, before: Any = None) -> TurnRunner:
        env = TurnEnv(cell, record=True, **keywords_of(options))
        if is_agent_name(policy):
            return TurnRunner(env=env, policy=learned_policy(policy, env, "turn"))
        known: dict[str, Policy[Floats32, Floats32]] = {"straight": Straight(), "random": RandomPolicy()}
        return TurnRunner(env=env, policy=known[policy])

    def measure(self, cell: TurnCell, runs: Sequence[Episode], seed: int) -> TurnResult:
        errors = np.concatenate([np.abs(trace.q[:, 0] - cell.goal) for trace, _ in runs])
        return TurnResult(
            error_max_rad=float(errors.max()), reward=float(np.mean([total for _, total in runs])), trace=runs[0][0]
        )

    def head(self, cell: TurnCell) -> Mapping[str, object]:
        return {"goal_rad": cell.goal}


class TurnTask(TrainingTask):
    environment = "turn"

    def __init__(self, config: TrainConfig, chosen: TurnTraining) -> None:
        self.config, self.settings = config, {"physics": "ideal"}
        self._cell = load_cell(chosen.cell, TurnCell)
        self.cells = (self._cell,)

    @property
    def entries(self) -> list[str]:
        return [entry.name for entry in ENTRIES]

    def vector(self) -> None:
        return None

    def single(self, turn: int) -> TurnEnv:
        return TurnEnv(self._cell)

    def evaluator(self) -> CurveEvaluator:
        return CurveEvaluator([TurnEnv(self._cell)], self.config.evaluation)


REPORT: Report[Any] = Report(
    title_suffix=lambda evaluation: "",
    caption=lambda evaluation: f"goal {evaluation.cell.goal:g} rad",
    summary_sentence=lambda evaluation: f"{len(evaluation.results)} policies turned the arm.",
    figures=lambda evaluation: {},
)


@pytest.fixture
def file(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> str:
    """A cell file of the new kind, which has its line in every table."""
    put: Callable[[Any, Any, Any], None] = monkeypatch.setitem
    put(CELL_CONFIGS, "turn", TurnCellConfig)
    put(CELLS, "turn", TurnCell)
    put(KINDS, "turn", TurnKind())
    put(REPORTS, "turn", REPORT)
    put(TASKS, TurnTraining, TurnTask)
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "quarter.yaml"
    path.write_text(
        "kind: turn\nname: quarter\ngoal_rad: 1.0\nphysics_tick_s: 0.01\ncontrol_period_s: 0.02\n"
        "arm: {name: planar, urdf: planar_two_link.urdf}\n"
    )
    return str(path)


def test_its_cell_environment_and_policies_keep_every_promise(file: str) -> None:
    cell = load_cell(file, TurnCell)
    check_kind("turn", cell)
    check_environment(lambda **options: TurnEnv(file, **options))
    check_policy(Straight(), TurnEnv(cell))
    check_env(TurnEnv(cell), skip_render_check=True)


def test_commands_evaluate_and_film_it(file: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["evaluate", file, "--from-rad", "0.5", "--no-figures", "--json", "turn.json"]) == 0
    out = capsys.readouterr().out
    assert "quarter in simulation" in out
    assert "2 policies turned the arm." in out
    said = json.loads((tmp_path / "turn.json").read_text())
    assert said["policies"]["straight"]["error_max_rad"] == 0.5
    assert main(["record", file, "--policy", "straight", "--out", str(tmp_path / "film")]) == 0
    assert len(list((tmp_path / "film").glob("*.png"))) > 10
    assert main(["evaluate", file, "--shield"]) == 2
    assert "in turn cells '--shield'" in capsys.readouterr().err


@pytest.mark.rl
def test_it_is_trained_and_its_agent_is_a_policy(file: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    config = TurnTrainConfig(
        name="turn", algorithm="ppo", turn=TurnTraining(cell=file), num_envs=2, total_steps=256,
        ppo=PPOConfig(rollout_steps=64, batch_size=64, epochs=1),
    )  # fmt: skip
    training = train(config, tmp_path / "out")
    assert training.curve[-1]["episodes"] == config.evaluation.episodes
    assert load_agent(tmp_path / "out" / "agent.npz").header.environment == "turn"
    assert main(["evaluate", file, "--policies", "ppo:out/agent.npz", "--no-figures"]) == 0
    assert "ppo:out/agent.npz" in capsys.readouterr().out

"""Training agents that see graphs: rows of teams, a teacher, the best agent kept, exact resume, wrong files."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("stable_baselines3")
pytest.importorskip("tensorboard")

from armtempo.agents import compare_on, evaluate, train
from armtempo.agents.coordination._teaching import GO, HOLD, demonstrate
from armtempo.agents.coordination._team_training import TeamEvaluator, demonstrations, team_simulations
from armtempo.agents.policies import Agent, LearnedPolicy, load_agent
from armtempo.agents.training.vec_envs import TeamVecEnv
from armtempo.configs import EvaluationConfig, load_train_config
from armtempo.envs import GRAPH_ARMS, NODE_ENTRIES, BatchSimulation, CoordinationEnv
from armtempo.errors import ConfigError, InputError
from armtempo.planners import CoordinationCell, generate_cell, load_cell

pytestmark = [pytest.mark.rl, pytest.mark.filterwarnings("ignore::DeprecationWarning:tensorboard.*")]

TEAM: dict[str, Any] = {"shield": True, "observation": "graph", "orders": "search+stop", "reward": "team"}
FILE = """
name: small
algorithm: ppo
coordination:
  cells: [lee1991]
  learners: all
  shield: true
  reward: team
  observation: graph
  orders: search+stop
  hold_periods: 10
  disturbance: all-any
  undisturbed_share: 0.5
num_envs: 4
total_steps: 192
checkpoint_every_steps: 96
seed: 3
evaluation: {every_steps: 96, episodes: 2, select: best}
imitation: {decisions: 40, passes: 2, batch_size: 16}
network: {kind: graph, sizes: [8, 8], activation: relu}
ppo: {rollout_steps: 12, batch_size: 24, epochs: 2, gamma: 1.0}
"""


@pytest.fixture(scope="module")
def ring() -> CoordinationCell:
    return generate_cell("ring", 1, 0, arms=3).cell


def test_a_training_keeps_its_best_agent_which_drives_any_number_of_arms(
    tmp_path: Path, ring: CoordinationCell
) -> None:
    (tmp_path / "small.yaml").write_text(FILE)
    training = train(tmp_path / "small.yaml", tmp_path / "out")
    assert [row["steps"] for row in training.curve] == [0, 96, 192]
    best = min(training.curve, key=lambda row: row["mixed_ratio"])
    agent = load_agent(tmp_path / "out" / "agent.npz")
    assert agent.header.steps == best["steps"]
    assert agent.header.network == "graph"
    assert agent.header.settings == {
        "physics": "ideal", "mode": "speed", "shield": True, "observation": "graph", "orders": "search+stop",
    }  # fmt: skip
    name = f"ppo:{tmp_path / 'out' / 'agent.npz'}"
    for cell in (load_cell("lee1991"), ring):
        result = evaluate(cell, ["vci", name, "search"], physics="ideal", shield=True).results[name]
        assert result.finished == 1
        assert result.violations == 0
    with pytest.raises(InputError, match="acts under a shield"):
        evaluate(ring, [name], physics="ideal")
    compared = compare_on([ring], ["search+stop", name], episodes=2, disturbance="all-any")
    assert None not in compared.cells[0].makespans_s[name]


def test_an_action_is_held_as_long_as_in_training(tmp_path: Path, ring: CoordinationCell) -> None:
    (tmp_path / "small.yaml").write_text(FILE)
    agent = train(tmp_path / "small.yaml", tmp_path / "out", steps=48).agent
    assert agent.header.decide_every == 10
    env = CoordinationEnv(ring, physics="ideal", shield=True, observation="graph", orders="search+stop")
    policy = LearnedPolicy(agent)
    observations, _ = env.reset(seed=0)
    policy.reset()
    asked = []
    for _ in range(25):
        actions = policy.act(observations, env)
        asked.append(np.concatenate([actions[name] for name in env.agents]))
        seen = observations["arm_0"]
        if len(asked) % 10 == 1:
            np.testing.assert_array_equal(asked[-1], agent.act_on_graph(seen["nodes"], seen["edges"])[:, 0])
        else:
            np.testing.assert_array_equal(asked[-1], asked[-2])
        observations, *_ = env.step(actions)
    env.close()


def test_a_training_that_is_resumed_ends_as_one_that_was_not_interrupted(tmp_path: Path) -> None:
    (tmp_path / "small.yaml").write_text(FILE)
    whole = train(tmp_path / "small.yaml", tmp_path / "whole")
    train(tmp_path / "small.yaml", tmp_path / "parts", steps=96)
    parts = train(tmp_path / "small.yaml", tmp_path / "parts", resume=True)
    drop = "seconds"
    assert [{**row, drop: 0} for row in parts.curve] == [{**row, drop: 0} for row in whole.curve]
    for ours, theirs in zip(whole.agent.layers, parts.agent.layers, strict=True):
        for a, b in zip(ours, theirs, strict=True):
            np.testing.assert_array_equal(a, b)


def test_a_row_decides_for_all_arms_and_its_rewards_add_up_to_the_makespan(ring: CoordinationCell) -> None:
    simulations = team_simulations((ring, load_cell("lee1991")), 5, TEAM)
    assert [one.episodes for one in simulations] == [2, 3]
    env = TeamVecEnv(simulations, hold_periods=7)
    env.seed(0)
    rows: Any = env.reset()
    assert env.observation_space.contains(rows[0])
    actions = np.ones((5, GRAPH_ARMS), dtype=np.float32)
    ended: dict[int, Any] = {}
    while len(ended) < 5:
        rows, _, dones, infos = env.step(actions)
        for e in np.flatnonzero(dones).tolist():
            ended.setdefault(e, infos[e])
    for e, info in ended.items():
        one = simulations[e >= 2]
        alone = BatchSimulation(one.cell, 1, **TEAM)
        alone.seed(e)
        alone.reset()
        while np.isnan(alone.arrival).any():
            alone.step(np.ones(alone.lam.shape))
        assert info["makespan_s"] == alone.arrival.max()
        assert info["episode"]["r"] == pytest.approx(1.0 - info["makespan_s"] / one.reference_time)
        assert info["is_success"]
        assert not info["TimeLimit.truncated"]
        alone.close()
    env.close()


def test_a_team_goes_on_from_its_state(ring: CoordinationCell) -> None:
    first, second = (TeamVecEnv(team_simulations((ring,), 2, {**TEAM, "disturbance": "all-any"})) for _ in range(2))
    first.seed(1)
    first.reset()
    random = np.random.default_rng(0)
    for _ in range(30):
        first.step(random.uniform(-1.0, 1.0, (2, GRAPH_ARMS)).astype(np.float32))
    second.reset()
    second.set_state(first.get_state())
    for _ in range(30):
        actions = random.uniform(-1.0, 1.0, (2, GRAPH_ARMS)).astype(np.float32)
        for ours, theirs in zip(first.step(actions)[:3], second.step(actions)[:3], strict=True):
            np.testing.assert_array_equal(ours, theirs)
    first.close()
    second.close()


def test_shares_of_undisturbed_episodes_add_up_over_cells() -> None:
    cells = [load_cell("lee1991")] * 7
    env = TeamVecEnv(team_simulations(cells, 7, {**TEAM, "disturbance": "all-any"}))
    env.leave_undisturbed(0.4)
    assert sum(one.undisturbed.sum() for one in env.simulations) == 3
    env.close()


def test_the_teacher_holds_arms_back_at_rest_and_says_what_came_of_it(ring: CoordinationCell) -> None:
    simulation = BatchSimulation(ring, 3, **TEAM)
    shown = demonstrate(simulation, 0, 10)
    simulation.close()
    nodes = shown.rows[:, : GRAPH_ARMS * len(NODE_ENTRIES)].reshape(len(shown.rows), GRAPH_ARMS, -1)
    names = [entry.name for entry in NODE_ENTRIES]
    acts = (nodes[..., names.index("present")] > 0.0) & (nodes[..., names.index("arrived")] == 0.0)
    np.testing.assert_array_equal(shown.actions != 0.0, acts)
    held = shown.actions == HOLD
    assert held.any()
    assert (shown.actions == GO).any()
    assert (nodes[..., names.index("at_rest")][held] == 1.0).all()
    assert (nodes[..., names.index("delay")][held] > 0.0).all()
    begins = np.flatnonzero((nodes[:, :3, names.index("elapsed")] == 0.0).all(axis=1))
    makespans = simulation.arrival.max(axis=1)
    np.testing.assert_allclose(shown.returns[begins], 1.0 - makespans / simulation.reference_time, rtol=1e-5)


def test_demonstrations_are_the_same_for_the_same_seed(ring: CoordinationCell) -> None:
    how: Any = {"hold_periods": 10, "undisturbed_share": 0.5, "seed": 4}
    options = {**TEAM, "disturbance": "all-any"}
    first, second = (demonstrations((ring,), 20, options, **how) for _ in range(2))
    for name in ("rows", "actions", "returns"):
        np.testing.assert_array_equal(getattr(first, name), getattr(second, name))


def test_an_agent_at_full_speed_is_as_quick_as_full_speed(ring: CoordinationCell, tmp_path: Path) -> None:
    (tmp_path / "small.yaml").write_text(FILE)
    agent = train(tmp_path / "small.yaml", tmp_path / "out", steps=48).agent
    *layers, (weight, bias) = agent.layers
    full = Agent(header=agent.header, layers=(*layers, (0.0 * weight, 0.0 * bias + 1.5)))
    evaluator = TeamEvaluator((ring,), {**TEAM, "disturbance": "all-any"}, EvaluationConfig(episodes=2), 10)
    row = evaluator.row(full)
    evaluator.close()
    assert row["undisturbed_ratio"] == row["disturbed_ratio"] == row["mixed_ratio"] == 1.0
    assert row["finished"] == row["episodes"] == 3


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ("learners: last", "graph needs learners: all"),
        ("reward: own", "graph needs reward: team"),
        ("action: speed+priority", "leave it out"),
        ("cut_penalty: 0.1", "needs observation: local"),
        ("observation: local", "needs observation: graph"),
    ],
)
def test_what_does_not_go_together_is_said(tmp_path: Path, wrong: str, said: str) -> None:
    key = wrong.partition(":")[0]
    lines = [line for line in FILE.splitlines() if not line.strip().startswith(f"{key}:")]
    lines.insert(lines.index("coordination:") + 1, f"  {wrong}")
    (tmp_path / "wrong.yaml").write_text("\n".join(lines))
    with pytest.raises(ConfigError, match=said):
        load_train_config(tmp_path / "wrong.yaml")


def test_networks_and_observations_go_together(tmp_path: Path) -> None:
    (tmp_path / "wrong.yaml").write_text(FILE.replace("kind: graph, ", ""))
    with pytest.raises(ConfigError, match="go together"):
        load_train_config(tmp_path / "wrong.yaml")

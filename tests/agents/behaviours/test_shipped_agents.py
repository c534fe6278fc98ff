"""The agents that come with armtempo do what is said of them."""

from __future__ import annotations

import math
from functools import partial

import numpy as np
import pytest

from armtempo.agents import ExecutionPolicy, compare_on, evaluate, find_agent, learned_policy, run_episode
from armtempo.configs import load_train_config, parse_train_config
from armtempo.envs import CoordinationEnv, Physics
from armtempo.planners import BlendCell, IKCell, benchmark_instances, execution_of, load_cell, schedule

NAMES = ("ppo:lee1991", "ppo:mixed-priority", "ppo:generalist", "ppo:blend-tracking", "ppo:feedback-ik")


@pytest.mark.parametrize("name", NAMES)
def test_it_says_where_it_comes_from(name: str) -> None:
    header = find_agent(name).header
    assert header.command.startswith(f"armtempo train {header.name}")
    bundled = load_train_config(header.name)  # is the one that made it
    assert parse_train_config(header.config, bundled.source).model_dump() == bundled.model_dump()
    assert header.curve[-1]["steps"] == header.steps


def test_lee1991_is_within_one_percent_of_the_optimum() -> None:
    """Run in the same environment, so at the same control period."""
    cell = load_cell("lee1991")
    env = CoordinationEnv(cell, physics="ideal", shield=True, record=True)
    trace, _ = run_episode(env, learned_policy("ppo:lee1991", env))
    best, _ = run_episode(env, ExecutionPolicy(partial(execution_of, schedule(cell, "optimal"))))
    assert trace.makespan < 1.01 * best.makespan
    assert trace.violations == 0
    env.close()


@pytest.mark.parametrize(("physics", "episodes"), [("ideal", 100), ("bullet", 5)])
def test_lee1991_collides_with_nobody_whatever_is_drawn(physics: Physics, episodes: int) -> None:
    env = CoordinationEnv(
        "lee1991", physics=physics, shield=True, record=True, master_late_s=(0.0, 0.15), observation_noise=0.01
    )
    policy = learned_policy("ppo:lee1991", env)
    makespans = []
    for seed in range(episodes):
        trace, _ = run_episode(env, policy, seed)
        assert trace.violations == 0
        makespans.append(trace.makespan)
    assert all(math.isfinite(time) for time in makespans)
    assert np.std(makespans) > 0.01  # they were drawn
    env.close()


def test_both_arms_of_mixed_priority_ask_for_what_the_shield_would_let_them_have() -> None:
    """As quick as full speed held by the shield, which changes a quarter of what full speed asks for."""
    cell = load_cell("mixed-priority")
    policies = ("vci", "phase-plane", "ppo:mixed-priority")
    for disturbance, episodes, most in ((None, 1, 1.003), ("stop-and-go", 10, 1.01)):
        found = evaluate(
            cell, policies, physics="ideal", shield=True, disturbance=disturbance, episodes=episodes
        ).results
        vci, full, agent = (found[name] for name in policies)
        assert agent.makespan_s is not None
        assert vci.makespan_s is not None
        assert agent.makespan_s < most * vci.makespan_s
        assert agent.violations == 0
        assert agent.interventions is not None
        assert full.interventions is not None
        assert agent.interventions < 0.1 < full.interventions


def test_the_generalist_beats_the_best_classical_policy_in_cells_it_has_not_seen() -> None:
    """Behind an arm that is late, slow or stops; the bench asks for all cells of the split."""
    known = set(find_agent("ppo:generalist").header.cells)
    mixed = [
        one.build()
        for one in benchmark_instances("test", family="planar")
        if one.labels.status == "feasible" and one.labels.priority_class == "mixed"
    ]
    assert not known & {cell.name for cell in mixed}
    compared = compare_on(mixed[:2], ["vci", "ppo:generalist"], episodes=5, disturbance="any")
    figures = compared.figures("ppo:generalist")
    assert (figures["finished"], figures["violations"]) == (10, 0)
    assert figures["ratio_to_best_online"][1][1] < 1.0


def test_the_feed_rate_agent_is_as_good_as_the_best_baseline() -> None:
    cell = load_cell("lee2006", BlendCell)
    result = evaluate(
        cell, ["line-speed", "constant", "ppo:blend-tracking"], physics="ideal", family="line-arc", episodes=3
    )
    rewards = {name: one.reward for name, one in result.results.items()}
    assert rewards["ppo:blend-tracking"] > rewards["line-speed"] - 0.01
    assert rewards["ppo:blend-tracking"] > rewards["constant"] + 0.5


def test_gains_of_the_agent_follow_targets_out_of_reach_better_than_the_cells() -> None:
    """Targets that it has not seen: the training draws by its own seed."""
    cell, names = load_cell("chung", IKCell), ("law", "ppo:feedback-ik")
    far = evaluate(cell, names, physics="ideal", family="partly-unreachable", episodes=4, seed=500).results
    law, agent = (far[name] for name in names)
    assert agent.reward > law.reward + 0.1
    assert agent.orientation_error_rms_rad < 0.7 * law.orientation_error_rms_rad
    near = evaluate(cell, names[1], physics="ideal", family="near-singular", episodes=3, seed=500).results
    assert near[names[1]].succeeded == 3

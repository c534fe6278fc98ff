"""Many episodes at once: the bits of one environment at a time, Gymnasium's conventions, exact saving."""

from __future__ import annotations

import copy
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode

from armtempo.arrays import Floats32
from armtempo.envs import (
    BatchSimulation,
    CoordinationEnv,
    CoordinationVectorEnv,
    Disturbance,
    YieldingEnv,
    YieldingVectorEnv,
    coordination_v0,
)
from armtempo.errors import ActionError, InputError, UnknownNameError
from armtempo.planners import CoordinationCell
from armtempo.planners.topp import Mode

MANY: dict[str, Any] = {
    "disturbance": "any",
    "observation_noise": 0.02,
    "start_phase": (0.0, 0.3),
    "master_late_s": (0.0, 0.15),
}
PRIORITY: dict[str, Any] = {
    "shield": True, "action": "speed+priority", "start_phase": (0.0, 0.3), "disturbance": "stop-and-go",
}  # fmt: skip
CASES: list[dict[str, Any]] = [
    {},
    {"mode": "acceleration", "master_late_s": 0.11},
    {"mode": "acceleration", "disturbance": "slow", "shield": True},
    {"disturbance": "stop-and-go", "master_late_s": 0.05},
    MANY,
    {
        **MANY,
        "disturbance": Disturbance(late_s=(0.0, 0.1), speed=(0.5, 1.0), stops=(0, 2), stop_s=(0.0, 0.1), arms=(0, 1)),
    },
    {"max_episode_s": 0.2, "observation_noise": 0.1},
    {"shield": True, "start_phase": (0.0, 0.3), "disturbance": "stop-and-go"},
    PRIORITY,
]


def _actions(generator: np.random.Generator, shape: tuple[int, ...]) -> Floats32:
    """Of different tempers, so that some collide, some arrive and some run out of time."""
    low = np.linspace(-1.2, 0.9, shape[0]).reshape((-1,) + (1,) * (len(shape) - 1))
    return generator.uniform(np.broadcast_to(low, shape), 1.0).astype(np.float32)


@pytest.mark.parametrize("options", CASES)
def test_all_arms_have_the_bits_of_single_environments(lee1991: CoordinationCell, options: dict[str, Any]) -> None:
    """Whole episodes, several after another in each slot; every array equal exactly."""
    count, arms = 5, 2
    many = CoordinationVectorEnv(lee1991, count, threads=2, **options)
    singles = [CoordinationEnv(lee1991, physics="ideal", **options) for _ in range(count)]
    observations, infos = many.reset(seed=40)
    agents = singles[0].possible_agents
    for e, env in enumerate(singles):
        rows, info = env.reset(seed=40 + e)
        np.testing.assert_array_equal(observations[e], np.stack([rows[agent] for agent in agents]))
        assert info["arm_0"]["disturbance"]["late_s"] == infos["disturbance"]["late_s"][e].tolist()
    generator = np.random.default_rng(3)
    ends = {"violation": 0, "arrived": 0, "time": 0}
    for _ in range(400):
        actions = _actions(generator, (count, arms, *many.arm_action_space.shape))
        observations, rewards, terminated, truncated, infos = many.step(actions)
        for e, env in enumerate(singles):
            running = env.agents
            rows, one_rewards, one_terminated, one_truncated, one_infos = env.step(
                {agent: actions[e, agents.index(agent)] for agent in running}
            )
            over = not env.agents
            assert over == bool(infos and infos["_final_obs"][e])
            seen = infos["final_obs"][e] if over else observations[e]
            for i, agent in enumerate(agents):
                if agent in running:
                    np.testing.assert_array_equal(seen[i], rows[agent])
                    assert rewards[e, i] == one_rewards[agent]
                    assert (terminated[e, i], truncated[e, i]) == (one_terminated[agent], one_truncated[agent])
                else:
                    assert rewards[e, i] == 0.0
                    assert terminated[e, i]
            if over:
                final, last = infos["final_info"], one_infos[running[-1]]
                assert final["violation"][e] == last["violation"]
                if "shield" in options:
                    assert not last["violation"]
                    assert final["shield_steps"][e] == last["shield_steps"]
                    for agent in running:
                        i = agents.index(agent)
                        assert final["shield_changed"][e, i] == one_infos[agent]["shield_changed"]
                        assert final["shield_change"][e, i] == pytest.approx(one_infos[agent]["shield_change"])
                assert np.array_equal(final["arrival_s"][e], env.simulation.arrival, equal_nan=True)
                ends["violation" if last["violation"] else "arrived" if final["is_success"][e] else "time"] += 1
                rows, _ = env.reset()
                np.testing.assert_array_equal(observations[e], np.stack([rows[agent] for agent in agents]))
    assert sum(ends.values()) > 5
    if "max_episode_s" in options:
        assert ends["time"] > 0
    elif options:
        assert ends["arrived"] > 0


@pytest.mark.parametrize("autoreset", [AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP])
@pytest.mark.parametrize("options", [MANY, {"others": "delay"}, {"others": "delay", **PRIORITY}])
def test_yielding_has_the_bits_of_gymnasiums_own_vector(
    lee1991: CoordinationCell, autoreset: AutoresetMode, options: dict[str, Any]
) -> None:
    count = 3
    many = gymnasium.make_vec(
        "armtempo/Yielding-v0", num_envs=count, vectorization_mode="vector_entry_point", cell=lee1991,
        autoreset_mode=autoreset, **options,
    )  # fmt: skip
    wanted = gymnasium.vector.SyncVectorEnv(
        [lambda: YieldingEnv(lee1991, physics="ideal", **options)] * count, autoreset_mode=autoreset
    )
    assert isinstance(many, YieldingVectorEnv)
    assert many.observation_space == wanted.observation_space
    assert many.action_space == wanted.action_space
    actions_shape = many.single_action_space.shape or ()
    assert many.metadata["autoreset_mode"] == autoreset
    one, info = many.reset(seed=7)
    two, wanted_info = wanted.reset(seed=7)
    np.testing.assert_array_equal(one, two)
    np.testing.assert_array_equal(info["master_late_s"], wanted_info["master_late_s"])
    generator, ended = np.random.default_rng(0), 0
    for _ in range(250):
        actions = _actions(generator, (count, *actions_shape))
        found, expected = many.step(actions), wanted.step(actions)
        for ours, theirs in zip(found[:4], expected[:4], strict=True):
            assert np.asarray(ours).dtype == np.asarray(theirs).dtype
            np.testing.assert_array_equal(ours, theirs)
        over = found[2] | found[3]
        ended += int(over.sum())
        if over.any() and autoreset == AutoresetMode.SAME_STEP:
            for e in np.flatnonzero(over):
                np.testing.assert_array_equal(found[4]["final_obs"][e], expected[4]["final_obs"][e])
                assert found[4]["final_info"]["is_success"][e] == expected[4]["final_info"]["is_success"][e]
        elif over.any():
            np.testing.assert_array_equal(found[4]["_is_success"], over)
            np.testing.assert_array_equal(found[4]["is_success"], expected[4]["is_success"])
            np.testing.assert_array_equal(found[4]["violation"], expected[4]["violation"])
    assert ended >= 3
    many.close()
    wanted.close()


@pytest.mark.parametrize("mode", ["speed", "acceleration"])
def test_going_on_from_a_saved_state(lee1991: CoordinationCell, mode: Mode) -> None:
    def made() -> tuple[Any, ...]:
        return (
            CoordinationVectorEnv(lee1991, 6, mode=mode, **MANY),
            YieldingVectorEnv(6, lee1991, mode=mode, autoreset_mode=AutoresetMode.NEXT_STEP, **MANY),
        )

    generator = np.random.default_rng(1)
    for env, other, shape in zip(made(), made(), [(6, 2, 1), (6, 1)], strict=True):
        env.reset(seed=3)
        for _ in range(70):
            env.step(_actions(generator, shape))
        state = env.get_state()
        kept = copy.deepcopy(state)
        later = [_actions(generator, shape) for _ in range(120)]
        first = [env.step(action) for action in later]
        for name, array in state.items():
            np.testing.assert_array_equal(array, kept[name])  # a copy
        other.set_state(state)
        for action, wanted in zip(later, first, strict=True):
            for ours, theirs in zip(other.step(action)[:4], wanted[:4], strict=True):
                np.testing.assert_array_equal(ours, theirs)
        with pytest.raises(InputError, match="does not fit"):
            other.set_state({name: a[:2] if isinstance(a, np.ndarray) else a for name, a in state.items()})


def test_team_rewards_sum_up_to_one_minus_the_makespan(lee1991: CoordinationCell) -> None:
    env = CoordinationVectorEnv(lee1991, 4, reward="team", learners=(1,), master_late_s=(0.0, 0.1))
    env.reset(seed=5)
    total, seen = np.zeros(4), 0
    patience = np.array([0.0, 0.4, 0.5, 0.6])  # [s] the first collides
    for _ in range(400):
        waits = env.simulations[0].time < patience
        actions = np.where(waits, -1.0, 1.0)[:, None, None] * np.ones((4, 2, 1))
        _, rewards, _, _, infos = env.step(actions)
        np.testing.assert_array_equal(rewards[:, 0], rewards[:, 1])
        total += rewards[:, 0]
        for e in np.flatnonzero(infos["_final_obs"]) if infos else ():
            if infos["final_info"]["is_success"][e]:
                makespan = infos["final_info"]["makespan_s"][e]
                assert total[e] == pytest.approx(1.0 - makespan / lee1991.sequential_makespan, abs=1e-9)
                seen += 1
            else:
                assert total[e] < -1.0  # colliding costs more than anything else
            total[e] = 0.0
    assert seen > 0


def test_arms_that_do_not_learn_run_at_full_speed(lee1991: CoordinationCell) -> None:
    one, two = (CoordinationVectorEnv(lee1991, 2, learners=(1,)) for _ in range(2))
    one.reset(seed=0)
    two.reset(seed=0)
    for _ in range(10):
        a = one.step(np.full((2, 2, 1), -0.5))
        b = two.step(np.array([[[0.9], [-0.5]], [[-1.0], [-0.5]]]))
        np.testing.assert_array_equal(a[0], b[0])
    assert (one.simulations[0].mu[:, 0] > one.simulations[0].mu[:, 1]).all()


def test_under_the_shield_they_are_agents_that_ask_for_full_speed(lee1991: CoordinationCell) -> None:
    """As in ``CoordinationEnv``: also where the learner is ahead, and the other has to let it pass."""
    options: dict[str, Any] = {"shield": True, "start_phase": (0.0, 0.3)}
    one = CoordinationVectorEnv(lee1991, 12, learners=(1,), **options)
    all_of_them = CoordinationVectorEnv(lee1991, 12, **options)
    one.reset(seed=3)
    all_of_them.reset(seed=3)
    held = 0
    for _ in range(60):
        actions = np.full((12, 2, 1), -1.0)
        a = one.step(actions)
        actions[:, 0] = 1.0
        np.testing.assert_array_equal(a[0], all_of_them.step(actions)[0])
        held += int(one.simulations[0].shield_changed[:, 0].sum())
    assert held > 0


def test_some_are_left_undisturbed(lee1991: CoordinationCell) -> None:
    disturbed: dict[str, Any] = {"disturbance": "any", "start_phase": (0.1, 0.3), "master_late_s": (0.1, 0.2)}
    for shield in (False, True):
        env = CoordinationVectorEnv([lee1991, lee1991], 8, shield=shield, **disturbed)
        env.leave_undisturbed(0.5)
        env.reset(seed=0)
        for one in env.simulations:
            assert (one.lam[:2] == 0.0).all()
            assert (one.drawn["late_s"][:2] == 0.0).all()
            assert (one.lam[2:] > 0.0).all()
            assert (one.drawn["late_s"][2:, 0] >= 0.1).all()
        state = env.get_state()
        env.leave_undisturbed(0.0)
        env.set_state(state)
        assert [int(one.undisturbed.sum()) for one in env.simulations] == [2, 2]
        with pytest.raises(InputError, match="between 0 and 1"):
            env.leave_undisturbed(1.5)


def test_several_cells_share_the_episodes(lee1991: CoordinationCell) -> None:
    both = CoordinationVectorEnv([lee1991, lee1991], 6, observation_noise=0.01)
    alone = CoordinationVectorEnv(lee1991, 6, observation_noise=0.01)
    generator = np.random.default_rng(8)
    np.testing.assert_array_equal(both.reset(seed=2)[0], alone.reset(seed=2)[0])
    for _ in range(120):
        actions = _actions(generator, (6, 2, 1))
        for ours, theirs in zip(both.step(actions)[:4], alone.step(actions)[:4], strict=True):
            np.testing.assert_array_equal(ours, theirs)
    assert coordination_v0.vector_env is CoordinationVectorEnv


def test_threads_change_nothing(lee1991: CoordinationCell) -> None:
    runs = []
    for threads in (1, 2, 3):
        simulation = BatchSimulation(lee1991, 200, threads=threads, **MANY)
        simulation.seed(1)
        simulation.reset()
        generator = np.random.default_rng(4)
        for _ in range(20):
            simulation.step(generator.uniform(0.0, 1.0, (200, 2)))
        runs.append(simulation.get_state())
        simulation.close()
        simulation.close()
    for name, array in runs[0].items():
        np.testing.assert_array_equal(array, runs[1][name])
        np.testing.assert_array_equal(array, runs[2][name])


def test_reset_of_some(lee1991: CoordinationCell) -> None:
    env = YieldingVectorEnv(3, lee1991, master_late_s=0.2)
    env.reset(seed=0)
    for _ in range(5):
        before = env.step(np.ones((3, 1)))[0]
    after, infos = env.reset(options={"reset_mask": np.array([True, False, True])})
    np.testing.assert_array_equal(after[1], before[1])
    assert (after[[0, 2], 0] == -1.0).all()
    np.testing.assert_array_equal(infos["_master_late_s"], [True, False, True])


def test_input_errors(lee1991: CoordinationCell) -> None:
    with pytest.raises(InputError, match='vectorization_mode="sync"'):
        gymnasium.make_vec("armtempo/Yielding-v0", num_envs=2, cell=lee1991, physics="bullet")
    with pytest.raises(InputError, match="autoreset_mode"):
        YieldingVectorEnv(2, lee1991, autoreset_mode="Disabled")
    with pytest.raises(InputError, match="num_envs"):
        CoordinationVectorEnv(lee1991, 0)
    with pytest.raises(InputError, match="num_envs must be a whole number above 0, got True"):
        CoordinationVectorEnv(lee1991, True)
    number: Any = 3
    with pytest.raises(InputError, match="a cell is a name or a file, got int"):
        CoordinationVectorEnv(number, 2)
    with pytest.raises(InputError, match="learners"):
        CoordinationVectorEnv(lee1991, 2, learners=(2,))
    with pytest.raises(UnknownNameError, match="reward"):
        CoordinationVectorEnv(lee1991, 2, reward="mine")
    with pytest.raises(InputError, match="1 seeds for 2"):
        CoordinationVectorEnv(lee1991, 2).reset(seed=[3])
    env = YieldingVectorEnv(2, lee1991)
    with pytest.raises(ActionError, match="call reset"):
        env.step(np.zeros((2, 1)))
    env.reset(seed=0)
    for wrong in (np.zeros(2), np.full((2, 1), np.nan), None):
        with pytest.raises(ActionError, match="shape"):
            env.step(wrong)  # type: ignore[arg-type]


@pytest.mark.parametrize("kind", [YieldingVectorEnv, CoordinationVectorEnv])
def test_resets_and_steps_out_of_turn_are_refused_as_everywhere(lee1991: CoordinationCell, kind: Any) -> None:
    env = kind(cell=lee1991, num_envs=2)
    with pytest.raises(InputError, match="before a reset"):
        env.get_state()
    with pytest.raises(UnknownNameError, match=r"reset option 'master_late'.*did you mean 'master_late_s'"):
        env.reset(options={"master_late": 0.1})
    with pytest.raises(InputError, match="options must map"):
        env.reset(options=[1])
    for mask in (np.zeros(2, dtype=np.bool_), np.ones(3, dtype=np.bool_), [True, False], np.ones(2)):
        with pytest.raises(InputError, match="reset_mask"):
            env.reset(options={"reset_mask": mask})
    env.reset(seed=0, options={"master_late_s": 0.1})
    env.close()
    env.close()
    with pytest.raises(InputError, match="closed"):
        env.reset()
    with pytest.raises(ActionError, match="closed"):
        env.step(np.zeros(env.action_space.shape))


def test_a_seed_of_none_goes_on_with_what_is_drawn(lee1991: CoordinationCell) -> None:
    """As a reset without a seed does in a single environment."""
    many = YieldingVectorEnv(2, lee1991, **MANY)
    singles = [YieldingEnv(lee1991, physics="ideal", **MANY) for _ in range(2)]
    many.reset(seed=[5, 6])
    seen, _ = many.reset(seed=[None, 9])
    for env, seeds in zip(singles, ((5, None), (6, 9)), strict=True):
        for seed in seeds:
            last, _ = env.reset(seed=seed)
        np.testing.assert_array_equal(seen[singles.index(env)], last)


@pytest.mark.parametrize("kind", [YieldingVectorEnv, CoordinationVectorEnv, BatchSimulation])
def test_options_are_checked_by_their_record(kind: Any, lee1991: CoordinationCell) -> None:
    make = {"cell": lee1991, ("episodes" if kind.__name__ == "BatchSimulation" else "num_envs"): 2}
    with pytest.raises(UnknownNameError, match="sheild"):
        kind(**make, sheild=True)
    with pytest.raises(InputError, match="max_episode_s"):
        kind(**make, max_episode_s=True)
    with pytest.raises(InputError, match="model_error"):
        kind(**make, model_error=0.1)


def test_bullet_is_refused_in_one_line_that_names_the_way_out() -> None:
    with pytest.raises(InputError, match='"ideal"') as refused:
        gymnasium.make_vec("armtempo/Yielding-v0", num_envs=2, physics="bullet")
    assert "\n" not in str(refused.value)
    assert 'vectorization_mode="sync"' in str(refused.value)
    several = gymnasium.make_vec("armtempo/Yielding-v0", num_envs=2, vectorization_mode="sync", physics="bullet")
    several.reset(seed=0)
    several.close()

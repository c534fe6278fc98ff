"""The shield: nothing that is asked for collides or sticks, and what needs no change gets none."""

from __future__ import annotations

import gymnasium
import numpy as np
import pytest

from armtempo.agents import make_policy, run_episode
from armtempo.arrays import Floats
from armtempo.envs import (
    CHANNELS,
    REQUESTS,
    CoordinationEnv,
    CoordinationOptions,
    CoordinationSimulation,
    Shield,
    ShieldParallelWrapper,
    ShieldWrapper,
    YieldingEnv,
    shield_trial,
)
from armtempo.envs.coordination.shield._admission import COMMAND_STEPS
from armtempo.envs.coordination.shield._kernels import PARTS_PER_TICK, WAITING_ARM, fits
from armtempo.envs.coordination.shield._turning import begin
from armtempo.errors import InfeasibleError, InputError
from armtempo.planners import CoordinationCell, benchmark_instances, load_cell, schedule
from armtempo.planners.topp import Mode

FULL = np.ones(1, dtype=np.float32)


@pytest.fixture(scope="module")
def mixed() -> CoordinationCell:
    return load_cell("mixed-priority")


@pytest.mark.parametrize("requests", REQUESTS)
@pytest.mark.parametrize("uncertain", [(), (0,), (0, 1)])
def test_trials_neither_violate_nor_stick(mixed: CoordinationCell, requests: str, uncertain: tuple[int, ...]) -> None:
    trial = shield_trial(mixed, requests, 13_400, uncertain=uncertain)
    assert trial.steps >= 13_400
    assert trial.violations == 0
    assert trial.stuck == 0
    assert trial.clearance > mixed.d_min


def test_an_arm_that_cannot_hold_still_where_it_starts_waits_there_for_whoever_is_late() -> None:
    """It slid from its start, under command 0, into the region of an arm that had not gone yet."""
    (cell,) = [one.build() for one in benchmark_instances("validation") if one.name == "fixture3-1991-0002"]
    assert not cell.planes[2].holdable[0]
    env = CoordinationEnv(cell, physics="ideal", shield=True, disturbance="all-any", record=True)
    full = make_policy("phase-plane", cell)
    for seed in range(70_000, 70_008):
        trace, _ = run_episode(env, full, seed)
        assert trace.violations == 0
        assert np.isfinite(trace.makespan)
    env.close()


@pytest.mark.parametrize("channel", CHANNELS[1:])
@pytest.mark.parametrize("mode", ["speed", "acceleration"])
def test_whoever_is_to_pass_first_all_arrive(mixed: CoordinationCell, channel: str, mode: Mode) -> None:
    for cell, uncertain in ((mixed, ()), (load_cell("planar-four"), (0, 2))):
        trial = shield_trial(
            cell, "mixed", 8_000, uncertain=uncertain, channel=channel, start_phase=(0.0, 0.4), mode=mode
        )
        assert trial.violations == trial.stuck == 0
        assert trial.changed > 0.0


def test_the_same_requests_collide_without(mixed: CoordinationCell) -> None:
    assert shield_trial(mixed, "full", 2_000, shielded=False).violations > 0
    assert shield_trial(mixed, "mixed", 2_000, shielded=False).violations > 0


def test_full_speed_is_near_the_optimum(mixed: CoordinationCell) -> None:
    trial = shield_trial(mixed, "full", 1_000)
    assert trial.changed > 0.0
    assert 1.0 - 1e-6 <= trial.makespan / schedule(mixed, "optimal").makespan <= 1.06


@pytest.mark.parametrize("mode", ["speed", "acceleration"])
@pytest.mark.parametrize("uncertain", [(), (1,)])
def test_commands_are_cut_no_more_than_needed(mode: Mode, uncertain: tuple[int, ...]) -> None:
    """The next larger step of a command that was cut gets some arm past its limit."""
    cell = load_cell("planar-four")
    simulation = CoordinationSimulation(cell, CoordinationOptions(physics="ideal", mode=mode))
    shield, unsure = Shield(cell, simulation.world), np.zeros(4, dtype=np.bool_)
    unsure[list(uncertain)] = True
    simulation.reset()
    shield.reset(simulation.lam, unsure)

    def fits_all(commands: Floats, waiting: int | None = None) -> bool:
        begin(simulation.lam, simulation.mu, shield.work)
        return all(
            fits(
                simulation.world, shield.tables, r, order, shield.orders, simulation.lam, simulation.mu, commands,
                unsure, PARTS_PER_TICK * cell.ticks_per_period, shield.work,
            )
            for r, order in enumerate(shield.orders.tolist())
            if waiting is None or shield.tables.region[r, order, WAITING_ARM] == waiting
        )  # fmt: skip

    cut = 0
    while (simulation.lam < [path.length for path in cell.paths]).any():
        admitted = shield.admit(simulation.lam, simulation.mu, np.ones(4))
        assert fits_all(admitted)
        for i in np.flatnonzero(admitted < 1.0).tolist():
            more = admitted.copy()
            more[i] += 1.0 / COMMAND_STEPS
            assert not fits_all(more, i)
            cut += 1
        simulation.step(admitted)
    assert cut > 20


def test_admitted_commands_are_admitted_again_and_far_ones_as_they_are(mixed: CoordinationCell) -> None:
    simulation = CoordinationSimulation(mixed, CoordinationOptions(physics="ideal"))
    shield = Shield(mixed, simulation.world)
    rng = np.random.default_rng(0)
    for _ in range(4):
        simulation.reset()
        shield.reset(simulation.lam)
        lengths = np.array([path.length for path in mixed.paths])
        far = True
        while (simulation.lam < lengths).any():
            asked = rng.uniform(0.0, 1.0, 2)
            admitted = shield.admit(simulation.lam, simulation.mu, asked)
            again = shield.admit(simulation.lam, simulation.mu, admitted)
            np.testing.assert_array_equal(again, admitted)
            assert (admitted <= asked).all()
            assert shield.leads_on(simulation.lam)
            if far:
                np.testing.assert_array_equal(admitted, asked)
            far = False  # only at the start, at rest, far from every region
            simulation.step(admitted)
            assert not simulation.violated
        assert np.isfinite(simulation.arrival).all()


def test_option_and_wrapper_do_the_same(mixed: CoordinationCell) -> None:
    inside = CoordinationEnv(mixed, physics="ideal", shield=True)
    outside = ShieldParallelWrapper(CoordinationEnv(mixed, physics="ideal"))
    rng = np.random.default_rng(1)
    first, _ = inside.reset(seed=3)
    second, _ = outside.reset(seed=3)
    changes = 0
    while inside.agents:
        actions = {agent: rng.uniform(0.5, 1.0, 1).astype(np.float32) for agent in inside.agents}
        first, rewards, ended, _, infos = inside.step(actions)
        second, others, _, _, beside = outside.step(actions)
        for agent in first:
            np.testing.assert_array_equal(first[agent], second[agent])
            assert rewards[agent] == others[agent]
            assert infos[agent] == beside[agent]
            changes += infos[agent]["shield"]["changed"]
            if ended[agent]:
                assert infos[agent]["is_success"]
                assert infos[agent]["shield_change"] >= 0.0
    assert changes > 0


@pytest.mark.parametrize("disturbance", [None, "late", "slow", "stop-and-go"])
def test_a_slave_behind_a_disturbed_master(disturbance: str | None) -> None:
    cell = load_cell("lee1991")
    wrapped = ShieldWrapper(YieldingEnv(cell, physics="ideal", disturbance=disturbance))
    env: gymnasium.Env[np.ndarray, np.ndarray] = YieldingEnv(
        cell, physics="ideal", disturbance=disturbance, shield=True
    )
    for seed in range(5):
        env.reset(seed=seed)
        wrapped.reset(seed=seed)
        over = False
        while not over:
            observation, _, terminated, truncated, info = env.step(FULL)
            np.testing.assert_array_equal(observation, wrapped.step(FULL)[0])
            over = terminated or truncated
        assert info["is_success"]
        assert info["shield_changed"] > 0


def test_a_few_steps_in_bullet() -> None:
    env = CoordinationEnv("lee1991", physics="bullet", shield=True)
    env.reset(options={"master_late_s": 0.05})
    while env.agents:
        _, _, _, _, infos = env.step(dict.fromkeys(env.agents, FULL))
        assert not any(info["shield_tube_exceeded"] for info in infos.values())
    assert not env.simulation.violated
    env.close()


def test_a_plan_says_who_passes_first(mixed: CoordinationCell) -> None:
    """A learner behind arms that run through whatever it does has nowhere to go; behind a plan it has."""
    with pytest.raises(InfeasibleError, match="others='optimal'"):
        YieldingEnv(mixed, physics="ideal", shield=True, learner=mixed.arms[0].name, others="phase-plane")
    env = YieldingEnv(mixed, physics="ideal", shield=True, others="optimal")
    env.reset(seed=0)
    over = False
    while not over:
        _, _, terminated, truncated, info = env.step(FULL)
        over = terminated or truncated
    assert info["is_success"]


def test_wrong_wrapping_is_refused(mixed: CoordinationCell) -> None:
    with pytest.raises(InputError, match="shield_tube_m"):
        CoordinationEnv(mixed, physics="ideal", shield=True, shield_tube_m=-1.0)
    with pytest.raises(InputError, match="has no shield"):
        ShieldWrapper(gymnasium.make("CartPole-v1"))

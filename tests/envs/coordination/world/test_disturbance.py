"""What goes wrong with arms is drawn as told, the same for the same seed, and does what its name says."""

from __future__ import annotations

import json
import math
from typing import Any

import numpy as np
import pytest

from armtempo.envs import (
    DISTURBANCES,
    BatchSimulation,
    CoordinationEnv,
    CoordinationVectorEnv,
    Disturbance,
    YieldingEnv,
)
from armtempo.envs.common._random import normal, uniform
from armtempo.errors import InputError, UnknownNameError
from armtempo.planners import CoordinationCell, schedule
from armtempo.planners.schedules import ScheduleExecution


def _splitmix(state: int) -> int:
    """By the published reference: one output of SplitMix64 from a state before it is advanced."""
    mask = (1 << 64) - 1
    z = (state + 0x9E3779B97F4A7C15) & mask
    z = ((z ^ (z >> 30)) * 0xBF58476D1CE4E5B9) & mask
    z = ((z ^ (z >> 27)) * 0x94D049BB133111EB) & mask
    return z ^ (z >> 31)


def test_counted_numbers_are_splitmix64_and_look_random() -> None:
    assert _splitmix(0) == 0xE220A8397B1DCDAF  # its first published output for seed 0
    z = 5
    for part in (1, 2, 3, 4):
        z = _splitmix((z + 0x9E3779B97F4A7C15 * part) & ((1 << 64) - 1))
    assert uniform(5, 1, 2, 3, 4) == (z >> 11) * 2.0**-53
    numbers = np.array([[uniform(k, e, s, 0, 1) for s in range(20)] for k in range(20) for e in range(20)])
    assert abs(numbers.mean() - 0.5) < 0.02
    assert abs(numbers.var() - 1 / 12) < 0.005
    assert len(np.unique(numbers)) == numbers.size
    drawn = np.array([normal(7, 0, s, 8, i) for s in range(100) for i in range(40)])
    assert abs(drawn.mean()) < 0.05
    assert abs(drawn.std() - 1.0) < 0.05


@pytest.mark.parametrize("family", DISTURBANCES)
def test_families_keep_to_their_ranges(lee1991: CoordinationCell, family: str) -> None:
    many = BatchSimulation(lee1991, 400, disturbance=family)
    T = lee1991.fastest[0].duration
    drawn = many.drawn
    late, speed, stops = drawn["late_s"], drawn["speed"], drawn["stops_s"]
    length, count = stops[..., 1] - stops[..., 0], (stops[..., 1] > 0.0).sum(axis=2)
    if family.startswith("all-"):
        assert (late[:, 1].any(), (speed[:, 1] < 1.0).any(), count[:, 1].any()) == (
            late[:, 0].any(), (speed[:, 0] < 1.0).any(), count[:, 0].any()
        )  # fmt: skip
        assert not (late[:, 0] == late[:, 1])[late[:, 0] > 0.0].any()  # each with draws of its own
        late, speed, stops, count, length = late[:, :1], speed[:, :1], stops[:, :1], count[:, :1], length[:, :1]
    else:
        assert not late[:, 1].any()
        assert (speed[:, 1] == 1.0).all()
        assert not count[:, 1].any()
    assert late.min() >= 0.0
    assert late.max() <= 0.5 * T
    assert speed.min() >= 0.4
    kinds = [late[:, 0] > 0.0, speed[:, 0] < 1.0, count[:, 0] > 0]
    wanted: list[float] = {
        "late": [1.0, 0.0, 0.0],
        "slow": [0.0, 1.0, 0.0],
        "stop-and-go": [0.0, 0.0, 1.0],
        "any": [1 / 3, 1 / 3, 1 / 3],
    }[family.removeprefix("all-")]
    np.testing.assert_allclose([kind.mean() for kind in kinds], wanted, atol=0.1)
    assert (np.sum(kinds, axis=0) == 1).all()
    if kinds[2].any():
        assert set(count[kinds[2], 0].tolist()) == {1, 2, 3}
        real = stops[..., 1] > 0.0
        assert (length[real] >= 0.1 * T).all()
        assert (length[real] <= 0.5 * T + 1e-12).all()
        assert (stops[..., 0][real] <= T).all()


def test_the_same_seed_draws_the_same_and_episodes_differ(lee1991: CoordinationCell) -> None:
    options: dict[str, Any] = {"physics": "ideal", "disturbance": "any", "start_phase": (0.0, 0.4)}
    one, two = YieldingEnv(lee1991, **options), CoordinationEnv(lee1991, **options)
    seen = []
    for seed in (3, None, None, 3):
        _, info = one.reset(seed=seed)
        _, infos = two.reset(seed=seed)
        assert info["disturbance"] == infos["arm_0"]["disturbance"] == infos["arm_1"]["disturbance"]
        assert json.loads(json.dumps(info)) == info
        seen.append(info["disturbance"])
    assert seen[0] == seen[3]
    assert seen[0] != seen[1] != seen[2]
    q = [lee1991.paths[i].evaluate(one.simulation.lam[i])[0] for i in range(2)]
    assert lee1991.clearance.arms(q).distance >= lee1991.planned_clearance


@pytest.mark.parametrize("disturbance", ["slow", "any", Disturbance(speed=(0.05, 0.05))])
def test_in_acceleration_mode_a_slow_arm_arrives(lee1991: CoordinationCell, disturbance: str | Disturbance) -> None:
    """A share of the command would be braking there: a slow arm takes a share of the largest speed."""
    shares = []
    env = CoordinationEnv(
        lee1991, physics="ideal", mode="acceleration", disturbance=disturbance, shield=True, max_episode_s=20.0
    )
    for seed in range(12):
        _, infos = env.reset(seed=seed)
        share = infos["arm_0"]["disturbance"]["speed"][0]
        while env.agents:
            _, _, _, truncated, _ = env.step({agent: np.ones(1, np.float32) for agent in env.agents})
            lam, mu = env.simulation.lam[0], env.simulation.mu[0]
            assert mu <= share * lee1991.planes[0].edge_speed(lam) * 1.001 + 1e-6
            assert not any(truncated.values())
        assert env.simulation.lam[0] == lee1991.paths[0].length
        shares.append(share)
    assert min(shares) < 0.5


def test_a_slow_arm_is_slow_and_a_stopped_one_stands(lee1991: CoordinationCell) -> None:
    full = np.ones((1, 2, 1))
    slow = CoordinationVectorEnv(lee1991, 1, disturbance=Disturbance(speed=(0.5, 0.5)), master_late_s=0.3)
    plain = CoordinationVectorEnv(lee1991, 1, master_late_s=0.3)
    half = full.copy()
    half[0, 0] = 0.0  # half of the speed
    stopped = CoordinationVectorEnv(
        lee1991, 1, disturbance=Disturbance(stops=(1, 1), stop_s=(0.05, 0.05)), master_late_s=0.0
    )
    for env in (slow, plain):
        env.reset(seed=0)
    for _ in range(120):
        np.testing.assert_array_equal(slow.step(full)[0], plain.step(half)[0])
    simulation = stopped.simulations[0]
    begin = end = 0.0
    for seed in range(20):
        stopped.reset(seed=seed)
        begin, end = simulation.drawn["stops_s"][0, 0, 0]
        if 0.03 < begin < 0.15:
            break
    assert 0.03 < begin < 0.15
    assert end - begin == pytest.approx(0.05)
    speeds = []
    hold = full.copy()
    hold[0, 1] = -1.0
    while simulation.time[0] < min(end, 0.25):
        before = simulation.time[0], simulation.mu[0, 0]
        stopped.step(hold)
        if begin <= before[0] < end:
            speeds.append(simulation.mu[0, 0] - before[1])
    assert speeds
    assert max(speeds) <= 0.0


@pytest.mark.parametrize("family", DISTURBANCES)
def test_the_released_delay_stays_free_of_violations(lee1991: CoordinationCell, family: str) -> None:
    """And behind a merely late master it loses nothing but what that is late."""
    plan = schedule(lee1991, "delay")
    env = CoordinationEnv(lee1991, physics="ideal", disturbance=family)
    execution = ScheduleExecution(plan)
    for seed in range(6):
        _, infos = env.reset(seed=seed)
        execution.reset()
        while env.agents:
            commands = execution.commands(env.simulation.lam, env.simulation.mu)
            env.step({a: np.array([2.0 * c - 1.0]) for a, c in zip(env.possible_agents, commands, strict=True)})
        assert not env.simulation.violated
        late = infos["arm_0"]["disturbance"]["late_s"][0]
        if late > 0.0 and family == "late":
            arrived = float(env.simulation.arrival.max())
            assert arrived <= late + plan.makespan + lee1991.control_period
    env.close()


@pytest.mark.parametrize(
    "wrong",
    [
        {"late_s": (-1.0, 0.0)}, {"late_s": (0.2, 0.1)}, {"late_s": (0.0, math.nan)}, {"speed": (0.0, 1.0)},
        {"speed": (0.5, 1.5)}, {"stops": (0.5, 1)}, {"stops": (0, 99)}, {"stop_s": 0.1}, {"arms": ()}, {"arms": (-1,)},
    ],
)  # fmt: skip
def test_wrong_ranges(wrong: dict[str, Any]) -> None:
    with pytest.raises(InputError, match=next(iter(wrong))):
        Disturbance(**wrong)


def test_wrong_options(lee1991: CoordinationCell) -> None:
    wrong: list[tuple[type[Exception], str, dict[str, Any]]] = [
        (UnknownNameError, "disturbance", {"disturbance": "moody"}),
        (InputError, "2 arms", {"disturbance": Disturbance(late_s=(0.1, 0.1), arms=(2,))}),
        (InputError, "observation_noise", {"observation_noise": -0.1}),
        (InputError, "start_phase", {"start_phase": 1.0}),
        (InputError, "master_late_s", {"master_late_s": (0.2, 0.1)}),
        (InputError, "model_error", {"model_error": 0.1}),
        (InputError, "friction_error", {"friction_error": math.inf}),
    ]
    for error, match, options in wrong:
        with pytest.raises(error, match=match):
            YieldingEnv(lee1991, physics="ideal", **options)

"""Cost of the environments: resets, steps per second, and ratios taken in the same run (one machine, one load)."""

from __future__ import annotations

import copy
import time
from collections.abc import Callable
from functools import partial
from typing import Any

import gymnasium
import numpy as np
import pybullet
import pytest
from pytest_benchmark.fixture import BenchmarkFixture

from armtempo.envs import (
    ActionMode,
    BatchSimulation,
    BlendTrackingEnv,
    BlendTrackingVectorEnv,
    CoordinationEnv,
    FeedbackIKEnv,
    FeedbackIKVectorEnv,
    Physics,
    YieldingEnv,
)
from armtempo.planners import BlendCell, CoordinationCell, IKCell, build_cell, generate_cell, load_cell

RESET_MS = 2.0
COPY_MS, STATE_MS = 20.0, 1.0  # a deep copy in PyBullet, and set_state
BATCH, BATCH_PER_S = 4096, 1e6  # episodes; agent steps of 10 ticks per second on two cores
SINGLE_PER_S = 1e4
BARE_RATIO = 2.0
IDEAL_RATIO = 10.0
MUJOCO_RATIO = 2.0  # of a whole step to that in PyBullet; most of either is FCL's
STEPS_PER_S = {"bullet": 500.0, "ideal": 5000.0}  # on a machine that does other things too
BLEND_STEPS_PER_S = {"bullet": 400.0, "ideal": 1200.0}  # likewise; 10 ticks each
IK_STEPS_PER_S = {("bullet", "speeds"): 250.0, ("ideal", "speeds"): 600.0, ("ideal", "gains"): 250.0}  # 10 ticks each
IK_MANY = ((1, 1), (2, 1), (2, 20))  # threads and periods that an action is held
IK_RATIO = 4.0  # of the last to one environment alone
BLEND_RATIO = 2.5  # of 64 episodes at once to Gymnasium's vector of single ones, on one core
ACTION = np.array([0.2], dtype=np.float32)
LATE = 0.1  # so that whole episodes run without a violation


def _seconds_per_step(env: YieldingEnv, steps: int) -> float:
    env.reset(seed=0)
    began = time.perf_counter()
    for _ in range(steps):
        _, _, terminated, truncated, _ = env.step(ACTION)
        if terminated or truncated:
            env.reset()
    return (time.perf_counter() - began) / steps


def _bare_client(cell: CoordinationCell) -> tuple[int, list[int]]:
    """What anyone would load: the robots' own files, without default motors. The client and the bodies."""
    client = pybullet.connect(pybullet.DIRECT)
    pybullet.setTimeStep(cell.physics_tick, physicsClientId=client)
    pybullet.setPhysicsEngineParameter(numSolverIterations=10, physicsClientId=client)
    bodies = []
    for arm, path in zip(cell.arms, cell.paths, strict=True):
        place = arm.T_world_base[:3, 3].tolist()
        flags = pybullet.URDF_USE_INERTIA_FROM_FILE
        body = pybullet.loadURDF(str(arm.urdf), place, useFixedBase=True, flags=flags, physicsClientId=client)
        for joint, value in enumerate(path.evaluate(0.0)[0].tolist()):
            pybullet.setJointMotorControl2(body, joint, pybullet.VELOCITY_CONTROL, force=0.0, physicsClientId=client)
            pybullet.resetJointState(body, joint, value, physicsClientId=client)
        bodies.append(body)
    return client, bodies


def _bare_loop(client: int, bodies: list[int], ticks: int) -> float:
    """What anyone would write: states, PD and inverse dynamics, torques, step; no clearance, no path, no record."""
    joints, wanted = [0, 1], np.zeros(2)
    began = time.perf_counter()
    for _ in range(ticks):
        for body in bodies:
            states = pybullet.getJointStates(body, joints, physicsClientId=client)
            q = np.array([state[0] for state in states])
            qd = np.array([state[1] for state in states])
            qdd = 100.0 * (wanted - q) - 20.0 * qd
            torque = pybullet.calculateInverseDynamics(
                body, q.tolist(), qd.tolist(), qdd.tolist(), physicsClientId=client
            )
            pybullet.setJointMotorControlArray(
                body,
                joints,
                pybullet.TORQUE_CONTROL,
                forces=np.clip(torque, -25.0, 25.0).tolist(),
                physicsClientId=client,
            )
        pybullet.stepSimulation(physicsClientId=client)
    return (time.perf_counter() - began) / ticks


def _ratio(a: Callable[[], float], b: Callable[[], float], rounds: int = 40) -> tuple[float, float, float]:
    """Best times of two loops, run in turns so that both meet the same load, and the median of their ratios."""
    times = np.array([(a(), b()) for _ in range(rounds)])
    return float(times[:, 0].min()), float(times[:, 1].min()), float(np.median(times[:, 0] / times[:, 1]))


@pytest.mark.parametrize("physics", ["bullet", "ideal"])
def test_reset(benchmark: BenchmarkFixture, lee1991: CoordinationCell, physics: Physics) -> None:
    env = CoordinationEnv(lee1991, physics=physics)
    try:
        benchmark(env.reset)
        assert benchmark.stats is not None
        assert benchmark.stats["median"] < RESET_MS * 1e-3
    finally:
        env.close()


def test_copies_and_states(lee1991: CoordinationCell, capsys: pytest.CaptureFixture[str]) -> None:
    env = CoordinationEnv(lee1991, physics="bullet", shield=True)
    env.reset(seed=0)
    state = env.get_state()
    seconds = np.empty((30, 2))
    for row in seconds:
        began = time.perf_counter()
        copied = copy.deepcopy(env)
        row[0] = time.perf_counter() - began
        copied.close()
        began = time.perf_counter()
        env.set_state(state)
        row[1] = time.perf_counter() - began
    env.close()
    copying, setting = 1e3 * np.median(seconds, axis=0)
    with capsys.disabled():
        print(f"\ndeep copy {copying:.1f} ms, set_state {setting:.2f} ms")  # noqa: T201
    assert copying < COPY_MS
    assert setting < STATE_MS


@pytest.mark.parametrize("physics", ["bullet", "ideal"])
def test_steps_per_second(benchmark: BenchmarkFixture, lee1991: CoordinationCell, physics: Physics) -> None:
    env = YieldingEnv(lee1991, physics=physics, master_late_s=LATE)
    try:
        steps = 200 if physics == "bullet" else 2000
        seconds = benchmark(_seconds_per_step, env, steps)
        benchmark.extra_info["steps_per_s"] = 1.0 / seconds
        assert 1.0 / seconds > STEPS_PER_S[physics]
    finally:
        env.close()


@pytest.mark.parametrize("physics", ["bullet", "ideal"])
def test_blend_steps_per_second(benchmark: BenchmarkFixture, lee2006: BlendCell, physics: Physics) -> None:
    """Steps of 10 ticks; best of many, because the machine does other things too."""
    env = BlendTrackingEnv(lee2006, physics=physics)

    def steps() -> float:
        env.reset()
        began = time.perf_counter()
        for _ in range(80):  # at 0.6 of the rate: none arrives
            env.step(ACTION)
        return (time.perf_counter() - began) / 80

    try:
        benchmark(steps)
        seconds = min(steps() for _ in range(20))
        benchmark.extra_info["ticks_per_s"] = 10.0 / seconds
        assert 1.0 / seconds > BLEND_STEPS_PER_S[physics]
    finally:
        env.close()


@pytest.mark.parametrize(("physics", "mode"), IK_STEPS_PER_S)
def test_feedback_ik_steps_per_second(
    chung: IKCell, physics: Physics, mode: ActionMode, capsys: pytest.CaptureFixture[str]
) -> None:
    """Steps of 10 ticks with 6 joints; best of many, because the machine does other things too."""
    env = FeedbackIKEnv(chung, physics=physics, action_mode=mode)
    action = np.zeros(env.action_space.shape, dtype=np.float32)

    def steps() -> float:
        env.reset()
        began = time.perf_counter()
        for _ in range(100):
            env.step(action)
        return (time.perf_counter() - began) / 100

    try:
        rate = 1.0 / min(steps() for _ in range(20))
        with capsys.disabled():
            print(f"\nfeedback ik, {physics}, {mode}: {rate:.0f} steps/s of 10 ticks")  # noqa: T201
        assert rate > IK_STEPS_PER_S[physics, mode]
    finally:
        env.close()


def test_bullet_against_a_bare_loop(lee1991: CoordinationCell, capsys: pytest.CaptureFixture[str]) -> None:
    env, (client, bodies) = YieldingEnv(lee1991, physics="bullet", master_late_s=LATE), _bare_client(lee1991)
    try:
        ticks = lee1991.ticks_per_period
        ours, bare, ratio = _ratio(
            lambda: _seconds_per_step(env, 150) / ticks, lambda: _bare_loop(client, bodies, 150 * ticks)
        )
        with capsys.disabled():
            print(f"\nbullet: {ours * 1e6:.0f} us a tick, bare loop {bare * 1e6:.0f} us, ratio {ratio:.2f}")  # noqa: T201
        assert ratio <= BARE_RATIO
    finally:
        env.close()
        pybullet.disconnect(client)


@pytest.mark.parametrize("name", ["lee1991", "planar-four", "panda-pair"])
def test_mujoco_against_bullet(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    cell = load_cell(name)
    mujoco, bullet = (YieldingEnv(cell, physics=physics, master_late_s=LATE) for physics in ("mujoco", "bullet"))
    try:
        ours, theirs, ratio = _ratio(lambda: _seconds_per_step(mujoco, 40), lambda: _seconds_per_step(bullet, 40), 20)
        ticks = [cell.ticks_per_period / seconds for seconds in (ours, theirs)]
        with capsys.disabled():
            print(f"\n{name}: {ticks[0]:.0f} ticks/s in MuJoCo, {ticks[1]:.0f} in PyBullet, time x {ratio:.2f}")  # noqa: T201
        assert ratio <= MUJOCO_RATIO
    finally:
        mujoco.close()
        bullet.close()


def test_ideal_against_bullet(lee1991: CoordinationCell, capsys: pytest.CaptureFixture[str]) -> None:
    bullet = YieldingEnv(lee1991, physics="bullet", master_late_s=LATE)
    ideal = YieldingEnv(lee1991, physics="ideal", master_late_s=LATE)
    try:
        slow, fast, ratio = _ratio(lambda: _seconds_per_step(bullet, 150), lambda: _seconds_per_step(ideal, 1500))
        with capsys.disabled():
            print(f"\nbullet {1.0 / slow:.0f} steps/s, ideal {1.0 / fast:.0f} steps/s, ratio {ratio:.1f}")  # noqa: T201
        assert ratio >= IDEAL_RATIO
    finally:
        bullet.close()
        ideal.close()


def test_ik_batch(chung: IKCell, capsys: pytest.CaptureFixture[str]) -> None:
    """64 episodes of ``gains`` past what is hard; rounds in turns, best of many."""
    options: dict[str, Any] = {"action_mode": "gains", "family": ("near-singular", "partly-unreachable")}
    single = FeedbackIKEnv(chung, physics="ideal", action_mode="gains", family="partly-unreachable")
    many = [FeedbackIKVectorEnv(64, chung, targets=8, threads=n, hold_periods=h, **options) for n, h in IK_MANY]
    for env in many:
        env.reset(seed=0)
    random = np.random.default_rng(0)

    def of_many(env: FeedbackIKVectorEnv, hold: int) -> float:
        actions = random.uniform(-1.0, 1.0, (64, 4))
        began = time.perf_counter()
        for _ in range(20 // hold):
            env.step(actions)
        return 64 * 20 / (time.perf_counter() - began)

    def of_one() -> float:
        single.reset(seed=0)
        began = time.perf_counter()
        for action in random.uniform(-1.0, 1.0, (200, 4)).astype(np.float32):
            single.step(action)
        return 200 / (time.perf_counter() - began)

    rounds = [[of_one(), *(of_many(env, h) for env, (_, h) in zip(many, IK_MANY, strict=True))] for _ in range(12)]
    rates = np.max(rounds, axis=0)
    with capsys.disabled():
        print(  # noqa: T201
            f"\n64 episodes of gains: {rates[1]:.0f} control periods/s on one core, {rates[2]:.0f} on two, "
            f"{rates[3]:.0f} with actions held for 20; single {rates[0]:.0f}"
        )
    assert rates[3] >= IK_RATIO * rates[0]
    single.close()
    for env in many:
        env.close()


def test_blend_batch(lee2006: BlendCell, capsys: pytest.CaptureFixture[str]) -> None:
    """64 episodes whose rate changes in every period, against Gymnasium's vector of single ones; rounds in turns."""
    actions = np.random.default_rng(0).uniform(-0.2, 1.0, (30, 64, 1)).astype(np.float32)
    single = gymnasium.vector.SyncVectorEnv([partial(BlendTrackingEnv, lee2006, physics="ideal")] * 64)
    given = BlendTrackingVectorEnv(64, lee2006, threads=1)
    drawn = BlendTrackingVectorEnv(64, lee2006, threads=1, family="line-arc", paths=16)

    def of(env: Any) -> float:
        env.reset(seed=0)
        began = time.perf_counter()
        for action in actions:
            env.step(action)
        return 64 * len(actions) / (time.perf_counter() - began)

    rates = np.max([[of(env) for env in (single, given, drawn)] for _ in range(8)], axis=0)
    with capsys.disabled():
        print(  # noqa: T201
            f"\n64 blend episodes: {rates[1]:.0f} control periods/s on one core, {rates[2]:.0f} on 16 drawn paths; "
            f"single ones in turns {rates[0]:.0f}"
        )
    assert rates[1] >= BLEND_RATIO * rates[0]
    for env in (single, given, drawn):
        env.close()


def _agent_steps_per_second(simulation: BatchSimulation, steps: int) -> float:
    """Random commands; episodes that are over begin anew."""
    random = np.random.default_rng(0)
    commands = [random.uniform(0.0, 1.0, simulation.lam.shape) for _ in range(16)]
    began = time.perf_counter()
    for k in range(steps):
        simulation.step(commands[k % 16])
        over = np.asarray((simulation.terminated | simulation.truncated).all(axis=1), dtype=np.bool_)
        if over.any():
            simulation.reset(over)
    return steps * simulation.lam.size / (time.perf_counter() - began)


def test_batch(lee1991: CoordinationCell, capsys: pytest.CaptureFixture[str]) -> None:
    """4096 episodes, 10 ticks a step; rounds in turns, best of many, because the machine does other things too."""
    cell = build_cell(lee1991.config.model_copy(update={"control_period_s": 0.010}))
    one, two = (BatchSimulation(cell, BATCH, threads=threads) for threads in (1, 2))
    single = YieldingEnv(cell, physics="ideal", master_late_s=LATE)
    bullet = YieldingEnv(cell, physics="bullet", master_late_s=LATE)
    try:
        for simulation in (one, two):
            _agent_steps_per_second(simulation, 40)  # so that episodes are everywhere on their way
        rates = np.array(
            [
                (
                    _agent_steps_per_second(one, 10),
                    _agent_steps_per_second(two, 10),
                    1.0 / _seconds_per_step(single, 500),
                    1.0 / _seconds_per_step(bullet, 20),
                )
                for _ in range(30)
            ]
        ).max(axis=0)
        with capsys.disabled():
            print(  # noqa: T201
                f"\nbatch of {BATCH}: {rates[0]:.3g} agent steps/s on one core, {rates[1]:.3g} on two "
                f"(ratio {rates[1] / rates[0]:.2f}); single ideal {rates[2]:.0f} steps/s, bullet {rates[3]:.0f} "
                f"(ratio {rates[2] / rates[3]:.1f})"
            )
        assert rates[1] >= BATCH_PER_S
        assert rates[2] >= SINGLE_PER_S
        assert rates[2] >= IDEAL_RATIO * rates[3]
    finally:
        for env in (single, bullet):
            env.close()
        for simulation in (one, two):
            simulation.close()


SHIELDED_SHARE = 0.05  # of the bare rate, at least: measured 0.06-0.16
TRAINED: dict[str, dict[str, Any]] = {
    "bare": {},
    "shield": {"shield": True},
    "shield, start phases": {"shield": True, "start_phase": (0.0, 0.5)},
    "the same, all disturbed": {"shield": True, "start_phase": (0.0, 0.5), "disturbance": "all-any"},
}


def _rate_of_episodes(simulation: BatchSimulation) -> tuple[float, float, float]:
    """Agent steps per second of the process's time over two minimum times, share of resets, share of commands cut.

    From the same seed every time: stretches with nothing to decide are up to five times as fast as those between.
    """
    random, cell = np.random.default_rng(0), simulation.cell
    steps = int(2.0 * max(motion.duration for motion in cell.fastest) / cell.control_period)
    simulation.seed(0)
    simulation.reset()
    stepping, resetting, cut = 0.0, 0.0, 0
    for _ in range(steps):
        commands = np.clip(random.normal(0.8, 0.3, simulation.lam.shape), 0.0, 1.0)
        began = time.process_time()
        simulation.step(commands)
        stepping += time.process_time() - began
        cut += int(np.count_nonzero(simulation.shield_cut))
        over = np.asarray((simulation.terminated | simulation.truncated).all(axis=1), dtype=np.bool_)
        if over.any():
            began = time.process_time()
            simulation.reset(over)
            resetting += time.process_time() - began
    agent_steps, total = steps * simulation.lam.size, stepping + resetting
    return agent_steps / total, resetting / total, cut / agent_steps


@pytest.mark.parametrize("name", ["lee1991", "ring"])
def test_batch_in_states_of_training(name: str, lee1991: CoordinationCell, capsys: pytest.CaptureFixture[str]) -> None:
    """256 episodes on one core, commands about 0.8; the shield beside the bare simulation, rounds in turns."""
    cell = lee1991 if name == "lee1991" else generate_cell("ring", 1, 0, arms=4).cell
    many = {what: BatchSimulation(cell, 256, **options) for what, options in TRAINED.items()}
    rounds = [[_rate_of_episodes(simulation) for simulation in many.values()] for _ in range(5)]
    best = np.array(rounds)[:, :, 0].max(axis=0)
    with capsys.disabled():
        print()  # noqa: T201
        for k, what in enumerate(many):
            _, resets, cut = rounds[0][k]
            print(  # noqa: T201
                f"{name:>8} {what:<24} {best[k] / 1e3:7.1f} thousand agent steps/s ({best[k] / best[0]:.3f} of bare), "
                f"resets {100 * resets:.0f} % of the time, {100 * cut:.0f} % of the commands cut"
            )
    assert best.min() >= SHIELDED_SHARE * best[0]
    for simulation in many.values():
        simulation.close()

"""The same seed gives the same episode, to the last bit: again, in a fresh environment, and in another process."""

from __future__ import annotations

import hashlib
import itertools
import subprocess
import sys

import numpy as np
import pytest

from armtempo.envs import MODES, PHYSICS, CoordinationEnv, Physics, YieldingEnv
from armtempo.planners import CoordinationCell
from armtempo.planners.topp import Mode

_SCRIPT = """
import hashlib, sys
import numpy as np
from armtempo.envs import BlendTrackingEnv, CoordinationEnv, FeedbackIKEnv, YieldingEnv
from armtempo.planners import BlendCell, IKCell, load_cell

cell, digest = load_cell("lee1991"), hashlib.sha256()
for physics in ("bullet", "ideal"):
    env = CoordinationEnv(cell, physics=physics, master_late_s=0.11, record=True)
    random = np.random.default_rng(7)
    for seed in range(3):
        digest.update(repr(env.reset(seed=seed)).encode())
        while env.agents:
            actions = {agent: random.uniform(-0.5, 1.0, 1).astype(np.float32) for agent in env.agents}
            observations, *rest = env.step(actions)
            digest.update(b"".join(row.tobytes() for row in observations.values()) + repr(rest).encode())
        trace = env.trace
        for array in (trace.lam, trace.mu, trace.clearance, trace.path_error, trace.arrival, *trace.q, *trace.torque):
            digest.update(array.tobytes())
    env.close()
    env = YieldingEnv(cell, physics=physics, mode="acceleration", master_late_s=(0.0, 0.15))
    for seed in (3, None, None):
        observation, info = env.reset(seed=seed)
        digest.update(observation.tobytes() + repr(info).encode())
        over = False
        while not over:
            observation, *rest = env.step(random.uniform(-0.5, 1.0, 1).astype(np.float32))
            over = rest[1] or rest[2]
            digest.update(observation.tobytes() + repr(rest).encode())
    env.close()
    for profile, mapping in (("limit-aware", "exact"), ("line-speed", "paper")):
        env = BlendTrackingEnv(
            load_cell("lee2006", BlendCell), physics=physics, profile=profile, mapping=mapping, family="zigzag",
            record=True,
        )
        for seed in (3, None):
            observation, info = env.reset(seed=seed, options={"curve": "quintic"})
            digest.update(observation.tobytes() + repr(info).encode())
            over = False
            while not over:
                observation, *rest = env.step(random.uniform(-0.5, 1.0, 1).astype(np.float32))
                over = rest[1] or rest[2]
                digest.update(observation.tobytes() + repr(rest).encode())
        for array in (env.trace.s, env.trace.q, env.trace.tip, env.trace.torque, env.trace.contour_error):
            digest.update(array.tobytes())
        env.close()
    for mode, size, family in (("speeds", 6, "near-singular"), ("gains", 4, "partly-unreachable")):
        env = FeedbackIKEnv(
            load_cell("chung", IKCell), physics=physics, action_mode=mode, family=family, max_episode_s=1.0, record=True
        )
        for seed in (3, None):
            observation, info = env.reset(seed=seed)
            digest.update(observation.tobytes() + repr(info).encode())
            over = False
            while not over:
                observation, *rest = env.step(random.uniform(-1.0, 1.0, size).astype(np.float32))
                over = rest[1] or rest[2]
                digest.update(observation.tobytes() + repr(rest).encode())
        for array in (env.trace.q, env.trace.reference, env.trace.error, env.trace.torque, env.trace.singular_value):
            digest.update(array.tobytes())
        env.close()
sys.stdout.write(digest.hexdigest())
"""


def test_two_processes_run_the_same_episodes() -> None:
    runs = [
        subprocess.run([sys.executable, "-c", _SCRIPT], capture_output=True, text=True, check=True).stdout
        for _ in range(2)
    ]
    assert runs[0] == runs[1]
    assert len(runs[0]) == 64


def _digest(env: YieldingEnv, seed: int) -> str:
    digest = hashlib.sha256()
    random = np.random.default_rng(seed)
    observation, info = env.reset(seed=seed)
    digest.update(observation.tobytes() + repr(info).encode())
    over = False
    while not over:
        observation, reward, terminated, truncated, info = env.step(random.uniform(-0.3, 1.0, 1).astype(np.float32))
        digest.update(observation.tobytes() + repr((reward, terminated, truncated, info)).encode())
        over = terminated or truncated
    digest.update(env.simulation.joint_positions().tobytes())
    return digest.hexdigest()


@pytest.mark.parametrize(("physics", "mode"), list(itertools.product(PHYSICS, MODES)))
def test_after_any_episode_a_reset_is_as_good_as_new(lee1991: CoordinationCell, physics: Physics, mode: Mode) -> None:
    used = YieldingEnv(lee1991, physics=physics, mode=mode, master_late_s=(0.0, 0.15))
    for seed in range(6):
        fresh = YieldingEnv(lee1991, physics=physics, mode=mode, master_late_s=(0.0, 0.15))
        assert _digest(used, seed) == _digest(fresh, seed)
        fresh.close()
    used.close()


def test_two_environments_in_turns_do_not_meet(lee1991: CoordinationCell) -> None:
    """They share the cell and its clearance buffers, but nothing of the episode."""
    alone = YieldingEnv(lee1991)
    expected = _digest(alone, 1)
    other = CoordinationEnv(lee1991, master_late_s=0.12)
    other.reset()
    original = alone.step

    def step_both(action: np.ndarray) -> tuple[np.ndarray, float, bool, bool, dict[str, object]]:
        if other.agents:
            other.step({agent: np.ones(1, dtype=np.float32) for agent in other.agents})
        return original(action)

    alone.step = step_both  # type: ignore[method-assign]
    assert _digest(alone, 1) == expected
    alone.close()
    other.close()


def test_recording_changes_nothing(lee1991: CoordinationCell) -> None:
    ends = []
    for record in (False, True):
        env = CoordinationEnv(lee1991, master_late_s=0.12, record=record)
        env.reset()
        while env.agents:
            env.step({agent: np.array([0.7], dtype=np.float32) for agent in env.agents})
        ends.append((env.simulation.time, env.simulation.arrival.tobytes(), env.simulation.joint_positions().tobytes()))
        env.close()
    assert ends[0] == ends[1]

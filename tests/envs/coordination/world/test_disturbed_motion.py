"""The motion that a clairvoyant plans around is the one that the environment runs."""

from __future__ import annotations

from typing import get_args

import numpy as np
import pytest

from armtempo.envs import DISTURBANCES, CoordinationEnv, disturbed_motion
from armtempo.errors import InputError
from armtempo.planners import load_cell
from armtempo.planners.topp import Mode


@pytest.mark.parametrize("mode", get_args(Mode))
@pytest.mark.parametrize("family", DISTURBANCES)
def test_it_is_what_the_environment_runs(family: str, mode: Mode) -> None:
    cell = load_cell("lee1991")
    env = CoordinationEnv(cell, physics="ideal", mode=mode, disturbance=family, record=True)
    full, still = np.ones(1, dtype=np.float32), -np.ones(1, dtype=np.float32)
    for seed in range(5):
        _, infos = env.reset(seed=seed)
        motion = disturbed_motion(cell, 0, infos["arm_0"]["disturbance"], mode=mode)
        while "arm_0" in env.agents:
            env.step({"arm_0": full, "arm_1": still})
        trace = env.trace
        assert motion.duration == pytest.approx(trace.arrival[0], rel=1e-3)
        planned = np.array([motion.at(t)[0] for t in trace.time])
        assert np.abs(planned - trace.lam[:, 0]).max() < 1e-3 * cell.paths[0].length
    env.close()


def test_it_begins_at_the_start() -> None:
    drawn = {"late_s": [0.0, 0.0], "speed": [1.0, 1.0], "stops_s": [[], []], "start_phase": [0.2, 0.0]}
    with pytest.raises(InputError, match="not at its start"):
        disturbed_motion(load_cell("lee1991"), 0, drawn)

"""Torques of ideal motions: as the inverse dynamics have them, within limits where ticks pass from piece to piece."""

from __future__ import annotations

import numpy as np
import pytest

from armtempo.agents import evaluate
from armtempo.envs.coordination.world._ideal_torque import ideal_torque
from armtempo.planners import load_cell


def test_a_tick_that_passes_a_jump_counts_by_its_two_parts() -> None:
    """Constant mu_dot on either side of where a line ends and an arc begins: the mean of both torques over the tick."""
    dynamics = load_cell("mixed-priority").dynamics[0]
    jump = next(at for at, after in zip(dynamics.grid, dynamics.grid[1:], strict=False) if 0.0 < at == after)
    mu, before, after, share, tick = 0.8, -3.0, 5.0, 0.3, 1e-3  # at the jump, mu_dot before and after it
    first, second = share * tick, (1.0 - share) * tick
    lam = np.array([jump - mu * first + 0.5 * before * first**2, jump + mu * second + 0.5 * after * second**2])
    rate = np.array([mu - before * first, mu + after * second])
    exact = [
        np.mean([dynamics.torque(jump + mu * t + 0.5 * u * t**2, mu + u * t, u) for t in times], axis=0)
        for u, times in ((before, np.linspace(-first, -1e-9, 99)), (after, np.linspace(1e-9, second, 99)))
    ]
    found = ideal_torque(dynamics, lam, rate, tick)
    np.testing.assert_array_equal(found[0], 0.0)
    np.testing.assert_allclose(found[1], share * exact[0] + (1.0 - share) * exact[1], rtol=1e-4)


@pytest.mark.parametrize("cell", ["mixed-priority", "planar-four"])
def test_no_motion_under_commands_asks_for_more_than_the_limits(cell: str) -> None:
    found = evaluate(
        load_cell(cell), ["phase-plane", "random"], physics="ideal", shield=True, disturbance="all-stop-and-go",
        episodes=8,
    ).results  # fmt: skip
    for one in found.values():
        assert one.torque_demand_ratio_max < 1.002

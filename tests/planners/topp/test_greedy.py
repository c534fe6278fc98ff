"""The greedy profile is the fastest of all, and the limits it is at are told by their rows."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import linprog

from armtempo.arrays import Floats
from armtempo.planners import PathDynamics, PhasePlane
from armtempo.planners.topp._greedy import active_rows, greedy_profile
from armtempo.planners.topp._rows import Rows


def fastest_by_linear_program(rows: Rows, x_start: float, x_end: float) -> Floats:
    """The profile of the largest sum of ``x`` among all that keep the rows at both ends of every interval."""
    count, lines, upper = len(rows.station), [], []
    for i in range(count - 1):
        d2 = 2.0 * (rows.station[i + 1] - rows.station[i])
        for k in (i, i + 1):
            for j in range(rows.a.shape[1]):
                line = np.zeros(count)
                line[i], line[i + 1] = -rows.a[k, j] / d2, rows.a[k, j] / d2
                line[k] += rows.b[k, j]
                lines += [line, -line]
                upper += [rows.high[k, j], -rows.low[k, j]]
    bounds = [(0.0, float(cap)) for cap in rows.x_cap]
    bounds[0], bounds[-1] = (x_start, x_start), (x_end, x_end)
    solution = linprog(-np.ones(count), np.array(lines), np.array(upper), bounds=bounds)
    assert solution.status == 0
    return np.asarray(solution.x)


@pytest.mark.parametrize("seed", range(4))
def test_where_no_inertia_vanishes_no_profile_is_faster_anywhere(seed: int) -> None:
    """(Where one does, profiles of a grid may cross.)"""
    generator, grid = np.random.default_rng(seed), np.linspace(0.0, 1.0, 51)
    phase = generator.uniform(0.0, 2.0 * np.pi, (3, 2))
    M, Q, S = (np.sin(4.0 * grid[:, None] + own) for own in phase)
    plane = PhasePlane(PathDynamics(grid, 1.5 + M, Q, 0.0 * M, 0.5 * S, [-1.0, -1.0], [1.0, 1.5]))
    x = fastest_by_linear_program(plane.rows, 0.0, 0.0)
    np.testing.assert_allclose(plane.fastest().mu ** 2, x, atol=1e-6 * x.max())


def integrator(stations: int = 41) -> PhasePlane:
    grid, one, zero = np.linspace(0.0, 1.0, stations), np.ones((stations, 1)), np.zeros((stations, 1))
    return PhasePlane(PathDynamics(grid, one, zero, zero, zero, [-1.0], [1.0]))


def test_a_start_from_which_the_sets_cannot_be_met_is_told_by_its_station() -> None:
    plane = integrator()
    x = np.empty(41)
    assert greedy_profile(plane.rows, plane.sets, plane.counts, 0.0, False, x) == -1
    np.testing.assert_allclose(x, 2.0 * np.minimum(plane.rows.station, 1.0 - plane.rows.station), atol=1e-9)
    assert greedy_profile(plane.rows, plane.sets, plane.counts, 2.1, False, x) == 0  # braking ends past the end


def test_the_active_row_is_the_one_at_a_limit_with_its_side() -> None:
    grid, one = np.linspace(0.0, 1.0, 41), np.ones((41, 1))
    idle = np.hstack([0.5 * one, one])  # the first row is half used when the second is at its limit
    rows = PhasePlane(PathDynamics(grid, idle, 0.0 * idle, 0.0 * idle, 0.0 * idle, [-1.0, -1.0], [1.0, 1.0])).rows
    x = 2.0 * np.minimum(grid, 1.0 - grid)
    u = np.diff(x) / (2.0 * np.diff(grid))
    row, side = np.empty(40, dtype=np.int64), np.empty(40, dtype=np.int64)
    active_rows(rows, x, u, row, side)
    np.testing.assert_array_equal(row, 1)
    np.testing.assert_array_equal(side, [1] * 20 + [-1] * 20)
    active_rows(rows, 0.5 * x, 0.5 * u, row, side)
    np.testing.assert_array_equal(row, -1)
    np.testing.assert_array_equal(side, 0)

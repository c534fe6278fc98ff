"""Moves and dwells end to end: the moves' own values, borders on chart cells, sound bounds, errors with the step."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from armtempo.arrays import Floats
from armtempo.errors import InputError, PathError
from armtempo.planners import JointPath
from armtempo.planners.joint_paths import Dwell, SequencePath, Wait
from armtempo.planners.joint_paths.kernels import path_point


def zigzag(seed: int, moves: int = 3, joints: int = 2) -> SequencePath:
    """Moves with corners between them, some of which are dwells."""
    generator = np.random.default_rng(seed)
    steps: list[Any] = []
    at = generator.normal(size=joints)
    for _ in range(moves):
        if generator.uniform() < 0.5:
            steps.append(float(generator.uniform(0.01, 2.0)))
        points = np.vstack([at, at + np.cumsum(generator.normal(size=(generator.integers(1, 4), joints)), axis=0)])
        steps.append(JointPath.through(points))
        at = points[-1]
    return JointPath.sequence([*steps, Wait(0.001)])


@given(st.integers(0, 10**6))
def test_each_step_has_its_moves_own_values(seed: int) -> None:
    path = zigzag(seed)
    for k, step in enumerate(path.steps):
        start, stop = path.border[k : k + 2]
        share = np.linspace(0.0, 1.0, 9)[1:-1]
        q, dq, ddq = path.evaluate(start + share * (stop - start))
        if isinstance(step, Dwell):
            assert not dq.any()
            assert not ddq.any()
            assert not np.ptp(q, axis=0).any()
            continue
        own_q, own_dq, own_ddq = step.evaluate(share * step.length)
        stretch = step.length / (stop - start)
        np.testing.assert_allclose(q, own_q, atol=1e-12)
        np.testing.assert_allclose(dq, stretch * own_dq, rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(ddq, stretch**2 * own_ddq, rtol=1e-9, atol=1e-7)


def test_a_border_belongs_to_the_step_behind_it_or_before_it() -> None:
    path = JointPath.sequence(
        [JointPath.through([[0.0, 0.0], [1.0, 0.0]]), JointPath.through([[1.0, 0.0], [1.0, 1.0]])]
    )
    corner = path.border[1]
    (_, after, _), (_, before, _) = path.evaluate(corner), path.evaluate(corner, before=True)
    assert before[0] > 0.0 == before[1]
    assert after[1] > 0.0 == after[0]
    assert path.stops.tolist() == [corner]


@given(st.integers(0, 10**6))
def test_borders_are_those_of_chart_cells(seed: int) -> None:
    path = zigzag(seed, moves=6)
    cells = path.border * path.cells
    assert path.cells & (path.cells - 1) == 0
    assert (cells == np.round(cells)).all()
    assert np.diff(cells).min() >= 4
    assert (path.border[0], path.border[-1], path.length) == (0.0, 1.0, 1.0)
    assert set(path.stops) <= set(path.breakpoints)
    path.check_stations()


def test_a_longer_way_gets_more_of_the_path() -> None:
    path = JointPath.sequence([JointPath.through([[0.0], [3.0]]), 0.1, JointPath.through([[3.0], [2.0]])])
    first, dwell, second = np.diff(path.border)
    assert first == pytest.approx(3.0 * second, rel=0.1)
    assert dwell == 4 / 1024


@given(st.integers(0, 10**6), st.floats(0.0, 1.0), st.floats(0.0, 1.0))
def test_speed_bounds_are_none_too_low(seed: int, one: float, other: float) -> None:
    path = zigzag(seed)
    low, high = min(one, other), max(one, other)
    lam = np.linspace(low, high, 200)
    speed = np.maximum(*(np.abs(path.evaluate(lam, before=before)[1]).max(axis=0) for before in (False, True)))
    assert (path.speed_bound(low, high) >= speed * (1.0 - 1e-12)).all()
    bounds = path.speed_bound(lam[:-1], lam[1:])
    assert bounds.shape == (199, 2)
    assert (bounds >= np.abs(path.evaluate(0.5 * (lam[1:] + lam[:-1]))[1]) * (1.0 - 1e-12)).all()


def test_the_table_has_both_slopes_of_a_corner() -> None:
    """With one slope per station the pieces beside a corner were bent: 33 micrometres and twice the torque."""
    corner = JointPath.sequence(
        [JointPath.through([[0.0, 0.0], [0.5, 0.2]]), JointPath.through([[0.5, 0.2], [0.1, 0.9]])]
    )
    table, q = corner.table(), np.empty(2)
    lam = np.concatenate([np.linspace(0.0, 1.0, 4001), corner.border[1] + np.linspace(-1e-3, 1e-3, 301)])
    found = np.array([path_point(table, float(one), q) or q.copy() for one in lam])
    np.testing.assert_allclose(found, corner.evaluate(lam)[0], atol=1e-12)


def test_third_derivatives_are_the_moves() -> None:
    path = zigzag(3)
    lam = np.linspace(0.001, 0.999, 400)
    lam = lam[np.abs(lam[:, None] - path.breakpoints).min(axis=1) > 1e-4]
    h = 1e-6
    slope = (path.evaluate(lam + h)[2] - path.evaluate(lam - h)[2]) / (2.0 * h)
    np.testing.assert_allclose(path.third(lam), slope, rtol=1e-4, atol=1e-2)


def line(*points: float) -> JointPath:
    return JointPath.through(np.array(points)[:, None])  # type: ignore[return-value]


@pytest.mark.parametrize(
    ("steps", "words"),
    [
        ([], "sequence of 0 steps has no move (give a joint path"),
        ([0.5, 0.1], "sequence of 2 steps has no move"),
        ([line(0.0, 1.0), "there"], "step 1 of a sequence is 'there' (give joint paths"),
        ([line(0.0, 1.0), True], "step 1 of a sequence is True"),
        ([line(0.0, 1.0), 0.0], "dwell of 0.0 s (give a finite time > 0"),
        ([line(0.0, 1.0), float("nan")], "dwell of nan s"),
        ([0.1] * 3000 + [line(0.0, 1.0)], "sequence of 3001 steps needs 12016 cells, a chart has 8192"),
    ],
)
def test_bad_steps_are_named(steps: list[Any], words: str) -> None:
    with pytest.raises(InputError) as caught:
        JointPath.sequence(steps)
    assert words in str(caught.value)


def test_a_jump_between_moves_is_refused() -> None:
    with pytest.raises(PathError, match=r"step 2 of the sequence begins with joint 0 at 1.5, and the step before it"):
        JointPath.sequence([line(0.0, 1.0), 0.1, line(1.5, 2.0)])


def test_a_dwell_may_come_first_and_last() -> None:
    path = JointPath.sequence([0.2, line(0.0, 1.0), 0.3])
    q: Floats = path.evaluate([0.0, path.border[1] / 2, 1.0])[0]
    assert q[:, 0].tolist() == [0.0, 0.0, 1.0]
    assert [(part.start, part.seconds, part.exact) for part in path.standing] == [
        (0.0, 0.2, True),
        (path.border[2], 0.3, True),
    ]

"""Rows of episodes: thinned where there are many, without losing what counts."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from armtempo.commands.viewer._runs import FEWEST_ROWS, LARGEST_RUNS, most_rows, nearest_columns, rows_of
from armtempo.planners import CoordinationCell


@given(count=st.integers(1, 5000), most=st.integers(2, 600), seed=st.integers(0, 99))
def test_rows_keep_both_ends_and_the_extremes(count: int, most: int, seed: int) -> None:
    values = np.random.default_rng(seed).normal(size=(count, 1))
    rows = rows_of({"time": np.arange(count, dtype=float)[:, None], "value": values}, most)
    assert {0, count - 1, int(values.argmin()), int(values.argmax())} <= set(rows.tolist())
    assert len(rows) <= max(most, 2) + 4
    assert (np.diff(rows) > 0).all()


@given(lengths=st.lists(st.integers(1, 20_000), min_size=1, max_size=12), width=st.integers(1, 80))
def test_all_runs_together_stay_small(lengths: list[int], width: int) -> None:
    columns = [{"time": np.zeros((n, 1)), "rest": np.broadcast_to(0.0, (n, width))} for n in lengths]
    most = most_rows(columns)
    size = sum((4 * (1 + width) + 24) * min(n, most) for n in lengths)
    assert size <= LARGEST_RUNS or most == FEWEST_ROWS
    if most < max(lengths):  # and no smaller than needed
        assert sum((4 * (1 + width) + 24) * min(n, most + 1) for n in lengths) > LARGEST_RUNS


def test_nearest_points_are_as_far_apart_as_the_clearance(lee1991: CoordinationCell) -> None:
    shares = np.linspace(0.0, 1.0, 50)
    joints = [
        path.evaluate(share * path.length)[0] for path, share in zip(lee1991.paths, (shares, shares[::-1]), strict=True)
    ]
    found = nearest_columns(lee1991, joints)
    apart = np.linalg.norm(found["nearest"][:, 3:] - found["nearest"][:, :3], axis=1)
    clear = found["clearance"][:, 0]
    told = np.isfinite(apart)
    assert told.sum() > 20
    np.testing.assert_allclose(apart[told], clear[told], atol=1e-3)
    assert (clear[~told] <= 0.0).all()

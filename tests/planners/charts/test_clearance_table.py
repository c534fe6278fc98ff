"""Clearance tables: planar capsules in closed form, and what lies between the nodes."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from armtempo.planners import CoordinationCell
from armtempo.planners.charts import ClearanceTable, clearance_table, tabulated_clearance

GENERATOR = np.random.default_rng(7)


def table_of(a: float, b: float, both: float, count: int = 9) -> ClearanceTable:
    """Of ``1 + a x + b y + both x y`` over lengths 2 and 3."""
    x, y = np.meshgrid(np.linspace(0.0, 2.0, count), np.linspace(0.0, 3.0, count), indexing="ij")
    return ClearanceTable(1.0 + a * x + b * y + both * x * y, 2.0, 3.0)


number = st.floats(-5.0, 5.0)


@given(number, number, number, st.floats(0.0, 2.0), st.floats(0.0, 3.0))
def test_what_is_bilinear_is_told_exactly(a: float, b: float, both: float, x: float, y: float) -> None:
    told = tabulated_clearance(table_of(a, b, both), x, y)
    np.testing.assert_allclose(told, 1.0 + a * x + b * y + both * x * y, atol=1e-12)


@given(st.floats(-9.0, 9.0), st.floats(-9.0, 9.0))
def test_beyond_the_ends_it_is_as_at_the_ends(x: float, y: float) -> None:
    table = table_of(1.0, -2.0, 0.5)
    inside = min(max(x, 0.0), 2.0), min(max(y, 0.0), 3.0)
    assert tabulated_clearance(table, x, y) == tabulated_clearance(table, *inside)


def test_a_table_is_what_the_cells_clearance_says_at_nodes_and_its_transpose_seen_from_the_other(
    lee1991: CoordinationCell,
) -> None:
    table = clearance_table(0, 1, lee1991.arms, lee1991.paths, 0.05)
    nodes = len(table.distance)
    lam = [np.linspace(0.0, path.length, nodes) for path in lee1991.paths]
    for a, b in GENERATOR.integers(0, nodes, (200, 2)):
        q = [path.evaluate(own[k])[0] for path, own, k in zip(lee1991.paths, lam, (a, b), strict=True)]
        truth = lee1991.clearance.arms(q).distance
        assert abs(table.distance[a, b] - truth) < 1e-8  # capsules: exact
        assert abs(tabulated_clearance(table, float(lam[0][a]), float(lam[1][b])) - table.distance[a, b]) < 1e-12
    other = clearance_table(1, 0, lee1991.arms, lee1991.paths, 0.05)
    np.testing.assert_allclose(other.distance, table.distance.T, atol=1e-12)
    assert (table.length_a, table.length_b) == tuple(path.length for path in lee1991.paths)

"""Charts of two Pandas at 1024 x 1024: time and queries against brute force, and 200 000 questions to FCL."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from armtempo.planners import CoordinationChart, JointPath
from armtempo.planners.charts import clearance_table
from armtempo.robots import Arm, Clearance

Pair = tuple[tuple[Arm, Arm], tuple[JointPath, JointPath]]
FREE, UNDECIDED, BLOCKED = 0, 1, 2
D_MIN = 0.02
SEEDS = range(6)


def build(pair: Pair, shapes: Any = "real") -> CoordinationChart:
    arms, paths = pair
    return CoordinationChart.build(arms[0], paths[0], arms[1], paths[1], D_MIN, 1 / 1024, shapes=shapes)


def say(capsys: pytest.CaptureFixture[str], text: str) -> None:
    with capsys.disabled():
        print(f"\n{text}")  # noqa: T201


@pytest.mark.parametrize("shapes", ["capsules", "real"])
def test_chart_of_pandas_against_brute_force(
    benchmark: Any, panda_pair: Callable[[int], Pair], capsys: pytest.CaptureFixture[str], shapes: str
) -> None:
    """Brute force asks FCL on the same shapes at every cell's centre, which proves nothing between (extrapolated)."""
    pair = panda_pair(4)
    chart = benchmark.pedantic(build, (pair, shapes), rounds=5, warmup_rounds=1)
    arms, paths = pair
    clearance = Clearance(arms)
    generator = np.random.default_rng(0)
    q = [path.evaluate(generator.uniform(0.0, 1.0, 500))[0] for path in paths]
    start = time.perf_counter()
    for one, other in zip(*q, strict=True):
        clearance.between(0, 1, one, other, cutoff=D_MIN)
    brute = (time.perf_counter() - start) / len(q[0]) * chart.resolution**2
    pairs = len(arms[0].shapes) * len(arms[1].shapes) * chart.resolution**2
    own = benchmark.stats.stats.min
    fewer = pairs / (chart.pair_queries + chart.shape_queries)
    benchmark.extra_info.update(seconds=own, ratio=brute / own, pair_queries_ratio=fewer)
    say(
        capsys,
        f"chart of two Pandas, {shapes}: {own:.3f} s, {brute / own:.0f} times quicker than brute force (extrapolated), "
        f"{fewer:.0f} times fewer pair queries ({chart.pair_queries} by capsules, {chart.shape_queries} by shapes), "
        f"undecided {100 * chart.share(UNDECIDED):.2f} %",
    )
    assert brute / own >= 20.0
    if shapes == "capsules":
        assert fewer >= 500.0
    else:
        assert chart.share(UNDECIDED) < 0.03


def test_queries_of_six_pairs(panda_pair: Callable[[int], Pair], capsys: pytest.CaptureFixture[str]) -> None:
    for seed in SEEDS:
        pair = panda_pair(seed)
        pairs = len(pair[0][0].shapes) * len(pair[0][1].shapes) * 1024**2
        capsules, real = build(pair, "capsules"), build(pair)
        say(
            capsys,
            f"seed {seed}: capsules {pairs / capsules.pair_queries:.0f} times fewer queries; real shapes "
            f"{pairs / (real.pair_queries + real.shape_queries):.0f} times, undecided "
            f"{100 * real.share(UNDECIDED):.2f} %, blocked {100 * real.share(BLOCKED):.1f} %",
        )
        assert pairs / capsules.pair_queries >= 500.0
        assert real.share(UNDECIDED) < 0.03


def test_200_000_questions_to_fcl(panda_pair: Callable[[int], Pair], capsys: pytest.CaptureFixture[str]) -> None:
    """No free cell with an FCL distance below d_min, no blocked one with one above."""
    asked = {FREE: 0, BLOCKED: 0}
    generator = np.random.default_rng(12)
    start = time.perf_counter()
    for seed in range(4):
        pair = panda_pair(seed)
        chart, clearance = build(pair), Clearance(pair[0])
        cells = np.argwhere(chart.states != UNDECIDED)
        near = np.argwhere(chart.states == UNDECIDED)
        some = [
            cells[generator.integers(0, len(cells), 25_000)] + generator.uniform(0.0, 1.0, (25_000, 2)),
            near[generator.integers(0, len(near), 150_000)] + generator.uniform(-2.0, 3.0, (150_000, 2)),
        ]
        place = np.clip(np.concatenate(some), 0.0, chart.resolution - 1e-9)
        states = chart.states[tuple(place.astype(int).T)]
        place, states = place[states != UNDECIDED][:50_000], states[states != UNDECIDED][:50_000]
        assert len(states) == 50_000
        lam = place / chart.resolution
        q = [path.evaluate(column)[0] for path, column in zip(pair[1], lam.T, strict=True)]
        for state, one, other in zip(states.tolist(), *q, strict=True):
            distance = clearance.between(0, 1, one, other, cutoff=D_MIN).distance
            asked[state] += 1
            if state == FREE:
                assert distance >= D_MIN - 1e-6
            else:
                assert distance + 5e-4 < D_MIN  # FCL's own answer, before its tolerance is taken off
    say(
        capsys,
        f"FCL contradicts none of {asked[FREE]} free and {asked[BLOCKED]} blocked configurations "
        f"({time.perf_counter() - start:.0f} s)",
    )
    assert min(asked.values()) > 50_000


def test_passable(benchmark: Any, panda_pair: Callable[[int], Pair]) -> None:
    chart = build(panda_pair(4))

    def ask() -> int:
        return int(CoordinationChart(states=chart.states, length_a=1.0, length_b=1.0, d_min=D_MIN).passable.sum())

    benchmark.pedantic(ask, rounds=10, warmup_rounds=1)
    assert benchmark.stats.stats.min < 0.03


def test_a_diagonal_curve(benchmark: Any, panda_pair: Callable[[int], Pair]) -> None:
    chart = build(panda_pair(4))
    lam = np.linspace(0.0, 1.0, 1000)
    empty = CoordinationChart(states=np.zeros_like(chart.states), length_a=1.0, length_b=1.0, d_min=D_MIN)
    assert benchmark(empty.is_free_along, lam, lam)


def test_clearance_table(benchmark: Any, panda_pair: Callable[[int], Pair]) -> None:
    arms, paths = panda_pair(4)
    table = benchmark.pedantic(clearance_table, (0, 1, arms, paths, 0.06), rounds=2, warmup_rounds=1)
    assert np.isfinite(table.distance).all()
    clearance = Clearance(arms)
    last = len(table.distance) - 1
    for node in np.random.default_rng(0).integers(0, last + 1, (200, 2)):
        one, other = (path.evaluate(path.length * k / last)[0] for path, k in zip(paths, node, strict=True))
        truth = clearance.between(0, 1, one, other).distance
        assert min(truth - 5e-4, 0.06) <= table.distance[tuple(node)] <= truth + 1e-6

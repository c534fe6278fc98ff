"""Orders of passing decided on the way: prices in closed form, and the search against all orders there are."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from armtempo.arrays import Floats
from armtempo.planners.coordination import OrderSearch, PassingOrders, TimingProblem

Problems = Callable[..., TimingProblem]
LONGEST = 2.0  # [s] a double integrator of |mu_dot| <= 1 on a path of length 1, alone
CELL = 1.0 / 64
MIDDLE = (0.375, 0.625, 0.375, 0.625)


def there_at(place: float) -> float:
    return math.sqrt(2.0 * place) if place <= 0.5 else LONGEST - math.sqrt(2.0 * (1.0 - place))


def from_rest(place: float) -> float:
    return 2.0 * math.sqrt(1.0 - place)


def search_of(problem: TimingProblem) -> OrderSearch:
    pairs = itertools.combinations(problem.arms, 2)
    regions = PassingOrders.of_charts([1.0] * len(problem.arms), {pair: problem.chart_between(*pair) for pair in pairs})
    return OrderSearch(regions, problem.planes)


def at_start(search: OrderSearch, arms: int) -> tuple[Floats, Floats]:
    lam = np.zeros(arms)
    return lam, search.times_to_go(lam, lam)


def test_times_to_go_at_rest_and_at_full_speed(make_problem: Problems) -> None:
    search = search_of(make_problem({(0, 1): [MIDDLE]}, resolution=64))
    places = np.array([0.3, 0.7])
    for place in places:
        both = np.full(2, place)
        assert search.times_to_go(both, np.zeros(2))[0] == pytest.approx(from_rest(place), abs=2e-3)
        fastest = math.sqrt(2.0 * min(place, 1.0 - place))
        assert search.times_to_go(both, np.full(2, fastest))[1] == pytest.approx(LONGEST - there_at(place), abs=2e-3)
    assert (search.times_to_go(np.ones(2), np.zeros(2)) == 0.0).all()


def test_the_second_waits_until_the_first_has_left_and_loses_half_a_start(make_problem: Problems) -> None:
    search = search_of(make_problem({(0, 1): [MIDDLE]}, resolution=64))
    lam, to_go = at_start(search, 2)
    wait = there_at(0.625) - there_at(0.375)
    loss = 0.5 * (from_rest(0.375) - (LONGEST - there_at(0.375)))
    expected = LONGEST + wait + loss * wait / (wait + loss)
    for order in (0, 1):
        assert search.price(lam, to_go, np.array([order])) == pytest.approx(expected, abs=5e-3)
    late = to_go + np.array([0.0, wait + 0.01])  # who is late anyway does not wait
    assert search.price(lam, late, np.array([0])) == pytest.approx(late[1], abs=5e-3)
    best, prices = search.best(lam, late)
    assert best[0].tolist() == [0]
    assert prices[0] <= prices[-1]


def test_who_is_in_a_region_or_past_it_is_not_asked(make_problem: Problems) -> None:
    search = search_of(make_problem({(0, 1): [MIDDLE]}, resolution=64))
    inside = np.array([0.5, 0.1])
    to_go = search.times_to_go(inside, np.zeros(2))
    assert search.best(inside, to_go)[0].tolist() == [[0]]
    assert search.price(inside, to_go, np.array([1])) == math.inf
    past = np.array([0.7, 0.1])
    to_go = search.times_to_go(past, np.zeros(2))
    assert search.price(past, to_go, np.array([0])) == pytest.approx(to_go.max(), rel=2e-3)


def test_arms_that_wait_for_each_other_never_arrive(make_problem: Problems) -> None:
    """Three arms in a ring, each of whose regions begins for one arm where it is still in that before."""
    blocks = {(0, 1): [(0.25, 0.75, 0.5, 0.75)], (1, 2): [(0.25, 0.75, 0.5, 0.75)], (0, 2): [(0.5, 0.75, 0.25, 0.75)]}
    search = search_of(make_problem(blocks, arms=3, resolution=64))
    lam, to_go = at_start(search, 3)
    prices = {row: search.price(lam, to_go, np.array(row)) for row in itertools.product((0, 1), repeat=3)}
    assert math.inf in prices.values()
    best, found = search.best(lam, to_go)
    assert found[0] == prices[tuple(best[0].tolist())] == pytest.approx(min(prices.values()), abs=1e-9)
    assert np.isfinite(found).all()


boxes = st.lists(
    st.tuples(st.integers(2, 50), st.integers(2, 10), st.integers(2, 50), st.integers(2, 10)).map(
        lambda box: (box[0] * CELL, (box[0] + box[1]) * CELL, box[2] * CELL, (box[2] + box[3]) * CELL)
    ),
    max_size=2,
)


@settings(max_examples=30, deadline=None)
@given(
    pairs=st.lists(boxes, min_size=3, max_size=3),
    places=st.lists(st.integers(0, 20), min_size=3, max_size=3),
    standing=st.lists(st.floats(0.0, 1.0), min_size=3, max_size=3),
)
def test_the_search_finds_what_trying_all_orders_finds(
    make_problem: Problems, pairs: list[list[tuple[float, ...]]], places: list[int], standing: list[float]
) -> None:
    blocks = dict(zip(((0, 1), (0, 2), (1, 2)), pairs, strict=True))
    search = search_of(make_problem(blocks, arms=3, resolution=64))
    lam = np.array(places) * CELL
    to_go = search.times_to_go(lam, np.zeros(3)) + np.array(standing)
    R = len(search.regions.regions)
    best, prices = search.best(lam, to_go)
    every = np.array(list(itertools.product((0, 1), repeat=R)), dtype=np.int8).reshape(2**R, R)
    all_prices = np.array([search.price(lam, to_go, row) for row in every])
    assert np.isfinite(all_prices).any() == (len(best) > 0)
    if len(best):
        assert prices[0] == pytest.approx(all_prices.min(), abs=1e-6)
        assert (np.diff(prices) >= 0.0).all()
        for row, price in zip(best, prices, strict=True):
            assert search.price(lam, to_go, row) == pytest.approx(price, abs=1e-6)
    ranked, ranked_prices = search.best_ranks(lam, to_go)
    if len(ranked):
        assert ranked_prices[0] >= all_prices.min() - 1e-6
        assert search.price(lam, to_go, ranked[0]) == pytest.approx(ranked_prices[0], abs=1e-6)


def test_orders_of_many_arms_are_not_all_tried(make_problem: Problems) -> None:
    pairs = {pair: [MIDDLE] for pair in itertools.combinations(range(6), 2)}
    search = search_of(make_problem(pairs, arms=6, resolution=64))
    lam, to_go = at_start(search, 6)
    best, prices = search.best(lam, to_go)
    ranked, ranked_prices = search.best_ranks(lam, to_go)
    assert len(best) == len(ranked) == 8
    assert prices[0] <= ranked_prices[0] * 1.02  # a search of so many nodes is cut short

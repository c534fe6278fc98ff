"""Rules of both kinds in all planners, bound and shield; ``with`` by exhaustive count; circles at once."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from armtempo.errors import InfeasibleError
from armtempo.planners import CoordinationCell, CoordinationChart, schedule
from armtempo.planners.charts import FREE, Exclusion, after
from armtempo.planners.coordination import check_rules


def together(a: list[float], b: list[float]) -> list[Exclusion]:
    """Both events between the second and the third of four borders, waits beside them."""
    return [
        after(1, b[1], 0, a[0], 1.0, "b begins when a has come"),
        after(0, a[1], 1, b[0], 1.0, "a begins when b has come"),
        after(1, b[3], 0, a[2], 1.0, "b goes when a has done"),
        after(0, a[3], 1, b[2], 1.0, "a goes when b has done"),
    ]


def in_order(rules: list[Exclusion]) -> list[Exclusion]:
    return [rule if rule.arms == (0, 1) else rule.swapped for rule in rules]


def test_with_by_exhaustive_count() -> None:
    """No walk over free cells has one arm inside its event while the other is outside its three pieces."""
    cells = 20
    a, b = [4, 6, 10, 12], [8, 10, 12, 14]
    rules = together([v / cells for v in a], [v / cells for v in b])
    chart = CoordinationChart(
        states=np.zeros((cells, cells), dtype=np.uint8), length_a=1.0, length_b=1.0, d_min=0.01
    ).excluding(in_order(rules))
    assert chart.regions == 2  # one side each, apart by the waits
    free = chart.states == FREE
    walks = np.zeros((cells, cells), dtype=object)
    walks[0, 0] = 1
    for i in range(cells):
        for j in range(cells):
            if (i or j) and free[i, j]:
                walks[i, j] = (walks[i - 1, j] if i else 0) + (walks[i, j - 1] if j else 0)
    reached = walks > 0
    assert walks[-1, -1] > 10**3
    ahead = np.zeros_like(reached)
    ahead[-1, -1] = True
    for i in range(cells - 1, -1, -1):
        for j in range(cells - 1, -1, -1):
            if free[i, j] and ((i + 1 < cells and ahead[i + 1, j]) or (j + 1 < cells and ahead[i, j + 1])):
                ahead[i, j] = True
    on_a_walk = reached & ahead
    place = np.arange(cells) + 0.5
    inside_a, inside_b = (place > a[1]) & (place < a[2]), (place > b[1]) & (place < b[2])
    own_a, own_b = (place > a[0]) & (place < a[3]), (place > b[0]) & (place < b[3])
    assert not (on_a_walk & inside_a[:, None] & ~own_b[None, :]).any()
    assert not (on_a_walk & inside_b[None, :] & ~own_a[:, None]).any()
    assert (on_a_walk & inside_a[:, None] & inside_b[None, :]).any()


def test_a_circle_is_named() -> None:
    rules = [
        after(0, 0.5, 1, 0.6, 1.0, "'a' waits before 'pick' for 'b' to be done with 'clear'"),
        after(1, 0.3, 0, 0.7, 1.0, "'b' waits before 'clear' for 'a' to be done with 'pick'"),
        after(2, 0.3, 0, 0.1, 1.0, "'c' is none of it"),
    ]
    with pytest.raises(
        InfeasibleError, match=r"for ever: 'a' waits .* 'clear'; 'b' waits .* 'pick' \(take one"
    ) as told:
        check_rules((1.0, 1.0, 1.0), rules)
    assert told.value.data["cycle"] == (0, 1)
    check_rules((1.0, 1.0, 1.0), rules[1:])
    check_rules((1.0, 1.0), together([0.2, 0.3, 0.4, 0.5], [0.6, 0.7, 0.8, 0.9]))


@given(st.integers(0, 10**6))
def test_circles_are_those_of_an_exhaustive_search(seed: int) -> None:
    generator = np.random.default_rng(seed)
    rules = []
    for _ in range(generator.integers(1, 6)):
        second, first = generator.permutation(3)[:2]
        p, e = generator.choice([0.25, 0.5, 0.75], 2)
        rules.append(after(int(second), float(p), int(first), float(e), 1.0, "rule"))
    open_places: list[tuple[int, ...]] = [(0, 0, 0)]
    seen: set[tuple[int, ...]] = set()
    while open_places:
        at = open_places.pop()
        if at in seen:
            continue
        seen.add(at)
        for i in range(3):
            to = at[i] + 1  # quarters; the step from p on asks for what the rule asks
            free = all(
                at[rule.arms[0]] >= 4 * rule.part_a[1]
                for rule in rules
                if rule.arms[1] == i and at[i] >= 4 * rule.part_b[0]
            )
            if to <= 4 and free:
                open_places.append((*at[:i], to, *at[i + 1 :]))
    if (4, 4, 4) in seen:
        check_rules((1.0, 1.0, 1.0), rules)
    else:
        with pytest.raises(InfeasibleError):
            check_rules((1.0, 1.0, 1.0), rules)


@pytest.fixture(scope="module")
def synchronised(there_and_back: CoordinationCell) -> CoordinationCell:
    """The second arm may go back only when the first has begun to stand: it must have waited for it."""
    one, other = (path.border for path in there_and_back.paths)  # type: ignore[attr-defined]
    rule = after(1, other[1], 0, one[3], 1.0, "'slave' may not stand before 'master' has stood")
    return replace(there_and_back, exclusions=(rule,))


@pytest.mark.parametrize("method", ["interval", "optimal", "delay", "offset"])
def test_plans_keep_to_rules(synchronised: CoordinationCell, there_and_back: CoordinationCell, method: str) -> None:
    plan = schedule(synchronised, method)
    (rule,) = synchronised.exclusions
    first, second = plan.trajectories
    assert second.last_time_at(rule.part_b[0]) >= first.time_at(rule.part_a[1])
    assert plan.certificate.rules_broken == ()
    assert plan.gap_percent > -0.1
    assert plan.precedence.limit(1, 0)[0] <= rule.part_b[0]
    broken = replace(plan, trajectories=schedule(there_and_back, "delay", order=(1, 0)).trajectories)
    assert broken.certificate.rules_broken == (rule.rule,)


def test_the_refused_order_is_told_by_its_rule(synchronised: CoordinationCell) -> None:
    with pytest.raises(InfeasibleError, match="'master' cannot wait at its start: 'slave' may not stand before"):
        schedule(synchronised, "delay", order=(1, 0))


def test_a_rule_may_make_it_impossible(synchronised: CoordinationCell) -> None:
    one, other = (path.border for path in synchronised.paths)  # type: ignore[attr-defined]
    against = after(0, one[1], 1, other[3], 1.0, "'master' may not stand before 'slave' has stood").swapped
    cell = replace(synchronised, exclusions=(*synchronised.exclusions, against))
    with pytest.raises(InfeasibleError, match="no timing at all keeps the arms apart and to their rules: 'slave' may"):
        schedule(cell, "optimal")


def test_what_another_has_to_wait_for_is_no_wait_of_ones_own(synchronised: CoordinationCell) -> None:
    """The first arm of a rule never passes behind the other one there, so its observation does not ask for it."""
    free = replace(synchronised, exclusions=())
    first, second = (synchronised.chart_behind(*pair).last_column for pair in ((1, 0), (0, 1)))
    assert (first == free.chart_between(1, 0).last_column).all()
    assert (second == synchronised.chart_between(0, 1).last_column).all()
    assert (second != free.chart_between(0, 1).last_column).any()
    assert free.chart_behind(0, 1) is free.chart_between(0, 1)

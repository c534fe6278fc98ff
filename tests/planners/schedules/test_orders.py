"""Orders of the arms: found where none is asked for."""

from __future__ import annotations

from itertools import permutations

import pytest

from armtempo.errors import InfeasibleError, InputError
from armtempo.planners import CoordinationCell, Schedule, generate_cell, load_cell, schedule
from armtempo.planners.schedules import SHAPED, SHIFTED
from armtempo.planners.schedules._orders import best_of, promising_orders


@pytest.fixture(scope="module")
def ring() -> CoordinationCell:
    """Of three arms, for which the order of the file is not the best."""
    return generate_cell("ring", 777, 0, arms=3).cell


def tried(cell: CoordinationCell, method: str) -> dict[tuple[int, ...], float]:
    out = {}
    for order in permutations(range(len(cell.arms))):
        try:
            out[order] = schedule(cell, method, order=order).makespan
        except InfeasibleError:
            continue
    return out


@pytest.mark.parametrize("method", SHIFTED)
def test_shifted_motions_are_in_the_best_order_there_is(ring: CoordinationCell, method: str) -> None:
    every = tried(ring, method)
    plan = schedule(ring, method)
    assert plan.makespan == pytest.approx(min(every.values()), rel=2e-6)
    assert plan.makespan == every[plan.order]
    assert plan.makespan == schedule(ring, method, order="best").makespan


@pytest.mark.parametrize("method", SHAPED)
def test_shaped_motions_are_in_the_order_of_the_file_unless_asked(ring: CoordinationCell, method: str) -> None:
    own = schedule(ring, method)
    assert own.order == (0, 1, 2)
    assert own.makespan == schedule(ring, method, order="file").makespan
    assert schedule(ring, method, order="best").makespan <= own.makespan


def test_orders_that_are_as_good_are_left_as_in_the_file() -> None:
    cell = load_cell("lee1991")  # both arms are alike
    assert schedule(cell, "delay").order == (0, 1)
    assert schedule(cell, "delay", order="file").order == (0, 1)


@pytest.mark.parametrize("order", ["ab", "worst", 3])
def test_other_words_are_no_order(order: object) -> None:
    with pytest.raises(InputError, match=r"must name each of the 2 arms once.*best or file"):
        schedule(load_cell("lee1991"), "delay", order=order)  # type: ignore[arg-type]


def test_the_first_refusal_is_told() -> None:
    def plan(order: tuple[int, ...]) -> Schedule:
        raise InfeasibleError(f"not {order}")

    with pytest.raises(InfeasibleError, match=r"not \(1, 0\)"):
        best_of(plan, [(1, 0), (0, 1)])


def test_shapes_are_tried_in_the_order_of_the_file_and_those_best_for_start_delays(ring: CoordinationCell) -> None:
    orders = promising_orders(ring)
    delays = tried(ring, "delay")
    assert orders[0] == (0, 1, 2)
    assert len(orders) == len(set(orders)) <= 7
    assert min(delays, key=delays.__getitem__) in orders

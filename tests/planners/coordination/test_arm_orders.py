"""Orders of the arms to try: all of few, of many the longest first and each arm elsewhere."""

from __future__ import annotations

from itertools import permutations

from armtempo.planners.coordination import arm_orders


def test_all_orders_of_few_arms() -> None:
    assert arm_orders([1.0, 3.0, 2.0], 3) == list(permutations(range(3)))


def test_of_many_the_own_order_the_longest_first_and_each_arm_elsewhere() -> None:
    times = [1.0, 6.0, 2.0, 5.0, 3.0, 4.0]
    orders = arm_orders(times, 5)
    assert orders[:2] == [(0, 1, 2, 3, 4, 5), (1, 3, 5, 4, 2, 0)]
    assert len(orders) == len(set(orders)) < 40
    assert all(sorted(order) == list(range(6)) for order in orders)
    assert (0, 1, 3, 5, 4, 2) in orders  # the shortest is taken to the front

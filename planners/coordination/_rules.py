"""Rules alone: whether arms that go as far as they let each other all arrive, whatever is in the way besides."""

from __future__ import annotations

from collections.abc import Sequence

from armtempo.errors import InfeasibleError
from armtempo.planners.charts import Exclusion


def check_rules(lengths: Sequence[float], rules: Sequence[Exclusion]) -> None:
    """Check that arms on paths of these lengths do not wait for each other in a circle.

    Only rules of the form *not before the other has got there* count (see ``after``): they have one side. Progress
    never falls, so where every arm goes as far as the others' places let it, over and over, is the farthest that any
    execution gets.

    Raises:
        InfeasibleError: They do; the message has the rules of the circle, ``cycle`` its arms.
    """
    waits = [rule for rule in rules if _is_order(rule, lengths)]
    lam, moved = [0.0] * len(lengths), True
    while moved:
        moved = False
        for i, length in enumerate(lengths):
            reach = min([length, *(rule.part_b[0] for rule in _holding(waits, i, lam))])
            if reach > lam[i]:
                lam[i], moved = reach, True
    stuck = [i for i, length in enumerate(lengths) if lam[i] < length]
    if not stuck:
        return
    chain: list[int] = []
    held: list[Exclusion] = []
    at = stuck[0]
    while at not in chain:  # who is stuck is held by one that is stuck
        chain.append(at)
        held.append(min(_holding(waits, at, lam), key=lambda rule: rule.part_b[0]))
        at = held[-1].arms[0]
    begin = chain.index(at)
    circle = "; ".join(rule.rule for rule in held[begin:])
    raise InfeasibleError(
        f"arms wait for each other for ever: {circle}",
        remedy="take one of these rules back, or wait for an earlier step ('arrived' instead of 'done')",
        cycle=tuple(chain[begin:]),
        reason="circle",
    )


def _is_order(rule: Exclusion, lengths: Sequence[float]) -> bool:
    return rule.part_a[0] <= 0.0 and rule.part_b[1] >= lengths[rule.arms[1]]


def _holding(waits: Sequence[Exclusion], i: int, lam: Sequence[float]) -> list[Exclusion]:
    """The rules that hold arm i while the others are at ``lam``."""
    return [rule for rule in waits if rule.arms[1] == i and lam[rule.arms[0]] < rule.part_a[1]]

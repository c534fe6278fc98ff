"""Orders of the arms, by priority, that are worth trying."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import permutations


def arm_orders(times: Sequence[float], all_up_to: int) -> list[tuple[int, ...]]:
    """Orders of arms that need so long [s] alone, that of their numbers first.

    All of them of ``all_up_to`` arms or fewer; of more the longest first, and then each arm taken to every other place.
    """
    arms = range(len(times))
    if len(arms) <= all_up_to:
        return list(permutations(arms))
    longest = sorted(arms, key=lambda i: -times[i])
    found = [tuple(arms), tuple(longest)]
    for arm in arms:
        others = [other for other in longest if other != arm]
        found += [(*others[:place], arm, *others[place:]) for place in arms]
    return list(dict.fromkeys(found))

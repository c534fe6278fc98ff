"""Policies that run every arm at full speed and decide who passes first on the way; the shield does what they say.

``search``        the best order of every collision region for itself, by branch and bound (``OrderSearch``)
``search+stop``   the same, and an arm that stands is expected to stand for a while: as long as those seen so far did
``search+hold``   the same, and arms at rest that would have to stop on their way hold back where they are, for as long
                  as is quickest when it is run ahead under the shield, while no arm stands
``longest-path``  the arms in one order, the one whose longest chain of waits is the shortest
``reorder``       that order or the one that holds, with single regions turned while that pays
``rollout``       as ``search+hold``, and the best orders are run ahead, too

Each decides when an arm stops or goes, else every ``DECIDE_EVERY`` control periods, and keeps the order that holds
unless another is better by ``BETTER_SHARE`` of the time that is left.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import final

import numpy as np

from armtempo.agents.policies import Actions, Observations, action_size, to_action
from armtempo.arrays import Floats
from armtempo.envs import CoordinationEnv, EpisodeShield
from armtempo.envs.coordination.shield import BETTER_SHARE, DECIDE_EVERY
from armtempo.errors import InputError
from armtempo.planners import CoordinationCell
from armtempo.planners.coordination import Orders, OrderSearch

RUN_BETTER_SHARE = 0.005  # instead of ``BETTER_SHARE``, of orders that were run ahead: exact but for what nobody knows
RUNS = 3  # orders besides the one that holds that are run ahead, at most

Candidates = Callable[[OrderSearch, Floats, Floats, Orders], tuple[Orders, Floats]]
"""From a search, places, times to go and the orders that hold: orders (K, R), prices (K,) [s], the cheapest first."""


def _best(search: OrderSearch, lam: Floats, to_go: Floats, _: Orders) -> tuple[Orders, Floats]:
    return search.best(lam, to_go)


def _best_ranks(search: OrderSearch, lam: Floats, to_go: Floats, _: Orders) -> tuple[Orders, Floats]:
    return search.best_ranks(lam, to_go)


def _turned(search: OrderSearch, lam: Floats, to_go: Floats, held: Orders) -> tuple[Orders, Floats]:
    return search.turned(lam, to_go, (held, *search.best_ranks(lam, to_go)[0][:1]))


@dataclass(frozen=True, kw_only=True)
class _Rule:
    """How orders are decided.

    Attributes:
        candidates: Where they come from; None: from the shield's own search.
        expects: That an arm that stands goes on standing.
        runs_ahead: Candidates are run ahead; else their prices decide.
        holds: Arms at rest may hold back.
    """

    candidates: Candidates | None = None
    expects: bool = False
    runs_ahead: bool = False
    holds: bool = False


_RULES: Mapping[str, _Rule] = {
    "search": _Rule(),
    "search+stop": _Rule(expects=True),
    "search+hold": _Rule(expects=True, holds=True),
    "longest-path": _Rule(candidates=_best_ranks),
    "reorder": _Rule(candidates=_turned),
    "rollout": _Rule(candidates=_best, expects=True, runs_ahead=True, holds=True),
}
ORDER_POLICIES = tuple(_RULES)


@final
class OrderPolicy:
    """Full speed, in orders that are decided on the way; see the module.

    Args:
        name: One of ``ORDER_POLICIES``.
        cell: Where it acts, in environments with a shield.
    """

    def __init__(self, name: str, cell: CoordinationCell) -> None:
        self._name, self._rule, self._arms = name, _RULES[name], len(cell.arms)
        self._search: OrderSearch | None = None
        self.reset()

    def reset(self, seed: int | None = None) -> None:
        """Forget the episode."""
        self._periods: int | None = None
        self._held_until = np.zeros(self._arms)
        self._decided_at = np.full(self._arms, np.nan)

    def act(self, observations: Observations, env: CoordinationEnv) -> Actions:
        """Full speed or rest, for those who act; the shield of ``env`` is asked for another order where that pays.

        Raises:
            InputError: The environment has no shield.
        """
        shield = env.shield
        if shield is None:
            raise InputError(
                f"{self._name} decides whom a shield lets pass", remedy="make the environment with shield=True"
            )
        shield.watch()
        if shield.stands_changed or self._periods is None or self._periods >= DECIDE_EVERY:
            self._decide(env, shield)
            self._periods = 0
        self._periods += 1
        commands = np.where(env.simulation.time < self._held_until - 0.5 * env.cell.physics_tick, 0.0, 1.0)
        return {
            agent: to_action(float(commands[int(agent.rsplit("_", 1)[1])]), action_size(env, agent))
            for agent in observations
        }

    def _decide(self, env: CoordinationEnv, shield: EpisodeShield) -> None:
        first = self._periods is None
        if self._rule.candidates is None:
            shield.search(expects=self._rule.expects, first=first)
        else:
            self._ask(env, shield, self._rule.candidates, first)
        here = env.simulation.lam.copy()
        if self._rule.holds and not (np.array_equal(here, self._decided_at) and not shield.stands_changed):
            # While nobody has moved, what was decided holds: decided anew again and again, they would wait for ever.
            self._decided_at, self._held_until = here, np.zeros(self._arms)
            if not shield.stands.any():  # where an arm stands, who holds back may be the next
                self._held_until = env.simulation.time + shield.hold_back()

    def _ask(self, env: CoordinationEnv, shield: EpisodeShield, candidates: Candidates, first: bool) -> None:
        """Ask for the best of the candidates, if it is enough better than the order that holds."""
        if self._search is None or self._search.regions is not shield.regions:
            self._search = OrderSearch(shield.regions, env.cell.planes)
        search, lam, mu, held = self._search, env.simulation.lam, env.simulation.mu, shield.orders
        stands = shield.still() if self._rule.expects else np.zeros(self._arms)
        to_go = search.times_to_go(lam, mu) + stands
        found, prices = candidates(search, lam, to_go, held)
        if self._rule.runs_ahead:
            shield.ask(self._quickest(shield, found, stands, first))
            return
        price = search.price(lam, to_go, held)
        enough = price if first else (1.0 - BETTER_SHARE) * price
        for orders, candidate in zip(found, prices, strict=True):
            if candidate >= enough:
                return
            kept = shield.ask(orders)
            if search.price(lam, to_go, kept) <= candidate + 1e-9:
                return
            shield.ask(held)

    def _quickest(self, shield: EpisodeShield, candidates: Orders, stands: Floats, first: bool) -> Orders:
        """The order that is quickest when run ahead: the one that holds, or one of the first candidates."""
        held = shield.orders
        best = shield.run_ahead(held, stands=stands)
        enough = best.makespan if first else (1.0 - RUN_BETTER_SHARE) * best.makespan
        others = [orders for orders in candidates if (orders != held).any()]
        for wanted in others[:RUNS]:
            found = shield.run_ahead(wanted, stands=stands, horizon=enough)
            if found.makespan < enough:
                best, enough = found, found.makespan
        return best.orders

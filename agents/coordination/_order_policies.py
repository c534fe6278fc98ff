"""Policies that run every arm at full speed and decide who passes first on the way; the shield does what they say.

``search``        the best order of every collision region for itself, by branch and bound (``OrderSearch``)
``search+stop``   the same, and an arm that stands is expected to stand for a while: as long as those seen so far did
``longest-path``  the arms in one order, the one whose longest chain of waits is the shortest
``reorder``       that order or the one that holds, with single regions turned while that pays
``rollout``       the best orders of ``search+stop``, each run ahead under the shield; and arms at rest that would have
                  to stop on their way hold back where they are, if that is quicker, until a stop was seen

Each decides when an arm stops or goes, else every ``DECIDE_EVERY`` control periods, and keeps the order that holds
unless another is better by ``BETTER_SHARE`` of the time that is left.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import final

import numpy as np

from armtempo.agents.coordination._stops_seen import StopsSeen
from armtempo.agents.policies import Actions, Observations, action_size, to_action
from armtempo.arrays import Floats
from armtempo.envs import CoordinationEnv, EpisodeShield
from armtempo.errors import InputError
from armtempo.planners import CoordinationCell
from armtempo.planners.coordination import Orders, OrderSearch

DECIDE_EVERY = 10  # control periods
BETTER_SHARE = 0.02
RUN_BETTER_SHARE = 0.005  # likewise of orders that were run ahead, which is exact but for what nobody knows yet
RUNS = 7  # of a decision, at most: orders run ahead
HOLD_SHARES = (0.9, 0.6, 0.3)  # of the time that arms at rest will lose on their way, for which they hold back instead

Candidates = Callable[[OrderSearch, Floats, Floats, Orders], tuple[Orders, Floats]]
"""From a search, places, times to go and the orders that hold: orders (K, R), prices (K,) [s], the cheapest first."""

_CANDIDATES: Mapping[str, Candidates] = {
    "search": lambda search, lam, to_go, _: search.best(lam, to_go),
    "search+stop": lambda search, lam, to_go, _: search.best(lam, to_go),
    "longest-path": lambda search, lam, to_go, _: search.best_ranks(lam, to_go),
    "reorder": lambda search, lam, to_go, held: search.turned(
        lam, to_go, (held, *search.best_ranks(lam, to_go)[0][:1])
    ),
    "rollout": lambda search, lam, to_go, _: search.best(lam, to_go),
}
EXPECTING = ("search+stop", "rollout")  # that an arm that stands goes on standing
ORDER_POLICIES = tuple(_CANDIDATES)


@final
class OrderPolicy:
    """Full speed, in orders that are decided on the way; see the module.

    Args:
        name: One of ``ORDER_POLICIES``.
        cell: Where it acts, in environments with a shield.
    """

    def __init__(self, name: str, cell: CoordinationCell) -> None:
        self._name, self._candidates = name, _CANDIDATES[name]
        self._stops = StopsSeen(cell)
        self._search: OrderSearch | None = None
        self.reset()

    def reset(self, seed: int | None = None) -> None:
        """Forget the episode."""
        self._stops.reset()
        self._periods: int | None = None
        self._held_until = np.zeros(len(self._stops.stood))

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
        changed = self._stops.look(env, shield)
        if changed or self._periods is None or self._periods >= DECIDE_EVERY:
            self._decide(env, shield)
            self._periods = 0
        self._periods += 1
        commands = np.where(env.simulation.time < self._held_until - 0.5 * env.cell.physics_tick, 0.0, 1.0)
        self._stops.sent(env, commands)
        return {
            agent: to_action(float(commands[int(agent.rsplit("_", 1)[1])]), action_size(env, agent))
            for agent in observations
        }

    def _decide(self, env: CoordinationEnv, shield: EpisodeShield) -> None:
        if self._search is None or self._search.regions is not shield.regions:
            self._search = OrderSearch(shield.regions, env.cell.planes)
        search, lam = self._search, env.simulation.lam
        to_go = search.times_to_go(lam, env.simulation.mu)
        if self._name in EXPECTING:
            to_go += self._stops.still(env)
        held = shield.orders
        candidates = zip(*self._candidates(search, lam, to_go, held), strict=True)
        if self._name == "rollout":
            self._run_ahead(env, shield, [orders for orders, _ in candidates], to_go)
            return
        price = search.price(lam, to_go, held)
        enough = price if self._periods is None else (1.0 - BETTER_SHARE) * price
        for orders, candidate in candidates:
            if candidate >= enough:
                return
            kept = shield.ask(orders)
            if search.price(lam, to_go, kept) <= candidate + 1e-9:
                return
            shield.ask(held)

    def _run_ahead(self, env: CoordinationEnv, shield: EpisodeShield, candidates: list[Orders], to_go: Floats) -> None:
        """Ask for the order that is quickest when run ahead, and hold arms at rest back where that is quicker still."""
        stands = self._stops.still(env)
        best = shield.run_ahead(shield.orders, stands=stands)
        tried, share = {best.orders.tobytes()}, 0.0 if self._periods is None else RUN_BETTER_SHARE
        enough = (1.0 - share) * best.makespan
        for wanted in candidates:
            if len(tried) >= RUNS - len(HOLD_SHARES):
                break
            found = shield.run_ahead(wanted, stands=stands, horizon=enough)
            if found.makespan < enough:
                best, enough = found, found.makespan
            tried.add(found.orders.tobytes())
        shield.ask(best.orders)
        self._held_until[:] = 0.0
        if self._stops.rests or self._stops.stood.any():
            return  # where arms stop, who holds back is late for what nobody foresees: it costs 1 %
        late = np.where(env.simulation.mu == 0.0, best.arrival - to_go, 0.0)
        if late.max() > env.cell.control_period:
            for holds in (share * late for share in HOLD_SHARES):
                found = shield.run_ahead(best.orders, stands=np.maximum(stands, holds), horizon=best.makespan)
                if found.makespan < best.makespan:
                    best = found
                    self._held_until = env.simulation.time + holds

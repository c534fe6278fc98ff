"""Policies that run every arm at full speed and decide who passes first on the way; the shield does what they say.

``search``        the best order of every collision region for itself, by branch and bound (``OrderSearch``)
``search+stop``   the same, and an arm that stands is expected to stand for a while: as long as those seen so far did
``longest-path``  the arms in one order, the one whose longest chain of waits is the shortest
``reorder``       that order or the one that holds, with single regions turned while that pays

Each decides when an arm stops or goes, else every ``DECIDE_EVERY`` control periods, and keeps the order that holds
unless another is better by ``BETTER_SHARE`` of the time that is left. Where the references of the arms are is known to
whoever commands them; that an arm stands is seen from its not having done what it was told.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import final

import numpy as np

from armtempo.agents.policies import Actions, Observations, action_size, to_action
from armtempo.arrays import Bools, Floats
from armtempo.envs import CoordinationEnv, EpisodeShield
from armtempo.errors import InputError
from armtempo.planners import CoordinationCell
from armtempo.planners.coordination import Orders, OrderSearch

DECIDE_EVERY = 10  # control periods
BETTER_SHARE = 0.02
EXPECTED_REST_SHARE = 0.3  # of the mean minimum time: how long a stop lasts, before one was seen
BEHIND_SHARE = 1e-6  # of a path: an arm that is so far behind where it was sent is disturbed

Candidates = Callable[[OrderSearch, Floats, Floats, Orders], tuple[Orders, Floats]]
"""From a search, places, times to go and the orders that hold: orders (K, R), prices (K,) [s], the cheapest first."""

_CANDIDATES: Mapping[str, Candidates] = {
    "search": lambda search, lam, to_go, _: search.best(lam, to_go),
    "search+stop": lambda search, lam, to_go, _: search.best(lam, to_go),
    "longest-path": lambda search, lam, to_go, _: search.best_ranks(lam, to_go),
    "reorder": lambda search, lam, to_go, held: search.turned(
        lam, to_go, (held, *search.best_ranks(lam, to_go)[0][:1])
    ),
}
ORDER_POLICIES = tuple(_CANDIDATES)


@final
class OrderPolicy:
    """Full speed, in orders that are decided on the way; see the module.

    Args:
        name: One of ``ORDER_POLICIES``.
        cell: Where it acts, in environments with a shield.
    """

    def __init__(self, name: str, cell: CoordinationCell) -> None:
        self._name, self._candidates, self._expects = name, _CANDIDATES[name], name == "search+stop"
        self._rest_expected = EXPECTED_REST_SHARE * float(np.mean([motion.duration for motion in cell.fastest]))
        self._arms = len(cell.arms)
        self._search: OrderSearch | None = None
        self.reset()

    def reset(self, seed: int | None = None) -> None:
        """Forget the episode."""
        self._before: tuple[Floats, Floats, float] | None = None
        self._stood, self._since = np.zeros(self._arms, dtype=np.bool_), np.zeros(self._arms)
        self._rests: list[float] = []
        self._periods = 0

    def act(self, observations: Observations, env: CoordinationEnv) -> Actions:
        """Full speed, for those who act; the shield of ``env`` is asked for another order where that pays.

        Raises:
            InputError: The environment has no shield.
        """
        shield, simulation = env.shield, env.simulation
        if shield is None:
            raise InputError(
                f"{self._name} decides whom a shield lets pass", remedy="make the environment with shield=True"
            )
        lam, mu, now = simulation.lam.copy(), simulation.mu.copy(), float(simulation.time)
        stands = self._stands(env, shield, lam, mu)
        if self._before is None or self._periods >= DECIDE_EVERY or (stands != self._stood).any():
            self._note(stands, now)
            self._decide(env, shield, lam, mu, now)
            self._periods = 0
        self._before = lam, mu, simulation.clock
        self._periods += 1
        return {agent: to_action(1.0, action_size(env, agent)) for agent in observations}

    def _stands(self, env: CoordinationEnv, shield: EpisodeShield, lam: Floats, mu: Floats) -> Bools:
        """(A,) arms that do as if they had been told to brake."""
        out = np.zeros(len(lam), dtype=np.bool_)
        if self._before is None:
            return out
        last_lam, last_mu, clock = self._before
        admitted = 1.0 - shield.change
        for i, plane in enumerate(env.cell.planes):
            if lam[i] >= plane.length or admitted[i] <= 0.0:
                out[i] = self._stood[i] and lam[i] < plane.length
                continue
            near = BEHIND_SHARE * plane.length
            where = (float(last_lam[i]), float(last_mu[i]))
            time, mode = clock * env.cell.control_period, env.options.mode
            if lam[i] < plane.advance(*where, float(admitted[i]), time, mode=mode)[0] - near:
                out[i] = lam[i] <= plane.advance(*where, 0.0, time, mode=mode)[0] + near
        return out

    def _note(self, stands: Bools, now: float) -> None:
        """Who stands since when, and how long those stood who go again."""
        self._rests += list(now - self._since[self._stood & ~stands])
        self._since[stands & ~self._stood] = now
        self._stood = stands

    def _decide(self, env: CoordinationEnv, shield: EpisodeShield, lam: Floats, mu: Floats, now: float) -> None:
        if self._search is None or self._search.regions is not shield.regions:
            self._search = OrderSearch(shield.regions, env.cell.planes)
        to_go = self._search.times_to_go(lam, mu)
        if self._expects:
            rest = (self._rest_expected + sum(self._rests)) / (1 + len(self._rests))
            to_go += np.where(self._stood, np.maximum(rest - (now - self._since), env.cell.control_period), 0.0)
        held = shield.orders
        price = self._search.price(lam, to_go, held)
        enough = price if self._before is None else (1.0 - BETTER_SHARE) * price
        for orders, candidate in zip(*self._candidates(self._search, lam, to_go, held), strict=True):
            if candidate >= enough:
                return
            kept = shield.ask(orders)
            if self._search.price(lam, to_go, kept) <= candidate + 1e-9:
                return
            shield.ask(held)

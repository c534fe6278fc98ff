"""Many episodes of one cell at once, without physics: arrays in, arrays out, the bits of one environment at a time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Unpack, final

import numpy as np
from gymnasium.utils import seeding
from numpy.typing import ArrayLike

from armtempo.arrays import Bools, Floats, Ints
from armtempo.envs.common import (
    Chunks,
    check_names,
    count_of,
    ideal_options,
    key_from,
    spread,
)
from armtempo.envs.coordination._episode import time_limit
from armtempo.envs.coordination.graph import GraphView
from armtempo.envs.coordination.shield import (
    NOBODY_WAITS,
    OrderKeeper,
    Orders,
    OrderWork,
    admit_all,
    asked_orders,
    draw_shielded,
    foreseen,
    hold_back_all,
    keep_orders,
    look_all,
    note_all,
    shield_tables,
    shield_work,
    stops_seen,
)
from armtempo.envs.coordination.world import (
    OTHER,
    OTHERS,
    OWN,
    SIZE,
    CoordinationKeywords,
    CoordinationOptions,
    Draws,
    World,
    as_noise,
    check_places,
    describe,
    draw_all,
    ideal_world,
    make_draws,
    make_episodes,
    observe,
    run_periods,
    scratch_for,
    stops_max,
    uncertain_arms,
)
from armtempo.errors import InfeasibleError, InputError
from armtempo.planners import CoordinationCell, Precedence
from armtempo.planners.cells import as_cell
from armtempo.planners.coordination import PassingOrders
from armtempo.state import Stateful

REWARDS = ("own", "team")


@final
class BatchSimulation(Stateful):
    """E episodes of a cell at once (A arms), as environments with ``physics="ideal"`` run them, to the last bit.

    Args:
        cell: Name of a bundled cell, a cell file, or a built ``CoordinationCell``.
        episodes: How many, E.
        reward: ``own``: every arm its own, as ``CoordinationEnv`` has it. ``team``: the mean progress of all minus the
            time until the last has arrived, in units of the sequential time, minus (2 + mean share not covered) on a
            collision; the same for every arm. Without a collision it sums up to the path covered minus
            makespan / sequential time.
        scripted: Arms whose commands the shield does not change.
        plan: The precedence that those obey; None: they pass first everywhere.
        threads: How many share the episodes.
        **options: As ``CoordinationOptions`` has them; ``physics`` is ``ideal``.

    Attributes:
        lam, mu, arrival: (E, A) places, path speeds, instants of arrival (nan before).
        ticks: (E,) since the start of each episode.
        violated: (E,) whether two arms came closer than ``d_min``.
        observations: (E, A, 21) float32.
        graph: What all arms see with ``observation="graph"``: its ``graphs`` have (E, ...) arrays; else None.
        rewards: (E, A) of the last step.
        terminated, truncated: (E, A).
        undisturbed: (E,) bool, to be set: whose next episodes draw no disturbance, no lateness and no start phase.
        shield_cut: (E, A) by how much the shield cut the commands of the last step.
        shield_changed, shield_change: (E, A) how many commands of the episode the shield cut, and by how much in all.

    All of them are written in place: copy what is to be kept.
    """

    changing = (
        "_episodes", "observations", "rewards", "terminated", "truncated", "undisturbed", "_orders", "_asked",
        "_priority", "_uncertain", "shield_cut", "shield_changed", "shield_change", "_seen",
    )  # fmt: skip

    def __init__(
        self,
        cell: CoordinationCell | str | Path,
        episodes: int,
        *,
        reward: str = "own",
        scripted: Sequence[int] = (),
        plan: Precedence | None = None,
        threads: int = 1,
        **options: Unpack[CoordinationKeywords],
    ) -> None:
        chosen = ideal_options(CoordinationOptions, options, BatchSimulation)
        check_names(("reward", reward, REWARDS))
        self.cell, self.mode = as_cell(cell, CoordinationCell), chosen.mode
        self.reference_time, self.time_limit = time_limit(self.cell, chosen.max_episode_s)
        E, A = count_of(episodes, "episodes"), len(self.cell.arms)
        self._draws = make_draws(self.cell, chosen.disturbance, chosen.start_phase, chosen.master_late_s)
        self._no_draws = make_draws(self.cell)
        self._noise, self._team = as_noise(chosen.observation_noise), reward == "team"
        self._world: World = ideal_world(self.cell, self.mode)
        self._d_min, self._tick = self.cell.d_min, self.cell.physics_tick
        self._episodes = make_episodes(E, A, stops_max(self._draws))
        self.lam, self.mu, self.arrival = self._episodes.lam, self._episodes.mu, self._episodes.arrival
        self.ticks, self.violated = self._episodes.ticks, self._episodes.violated
        self.observations = np.zeros((E, A, SIZE), dtype=np.float32)
        self.rewards = np.zeros((E, A))
        self.terminated, self.truncated = np.zeros((E, A), dtype=np.bool_), np.zeros((E, A), dtype=np.bool_)
        self._lengths = np.array([path.length for path in self.cell.paths])
        self._all = np.ones(E, dtype=np.bool_)
        self.undisturbed = np.zeros(E, dtype=np.bool_)
        self._chunks = Chunks(E, threads)
        sizes = [last - first for first, last in self._chunks.bounds]
        self._scratch = [scratch_for(size, A, self.cell.ticks_per_period) for size in sizes]
        self._shield = chosen.shield
        self._tables = self._works = self._regions = None
        self._seen = stops_seen(E, A)
        self._keeper: OrderKeeper | None = None
        self.graph: GraphView | None = None
        self._order_works: list[OrderWork] = []
        if self._shield:
            self._tables = shield_tables(
                self.cell, self._world, scripted=scripted, plan=plan, tube_m=chosen.shield_tube_m
            )
            regions, self._regions = len(self._tables.region), self.cell.passing_orders(2.0 * chosen.shield_tube_m)
            self._works = [shield_work(self.cell, regions) for _ in sizes]
            self._watch(self._regions, chosen, len(sizes))
        self._orders = np.zeros((E, len(self._tables.region) if self._tables is not None else 0), dtype=np.int8)
        self._asked, self._priority = np.full_like(self._orders, NOBODY_WAITS), np.zeros((E, A))
        self._scripted = np.isin(np.arange(A), np.asarray(scripted, dtype=np.int64))
        self._uncertain, self._admitted = np.zeros((E, A), dtype=np.bool_), np.zeros((E, A))
        self.shield_cut = np.zeros((E, A))
        self.shield_changed, self.shield_change = np.zeros((E, A), dtype=np.int64), np.zeros((E, A))
        self.seed(None)
        self.reset()

    def _watch(self, regions: PassingOrders, chosen: CoordinationOptions, threads: int) -> None:
        """See who stands, where an observation or an order depends on it."""
        keeper = OrderKeeper(self.cell, regions, self._seen, chosen.orders)
        if keeper.decides or chosen.observation == "graph":
            self._keeper, self._order_works = keeper, [keeper.work() for _ in range(threads)]
        if chosen.observation == "graph":
            self.graph = GraphView(self.cell, keeper)

    @property
    def episodes(self) -> int:
        """E."""
        return len(self.ticks)

    @property
    def arms(self) -> int:
        """A."""
        return len(self._lengths)

    @property
    def time(self) -> Floats:
        """(E,) instants [s]."""
        return np.asarray(self.ticks * self._tick, dtype=np.float64)

    @property
    def numbers(self) -> Ints:
        """(E,) which episode each is on, from 0."""
        return self._episodes.number

    @property
    def steps(self) -> Ints:
        """(E,) control periods since the start of each episode."""
        return self._episodes.steps

    @property
    def drawn(self) -> dict[str, Floats]:
        """What the episodes drew: late_s, speed (E, A), stops_s (E, A, S, 2); new arrays."""
        own = self._episodes
        return {"late_s": own.late.copy(), "speed": own.speed.copy(), "stops_s": own.stops.copy()}

    @property
    def stands(self) -> Bools:
        """(E, A) arms that are seen to stand though they were sent on; nobody where nobody watches."""
        return np.zeros(self.lam.shape, dtype=np.bool_) if self._keeper is None else self._keeper.seen.stands.copy()

    def check_state(self, state: Mapping[str, Any]) -> None:
        """Raise InputError for a state with arms off their paths, or orders that there are not, too."""
        super().check_state(state)
        check_places(state, self._lengths)
        if not all(np.isin(state[name], (0, 1, NOBODY_WAITS)).all() for name in ("orders", "asked")):
            raise InputError("the state's orders are none", remedy="give what get_state returned")

    def _go_on(self, state: Mapping[str, Any]) -> None:
        super()._go_on(state)
        if self.graph is not None:
            every = self._all
            self.graph.fill(self._world, self._episodes, 0, len(every), every, self._orders, self._order_works[0])

    def describe(self, e: int) -> dict[str, Any]:
        """What episode e drew, as the environments' infos have it; right after its reset."""
        return describe(self._episodes, e, self._lengths)

    def seed(self, seed: int | Sequence[int | None] | None, mask: Bools | None = None) -> None:
        """New keys: episode e gets those of an environment with seed ``seed + e``, or of a sequence (E,).

        Episodes are counted anew: reset them next. ``mask`` (E,): only these.
        """
        for e, one in enumerate(spread(seed, self.episodes)):
            if mask is not None and not mask[e]:
                continue
            generator = seeding.np_random(one)[0]
            self._episodes.key[e], self._episodes.number[e] = key_from(generator), -1

    def reset(self, mask: Bools | None = None, master_late_s: float | None = None) -> None:
        """Begin new episodes, all of them or those of ``mask`` (E,); ``master_late_s`` [s] instead of what is drawn."""
        active = self._all if mask is None else np.asarray(mask, dtype=np.bool_)
        if active.shape != self._all.shape:
            raise InputError(f"mask has shape {active.shape}", remedy=f"give ({self.episodes},)")
        self._episodes.number[active] += 1
        late = -1.0 if master_late_s is None else float(master_late_s)
        for draws, drawn in ((self._draws, active & ~self.undisturbed), (self._no_draws, active & self.undisturbed)):
            if drawn.any():
                self._draw(draws, drawn, late)
        self.terminated[active], self.truncated[active], self.rewards[active] = False, False, 0.0
        observe(
            self._world, self._episodes, 0, self.episodes, active, self._noise, OTHERS, len(OWN), len(OTHER),
            self._scratch[0], self.observations,
        )  # fmt: skip
        if self._keeper is not None:
            self._keeper.forget(active)
            self._look(0, 0, self.episodes, active)

    def _look(self, k: int, first: int, last: int, active: Bools) -> None:
        """See who stands in the active ones of episodes first..last - 1, decide their orders, and show them."""
        keeper, tables, works = self._keeper, self._tables, self._works
        if keeper is None or tables is None or works is None:
            return
        look_all(
            self._world, tables, keeper.prices, keeper.seen, self._episodes, first, last, active, keeper.decides,
            keeper.expects(), self._scripted, self._uncertain, self.cell.ticks_per_period, self._orders, self._asked,
            self._order_works[k], works[k],
        )  # fmt: skip
        if self.graph is not None:
            self.graph.fill(self._world, self._episodes, first, last, active, self._orders, self._order_works[k])

    def _draw(self, draws: Draws, active: Bools, late: float) -> None:
        if self._tables is None or self._works is None:
            draw_all(self._world, draws, self._episodes, active, late)
            return
        failed = draw_shielded(
            self._world, draws, self._tables, self._episodes, active, late, self._scripted, self._orders, self._works[0]
        )
        if failed >= 0:
            remedy = "let the other arms follow a plan, others='optimal'"
            raise InfeasibleError(
                f"the shield finds no passing order in which all arms of cell {self.cell.name!r} arrive",
                remedy=remedy if self._scripted.any() else "start the arms elsewhere",
            )
        self._asked[active], self._priority[active] = NOBODY_WAITS, 0.0
        self._uncertain[active] = uncertain_arms(self._episodes)[active]
        self.shield_changed[active], self.shield_change[active] = 0, 0.0

    @property
    def orders(self) -> Orders:
        """(E, R) who passes first in each region now, see ``Shield``; a new array. R is 0 without a shield."""
        return self._orders.copy()

    def ask(self, wanted: Precedence | ArrayLike, mask: Bools | None = None) -> Orders:
        """Keep to an order in all episodes, or those of ``mask`` (E,), as ``EpisodeShield.ask``; ``orders`` (E, R).

        Raises:
            InputError: The order is not of these arms or regions, or there is no shield.
        """
        if self._tables is None or self._works is None or self._regions is None:
            raise InputError("episodes without a shield keep no order", remedy="make them with shield=True")
        asked = asked_orders(self._regions, wanted)
        for e in np.flatnonzero(self._all if mask is None else mask):
            keep_orders(
                self._world, self._tables, self._orders[e], asked, self.lam[e], self.mu[e], self._scripted,
                self._uncertain[e], self.cell.ticks_per_period, self._asked[e], self._works[0],
            )  # fmt: skip
        return self.orders

    def hold_back(self, mask: Bools | None = None) -> Floats:
        """(E, A) as ``EpisodeShield.hold_back``, of all episodes or those of ``mask`` (E,); others 0.

        Raises:
            InputError: Nobody watches the episodes.
        """
        keeper, tables, works = self._keeper, self._tables, self._works
        if keeper is None or tables is None or works is None:
            raise InputError("nobody watches these episodes", remedy='make them with observation="graph"')
        holds, chosen = np.zeros(self.lam.shape), self._all if mask is None else mask
        longest = foreseen(self.cell)

        def part(k: int, first: int, last: int) -> None:
            hold_back_all(
                self._world, tables, keeper.prices, keeper.seen, self._episodes, first, last, chosen, keeper.expected,
                self._scripted, self._uncertain, self.cell.ticks_per_period, self._orders, longest, holds,
                self._order_works[k], works[k],
            )  # fmt: skip

        self._chunks.run(part)
        return holds

    def step(self, commands: Floats, active: Bools | None = None, priority: Floats | None = None) -> None:
        """Run one control period under ``commands`` (E, A) in [0, 1]; episodes that are not ``active`` stand still.

        ``priority`` (E, A): as ``EpisodeShield.prefer``; arms that have arrived keep theirs.
        Go on only with episodes that are not over: no violation, not truncated, somebody still to arrive.
        """
        commands = np.ascontiguousarray(commands, dtype=np.float64)
        if commands.shape != self.lam.shape:
            raise InputError(f"commands have shape {commands.shape}", remedy=f"give {self.lam.shape}")
        active = self._all if active is None else active
        if priority is not None:
            given = active[:, None] & ~self.terminated & ~np.isnan(priority)
            self._priority[given] = priority[given]

        def part(k: int, first: int, last: int) -> None:
            asked = commands
            if self._tables is not None and self._works is not None:
                admit_all(
                    self._world, self._tables, self._episodes, first, last, active, self._orders, self._asked,
                    self._priority, self._scripted, self._uncertain, self.cell.ticks_per_period, commands,
                    self._admitted, self._works[k],
                )  # fmt: skip
                asked = self._admitted
            if self._keeper is not None:
                note_all(self._keeper.seen, self._episodes, first, last, active, asked)
            run_periods(
                self._world, self._episodes, first, last, active, asked, self._d_min, self.reference_time,
                self.time_limit, self._team, self._noise, OTHERS, len(OWN), len(OTHER), self._scratch[k],
                self.observations, self.rewards, self.terminated, self.truncated,
            )  # fmt: skip
            self._look(k, first, last, active)

        self._chunks.run(part)
        if self._shield:
            self.shield_cut[:] = np.where(active[:, None], commands - self._admitted, 0.0)
            self.shield_changed += self.shield_cut != 0.0
            self.shield_change += self.shield_cut

    def close(self) -> None:
        """End the threads; may be called twice."""
        self._chunks.close()

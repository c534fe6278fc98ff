"""The shield of one environment: lets through the largest commands that can neither collide nor end in a deadlock."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from itertools import combinations, permutations
from typing import NamedTuple, final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armtempo.arrays import Floats
from armtempo.envs.common import is_number
from armtempo.envs.coordination.shield._admission import admit
from armtempo.envs.coordination.shield._foresight import run_ahead
from armtempo.envs.coordination.shield._kernels import (
    CELL_COUNT,
    FIRST_CELL,
    LEADING_ARM,
    LIMIT_OFFSET,
    NOBODY_WAITS,
    PARTS_PER_TICK,
    REGION_COLUMNS,
    WAITING_ARM,
    Orders,
    ShieldTables,
    ShieldWork,
    feasible,
    fill_braked,
)
from armtempo.envs.coordination.shield._turning import NODES, first_orders, keep_orders, set_wanted
from armtempo.envs.coordination.world import World
from armtempo.errors import InfeasibleError, InputError, brief
from armtempo.planners import CoordinationCell, Precedence, schedule
from armtempo.planners.coordination import PassingOrders
from armtempo.state import Stateful

ARMS_ALL_ORDERS_TRIED = 4  # arms of which all priority orders are tried
REGIONS_ALL_ORDERS_TRIED = 12  # regions of which all orders are tried
STOPPING_PLACES = 64  # of a path, before which an arm that brakes is known to stop
FORESEEN_MINIMUM_TIMES = 12.0  # longest minimum times within which arms that are run ahead must arrive
BRAKING_MINIMUM_TIMES = 4.0  # longest minimum times from stop to stop within which a braking arm must come to rest


def shield_tables(
    cell: CoordinationCell,
    world: World,
    *,
    scripted: Sequence[int] = (),
    plan: Precedence | None = None,
    tube_m: float = 0.0,
) -> ShieldTables:
    """What the kernel needs of a cell.

    Args:
        cell: The cell.
        world: Its packed form.
        scripted: Arms that the shield does not change. Without a plan they pass first everywhere.
        plan: What the scripted arms obey.
        tube_m: How far every arm may be off its reference beyond the reserve of planned clearance [m].
    """
    if not (is_number(tube_m) and tube_m >= 0.0):
        raise InputError(f"shield_tube_m must be a distance in metres, got {brief(tube_m)}", remedy="give 0 or more")
    orders = cell.passing_orders(2.0 * tube_m)
    region = np.zeros((len(orders.regions), 2, REGION_COLUMNS), dtype=np.int64)
    parts, length = [np.zeros(1)], 1  # never empty
    for r, (a, b, own) in enumerate(orders.regions):
        a_first, b_first = (b, a, own.begin_a, own.limit_b), (a, b, own.begin_b, own.limit_a)
        for order, (waiting, leading, first_cell, limit) in enumerate((a_first, b_first)):
            row = region[r, order]
            row[WAITING_ARM], row[LEADING_ARM] = waiting, leading
            row[FIRST_CELL], row[CELL_COUNT], row[LIMIT_OFFSET] = first_cell, len(limit), length
            parts.append(limit)
            length += len(limit)
    arms = len(cell.arms)
    stations = max(len(plane.rows.station) for plane in cell.planes)
    braked, before = np.zeros((arms, STOPPING_PLACES, stations)), np.zeros((arms, stations), dtype=np.int64)
    for i, plane in enumerate(cell.planes):
        count = len(plane.rows.station)
        fill_braked(world, i, braked[i, :, :count], before[i, :count])
    return ShieldTables(
        buffer=np.concatenate(parts),
        region=region,
        cells=orders.resolutions.copy(),
        candidates=_candidates(cell, orders, tuple(scripted), plan),
        holdable=np.array(cell.holdable),
        braked=braked,
        before=before,
    )


def _candidates(
    cell: CoordinationCell, orders: PassingOrders, scripted: tuple[int, ...], plan: Precedence | None
) -> NDArray[np.int8]:
    """(C, R) orders to begin with: priorities as they are, then others; where none of them leads on, a mixed one."""
    arms = len(cell.arms)
    if plan is not None:
        rows = [orders.of_precedence(plan)]
    elif scripted:
        free = [i for i in range(arms) if i not in scripted]
        ranks = permutations(free) if len(free) <= ARMS_ALL_ORDERS_TRIED else [tuple(free)]
        rows = [orders.of_ranks((*scripted, *rank)) for rank in ranks]
        for r, region in enumerate(orders.regions):
            if region.a in scripted and region.b in scripted:  # they run whatever the others do
                for row in rows:
                    row[r] = NOBODY_WAITS
    else:
        ranks = permutations(range(arms)) if arms <= ARMS_ALL_ORDERS_TRIED else [tuple(range(arms))]
        rows = [np.where(orders.ruled < NOBODY_WAITS, orders.ruled, orders.of_ranks(rank)) for rank in ranks]
        if not any(_leads_on(orders, row) for row in rows):
            rows += _mixed_order(cell, orders, rows[0])
    return np.array(rows, dtype=np.int8).reshape(len(rows), len(orders.regions))


def _mixed_order(cell: CoordinationCell, orders: PassingOrders, priority: NDArray[np.int8]) -> list[NDArray[np.int8]]:
    """One order that leads on where no priority does, as near to the given one as can be; none if there is none."""
    regions = np.flatnonzero(orders.ruled == NOBODY_WAITS)
    if len(regions) > REGIONS_ALL_ORDERS_TRIED:  # too many to try them all
        with suppress(InfeasibleError):
            return [orders.of_precedence(schedule(cell, "optimal").precedence)]
        return []
    for count in range(1, len(regions) + 1):
        for turned in combinations(regions, count):
            row = priority.copy()
            row[list(turned)] ^= 1
            if _leads_on(orders, row):
                return [row]
    return []


def _leads_on(orders: PassingOrders, row: NDArray[np.int8]) -> bool:
    meant = orders.precedence(row)
    try:
        meant.check_deadlock_free()
    except InfeasibleError:
        return False
    return all(limit[0] > 0.0 for limit in meant.limits.values())  # else an arm is in the way where it starts


def shield_work(cell: CoordinationCell, regions: int) -> ShieldWork:
    """Scratch for one thread."""
    arms, ticks = len(cell.arms), cell.ticks_per_period
    longest = BRAKING_MINIMUM_TIMES * max(motion.longest_run for motion in cell.fastest)
    periods = int(np.ceil(longest / cell.control_period)) + 2
    return ShieldWork(
        places=np.zeros((2, arms, PARTS_PER_TICK * ticks * periods + 1)),
        length=np.zeros((2, arms), dtype=np.int64),
        rest=np.zeros((2, arms), dtype=np.bool_),
        speed=np.zeros((2, arms, periods + 1)),
        limits=np.zeros(PARTS_PER_TICK * ticks * periods + 1),
        fitting=np.zeros(regions, dtype=np.bool_),
        lam=np.zeros((4, arms)),
        speeds=np.zeros(PARTS_PER_TICK * ticks),
        unsure=np.zeros(arms, dtype=np.bool_),
        wanted=np.full(regions, NOBODY_WAITS, dtype=np.int8),
        nodes=np.zeros((NODES, regions), dtype=np.int8),
        settled=np.zeros((NODES, regions), dtype=np.bool_),
        wrong=np.zeros(regions, dtype=np.bool_),
        hindered=np.zeros(arms, dtype=np.bool_),
        freed=np.zeros(arms, dtype=np.bool_),
        turns=np.zeros(NODES, dtype=np.int64),
        turnable=np.zeros(regions, dtype=np.int8),
        circle=np.zeros(arms, dtype=np.int64),
        arms=np.zeros(arms, dtype=np.int64),
    )


def foreseen(cell: CoordinationCell) -> float:
    """Within which time arms that are run ahead must arrive [s]."""
    return FORESEEN_MINIMUM_TIMES * max(motion.duration for motion in cell.fastest)


class Foresight(NamedTuple):
    """What comes of an order at full speed.

    Attributes:
        orders: (R,) that hold then: what was wanted, or what is nearest to it.
        arrival: (A,) when each arm arrives [s from now]; inf: not before the horizon.
    """

    orders: Orders
    arrival: Floats

    @property
    def makespan(self) -> float:
        """When the last arm arrives [s from now]."""
        return float(self.arrival.max())


@final
class Shield(Stateful):
    """Commands that leave a way out, for the arms of one cell.

    A requested set of commands is let through if every arm, after one period under its own and maximum braking from
    then on, stays behind the limits of a passing order from which all arms arrive. Else the order is changed, where
    the requests ask for it and all arms arrive under the other one too; else commands are cut, none more than needed.

    An order can be asked for (``ask``), or arms be given numbers (``prefer``): the shield keeps the order that is
    nearest to it, of those that lead on and that the arms can still obey by braking, whatever the requests are.

    Args:
        cell: The cell.
        world: Its packed form.
        scripted: Arms that are not changed. Without a plan they pass first everywhere.
        plan: The precedence that scripted arms obey.
        tube_m: See ``shield_tables``.

    Attributes:
        regions: Where two arms can meet, R.
        orders: (R,) int8, who passes first in each, now: 0 its arm a, 1 its arm b, 2 nobody waits (scripted arms).
        asked: (R,) what is asked for, 2: nothing.
        scripted, uncertain: (A,) arms that are not changed, and that may be disturbed.
        ticks: Of a control period.
        longest: How far ahead arms are run, at most [s].
    """

    changing = ("orders", "asked", "_priority", "uncertain")

    def __init__(
        self,
        cell: CoordinationCell,
        world: World,
        *,
        scripted: Sequence[int] = (),
        plan: Precedence | None = None,
        tube_m: float = 0.0,
    ) -> None:
        arms = len(cell.arms)
        self.cell = cell
        self.tables = shield_tables(cell, world, scripted=scripted, plan=plan, tube_m=tube_m)
        self.regions = cell.passing_orders(2.0 * tube_m)
        self.orders = np.zeros(len(self.tables.region), dtype=np.int8)
        self.asked = np.full_like(self.orders, NOBODY_WAITS)
        self._priority = np.zeros(arms)
        self._world = world
        self.work = shield_work(cell, len(self.orders))
        self.ticks = cell.ticks_per_period
        self._planned = plan is not None
        self.scripted = np.zeros(arms, dtype=np.bool_)
        self.scripted[list(scripted)] = True
        self.uncertain = np.zeros(arms, dtype=np.bool_)
        self._admitted = np.zeros(arms)
        self.longest = foreseen(cell)

    def reset(self, lam: ArrayLike, uncertain: ArrayLike = False) -> None:
        """Choose who passes first for arms at rest at ``lam`` (A,); ``uncertain`` (A,): arms that may be disturbed.

        Raises:
            InfeasibleError: From there no passing order leads all arms to their ends.
        """
        self.uncertain[:] = uncertain
        self.asked[:], self._priority[:] = NOBODY_WAITS, 0.0
        places = np.array(lam, dtype=np.float64)
        if not first_orders(self._world, self.tables, places, self.scripted, self.orders, self.work):
            names = ", ".join(repr(arm.name) for arm in self.cell.arms)
            scripted = self.scripted.any() and not self._planned
            raise InfeasibleError(
                f"the shield finds no passing order in which all arms arrive: {names} from {places.round(4).tolist()}",
                remedy="let the other arms follow a plan, others='optimal'" if scripted else "start the arms elsewhere",
                arms=tuple(range(len(places))),
            )

    def doubt_all(self) -> None:
        """From now on any arm may do less than it is told: time goes slower, and periods do not get as far."""
        self.uncertain[:] = True

    def admit(self, lam: Floats, mu: Floats, commands: Floats) -> Floats:
        """(A,) the commands that are let through for the next period; a new array."""
        set_wanted(self.tables, self.asked, self._priority, self.work.wanted)
        admit(
            self._world, self.tables, self.orders, self.work.wanted, lam, mu, commands, self.scripted,
            self.uncertain, self.ticks, self._admitted, self.work,
        )  # fmt: skip
        return self._admitted.copy()

    def ask(self, wanted: Precedence | ArrayLike, lam: Floats, mu: Floats) -> Orders:
        """Keep to an order, or to what is nearest to it, until another is asked for, or the episode is over.

        Nearest has the fewest regions in another order, of all that lead on and that arms at ``lam`` with ``mu`` (A,)
        can still obey by braking.

        Args:
            wanted: A precedence, or (R,) as ``orders``, where 2 is either: commands may go on to decide it.
            lam: (A,) places.
            mu: (A,) path speeds.

        Returns:
            ``orders`` (R,) that hold now, a new array.

        Raises:
            InputError: It is not of these arms or regions.
        """
        asked = asked_orders(self.regions, wanted)
        keep_orders(
            self._world, self.tables, self.orders, asked, lam, mu, self.scripted, self.uncertain, self.ticks,
            self.asked, self.work,
        )  # fmt: skip
        return self.orders.copy()

    def run_ahead(
        self,
        wanted: Precedence | ArrayLike,
        lam: Floats,
        mu: Floats,
        *,
        stands: ArrayLike = 0.0,
        horizon: float = np.inf,
    ) -> Foresight:
        """What would come of an order if it were asked for now and all arms went on at full speed; nothing changes.

        Args:
            wanted: As for ``ask``.
            lam: (A,) places.
            mu: (A,) path speeds.
            stands: (A,) or one for all: for how long each arm brakes and stands first [s].
            horizon: What takes longer does not count [s].

        Raises:
            InputError: It is not of these arms or regions, or times are not such.
        """
        first, longest = _times(stands, len(lam)), min(_times(horizon, 1)[0], self.longest)
        orders, asked, arrival = self.orders.copy(), self.asked.copy(), np.zeros(len(lam))
        keep_orders(
            self._world, self.tables, orders, asked_orders(self.regions, wanted), lam, mu, self.scripted,
            self.uncertain, self.ticks, asked, self.work,
        )  # fmt: skip
        run_ahead(
            self._world, self.tables, orders.copy(), lam.copy(), mu.copy(), first, self.scripted, self.uncertain,
            self.ticks, longest, arrival, self.work,
        )  # fmt: skip
        return Foresight(orders=orders, arrival=arrival)

    def prefer(self, priority: ArrayLike) -> None:
        """From now on let the arm with the higher number (A,) pass first wherever nobody has entered and it leads on.

        nan leaves an arm's number as it is, 0 at first. Where two are equal, what was asked for holds, or who is first.
        """
        given = np.asarray(priority, dtype=np.float64)
        self._priority[:] = np.where(np.isnan(given), self._priority, given)

    @property
    def precedence(self) -> Precedence:
        """What the orders that hold now mean; regions where nobody waits are left out."""
        return self.regions.precedence(self.orders)

    def leads_on(self, lam: Floats) -> bool:
        """Whether from arms at rest at ``lam`` (A,) the orders as they are lead all arms to their ends."""
        return bool(feasible(self._world, self.tables, self.orders, lam.copy(), np.zeros(len(lam))))


def asked_orders(regions: PassingOrders, wanted: Precedence | ArrayLike) -> Orders:
    """(R,) what is asked for, a new array; see ``Shield.ask``.

    Raises:
        InputError: It is not of these arms or regions.
    """
    if isinstance(wanted, Precedence):
        if wanted.lengths != regions.lengths:
            raise InputError("the precedence is of other paths", remedy="plan in the cell of the shield")
        return regions.of_precedence(wanted)
    try:
        asked = np.asarray(wanted)
        good = asked.shape == (len(regions.regions),) and bool(np.isin(asked, (0, 1, NOBODY_WAITS)).all())
    except ValueError:  # ragged
        good = False
    if not good:
        raise InputError(
            f"an order must be {len(regions.regions)} numbers 0, 1 or 2, got {brief(wanted)}",
            remedy="give a Precedence, or one number for each collision region",
        )
    return asked.astype(np.int8)


def _times(given: ArrayLike, count: int) -> Floats:
    """(count,) times [s], from as many or one for all; a new array.

    Raises:
        InputError: They are none.
    """
    try:
        times = np.array(np.broadcast_to(np.asarray(given, dtype=np.float64), (count,)))
    except (TypeError, ValueError, OverflowError):
        times = np.full(count, np.nan)
    if not (times >= 0.0).all():
        raise InputError(f"times must be {count} numbers >= 0, or one, got {brief(given)}", remedy="give seconds")
    return times

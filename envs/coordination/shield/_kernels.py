"""The shield's compiled part: commands for one control period that leave every arm a way to stop, and all a way on.

A command is foreseen exactly as the environment will run it: for one period, then maximum braking period by period
until the arm is at rest. Orders (R,) say of every collision region who passes first (see ``PassingOrders``): 0 its arm
a, 1 its arm b, 2 nobody waits. Arms that obey the limits of feasible orders neither meet nor wait for each other for
ever; both are kept: limits are asked at every tick for all arms at once, and orders change only to feasible ones.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from armtempo.arrays import Bools, Floats, Ints
from armtempo.envs.coordination.world import World, length_of, steps_of
from armtempo.planners.charts.kernels import cell_at
from armtempo.planners.topp import kernels as phase_kernels
from armtempo.robots import inlined, njit, uncounted

Orders = NDArray[np.int8]

LIMIT_MARGIN_SHARE = 1e-7  # of a path: how far behind a limit an arm is kept
PARTS_PER_TICK = 8  # in which limits are asked; a power of two, so that a tick has the same bits in parts
BRAKING_SAFETY_SQUARED = 0.98  # of the square of a speed: what braking in other pieces may change is far less
UNTIL_REST = 1 << 40  # parts: as many as there are

NOBODY_WAITS = 2  # an order, beside 0 and 1
# Columns of ``ShieldTables.region``.
WAITING_ARM, LEADING_ARM, FIRST_CELL, CELL_COUNT, LIMIT_OFFSET = range(5)
REGION_COLUMNS = 5
# Rows of ``ShieldWork``: the command for one period, then braking; braking from now on.
COMMANDED, BRAKING = range(2)


class ShieldTables(NamedTuple):
    """What does not change during an episode; R regions, A arms."""

    buffer: Floats  # limits, one after the other
    region: Ints  # (R, 2, 5) [r, who passes first: 0 is a, 1 is b]: who waits, who leads, and the limit: its first cell
    #               on the leading arm's path, number of cells, where it begins in the buffer
    cells: Ints  # (A, A) resolution of the pair's chart
    candidates: Orders  # (C, R) orders to begin with, the preferred first
    holdable: Bools  # (A,) whether the arm can stand wherever it is
    braked: Floats  # (A, M, N) at every station: the largest square of a speed from which an arm stops before place m
    before: Ints  # (A, N) per station: the last of these places that is not behind it, or -1


class ShieldWork(NamedTuple):
    """Scratch of one thread; K + 1 places: now, and at the end of every part of a tick."""

    places: Floats  # (2, A, K + 1) under the command for one period, then braking; braking from now on
    length: Ints  # (2, A) parts that are foreseen; 0: not begun
    rest: Bools  # (2, A) whether the arm is at rest from there on
    speed: Floats  # (2, A, P + 1) at the begin of every period
    limits: Floats  # (K + 1,) how far one arm may go, at the begin of every part of a tick
    fitting: Bools  # (R,) regions whose waiting arm is known to stay behind its limit, as commands are
    lam: Floats  # (4, A) where arms are, how far they may go, where they stop, and no command
    speeds: Floats  # (parts of a period,)
    wanted: Orders  # (R,) who is to pass first; 2: whoever does
    nodes: Orders  # (NODES, R) orders of a search
    settled: Bools  # (NODES, R) which of them stay as they are
    wrong: Bools  # (R,) whether the commands contradict an order
    hindered: Bools  # (A,) arms that these hold back and turning them may free
    freed: Bools  # (A,) those that are to be freed now
    turns: Ints  # (NODES,) how many are turned
    turnable: Orders  # (R,) whether an order can be turned: 0 not, 1 it can, 2 not looked at yet
    circle: Ints  # (A,) regions
    arms: Ints  # (A,)
    unsure: Bools  # (A,) arms that may do less than they are told


class Limit(NamedTuple):
    """How far the waiting arm of a region may go, by cells of the leading arm's path."""

    per_length: float  # cells of the leading arm's whole path per length
    cells: int  # of the whole path
    begin: int  # the region's first cell
    span: int  # number of its cells
    offset: int  # where the limits begin in the buffer


@inlined
def limit_of(world: World, tables: ShieldTables, r: int, order: int) -> Limit:
    region = tables.region
    j = region[r, order, LEADING_ARM]
    cells = tables.cells[region[r, order, WAITING_ARM], j]
    return Limit(
        cells / length_of(world, j),
        cells,
        region[r, order, FIRST_CELL],
        region[r, order, CELL_COUNT],
        region[r, order, LIMIT_OFFSET],
    )


@inlined
def limit_at(buffer: Floats, of: Limit, place: float) -> float:
    """How far the waiting arm of a region may go while the leading one is at ``place`` of its path."""
    cell = cell_at(place, of.per_length, of.cells) - of.begin
    limit = np.inf
    if cell < of.span:
        limit = buffer[of.offset + max(cell, 0)]
    return limit


@inlined
def limit_now(world: World, tables: ShieldTables, r: int, order: int, lam: Floats) -> float:
    """How far the waiting arm of region r may go while all arms are at ``lam`` (A,)."""
    return limit_at(tables.buffer, limit_of(world, tables, r, order), lam[tables.region[r, order, LEADING_ARM]])


@uncounted
def feasible(world: World, tables: ShieldTables, orders: Orders, lam: Floats, reach: Floats) -> bool:
    """Whether arms that go as far as the others' places allow, over and over, all arrive; ``lam`` (A,) is where."""
    moved = True
    while moved:
        for i in range(lam.shape[0]):
            reach[i] = length_of(world, i)
        for r in range(orders.shape[0]):
            if orders[r] < NOBODY_WAITS:
                i, limit = tables.region[r, orders[r], WAITING_ARM], limit_now(world, tables, r, orders[r], lam)
                reach[i] = min(reach[i], limit - LIMIT_MARGIN_SHARE * length_of(world, i))
        moved = False
        for i in range(lam.shape[0]):
            if reach[i] > lam[i]:
                lam[i], moved = reach[i], True
    for i in range(lam.shape[0]):  # noqa: SIM110 (compiled)
        if lam[i] < length_of(world, i):
            return False
    return True


@njit
def fill_braked(world: World, i: int, braked: Floats, before: Ints) -> None:
    """Fill arm i's ``braked`` (M, N) and ``before`` (N,), for M stations about equally far apart.

    Backwards from rest at such a station, interval by interval: the largest ``x`` from which the hardest braking is not
    faster at its end than it may be there. Braking motions do not cross, so whoever is slower stops earlier. (There is
    no bound on where an arm stops that is smooth in its speed: a little faster, and at high speed the limits may pull
    it on for half of its path.)
    """
    steps = steps_of(world, i)
    count, last = braked.shape[0], steps.shape[0] - 1
    braked[:], before[:] = 0.0, -1
    for m in range(count):
        station = ((m + 1) * last) // count
        before[station:] = m
        for k in range(station - 1, -1, -1):
            low, high = braked[max(m - 1, 0), k], steps[k, phase_kernels.EDGE_HIGH]
            most = braked[m, k + 1]
            d2 = 2.0 * (steps[k + 1, phase_kernels.STATION] - steps[k, phase_kernels.STATION])
            x = high
            for _ in range(25 if low < high else 0):  # from the edge itself first: mostly that is it
                begin, _ = phase_kernels.bounds_in(steps, k, 0.0, x, 0.0)
                end, _ = phase_kernels.bounds_in(steps, k, 1.0, x, d2)
                if x + d2 * max(begin, end) <= most:
                    low = x
                else:
                    high = x
                if low == high:
                    break
                x = 0.5 * (low + high)
            braked[m, k] = low if d2 > 0.0 else most


@uncounted
def stops_before(
    steps: Floats, holdable: bool, braked: Floats, before: Ints, lam: float, mu: float, limit: float, tick: float
) -> bool:
    """Whether an arm certainly comes to rest before a limit if it brakes now; it may do so even if this says no.

    ``braked`` (M, N) and ``before`` (N,) of the arm: see ``ShieldTables``.
    """
    if lam > limit or not holdable:
        return False
    if mu <= 0.0:
        return True
    m = before[phase_kernels.interval_at(steps, limit - mu * tick)]
    return m >= 0 and mu * mu <= BRAKING_SAFETY_SQUARED * _at_most(steps, braked, m, lam)


@uncounted
def speed_to_stop(steps: Floats, braked: Floats, before: Ints, lam: float, limit: float) -> float:
    """About the largest square of a speed from which an arm at ``lam`` stops before a limit: a guess, no bound."""
    if lam >= limit:
        return 0.0
    m = before[phase_kernels.interval_at(steps, limit)]
    count, last = braked.shape[0], steps.shape[0] - 1
    low_place, low, high_place, high = lam, 0.0, steps[last, phase_kernels.STATION], 0.0
    if m >= 0:
        place = steps[((m + 1) * last) // count, phase_kernels.STATION]
        if place > lam:
            low_place, low = place, _at_most(steps, braked, m, lam)
    if m + 1 < count:
        high_place, high = steps[((m + 2) * last) // count, phase_kernels.STATION], _at_most(steps, braked, m + 1, lam)
    return low + (limit - low_place) / (high_place - low_place) * (high - low)  # type: ignore[no-any-return]


@inlined
def _at_most(steps: Floats, braked: Floats, m: int, lam: float) -> float:
    """The largest square of a speed at ``lam`` from which an arm stops before place m."""
    k = phase_kernels.interval_at(steps, lam)
    x, begin, stop = braked[m, k], steps[k, phase_kernels.STATION], steps[k + 1, phase_kernels.STATION]
    return float(x + (lam - begin) / (stop - begin) * (braked[m, k + 1] - x))


@uncounted
def row_of(braking: bool) -> int:
    """Of ``work``: 0 under the command, 1 braking; a number written in a call would compile a copy of what it calls."""
    return 1 if braking else 0


@uncounted
def foresee(
    steps: Floats, by_speed: bool, holdable: bool, tick: float, command: float, parts: int, until: int, row: int,
    i: int, places: Floats, speed: Floats, length: Ints, rest: Bools, speeds: Floats,
) -> int:  # fmt: skip
    """Foresee arm i under its command (row 0) or braking (row 1) for one period, then braking, for ``until`` parts.

    ``places`` (K + 1,), ``speed`` (P + 1,): of ``work``, for this row and arm; they begin with where it is. (Arrays one
    by one, not ``work``: handing over a tuple counts references to all that is in it, which took most of the time.)

    Returns the last part foreseen; earlier than ``until``, the arm is at rest from there on. An arm that does not come
    to rest in time counts as going on to the end of its path.
    """
    k = length[row, i]
    if k >= until or (k > 0 and rest[row, i]):
        return k  # type: ignore[no-any-return]
    part, end, last = tick / PARTS_PER_TICK, steps[steps.shape[0] - 1, phase_kernels.STATION], places.shape[0] - 1
    if k == 0:
        _, speed[1], _ = phase_kernels.advance(
            steps, places[0], speed[0], command, by_speed, part, parts, places[1 : parts + 1], speeds, 1.0
        )
        rest[row, i] = False
        k = parts
    place, fast = places[k], speed[k // parts]
    while k < until:
        if place >= end or (fast <= 0.0 and holdable):
            rest[row, i] = True
            break
        if k + parts >= last:
            places[k + 1 :] = end
            k += 1
            rest[row, i] = True
            break
        before = place
        place, fast, _ = phase_kernels.advance(
            steps, place, fast, 0.0, by_speed, part, parts, places[k + 1 : k + 1 + parts], speeds
        )
        if place == before:
            rest[row, i] = True
            break
        k += parts
        speed[k // parts] = fast
    length[row, i] = k
    return k  # type: ignore[no-any-return]


@uncounted
def fits(
    world: World, tables: ShieldTables, r: int, order: int, orders: Orders, lam: Floats, mu: Floats, commands: Floats,
    unsure: Bools, parts: int, work: ShieldWork,
) -> bool:  # fmt: skip
    """Whether the waiting arm of a region stays behind its limit; under the order in force: or is just braking.

    Limits never fall and arms never go back: in every part of a tick it is enough that the one is, at its end, behind
    the limit from where the other is at its begin.
    """
    i, j = tables.region[r, order, WAITING_ARM], tables.region[r, order, LEADING_ARM]
    of, buffer = limit_of(world, tables, r, order), tables.buffer
    limit = limit_at(buffer, of, lam[j])
    if limit == np.inf:
        return True
    tick, by_speed, holdable = world.tick, world.by_speed, tables.holdable
    length, rest, speeds = work.length, work.rest, work.speeds
    own, braked, before = steps_of(world, i), tables.braked[i], tables.before[i]
    other, row, command = steps_of(world, j), row_of(unsure[j]), (0.0 if unsure[j] else commands[j])
    margin = LIMIT_MARGIN_SHARE * own[own.shape[0] - 1, 0]
    far, far_speed = work.places[COMMANDED, i], work.speed[COMMANDED, i]
    near, near_speed = work.places[row, j], work.speed[row, j]
    k, most, braking = 0, near.shape[0] - parts - 1, 0.0
    while True:
        last = foresee(
            own, by_speed, holdable[i], tick, commands[i], parts, k + parts, row_of(False), i, far, far_speed, length,
            rest, speeds,
        )  # fmt: skip
        if last > k and stops_before(
            own, holdable[i], braked, before, far[k + parts], far_speed[k // parts + 1], limit - margin, tick
        ):
            return True
        # What is not foreseen of an arm ahead does not count.
        stop = foresee(
            other, by_speed, holdable[j], tick, command, parts, k + parts, row, j, near, near_speed, length, rest,
            speeds,
        )  # fmt: skip
        stop = min(stop, most)
        if row == 1 and mu[j] <= 0.0:  # it may be late; an arm that cannot hold still would be foreseen to go
            stop = 0
        if last >= k + parts and far[k + parts] <= limit - margin:  # the whole period at once
            k += parts
            limit = limit_at(buffer, of, near[min(k, stop)])
            if limit == np.inf:
                return True
            continue
        for _ in range(parts):
            k += 1
            if k > last:
                return True
            if far[k] > limit - margin:
                if order != orders[r]:
                    return False
                done = foresee(
                    own, by_speed, holdable[i], tick, braking, parts, k, row_of(True), i, work.places[BRAKING, i],
                    work.speed[BRAKING, i], length, rest, speeds,
                )  # fmt: skip
                if far[k] > work.places[BRAKING, i, min(k, done)]:
                    return False
            limit = limit_at(buffer, of, near[min(k, stop)])
            if limit == np.inf:
                return True


@uncounted
def fill_limits(
    world: World, tables: ShieldTables, orders: Orders, i: int, lam: Floats, mu: Floats, commands: Floats,
    unsure: Bools, parts: int, until: int, work: ShieldWork,
) -> int:  # fmt: skip
    """Fill ``work.limits`` for arm i, margins taken off, up to part ``until`` or where they change no more: which."""
    limits, own = work.limits, steps_of(world, i)
    margin, known = LIMIT_MARGIN_SHARE * own[own.shape[0] - 1, 0], 0
    limits[0] = np.inf
    for r in range(orders.shape[0]):
        order = orders[r]
        if order == NOBODY_WAITS or tables.region[r, order, WAITING_ARM] != i:
            continue
        j, of = tables.region[r, order, LEADING_ARM], limit_of(world, tables, r, order)
        limit = limit_at(tables.buffer, of, lam[j])
        if limit == np.inf:
            continue
        row = row_of(unsure[j])
        near = work.places[row, j]
        stop = foresee(
            steps_of(world, j), world.by_speed, tables.holdable[j], world.tick, (0.0 if unsure[j] else commands[j]),
            parts, until, row, j, near, work.speed[row, j], work.length, work.rest, work.speeds,
        )  # fmt: skip
        stop = min(stop, until, near.shape[0] - parts - 1)
        if row == 1 and mu[j] <= 0.0:  # it may be late; an arm that cannot hold still would be foreseen to go
            stop = 0
        while known < stop:
            limits[known + 1] = limits[known]
            known += 1
        limits[0] = min(limits[0], limit - margin)
        for k in range(1, known + 1):
            if k <= stop and limit < np.inf:
                limit = limit_at(tables.buffer, of, near[k])
            if limit == np.inf:
                break
            limits[k] = min(limits[k], limit - margin)
    return known


@uncounted
def first_past(
    own: Floats, by_speed: bool, holdable: bool, tick: float, command: float, parts: int, i: int, limits: Floats,
    known: int, braked: Floats, before: Ints, far: Floats, far_speed: Floats, back: Floats, back_speed: Floats,
    length: Ints, rest: Bools, speeds: Floats,
) -> int:  # fmt: skip
    """The first part of a tick in which arm i gets past ``limits`` (known + 1,) and is not just braking; 0: none.

    None is what ``fits`` says, of all regions where it waits at once. ``far``, ``back``: of ``work``, where it is under
    the command and where if it brakes at once. (Arrays one by one: see ``foresee``.)
    """
    k, limit = 0, limits[0]
    while limit < np.inf:
        last = foresee(
            own, by_speed, holdable, tick, command, parts, k + parts, row_of(False), i, far, far_speed, length, rest,
            speeds,
        )  # fmt: skip
        if last > k and stops_before(
            own, holdable, braked, before, far[k + parts], far_speed[k // parts + 1], limit, tick
        ):
            return 0
        if last >= k + parts and far[k + parts] <= limit:  # the whole period at once
            k += parts
            limit = limits[min(k, known)]
            continue
        for _ in range(parts):
            k += 1
            if k > last:
                return 0
            if far[k] > limit:
                done = foresee(
                    own, by_speed, holdable, tick, 0.0, parts, k, row_of(True), i, back, back_speed, length, rest,
                    speeds,
                )  # fmt: skip
                if far[k] > back[min(k, done)]:
                    return k
            limit = limits[min(k, known)]
            if limit == np.inf:
                return 0
    return 0


@uncounted
def aim_behind(
    own: Floats, by_speed: bool, holdable: bool, tick: float, parts: int, i: int, k: int, limit: float, far: Floats,
    back: Floats, back_speed: Floats, length: Ints, rest: Bools, speeds: Floats,
) -> float:  # fmt: skip
    """About where arm i must not get farther in a period, that it may be behind a limit after part k; see there.

    Between where it gets by braking at once and by the command of ``far``, under which it is past the limit.
    """
    done = foresee(
        own, by_speed, holdable, tick, 0.0, parts, k, row_of(True), i, back, back_speed, length, rest, speeds
    )  # fmt: skip
    least = back[min(k, done)]
    share = (limit - least) / (far[k] - least) if far[k] > least else 0.0
    return back[parts] + share * (far[parts] - back[parts])  # type: ignore[no-any-return]

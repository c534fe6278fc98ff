r"""Velocity control intervals (Lee1991 section 2.4): the slave yields only where, and only as long as, it must.

The slave runs at full speed until it would be past the collision point C(t). Then, in steps of dT,

1. the shortest interval before t in which braking as hard as the limits allow keeps it behind C is its VCI;
2. the room that is left is used: brake over all but the last step of the VCI, and search there the torque that just
   keeps behind C (Fig. 3);
3. if even full acceleration in that step does, the adjusted step moves one step earlier, and those behind it run at
   full acceleration (Fig. 4), and so on.

Behind several masters C is the least of theirs. Where the paper is not safe or gives up, this is what is done
(the sixteen weaknesses of research on coordination, section 5):

======================================  ================================================================================
only P1 is used                         every collision region is above or below the motion; those that the slave passes
                                        before the master comes, at full speed, do not brake it (``_Regions``)
P1(t) may fall later                    C is the closure of the chart: what blocks *later* counts
several regions                         decided one by one: at full speed the slave is earliest, so a region that it
                                        does not pass first then it never does; those that braking elsewhere spoils go
                                        to the master, and the slave is planned anew
braking from the start fails            InfeasibleError with a reason; the caller swaps the order or searches intervals
the slave's start is unsafe             it passes that region first or it is InfeasibleError
the master parks in the way             likewise: the last column is in the closure
a waiting slave blocks the master       behind the closure it is clear of the rest of the master's path
deadlock with N arms                    one priority order for all; regions passed first are passed without a stop
braking leaves the admissible region    commands move between the edges of the controllable set (``advance``), all
                                        torques at full rate
one interval only is adjusted           the state that an adjustment leaves is in the controllable set; the next barrier
                                        is met by longer braking, from the start if need be
latest, hardest braking                 the method; ``delay`` and ``interval`` plan slow motion early
the past is rewritten                   every changed step is checked again (``_replay``)
sampling                                C is asked every 0.1 ms with the slave's place at the end and the master's at
                                        the beginning; the chart is certified cell by cell
fixed priority                          the caller tries orders
a late master                           ``guarded``: on line the slave can always brake, or leave, whatever masters do
horizon                                 an interval grows from its end; nothing before it is run again
======================================  ================================================================================
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple, final

import numpy as np

from armtempo.arrays import Bools, Floats, Ints
from armtempo.errors import InfeasibleError, InputError
from armtempo.planners.charts import CoordinationChart, cells_at
from armtempo.planners.coordination._guard import (
    LIMIT_MARGIN,
    horizon,
    largest_behind,
    places_at_checks,
    stays_behind,
    step,
)
from armtempo.planners.topp import Mode, PhasePlane, PhaseTrajectory
from armtempo.planners.topp.kernels import STATION
from armtempo.robots import njit

LONGEST_CHECK = 0.0001  # [s] C is asked at least this often
COMMAND_BISECTIONS = 40
PLACE_ROUNDING_SHARE = 1e-4  # of a path: a slave so little past a limit brakes (observations are float32)
LEAD_CHECKS = 2  # checks by which the slave must have left before the master comes, the one under way included

CORRECTIONS, LAST_STEP_ADJUSTED, EARLIER_STEP_ADJUSTED, LONGEST_INTERVAL = range(4)  # of the counts of corrections


@njit
def _replay(
    steps: Floats,
    state: Floats,
    command: Floats,
    first: int,
    last: int,
    by_speed: bool,
    dt: float,
    checks: int,
    limit: Floats,
) -> bool:
    """Run steps first..last from the stored state, storing states; whether all stay behind the limit."""
    scratch = np.empty((2, checks))
    for k in range(first, last + 1):
        state[k + 1, 0], state[k + 1, 1], state[k + 1, 2], safe = step(
            steps, state[k, 0], state[k, 1], command[k], by_speed, dt, checks, limit, k, scratch
        )
        if not safe:
            return False
    return True


@njit
def control_intervals(
    steps: Floats,
    state: Floats,
    command: Floats,
    by_speed: bool,
    dt: float,
    checks: int,
    limit: Floats,
    count: Floats,
    history: Floats,
) -> int:
    """Fill commands step by step until arrival; returns the number of steps, or -1 - k if step k cannot be made safe.

    ``state`` (K+1, 3): lam, mu, time used in the step before; row 0 is the start. ``limit`` (K checks,): C at the
    beginning of every check. ``count`` (4,): corrections, those of Fig. 3, those of Fig. 4, longest VCI in steps.
    ``history`` (C, 4): of the first C corrections the step of the collision, first step of the VCI, adjusted step,
    its command.
    """
    end = steps[-1, STATION]
    k = 0
    while k < command.shape[0]:
        if state[k, 0] >= end:
            return k
        command[k] = 1.0
        if not _replay(steps, state, command, k, k, by_speed, dt, checks, limit):
            first = k
            while True:  # steps 1-4: the shortest interval of braking that avoids the collision
                command[first] = 0.0
                for later in range(first + 1, k + 1):
                    command[later] = 0.0
                if _replay(steps, state, command, first, k, by_speed, dt, checks, limit):
                    break
                if first == 0:
                    return -1 - k
                first -= 1
            adjusted = k
            while True:  # steps 2-5: use the room that is left
                command[adjusted] = 1.0
                if adjusted == first or not _replay(steps, state, command, adjusted, k, by_speed, dt, checks, limit):
                    break
                adjusted -= 1
            low, high = 0.0, 1.0
            if _replay(steps, state, command, adjusted, k, by_speed, dt, checks, limit):
                low = 1.0
            else:
                for _ in range(COMMAND_BISECTIONS):
                    command[adjusted] = 0.5 * (low + high)
                    if _replay(steps, state, command, adjusted, k, by_speed, dt, checks, limit):
                        low = command[adjusted]
                    else:
                        high = command[adjusted]
            command[adjusted] = low
            _replay(steps, state, command, adjusted, k, by_speed, dt, checks, limit)
            done = int(count[CORRECTIONS])
            if done < history.shape[0]:
                history[done, 0], history[done, 1], history[done, 2], history[done, 3] = k, first, adjusted, low
            count[CORRECTIONS] += 1
            count[LAST_STEP_ADJUSTED if adjusted == k else EARLIER_STEP_ADJUSTED] += 1
            count[LONGEST_INTERVAL] = max(count[LONGEST_INTERVAL], k - first + 1)
        k += 1
    return k if state[k, 0] >= end else -1 - k


class VciPlan(NamedTuple):
    """Commands of a slave, one per step, and what it took to find them."""

    commands: Floats  # (K,) in [0, 1]
    trajectory: PhaseTrajectory
    corrections: int
    last_step_adjusted: int  # Fig. 3
    earlier_step_adjusted: int  # Fig. 4
    longest_interval: float  # [s]
    history: Floats  # (corrections, 4): step of the collision, first step of the VCI, adjusted step, its command


class _Regions:
    """The collision regions of a chart of (master, slave), one by one: m regions over R columns.

    A motion never goes back, so it passes a region on one side: below (the master first) or above (the slave first).
    """

    def __init__(self, chart: CoordinationChart) -> None:
        regions, self._cells, self._length = chart.components, chart.resolution, chart.length_a
        self.count = len(regions)
        closure, self.end = np.empty((self.count, self._cells)), np.zeros((self.count, self._cells))
        for k, region in enumerate(regions):
            closure[k] = region.whole_limit_b
            self.end[k, region.begin_a : region.begin_a + len(region.end_b)] = region.end_b
        # (m, R) below this the slave is clear of the region for the rest of the master's path (at 0: nowhere to wait),
        self.closure = np.where(closure == 0.0, -chart.length_b, closure)
        # (m, R) and beyond this.
        self.left = np.maximum.accumulate(self.end[:, ::-1], axis=1)[:, ::-1]

    def column(self, lam: Floats) -> Ints:
        return cells_at(lam, self._length, self._cells)

    def limit(self, below: Bools, column: Ints) -> Floats:
        """C at columns, of the regions that the master passes first."""
        if not below.any():
            return np.full(len(column), np.inf)
        limit: Floats = self.closure[below].min(axis=0)[column]
        return limit

    def passed_first(self, regions: Bools, slave: Floats, column: Ints) -> Bools:
        """(m,) which of ``regions`` the slave, at ``slave`` (K,), leaves before the master's ``column`` (K,) comes."""
        out = np.zeros(self.count, dtype=np.bool_)
        reached = np.maximum.accumulate(
            np.minimum(np.append(column[LEAD_CHECKS:], [column[-1]] * LEAD_CHECKS), self._cells - 1)
        )
        for k in np.flatnonzero(regions):
            above = np.maximum.accumulate(self.end[k, column[0] :])
            out[k] = bool((slave >= above[reached - column[0]]).all())
        return out


@dataclass(frozen=True, kw_only=True, eq=False)
@final
class VelocityControl:
    """Velocity control intervals of a slave behind one master or several.

    Attributes:
        slave: Its phase plane.
        masters: The masters'.
        charts: Per master the chart of (master, slave), built with the clearance wanted.
        period: Step dT, the time for which one command holds [s].
        mode: What a command between 0 (maximum braking) and 1 (full speed) means.
        checks: How often per step the collision point is asked.
    """

    slave: PhasePlane
    masters: tuple[PhasePlane, ...]
    charts: tuple[CoordinationChart, ...]
    period: float
    mode: Mode = "acceleration"
    checks: int = 0

    def __deepcopy__(self, memo: dict[int, object]) -> VelocityControl:
        return self  # nothing in it changes; its planes and charts are the cell's

    def __post_init__(self) -> None:
        if not (math.isfinite(self.period) and self.period > 0.0):
            raise InputError(f"the control period must be positive, got {self.period}")
        if len(self.masters) != len(self.charts):
            raise InputError(f"{len(self.masters)} masters, but {len(self.charts)} charts", remedy="give one for each")
        if self.checks < 1:
            object.__setattr__(self, "checks", math.ceil(self.period / LONGEST_CHECK - 1e-9))

    @cached_property
    def _regions(self) -> tuple[_Regions, ...]:
        return tuple(_Regions(chart) for chart in self.charts)

    @cached_property
    def _alone(self) -> float:
        """Minimum time of the slave [s]."""
        return self.slave.fastest().duration

    @cached_property
    def _horizon(self) -> int:
        """Checks after which everybody who brakes is at rest."""
        return horizon([self.slave, *self.masters], self.period, self.checks)

    def _run(self, plane: PhasePlane, lam: float, mu: float, commands: Floats, count: int, mode: Mode) -> Floats:
        """(count,) places at the beginning of every check."""
        return places_at_checks(plane, lam, mu, commands, mode == "speed", self.period, self.checks, count)

    def plan(self, masters: Sequence[PhaseTrajectory], lam: float = 0.0, mu: float = 0.0) -> VciPlan:
        """Plan the slave's whole motion from a state, the masters' motions starting now.

        Raises:
            InfeasibleError: Braking from now on cannot keep the slave behind its masters.
        """
        commands, counts, history = self._solve(masters, lam, mu, record=True)
        trajectory = self.slave.motion(commands, np.full(len(commands), self.period), lam, mu, mode=self.mode)
        corrections = int(counts[CORRECTIONS])
        history = history[:corrections].copy()
        history.setflags(write=False)
        return VciPlan(
            commands=commands,
            trajectory=trajectory,
            corrections=corrections,
            last_step_adjusted=int(counts[LAST_STEP_ADJUSTED]),
            earlier_step_adjusted=int(counts[EARLIER_STEP_ADJUSTED]),
            longest_interval=float(counts[LONGEST_INTERVAL]) * self.period,
            history=history,
        )

    def commands(self, masters: Sequence[PhaseTrajectory], lam: float, mu: float) -> Floats:
        """The commands of ``plan`` alone, for those who plan on line; raises as it does."""
        return self._solve(masters, lam, mu, record=False)[0]

    def _solve(
        self, masters: Sequence[PhaseTrajectory], lam: float, mu: float, *, record: bool
    ) -> tuple[Floats, Floats, Floats]:
        last = max((master.duration for master in masters), default=0.0)
        most = math.ceil((last + 3.0 * self._alone + 20.0 * self.period) / self.period)
        instants = np.arange(most * self.checks) * (self.period / self.checks)
        column = [
            regions.column(master.at(np.minimum(instants, master.duration))[0])
            for regions, master in zip(self._regions, masters, strict=True)
        ]

        def above(commands: Floats, among: list[Bools]) -> list[Bools]:
            """Which regions the slave passes first under these commands."""
            own = self._run(self.slave, lam, mu, commands, most * self.checks, self.mode)
            return [r.passed_first(k, own, c) for r, k, c in zip(self._regions, among, column, strict=True)]

        first = above(np.ones(1), [np.ones(regions.count, dtype=np.bool_) for regions in self._regions])
        while True:
            limit = np.full(most * self.checks, np.inf)
            for regions, slave_first, c in zip(self._regions, first, column, strict=True):
                limit = np.minimum(limit, regions.limit(~slave_first, c))
            if limit[0] - LIMIT_MARGIN >= lam and limit[-1] - LIMIT_MARGIN < self.slave.length:
                # the limit never falls: no use in creeping up to where it ends
                raise self._refusal(most * self.period, masters)
            found = self._intervals(lam, mu, limit - LIMIT_MARGIN, most, record=record)
            if isinstance(found, int):
                raise self._refusal(found * self.period, masters)
            still = above(np.append(found[0], 1.0), first)
            if all((a == b).all() for a, b in zip(still, first, strict=True)):
                return found
            first = still

    def _intervals(
        self, lam: float, mu: float, limit: Floats, most: int, *, record: bool
    ) -> tuple[Floats, Floats, Floats] | int:
        """Commands, counts and history; or the step that cannot be made safe."""
        state, commands = np.empty((most + 1, 3)), np.zeros(most)
        state[0] = lam, mu, 0.0
        counts = np.zeros(4)
        history = np.empty((most if record else 0, 4))
        steps = int(control_intervals(
            self.slave.edges.steps, state, commands, self.mode == "speed", self.period, self.checks,
            limit, counts, history,
        ))  # fmt: skip
        return -1 - steps if steps < 0 else (commands[:steps].copy(), counts, history)

    def _refusal(self, late: float, masters: Sequence[PhaseTrajectory]) -> InfeasibleError:
        """Why nothing keeps the slave behind, ``late`` [s] from now."""
        own = _name(self.slave, "the slave")
        blocking = [
            k
            for k, (regions, master) in enumerate(zip(self._regions, masters, strict=True))
            if late >= master.duration and np.isfinite(regions.closure[:, -1]).any()
        ]
        if blocking:  # the limit stands still by then: not braking failed, time ran out
            return InfeasibleError(
                f"{_name(self.masters[blocking[0]], 'a master')} ends in the way of {own}: closer than "
                f"{self.charts[blocking[0]].d_min:.4g} m for ever",
                remedy="let the other go first (swap the order of the arms), or move its end",
                reason="parked in the way",
            )
        names = " and ".join(_name(plane, "a master") for plane in self.masters)
        return InfeasibleError(
            f"velocity control cannot keep {own} behind {names}: it would collide {late:.4g} s "
            "from now even if it brakes at once",
            remedy="let the other arm go first (swap the order of the arms), or move a start or an end",
            reason="braking from the start is not enough",
        )

    def expected(self, states: Sequence[tuple[float, float]]) -> list[PhaseTrajectory]:
        """The motions that masters at (lam, mu) are expected to make: full speed."""
        return [plane.motion([1.0], [np.inf], lam, mu) for plane, (lam, mu) in zip(self.masters, states, strict=True)]

    def guarded(self, command: float, lam: float, mu: float, masters: Sequence[tuple[float, float]]) -> float:
        """The command in [0, 1], cut back until the slave keeps a way out, whatever its masters do.

        There are two ways out. *Brake*: maximum braking after one period stays behind masters that brake as hard as
        they can from now on; every master is at least as far as that. *Leave*: at full speed from now on the slave has
        left some regions before masters at full speed come, and until then, and braking after, stays behind in all
        others. A master that is late, slow or stops costs time, never a collision.

        A slave that is in the way where it starts, and cannot count on getting out, has neither for that region: there
        it does as planned, and keeps behind in all others.

        Args:
            command: What the slave is to do for one period.
            lam: Where it is.
            mu: Its path speed.
            masters: (lam, mu) of every master.
        """
        column, live, limits = [], [], []
        for regions, plane, state in zip(self._regions, self.masters, masters, strict=True):
            braking = self._run(plane, *state, np.zeros(1), self._horizon, "speed")
            column.append(regions.column(braking))
            live.append(regions.left[:, column[-1][0]] > lam)
            limits.append(regions.limit(live[-1], column[-1]))
        slave, by_speed = self.slave, self.mode == "speed"
        if not any(regions.any() for regions in live):
            return command
        limit = np.min(limits, axis=0) - LIMIT_MARGIN
        as_wanted = stays_behind(slave.edges.steps, lam, mu, command, -1.0, by_speed, self.period, self.checks, limit)
        if as_wanted:
            return command
        if self._can_leave(lam, mu, masters, column, live):
            return 1.0
        loose = limit + PLACE_ROUNDING_SHARE * slave.length
        if not stays_behind(slave.edges.steps, lam, mu, 0.0, -1.0, by_speed, self.period, self.checks, loose):
            if limit.min() >= 0.0:
                return 0.0  # a hair too far: stop
            # nowhere to wait in some regions: as planned there, and behind the masters in all others
            limits = [
                regions.limit(below & (regions.closure[:, at[0]] >= 0.0), at)
                for regions, below, at in zip(self._regions, live, column, strict=True)
            ]
            limit = np.min(limits, axis=0) - LIMIT_MARGIN
        return float(largest_behind(slave.edges.steps, lam, mu, command, by_speed, self.period, self.checks, limit))

    def _can_leave(
        self,
        lam: float,
        mu: float,
        masters: Sequence[tuple[float, float]],
        braking: Sequence[Ints],
        live: Sequence[Bools],
    ) -> bool:
        """Whether full speed is a way out; ``braking`` are the columns of masters that brake."""
        slave = self.slave
        own = self._run(slave, lam, mu, np.ones(1), self._horizon, self.mode)
        ends: list[tuple[float, int, int]] = []
        for m, (regions, plane, state) in enumerate(zip(self._regions, self.masters, masters, strict=True)):
            fast = regions.column(self._run(plane, *state, np.ones(1), self._horizon, "speed"))
            first = regions.passed_first(live[m], own, fast)
            ends += [(float(regions.left[k, braking[m][0]]), m, int(k)) for k in np.flatnonzero(first)]
        # The nearest one, the nearest two, ...: at full speed past the last of them, then braking behind the others.
        # If that is safe now it is so after a period of it: what can be left then includes what can be left now.
        below = [regions.copy() for regions in live]
        for end, m, k in sorted(ends):
            below[m][k] = False
            limit = np.min([r.limit(b, c) for r, b, c in zip(self._regions, below, braking, strict=True)], axis=0)
            if stays_behind(
                slave.edges.steps, lam, mu, 1.0, end, self.mode == "speed", self.period, self.checks,
                limit - LIMIT_MARGIN,
            ):  # fmt: skip
                return True
        return False


def plan_vci(
    planes: Sequence[PhasePlane],
    chart_between: Callable[[int, int], CoordinationChart],
    order: Sequence[int],
    period: float,
) -> tuple[tuple[PhaseTrajectory, ...], tuple[VciPlan | None, ...]]:
    """Plan all arms in an order of priority: the first in minimum time, each other one behind all before it.

    Args:
        planes: One phase plane per arm.
        chart_between: The chart of two arms, first index along the first one's path.
        order: The arms, the highest priority first.
        period: Step dT [s].

    Returns:
        One motion per arm, and what velocity control did for each (None for the first in the order).

    Raises:
        InfeasibleError: Some arm cannot be kept behind those before it; the message says which, and why.
    """
    motions: dict[int, PhaseTrajectory] = {order[0]: planes[order[0]].fastest()}
    plans: dict[int, VciPlan | None] = {order[0]: None}
    for place, i in enumerate(order[1:], start=1):
        before = order[:place]
        control = VelocityControl(
            slave=planes[i],
            masters=tuple(planes[j] for j in before),
            charts=tuple(chart_between(j, i) for j in before),
            period=period,
        )
        plan = control.plan([motions[j] for j in before])
        motions[i], plans[i] = plan.trajectory, plan
    arms = range(len(planes))
    return tuple(motions[i] for i in arms), tuple(plans[i] for i in arms)


def _name(plane: PhasePlane, otherwise: str) -> str:
    return otherwise if plane.dynamics.arm is None else f"arm {plane.dynamics.arm.name!r}"

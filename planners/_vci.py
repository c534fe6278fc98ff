r"""Velocity control intervals (Lee1991 section 2.4): the slave yields only where, and only as long as, it must.

The slave runs at full speed until it would be past the collision point C(t). Then, in steps of dT,

1. the shortest interval before t in which braking as hard as the limits allow keeps it behind C is its VCI;
2. the room that is left is used: brake over all but the last step of the VCI, and search there the torque that just
   keeps behind C (Fig. 3);
3. if even full acceleration in that step does, the adjusted step moves one step earlier, and those behind it run at
   full acceleration (Fig. 4), and so on.

Made safe where the paper is not: C is the closure of the chart (what blocks *later* counts), it is asked several
times a step with the slave's place at the end and the master's at the beginning, so nothing is missed in between, and
the slave never leaves its controllable set.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple, final

import numpy as np
from numpy.typing import NDArray

from armtempo.errors import InfeasibleError, InputError
from armtempo.planners._coordination_chart import CoordinationChart
from armtempo.planners._phase_kernels import Edges, Rows, advance
from armtempo.planners._phase_plane import Mode, PhasePlane
from armtempo.planners._phase_trajectory import PhaseTrajectory
from armtempo.robots import njit

Array = NDArray[np.float64]

FINEST_CHECK = 0.0001  # [s] C is asked at least this often
MARGIN = 1e-7  # of lambda: how far behind C the slave is kept
BISECTIONS = 40


@njit
def _step(
    rows: Rows,
    edges: Edges,
    lam: float,
    mu: float,
    command: float,
    by_speed: bool,
    dt: float,
    checks: int,
    limit: Array,
    at: int,
    scratch: Array,
) -> tuple[float, float, float, bool]:
    """One step under one command; also the time used and whether it stays behind the limit all the while."""
    used, safe = 0.0, True
    for m in range(checks):
        lam, mu, time, _ = advance(rows, edges, lam, mu, command, by_speed, dt / checks, scratch, 0)
        used += time
        safe = safe and lam <= limit[at * checks + m]
        if lam >= rows.station[-1]:
            break
    return lam, mu, used, safe


@njit
def _replay(
    rows: Rows,
    edges: Edges,
    state: Array,
    command: Array,
    first: int,
    last: int,
    by_speed: bool,
    dt: float,
    checks: int,
    limit: Array,
) -> bool:
    """Run steps first..last from the stored state, storing states; whether all stay behind the limit."""
    scratch = np.empty((0, 3))
    for k in range(first, last + 1):
        state[k + 1, 0], state[k + 1, 1], state[k + 1, 2], safe = _step(
            rows, edges, state[k, 0], state[k, 1], command[k], by_speed, dt, checks, limit, k, scratch
        )
        if not safe:
            return False
    return True


@njit
def control_intervals(
    rows: Rows,
    edges: Edges,
    state: Array,
    command: Array,
    by_speed: bool,
    dt: float,
    checks: int,
    limit: Array,
    count: Array,
    history: Array,
) -> int:
    """Fill commands step by step until arrival; returns the number of steps, or -1 - k if step k cannot be made safe.

    ``state`` (K+1, 3): lam, mu, time used in the step before; row 0 is the start. ``limit`` (K checks,): C at the
    beginning of every check. ``count`` (4,): corrections, those of Fig. 3, those of Fig. 4, longest VCI in steps.
    ``history`` (C, 4): of the first C corrections the step of the collision, first step of the VCI, adjusted step,
    its command.
    """
    end = rows.station[-1]
    k = 0
    while k < command.shape[0]:
        if state[k, 0] >= end:
            return k
        command[k] = 1.0
        if not _replay(rows, edges, state, command, k, k, by_speed, dt, checks, limit):
            first = k
            while True:  # steps 1-4: the shortest interval of braking that avoids the collision
                command[first] = 0.0
                for later in range(first + 1, k + 1):
                    command[later] = 0.0
                if _replay(rows, edges, state, command, first, k, by_speed, dt, checks, limit):
                    break
                if first == 0:
                    return -1 - k
                first -= 1
            adjusted = k
            while True:  # steps 2-5: use the room that is left
                command[adjusted] = 1.0
                if adjusted == first or not _replay(
                    rows, edges, state, command, adjusted, k, by_speed, dt, checks, limit
                ):
                    break
                adjusted -= 1
            low, high = 0.0, 1.0
            if _replay(rows, edges, state, command, adjusted, k, by_speed, dt, checks, limit):
                low = 1.0
            else:
                for _ in range(BISECTIONS):
                    command[adjusted] = 0.5 * (low + high)
                    if _replay(rows, edges, state, command, adjusted, k, by_speed, dt, checks, limit):
                        low = command[adjusted]
                    else:
                        high = command[adjusted]
            command[adjusted] = low
            _replay(rows, edges, state, command, adjusted, k, by_speed, dt, checks, limit)
            done = int(count[0])
            if done < history.shape[0]:
                history[done, 0], history[done, 1], history[done, 2], history[done, 3] = k, first, adjusted, low
            count[0] += 1
            count[1 if adjusted == k else 2] += 1
            count[3] = max(count[3], k - first + 1)
        k += 1
    return k if state[k, 0] >= end else -1 - k


@njit
def _behind(
    rows: Rows,
    edges: Edges,
    lam: float,
    mu: float,
    command: float,
    by_speed: bool,
    dt: float,
    checks: int,
    limit: Array,
) -> bool:
    """Whether one step under a command, then maximum braking to rest, stays behind the limit."""
    scratch = np.empty((0, 3))
    for at in range(limit.shape[0] // checks):
        lam, mu, _, safe = _step(rows, edges, lam, mu, command, by_speed, dt, checks, limit, at, scratch)
        if not safe:
            return False
        command = 0.0
        if mu <= 0.0 or lam >= rows.station[-1]:
            return True
    return True


class VciPlan(NamedTuple):
    """Commands of a slave, one per step, and what it took to find them."""

    commands: Array  # (K,) in [0, 1]
    trajectory: PhaseTrajectory
    corrections: int
    last_step_adjusted: int  # Fig. 3
    earlier_step_adjusted: int  # Fig. 4
    longest_interval: float  # [s]
    history: Array  # (corrections, 4): step of the collision, first step of the VCI, adjusted step, its command


@dataclass(frozen=True, kw_only=True, eq=False)
@final
class VelocityControl:
    """Velocity control intervals of a slave behind a master.

    Attributes:
        slave: Its phase plane.
        master: The master's.
        chart: Chart of (master, slave), built with the clearance wanted.
        period: Step dT, the time for which one command holds [s].
        mode: What a command between 0 (maximum braking) and 1 (full speed) means.
        checks: How often per step the collision point is asked.
    """

    slave: PhasePlane
    master: PhasePlane
    chart: CoordinationChart
    period: float
    mode: Mode = "acceleration"
    checks: int = 0

    def __post_init__(self) -> None:
        if not (math.isfinite(self.period) and self.period > 0.0):
            raise InputError(f"the control period must be positive, got {self.period}")
        if self.checks < 1:
            object.__setattr__(self, "checks", math.ceil(self.period / FINEST_CHECK - 1e-9))

    def _limit(self, master: PhaseTrajectory, steps: int) -> Array:
        """C at the beginning of every check of ``steps`` steps, the master's motion starting now."""
        instants = np.arange(steps * self.checks) * (self.period / self.checks)
        lam = master.at(np.minimum(instants, master.duration))[0]
        column = np.clip((lam / self.chart.step_a - 1e-9).astype(np.int64), 0, self.chart.resolution - 1)
        return self.chart.closure[column] - MARGIN

    def plan(self, master: PhaseTrajectory, lam: float = 0.0, mu: float = 0.0) -> VciPlan:
        """Plan the slave's whole motion from a state, the master's motion starting now.

        Raises:
            InfeasibleError: Braking from now on cannot keep the slave behind the master.
        """
        commands, counts, history = self._solve(master, lam, mu, record=True)
        trajectory = self.slave.motion(
            np.repeat(commands, self.checks),
            np.full(len(commands) * self.checks, self.period / self.checks),
            lam,
            mu,
            mode=self.mode,
        )
        corrections = int(counts[0])
        history = history[:corrections].copy()
        history.setflags(write=False)
        return VciPlan(
            commands, trajectory, corrections, int(counts[1]), int(counts[2]), float(counts[3]) * self.period, history
        )

    def commands(self, master: PhaseTrajectory, lam: float, mu: float) -> Array:
        """The commands of ``plan`` alone, for those who plan on line; raises as it does."""
        return self._solve(master, lam, mu, record=False)[0]

    @cached_property
    def _alone(self) -> float:
        """Minimum time of the slave [s]."""
        return self.slave.fastest().duration

    def _solve(self, master: PhaseTrajectory, lam: float, mu: float, *, record: bool) -> tuple[Array, Array, Array]:
        longest = master.duration + 3.0 * self._alone + 20.0 * self.period
        most = math.ceil(longest / self.period)
        state, commands = np.empty((most + 1, 3)), np.zeros(most)
        state[0] = lam, mu, 0.0
        counts = np.zeros(4)
        history = np.empty((most if record else 0, 4))
        steps = int(control_intervals(
            self.slave.rows, self.slave.edges, state, commands, self.mode == "speed", self.period, self.checks,
            self._limit(master, most), counts, history,
        ))  # fmt: skip
        if steps < 0:
            names = [repr(plane.dynamics.arm.name) if plane.dynamics.arm else "" for plane in (self.master, self.slave)]
            late = (-1 - steps) * self.period
            if late >= master.duration:  # the limit stands still by then: not braking failed, time ran out
                raise InfeasibleError(
                    f"arm {names[0]} ends in the way of arm {names[1]}: closer than {self.chart.d_min:.4g} m for ever",
                    remedy="let the other go first (swap the order of the arms), or move its end",
                    reason="parked in the way",
                )
            raise InfeasibleError(
                f"velocity control cannot keep arm {names[1]} behind arm {names[0]}: it would collide {late:.4g} s "
                "from now even if it brakes at once",
                remedy="let the other arm go first (swap the order of the arms), or move a start or an end",
                reason="braking from the start is not enough",
            )
        return commands[:steps].copy(), counts, history

    def expected(self, master_lam: float, master_mu: float) -> PhaseTrajectory:
        """The motion that the master is expected to make from where it is: full speed."""
        return self.master.motion([1.0], [np.inf], master_lam, master_mu)

    def guarded(self, command: float, lam: float, mu: float, master_lam: float, master_mu: float) -> float:
        """The command in [0, 1], cut back until the slave could still brake behind a master that brakes too.

        ``lam``, ``mu``: the slave's state; ``master_lam``, ``master_mu``: the master's. Maximum braking after one
        period must stay behind a master that brakes as hard as it can from now on. Every master is at least as far as
        that one, so a master that is late, slow or stops costs time, never a collision.
        """
        stopping = self.master.braking(master_lam, master_mu)
        longest = self.period + self.slave.braking(lam, mu).duration + self._alone
        limit = self._limit(stopping, math.ceil(longest / self.period))
        by_speed = self.mode == "speed"

        def safe(candidate: float) -> bool:
            return _behind(
                self.slave.rows, self.slave.edges, lam, mu, candidate, by_speed, self.period, self.checks, limit
            )

        if safe(command):
            return command
        low, high = 0.0, command
        for _ in range(BISECTIONS // 2):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if safe(middle) else (low, middle)
        return low

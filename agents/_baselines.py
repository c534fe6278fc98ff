"""Baseline policies: the planners of the field, acting through the same door as learned agents.

``phase-plane``  every arm runs its path in minimum time, whatever the others do
``vci``          velocity control intervals (Lee1991 section 2.4), on line: planned anew in every control period from
what is seen
``random``       uniform actions
and the schedules (``sequential``, ``constant-speed``, ``constant-acceleration``, ``delay``, ``optimal``), executed by
precedence: the arm that goes second is released by how far the first *is*, not by the clock.
"""

from __future__ import annotations

from collections import deque
from typing import final

import numpy as np

from armtempo.agents._policy import Actions, Observations, Policy, to_action
from armtempo.envs import OTHER, OWN, CoordinationEnv, share
from armtempo.errors import InfeasibleError, UnknownNameError
from armtempo.planners import METHODS, Cell, Mode, PhasePlane, Schedule, VelocityControl, schedule

_OWN = {entry.name: k for k, entry in enumerate(OWN)}
_OTHER = {entry.name: len(OWN) + k for k, entry in enumerate(OTHER)}
_BISECTIONS = 30
_CATCH_UP = 0.5  # of a period: a larger lag of the first arm stops its clock
_FINEST_CHECK = 0.001  # [s] a collision point is asked at least about this often
_AS_EXPECTED = 1e-4  # of a path: a smaller surprise is no reason to plan anew


def _position(cell: Cell, arm: int, progress: float, speed: float) -> tuple[float, float]:
    """``lam`` and ``mu`` of an arm from its entries of an observation."""
    plane = cell.planes[arm]
    lam = share(progress) * plane.length
    return lam, share(speed) * plane.edge_speed(lam)


def _states(cell: Cell, observations: Observations) -> list[tuple[float, float]]:
    """``lam``, ``mu`` of both arms as the agents see them; an arm whose agent has left is at its end."""
    states = [(plane.length, 0.0) for plane in cell.planes]
    for agent, row in observations.items():
        arm = int(agent.rsplit("_", 1)[1])
        states[arm] = _position(cell, arm, float(row[_OWN["progress"]]), float(row[_OWN["speed"]]))
        if row[_OTHER["present"]] > 0.5 and len(cell.arms) == 2:
            states[1 - arm] = _position(cell, 1 - arm, float(row[_OTHER["progress"]]), float(row[_OTHER["speed"]]))
    return states


def _foresee(
    plane: PhasePlane, lam: float, mu: float, command: float, period: float, ticks: int, mode: Mode
) -> tuple[float, float]:
    """Where an arm will be after a period, moved tick by tick as in the environment, and the time it will have used."""
    total = 0.0
    for _ in range(ticks):
        lam, mu, used = plane.advance(lam, mu, command, period / ticks, mode=mode)
        total += used
        if lam >= plane.length:
            break
    return lam, total


def _control(cell: Cell, order: tuple[int, ...], mode: Mode) -> VelocityControl:
    """Velocity control of the second arm in ``order`` behind the first."""
    first, second = order
    return VelocityControl(
        slave=cell.planes[second],
        master=cell.planes[first],
        chart=cell.chart if order == (0, 1) else cell.chart.swapped,
        period=cell.control_period,
        mode=mode,
        checks=cell.ticks_per_period * max(round(cell.physics_tick / _FINEST_CHECK), 1),  # whole parts of its ticks
    )


@final
class PhasePlanePolicy:
    """Every arm in minimum time (Lee1991 section 2.2): the master's policy. For all arms at once it collides."""

    def reset(self, seed: int | None = None) -> None:
        """Nothing to forget."""

    def act(self, observations: Observations, env: CoordinationEnv) -> Actions:
        """Full speed."""
        return {agent: to_action(1.0) for agent in observations}


@final
class RandomPolicy:
    """Uniform actions."""

    def __init__(self) -> None:
        self.reset()

    def reset(self, seed: int | None = None) -> None:
        """Start the random numbers again."""
        self._random = np.random.default_rng(seed)

    def act(self, observations: Observations, env: CoordinationEnv) -> Actions:
        """Draw one action for every agent."""
        return {agent: self._random.uniform(-1.0, 1.0, 1).astype(np.float32) for agent in observations}


@final
class VciPolicy:
    """The master in minimum time, the slave by velocity control intervals, on line.

    The slave plans from what it sees, expecting the master to go on at full speed, and keeps to that plan as long as it
    sees what it expected; else it plans anew. Every command is cut back until the slave could still brake behind a
    master that brakes too: a master that is late, slow or stops costs time, never a collision.
    """

    def __init__(self, cell: Cell) -> None:
        self._cell = cell
        self._control: VelocityControl | None = None
        self.reset()

    def reset(self, seed: int | None = None) -> None:
        """Forget the plan."""
        self._commands: deque[float] = deque()
        self._expected = (-1.0, -1.0)

    def act(self, observations: Observations, env: CoordinationEnv) -> Actions:
        """Full speed for the master; for the slave its planned command, guarded."""
        actions = {agent: to_action(1.0) for agent in observations}
        if len(self._cell.arms) < 2 or "arm_1" not in observations:
            return actions
        if self._control is None or self._control.mode != env.mode:
            self._control = _control(self._cell, (0, 1), env.mode)
        (master_lam, master_mu), (lam, mu) = _states(self._cell, observations)
        actions["arm_1"] = to_action(self._command(self._control, lam, mu, master_lam, master_mu))
        return actions

    def _command(self, control: VelocityControl, lam: float, mu: float, master_lam: float, master_mu: float) -> float:
        surprise = max(abs(lam - self._expected[0]), abs(master_lam - self._expected[1]))
        if surprise > _AS_EXPECTED * control.slave.length or not self._commands:
            try:
                self._commands = deque(control.commands(control.expected(master_lam, master_mu), lam, mu))
            except InfeasibleError:  # too late to stay behind: brake, and see
                self._commands = deque([0.0])
        command = control.guarded(self._commands.popleft() if self._commands else 1.0, lam, mu, master_lam, master_mu)
        ticks = self._cell.ticks_per_period
        self._expected = (
            _foresee(control.slave, lam, mu, command, control.period, ticks, control.mode)[0],
            _foresee(control.master, master_lam, master_mu, 1.0, control.period, ticks, "speed")[0],
        )
        return command


@final
class SchedulePolicy:
    """Executes a schedule by precedence.

    The arm that goes first follows its own motion, and waits for itself when it is held up. The second follows the
    clock of the first: the planned time of the position at which that one *is*, so it is released by the first arm's
    lambda. Its commands are guarded as in ``VciPolicy``: a first arm that is slow or stops costs time, never a
    collision.
    """

    def __init__(self, plan: Schedule) -> None:
        self.plan = plan
        self._control: VelocityControl | None = None
        self.reset()

    def reset(self, seed: int | None = None) -> None:
        """Set the clocks of the plan back."""
        self._leading: float | None = None
        self._following = 0.0

    def act(self, observations: Observations, env: CoordinationEnv) -> Actions:
        """For every arm the command that brings it to, not past, its planned position at the end of the period."""
        plan, period = self.plan, env.cell.control_period
        states = _states(env.cell, observations)
        leader = plan.order[0]
        motion, lam = plan.trajectories[leader], states[leader][0]
        planned = float(motion.time_at(lam))  # when the plan has the leader where it is
        if lam < motion.lam[-1] * (1.0 - 1e-6):
            self._following = planned
        else:
            self._following = max(self._following + period, motion.duration)
        # The leader's own clock runs on through small lags, so that they are caught up; it waits when it is held.
        ahead = 0.0 if self._leading is None else self._leading + period
        self._leading = min(ahead, planned + _CATCH_UP * period)
        actions = {}
        for agent in observations:
            arm = int(agent.rsplit("_", 1)[1])
            clock = self._leading if arm == leader else self._following
            command = self._command(env, arm, *states[arm], clock)
            if arm != leader:
                if self._control is None or self._control.mode != env.mode:
                    self._control = _control(env.cell, plan.order, env.mode)
                command = self._control.guarded(command, *states[arm], *states[leader])
            actions[agent] = to_action(command)
        return actions

    def _command(self, env: CoordinationEnv, arm: int, lam: float, mu: float, clock: float) -> float:
        """The largest command that does not bring the arm farther, or to its end earlier, than planned."""
        motion, plane, period = self.plan.trajectories[arm], env.cell.planes[arm], env.cell.control_period
        near = 1e-6 * plane.length  # observations are float32
        target = float(motion.at(clock + period)[0]) + near
        earliest = motion.duration - clock - 1e-6 * motion.duration

        def behind(command: float) -> bool:
            reached, used = _foresee(plane, lam, mu, command, period, env.cell.ticks_per_period, env.mode)
            return reached <= target and (reached < plane.length or used >= earliest)

        if behind(1.0):
            return 1.0
        if mu <= 0.0 and target <= lam + 2.0 * near:
            return 0.0
        low, high = 0.0, 1.0
        for _ in range(_BISECTIONS):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if behind(middle) else (low, middle)
        return low


POLICIES = ("phase-plane", *METHODS, "random")


def make_policy(name: str, cell: Cell, plan: Schedule | None = None) -> Policy:
    """A baseline by name.

    Args:
        name: One of ``POLICIES``.
        cell: What it acts in.
        plan: Its schedule, where it is known already.

    Raises:
        UnknownNameError: No such policy.
        InfeasibleError: Its schedule does not exist in this cell.
    """
    if name == "phase-plane":
        return PhasePlanePolicy()
    if name == "random":
        return RandomPolicy()
    if name == "vci":
        return VciPolicy(cell)
    if name in METHODS:
        return SchedulePolicy(plan if plan is not None else schedule(cell, name))
    raise UnknownNameError("policy", name, POLICIES)

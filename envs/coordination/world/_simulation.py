"""Episodes of a cell, tick by tick: references along the paths, physics or none, clearance, arrival, violation.

Both environments run on this; it knows arms and time, not agents, spaces or rewards.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, final

import numpy as np
from numpy.typing import ArrayLike

from armtempo.arrays import Bools, Floats, Floats32
from armtempo.envs.bodies import Controller, End, Recorder, Settling, Trace
from armtempo.envs.coordination.world._disturbance import (
    START_ATTEMPTS,
    describe,
    draw,
    make_draws,
    stops_max,
    uncertain_arms,
)
from armtempo.envs.coordination.world._entries import OTHER, OTHERS, OWN, SIZE
from armtempo.envs.coordination.world._ideal_torque import ideal_torque
from armtempo.envs.coordination.world._keeping_up import first_rate, keeps_up
from armtempo.envs.coordination.world._kernels import (
    move,
    moved_closer,
    observe,
    reference_joints,
    run_periods,
    scratch_for,
    tip_positions,
    tracking_error,
)
from armtempo.envs.coordination.world._options import CoordinationOptions
from armtempo.envs.coordination.world._pace import obeyed_commands, pace
from armtempo.envs.coordination.world._world import (
    Episodes,
    World,
    breaks_rule,
    check_places,
    ideal_world,
    make_episodes,
    pack,
)
from armtempo.planners import CoordinationCell
from armtempo.robots import Arm
from armtempo.state import Stateful


def _levers(arm: Arm) -> Floats:
    """(n,) how far a point of the arm's shapes gets, at most, per radian or metre of each joint."""
    ends, radius = np.stack([arm.capsules.p0, arm.capsules.p1]), arm.capsules.radius
    reach = np.linalg.norm(ends, axis=2).max(axis=0) + radius
    q_max = np.maximum(np.abs(arm.position_min), np.abs(arm.position_max))
    most: Floats = arm.levers(reach, q_max).max(axis=1, initial=0.0)
    return most


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class CoordinationTrace(Trace[tuple[Floats, ...]]):
    """An episode at its ticks; A arms, T + 1 rows (row 0 is the start; torques of row k act from tick k - 1 to k).

    Attributes:
        time: (T+1,) [s].
        lam: (T+1, A) reference positions along the paths.
        mu: (T+1, A) reference path speeds.
        q: one (T+1, n) per arm, joint positions: measured, or on the path without physics [rad].
        torque: one (T+1, n) per arm, applied [N m].
        demand: one (T+1, n) per arm, before clipping at the limits [N m].
        clearance: (T+1,) smallest distance of two arms [m]; where it is above the smallest so far, a lower bound.
        path_error: (T+1, A) distance of the tips from their references [m].
        arrival: (A,) instants of arrival [s], nan where an arm did not arrive.
        violations: Number of ticks with a clearance below ``d_min``, or with a rule broken.
        torque_max: one (n,) per arm, the limits [N m].
    """

    lam: Floats
    mu: Floats
    clearance: Floats
    path_error: Floats
    arrival: Floats
    violations: int

    @property
    def makespan(self) -> float:
        """Instant at which the last arm arrived [s]; nan if one did not."""
        return float(np.max(self.arrival))

    @property
    def arrived(self) -> float:
        """The ``makespan``."""
        return self.makespan


@final
class CoordinationSimulation(Stateful):
    """One cell, run in control periods.

    Args:
        cell: Arms on their paths.
        options: Of its episodes; the shield and the time limit are not its business.
        record: Keep a trace.

    Attributes:
        lam, mu: (A,) the references now.
        time: Instant [s].
        arrival: (A,) instants of arrival, nan before; in ``bullet`` known once the tip has settled.
        violated: Whether two arms came closer than ``d_min``, or broke a rule.
        min_clearance: Smallest clearance so far [m].
        options: As given.
        keeps_up: Whether the cell's torque reserve is enough for the errors of the options; where it is not, that is
            said in the log, and arms are late.

    Raises:
        InputError: The cell has no such arm as the one that is disturbed.
    """

    changing = (
        "_episodes", "_ticks", "violated", "_violations", "min_clearance", "_drawn", "_settling", "_controller",
        "_recorder", "_q_asked", "_distance_asked", "_observation",
    )  # fmt: skip

    def __init__(self, cell: CoordinationCell, options: CoordinationOptions, *, record: bool = False) -> None:
        self.cell, self.options, self.physics, self.record = cell, options, options.physics, record
        self._draws = make_draws(cell, options.disturbance, options.start_phase, options.master_late_s)
        self._noise = float(options.observation_noise)
        arms, ticks = len(cell.arms), cell.ticks_per_period
        tables = options.physics == "ideal" or self._draws.phase[1] > 0.0
        self._world = ideal_world(cell, options.mode) if tables else pack(cell, options.mode)
        self._episodes = make_episodes(1, arms, stops_max(self._draws))
        self._scratch = scratch_for(1, arms, ticks)
        self._active = np.ones(1, dtype=np.bool_)
        self._unused = np.zeros((1, arms)), np.zeros((1, arms), dtype=np.bool_), np.zeros((1, arms), dtype=np.bool_)
        self._tick, self._d_min = cell.physics_tick, cell.d_min  # kept: the configuration behind them is slow to ask
        self._lengths, self._alone = np.array([path.length for path in cell.paths]), arms < 2
        self._controller = Controller(
            cell, options.physics, model_error=options.model_error, friction_error=options.friction_error
        )
        self._joints = np.zeros((ticks, *self._q.shape))
        self._obeyed, self._began, self._motion = np.zeros(arms), np.zeros((3, arms)), np.zeros((3, arms))
        self._starts = self._joints_at(np.zeros(arms))
        self._goals = np.zeros((arms, 3))
        tip_positions(self._world, self._joints_at(self._lengths), self._goals)
        self._q_asked, self._distance_asked = np.zeros_like(self._q), math.inf
        self._lever = np.zeros_like(self._q)
        for i, arm in enumerate(cell.arms):
            self._lever[i, : arm.dof] = _levers(arm)
        self._observation = np.zeros((1, arms, SIZE), dtype=np.float32)
        self._tips, self._tips_before = np.zeros((arms, 3)), np.zeros((arms, 3))
        self._settling = Settling(arms)
        self._recorder = Recorder(wanted=record, tick=self._tick)
        self.keeps_up = keeps_up(cell, options)
        self._clock_first = 1.0
        if options.physics != "ideal":
            self._clock_first = first_rate(self._world, cell, options, enough=self.keeps_up)
        self.reset()

    def check_state(self, state: Mapping[str, Any]) -> None:
        """Raise InputError for a state with arms off their paths, too."""
        super().check_state(state)
        check_places(state, self._lengths)

    def _joints_at(self, lam: Floats) -> Floats:
        """(A, n) joint positions on the paths at ``lam`` (A,)."""
        q = np.zeros_like(self._q)
        for i, path in enumerate(self.cell.paths):
            q[i, : path.dof] = path.evaluate(lam[i])[0]
        return q

    def reset(
        self,
        late: ArrayLike | None = 0.0,
        *,
        key: int = 0,
        number: int = 0,
        accepts: Callable[[], bool] | None = None,
    ) -> None:
        """Back to the start, at rest; all that is drawn belongs to ``key`` (64 bits) and the ``number`` of the episode.

        ``late`` (A,) [s]: how long each arm stands before it obeys its commands, besides its disturbance; None: the
        first one as drawn from ``master_late_s``. ``accepts``: whether the places drawn will do; asked while there are
        attempts left.
        """
        episodes = self._episodes
        episodes.key[0], episodes.number[0] = key, number
        attempt = 0
        while True:
            attempt = draw(self._world, self._draws, episodes, 0, -1.0 if late is None else 0.0, attempt)
            if accepts is None or attempt >= START_ATTEMPTS or accepts():
                break
            attempt += 1
        if late is not None:
            episodes.late[0] += np.asarray(late, dtype=np.float64)
        self._settling.reset()
        episodes.clock[0] = self._clock_first
        self._ticks = 0
        self.violated = False
        self._violations = 0
        self._controller.reset(self._joints_at(self.lam) if self.lam.any() else self._starts)
        nearest = float(episodes.smallest[0]) if self.physics == "ideal" else self._nearest(math.inf)
        self.min_clearance = nearest
        self._drawn = describe(episodes, 0, self._lengths)
        self._recorder.clear()
        if self.record:
            self._keep(nearest, np.zeros(self.arms))

    @property
    def _q(self) -> Floats:
        return self._controller.q

    @property
    def lam(self) -> Floats:
        """(A,) where the references are now; not kept beside the episodes: a copy would have one of its own."""
        lam: Floats = self._episodes.lam[0]
        return lam

    @property
    def mu(self) -> Floats:
        """(A,) their speeds now."""
        mu: Floats = self._episodes.mu[0]
        return mu

    @property
    def time(self) -> float:
        """Instant [s]."""
        return self._ticks * self._tick

    @property
    def arrival(self) -> Floats:
        """(A,) instants of arrival [s], nan before."""
        return self._settling.arrival

    @property
    def end(self) -> End:
        """When the last arm arrived, and whether two came too close."""
        return End(float(np.max(self.arrival)), self.violated)

    @property
    def episodes(self) -> Episodes:
        """The episode as compiled loops take it, one of one."""
        return self._episodes

    @property
    def world(self) -> World:
        """The cell as compiled loops take it."""
        return self._world

    @property
    def uncertain(self) -> Bools:
        """(A,) arms that may do less than they are told in this episode: all, where the clock may go slower."""
        uncertain: Bools = uncertain_arms(self._episodes)[0] | (not self.keeps_up or self.clock < 1.0)
        return uncertain

    @property
    def clock(self) -> float:
        """How fast the references' time goes, at most; below 1 where torques do not suffice, and so ``mu``, too."""
        return float(self._episodes.clock[0])

    def tracking_error(self) -> Floats:
        """(A,) how far the tips are from their references now [m]."""
        error = np.zeros(self.arms)
        if self.physics != "ideal":
            tracking_error(self._world, self.lam, self._q, error)
        return error

    def path_errors(self) -> tuple[Floats, Floats]:
        """(A,) how far the tips are off their paths now, and along them from their references [m]; to first order."""
        off, along = np.zeros(self.arms), np.zeros(self.arms)
        for i, (arm, path) in enumerate(zip(self.cell.arms, self.cell.paths, strict=True)):
            wanted, slope, _ = path.evaluate(self.lam[i])
            error = (arm.tip_pose(self.joint_positions()[i, : arm.dof]) - arm.tip_pose(wanted))[:3, 3]
            direction = arm.jacobian(wanted)[:3] @ slope
            length = float(np.linalg.norm(direction))
            along[i] = abs(error @ direction) / length if length > 0.0 else 0.0
            off[i] = math.sqrt(max(float(error @ error) - along[i] ** 2, 0.0))
        return off, along

    @property
    def clipped(self) -> bool:
        """Whether torques were, in the last tick."""
        return self._controller.clipped

    @property
    def arms(self) -> int:
        """Number of arms."""
        return len(self.cell.arms)

    @property
    def drawn(self) -> dict[str, Any]:
        """What the last reset drew: late_s, speed and start_phase of every arm, its stops_s (from, until)."""
        return self._drawn

    def _nearest(self, cutoff: float) -> float:
        """Smallest distance of two arms; above ``cutoff`` it may be a lower bound.

        Nothing is asked while the last answer minus what the arms have moved since stays above ``cutoff``, unless it
        is recorded: a trace is to show the distance, not such a bound.
        """
        if self._alone:
            return math.inf
        now = self._controller.q
        if cutoff < math.inf and not self.record:
            bound = float(self._distance_asked - moved_closer(self._q_asked, now, self._lever))
            if bound >= cutoff:
                return bound
        q = [row[: arm.dof] for row, arm in zip(now, self.cell.arms, strict=True)]
        self._q_asked[:] = now
        self._distance_asked = self.cell.clearance.arms(q, cutoff).distance
        return self._distance_asked

    def step(self, commands: Floats) -> None:
        """Run one control period under ``commands`` (A,) in [0, 1]; stops at the first tick with a violation."""
        commands = np.asarray(commands, dtype=np.float64).reshape(1, -1)
        if self.physics == "ideal":
            self._step_ideal(commands)
        else:
            self._step_bullet(commands)

    def _step_ideal(self, commands: Floats) -> None:
        episodes, began = self._episodes, self._ticks
        run_periods(
            self._world, episodes, 0, 1, self._active, commands, self._d_min, 1.0, math.inf, False, self._noise,
            OTHERS, len(OWN), len(OTHER), self._scratch, self._observation, *self._unused,
        )  # fmt: skip
        self._ticks = int(episodes.ticks[0])
        self.violated = bool(episodes.violated[0])
        self._violations += self.violated
        self.arrival[:] = episodes.arrival[0]
        self.min_clearance = float(episodes.smallest[0])
        if self.record:
            ran, scratch = self._ticks - began, self._scratch
            self._recorder.extend(
                lam=scratch.places[0, :, :ran].T,
                mu=scratch.speeds[0, :, :ran].T,
                clearance=scratch.clearance[0, :ran],
                path_error=np.zeros((ran, self.arms)),
            )

    def _step_bullet(self, commands: Floats) -> None:
        """The references of the period are those of ``ideal``, as fast as the clock; the arms follow tick by tick.

        From the first tick with a torque that does not suffice the rest of the period is worked out tick by tick.
        """
        episodes, scratch, controller = self._episodes, self._scratch, self._controller
        began, rate, planned = self._began, self.clock, True
        began[0], began[1], began[2] = self.lam, self.mu, episodes.arrival[0]
        move(self._world, episodes, 0, 1, self._active, commands, scratch)
        reference_joints(self._world, scratch.places[0], self._joints)
        self._first_end = float(np.fmin.reduce(episodes.arrival[0]))
        k = 0
        for k, joints in enumerate(self._joints):
            if planned and controller.ask(joints):
                planned = False
                obeyed_commands(self._world, episodes, commands, self._obeyed)
                self._go_back(k)
                rate = self._pace()
            elif not planned:
                controller.shift()
                rate = self._pace()
            elif self.record or len(self._world.rules):
                self.lam[:], self.mu[:] = scratch.places[0, :, k], scratch.speeds[0, :, k]
            self._tick_bullet(rate)
            if self.violated:
                episodes.violated[0] = True
                break
        if planned:
            self.lam[:], self.mu[:] = scratch.places[0, :, k], scratch.speeds[0, :, k]
        episodes.ticks[0] = self._ticks
        episodes.steps[0] += 1

    def _go_back(self, k: int) -> None:
        """The references are where they were at the begin of tick k of the period."""
        episodes, scratch, began = self._episodes, self._scratch, self._began
        if k:
            began[0], began[1] = scratch.places[0, :, k - 1], scratch.speeds[0, :, k - 1]
        not_yet = ~(episodes.arrival[0] <= self.time + 1e-12)
        self.lam[:], self.mu[:], episodes.arrival[0, not_yet] = began[0], began[1], began[2, not_yet]

    def _pace(self) -> float:
        """The references of one tick, and the torques, at the rate at which torques suffice; the rate."""
        episodes, controller = self._episodes, self._controller
        episodes.ticks[0] = self._ticks
        rate = pace(
            self._world, episodes, self._obeyed, controller.gain, controller.measured, controller.reference,
            controller.demand, controller.torque, self._motion,
        )  # fmt: skip
        self.lam[:], self.mu[:], episodes.arrival[0] = self._motion
        self._first_end = float(np.fmin.reduce(episodes.arrival[0]))
        return rate

    def _tick_bullet(self, rate: float) -> None:
        """One tick with the torques that are worked out."""
        self._controller.act()
        self._ticks += 1
        nearest = self._nearest(self.min_clearance)
        self.min_clearance = min(self.min_clearance, nearest)
        if not nearest >= self._d_min or breaks_rule(self._world, self.lam):
            self.violated = True
            self._violations += 1
        if self._first_end <= self.time + 1e-12:
            self._settle()
        if self.record:
            self._keep(nearest, self.tracking_error(), rate)

    def _settle(self) -> None:
        """Whether arms whose references have ended are where they are to be."""
        tick, q = self._tick, self._q
        tip_positions(self._world, q - tick * self._controller.qd, self._tips_before)  # the step was q' = q + dt qd'
        tip_positions(self._world, q, self._tips)
        speed = np.linalg.norm(self._tips - self._tips_before, axis=1) / tick
        distance = np.linalg.norm(self._tips - self._goals, axis=1)
        self._settling.watch(self.time, self._episodes.arrival[0], distance, speed)

    def _keep(self, nearest: float, path_error: Floats, rate: float = 1.0) -> None:
        """A row of the trace; joints and torques without physics follow from the others."""
        lam, mu = self.lam, rate * self.mu
        known: dict[str, ArrayLike] = {"lam": lam, "mu": mu, "clearance": nearest, "path_error": path_error}
        if self.physics == "ideal":
            self._recorder.add(**known)
        else:
            controller = self._controller
            self._recorder.add(**known, q=controller.q, torque=controller.torque, demand=controller.demand)

    def observe(self) -> Floats32:
        """(A, 21) observations of all arms, in the order of ``COORDINATION_ENTRIES``; a new array."""
        if self.physics != "ideal" or self._ticks == 0:
            observe(
                self._world, self._episodes, 0, 1, self._active, self._noise, OTHERS, len(OWN), len(OTHER),
                self._scratch, self._observation,
            )  # fmt: skip
        observation: Floats32 = self._observation[0].copy()
        return observation

    def joint_positions(self) -> Floats:
        """(A, n) joint positions now: measured, or on the path without physics [rad]."""
        return self._q.copy() if self.physics != "ideal" else self._joints_at(self.lam)

    def trace(self) -> CoordinationTrace:
        """What happened so far.

        Raises:
            InputError: Nothing was recorded.
        """
        columns, arms = self._recorder.columns(), self.cell.arms
        if self.physics != "ideal":
            q, torque, demand = (
                tuple(np.ascontiguousarray(rows[:, i, : arm.dof]) for i, arm in enumerate(arms))
                for rows in [columns.pop(name) for name in ("q", "torque", "demand")]
            )
        else:
            lam, mu = columns["lam"], columns["mu"]
            q = tuple(path.evaluate(lam[:, i])[0] for i, path in enumerate(self.cell.paths))
            torque = demand = tuple(
                ideal_torque(one, lam[:, i], mu[:, i], self._tick) for i, one in enumerate(self.cell.dynamics)
            )
        return CoordinationTrace(
            **columns,
            q=q,
            torque=torque,
            demand=demand,
            arrival=self.arrival.copy(),
            violations=self._violations,
            torque_max=tuple(arm.torque_max for arm in arms),
        )

    def close(self) -> None:
        """Leave PyBullet; may be called twice."""
        self._controller.close()

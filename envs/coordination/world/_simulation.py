"""Episodes of a cell, tick by tick: references along the paths, physics or none, clearance, arrival, violation.

Both environments run on this; it knows arms and time, not agents, spaces or rewards.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, final

import numpy as np
from numpy.typing import ArrayLike

from armtempo.arrays import Bools, Floats, Floats32
from armtempo.envs.bodies import (
    CONTROLLER_GAIN,
    PHYSICS,
    SETTLED_DISTANCE,
    SETTLED_SPEED,
    SETTLED_TIME,
    Physics,
    Scene,
    pybullet,
)
from armtempo.envs.coordination.world._disturbance import (
    ATTEMPTS,
    Disturbance,
    Range,
    as_noise,
    describe,
    draw,
    draws_of,
    stops_of,
    uncertain_arms,
)
from armtempo.envs.coordination.world._entries import OTHER, OTHERS, OWN, SIZE
from armtempo.envs.coordination.world._kernels import (
    control,
    move,
    moved_closer,
    observe,
    run_periods,
    scratch_for,
    tip_positions,
    tracking_error,
)
from armtempo.envs.coordination.world._world import World, episodes_of, ideal_world, pack
from armtempo.errors import InputError, UnknownNameError
from armtempo.planners import CoordinationCell
from armtempo.planners.topp import Mode
from armtempo.robots import Arm

MODES: tuple[Mode, ...] = ("speed", "acceleration")


def _levers(arm: Arm) -> Floats:
    """(n,) how far a point of the arm's shapes gets, at most, per radian or metre of each joint."""
    ends, radius = np.stack([arm.capsules.p0, arm.capsules.p1]), arm.capsules.radius
    reach = np.linalg.norm(ends, axis=2).max(axis=0) + radius
    q_max = np.maximum(np.abs(arm.position_min), np.abs(arm.position_max))
    most: Floats = arm.levers(reach, q_max).max(axis=1, initial=0.0)
    return most


def _check_errors(physics: Physics, model_error: float, friction_error: float) -> None:
    for name, value in (("model_error", model_error), ("friction_error", friction_error)):
        if not (math.isfinite(value) and value > -1.0):
            raise InputError(f"{name} must be a finite share above -1, got {value!r}", remedy="give 0 for none")
        if value and physics != "bullet":
            raise InputError(f"{name} is for simulated bodies, physics is {physics!r}", remedy='use physics="bullet"')


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class CoordinationTrace:
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
        violations: Number of ticks with a clearance below ``d_min``.
        torque_max: one (n,) per arm, the limits [N m].
    """

    time: Floats
    lam: Floats
    mu: Floats
    q: tuple[Floats, ...]
    torque: tuple[Floats, ...]
    demand: tuple[Floats, ...]
    clearance: Floats
    path_error: Floats
    arrival: Floats
    violations: int
    torque_max: tuple[Floats, ...]

    @property
    def makespan(self) -> float:
        """Instant at which the last arm arrived [s]; nan if one did not."""
        return float(np.max(self.arrival))

    @property
    def torque_ratio_max(self) -> float:
        """Largest |applied torque| / limit."""
        return max(float(np.max(np.abs(t) / m)) for t, m in zip(self.torque, self.torque_max, strict=True))

    @property
    def torque_demand_ratio_max(self) -> float:
        """Largest |demanded torque| / limit."""
        return max(float(np.max(np.abs(t) / m)) for t, m in zip(self.demand, self.torque_max, strict=True))

    @property
    def torque_clipped_fraction(self) -> float:
        """Share of joint torques that were clipped by more than a thousandth of their limit, until the last arrival."""
        until = self.time <= (self.makespan if math.isfinite(self.makespan) else np.inf)
        clipped = [np.abs(t)[until] > 1.001 * m for t, m in zip(self.demand, self.torque_max, strict=True)]
        return float(np.mean(np.concatenate([c.ravel() for c in clipped])))


@final
class CoordinationSimulation:
    """One cell, run in control periods.

    Args:
        cell: Arms on their paths.
        physics: ``bullet``: torque-controlled in PyBullet, FCL clearance at every tick. ``ideal``: on the paths,
            without tracking error, clearance from a table.
        mode: What a command in [0, 1] means, see ``PhasePlane.advance``.
        record: Keep a trace.
        disturbance: What may go wrong with arms (see ``Disturbance``), or the name of a family of it.
        observation_noise: Standard deviation of normal noise on every entry that is not 0/1-valued or padding, clipped
            into the space.
        start_phase: Share of the path where each arm starts, at rest: a number, or (lowest, highest). Draws closer than
            plans allow, or where an arm cannot stand, are drawn again, at most 32 times; then all start at 0.
        master_late_s: How long the first arm stands at its start [s]: a number, or (lowest, highest).
        model_error: In ``bullet``, by what share the simulated bodies are heavier than the plans' (-0.1: lighter).
        friction_error: In ``bullet``, by what share the joints' damping and dry friction are larger.

    Attributes:
        lam, mu: (A,) the references now.
        time: Instant [s].
        arrival: (A,) instants of arrival, nan before; in ``bullet`` known once the tip has settled.
        violated: Whether two arms came closer than ``d_min``.
        min_clearance: Smallest clearance so far [m].
    """

    def __init__(
        self,
        cell: CoordinationCell,
        *,
        physics: Physics = "bullet",
        mode: Mode = "speed",
        record: bool = False,
        disturbance: str | Disturbance | None = None,
        observation_noise: float = 0.0,
        start_phase: float | Range = 0.0,
        master_late_s: float | Range = 0.0,
        model_error: float = 0.0,
        friction_error: float = 0.0,
    ) -> None:
        if physics not in PHYSICS:
            raise UnknownNameError("physics", str(physics), PHYSICS)
        if mode not in MODES:
            raise UnknownNameError("mode", str(mode), MODES)
        self.cell, self.physics, self.mode, self.record = cell, physics, mode, record
        self._draws = draws_of(cell, disturbance, start_phase, master_late_s)
        self._noise = as_noise(observation_noise)
        _check_errors(physics, model_error, friction_error)
        arms = len(cell.arms)
        width = max(arm.dof for arm in cell.arms)
        tables = physics == "ideal" or self._draws.phase[1] > 0.0
        self._world = ideal_world(cell, mode) if tables else pack(cell, mode)
        self._episodes = episodes_of(1, arms, stops_of(self._draws))
        self._scratch = scratch_for(1, arms, cell.ticks_per_period)
        self._active = np.ones(1, dtype=np.bool_)
        self._unused = np.zeros((1, arms)), np.zeros((1, arms), dtype=np.bool_), np.zeros((1, arms), dtype=np.bool_)
        self.lam, self.mu = self._episodes.lam[0], self._episodes.mu[0]
        self._tick, self._d_min = cell.physics_tick, cell.d_min  # kept: the configuration behind them is slow to ask
        self._lengths = np.array([path.length for path in cell.paths])
        self._starts = np.zeros((arms, width))
        self._goals = np.zeros((arms, 3))
        goals = np.zeros((arms, width))
        for i, path in enumerate(cell.paths):
            self._starts[i, : path.dof] = path.evaluate(0.0)[0]
            goals[i, : path.dof] = path.evaluate(path.length)[0]
        tip_positions(self._world, goals, self._goals)
        self._measured = np.zeros((2, arms, width))
        self._q, self._qd = self._measured
        self._q_asked, self._distance_asked = np.zeros((arms, width)), math.inf
        self._lever = np.zeros((arms, width))
        for i, arm in enumerate(cell.arms):
            self._lever[i, : arm.dof] = _levers(arm)
        self._torque, self._demand = np.zeros((arms, width)), np.zeros((arms, width))
        self._reference = np.zeros((3, arms, width))
        self._observation = np.zeros((1, arms, SIZE), dtype=np.float32)
        self._tips, self._tips_before, self._error = np.zeros((arms, 3)), np.zeros((arms, 3)), np.zeros(arms)
        self._scene: Scene | None = None
        if physics == "bullet":
            self._scene = Scene(cell)
            pybullet.setGravity(*cell.config.gravity_m_s2, physicsClientId=self._scene.client)
            pybullet.setPhysicsEngineParameter(
                numSolverIterations=10, deterministicOverlappingPairs=1, physicsClientId=self._scene.client
            )
            if model_error:
                self._scene.weigh(1.0 + model_error)
            if friction_error:
                self._scene.rub(1.0 + friction_error)
        self.reset()

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
        arms, episodes = len(self.cell.arms), self._episodes
        episodes.key[0], episodes.number[0] = key, number
        attempt = 0
        while True:
            attempt = draw(self._world, self._draws, episodes, 0, -1.0 if late is None else 0.0, attempt)
            if accepts is None or attempt >= ATTEMPTS or accepts():
                break
            attempt += 1
        if late is not None:
            episodes.late[0] += np.asarray(late, dtype=np.float64)
        starts = self._starts
        if self.lam.any():
            starts = np.zeros_like(self._starts)
            for i, path in enumerate(self.cell.paths):
                starts[i, : path.dof] = path.evaluate(self.lam[i])[0]
        self.arrival = np.full(arms, np.nan)
        self._settled_since = np.full(arms, np.nan)
        self._ticks = 0
        self.violated = False
        self._violations = 0
        self._q[:], self._qd[:] = starts, 0.0
        self._reference[:] = starts
        if self._scene is not None:
            self._scene.place(starts)
        nearest = float(episodes.smallest[0]) if self.physics == "ideal" else self._nearest(math.inf)
        self.min_clearance = nearest
        self._drawn = describe(episodes, 0, self._lengths)
        self._rows: list[tuple[Floats, ...]] = []
        if self.record:
            zero = np.zeros_like(self._torque)
            self._rows.append(
                (self.lam.copy(), self.mu.copy(), self._q.copy(), zero, zero, np.array([nearest]), np.zeros(arms))
            )

    @property
    def time(self) -> float:
        """Instant [s]."""
        return self._ticks * self._tick

    @property
    def world(self) -> World:
        """The cell as compiled loops take it."""
        return self._world

    @property
    def uncertain(self) -> Bools:
        """(A,) arms that may do less than they are told in this episode."""
        uncertain: Bools = uncertain_arms(self._episodes)[0]
        return uncertain

    def tracking_error(self) -> Floats:
        """(A,) how far the tips are from their references now [m]."""
        error = np.zeros(self.arms)
        if self.physics == "bullet":
            tracking_error(self._world, self.lam, self._q, error)
        return error

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
        if self.arms < 2:
            return math.inf
        if cutoff < math.inf and not self.record:
            bound = float(self._distance_asked - moved_closer(self._q_asked, self._q, self._lever))
            if bound >= cutoff:
                return bound
        q = [row[: arm.dof] for row, arm in zip(self._q, self.cell.arms, strict=True)]
        self._q_asked[:] = self._q
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
            places, speeds, clearance = self._scratch.places[0], self._scratch.speeds[0], self._scratch.clearance[0]
            self._rows += [
                (places[:, k].copy(), speeds[:, k].copy(), *[np.empty(0)] * 3, clearance[k : k + 1].copy(),
                 np.zeros(self.arms))
                for k in range(self._ticks - began)
            ]  # fmt: skip

    def _step_bullet(self, commands: Floats) -> None:
        """The references of the period are those of ``ideal``; the arms follow them tick by tick."""
        episodes, scratch = self._episodes, self._scratch
        move(self._world, episodes, 0, 1, self._active, commands, scratch)
        for k in range(scratch.places.shape[2]):
            self.lam[:], self.mu[:] = scratch.places[0, :, k], scratch.speeds[0, :, k]
            self._tick_bullet()
            if self.violated:
                episodes.violated[0] = True
                break
        episodes.ticks[0] = self._ticks
        episodes.steps[0] += 1

    def _tick_bullet(self) -> None:
        assert self._scene is not None
        tick = self._tick
        control(
            self._world, self.lam, CONTROLLER_GAIN / tick, self._measured, self._reference, self._demand, self._torque
        )
        self._scene.push(self._torque)
        self._scene.read(self._q, self._qd)
        self._ticks += 1
        nearest = self._nearest(self.min_clearance)
        self.min_clearance = min(self.min_clearance, nearest)
        if nearest < self._d_min:
            self.violated = True
            self._violations += 1
        if (self._episodes.arrival[0] <= self.time + 1e-12).any():
            self._settle(tick)
        if self.record:
            tracking_error(self._world, self.lam, self._q, self._error)
            self._rows.append(
                (
                    self.lam.copy(),
                    self.mu.copy(),
                    self._q.copy(),
                    self._torque.copy(),
                    self._demand.copy(),
                    np.array([nearest]),
                    self._error.copy(),
                )
            )

    def _settle(self, tick: float) -> None:
        """An arm arrives at the later of its reference's end and the first tick from which its tip stays settled."""
        tip_positions(self._world, self._q - tick * self._qd, self._tips_before)  # the step was q' = q + dt qd'
        tip_positions(self._world, self._q, self._tips)
        speed = np.linalg.norm(self._tips - self._tips_before, axis=1) / tick
        distance = np.linalg.norm(self._tips - self._goals, axis=1)
        arrived = self._episodes.arrival[0]
        calm = (arrived <= self.time + 1e-12) & (distance < SETTLED_DISTANCE) & (speed < SETTLED_SPEED)
        self._settled_since = np.where(calm, np.fmin(self._settled_since, self.time), np.nan)
        done = np.isnan(self.arrival) & (self.time - self._settled_since >= SETTLED_TIME - 1e-9)
        self.arrival[done] = np.maximum(arrived, self._settled_since)[done]

    def observe(self) -> Floats32:
        """(A, 21) observations of all arms, in the order of ``COORDINATION_ENTRIES``; a new array."""
        if self.physics == "bullet" or self._ticks == 0:
            observe(
                self._world, self._episodes, 0, 1, self._active, self._noise, OTHERS, len(OWN), len(OTHER),
                self._scratch, self._observation,
            )  # fmt: skip
        observation: Floats32 = self._observation[0].copy()
        return observation

    def joint_positions(self) -> Floats:
        """(A, n) joint positions now: measured, or on the path without physics [rad]."""
        if self.physics == "bullet":
            return self._q.copy()
        q = np.zeros_like(self._q)
        for i, path in enumerate(self.cell.paths):
            q[i, : path.dof] = path.evaluate(self.lam[i])[0]
        return q

    def trace(self) -> CoordinationTrace:
        """What happened so far.

        Raises:
            InputError: Nothing was recorded.
        """
        if not self.record:
            raise InputError("this environment keeps no trace", remedy="make it with record=True")
        columns = list(zip(*self._rows, strict=True))
        lam, mu = np.stack(columns[0]), np.stack(columns[1])
        arms = self.cell.arms
        if self.physics == "bullet":
            q, torque, demand = (
                tuple(np.stack(columns[k])[:, i, : arm.dof] for i, arm in enumerate(arms)) for k in (2, 3, 4)
            )
        else:
            q = tuple(path.evaluate(lam[:, i])[0] for i, path in enumerate(self.cell.paths))
            torque = demand = tuple(self._ideal_torque(i, lam[:, i], mu[:, i]) for i in range(self.arms))
        return CoordinationTrace(
            time=np.asarray(np.arange(len(lam)) * self._tick, dtype=np.float64),
            lam=lam,
            mu=mu,
            q=q,
            torque=torque,
            demand=demand,
            clearance=np.concatenate(columns[5]),
            path_error=np.stack(columns[6]),
            arrival=self.arrival.copy(),
            violations=self._violations,
            torque_max=tuple(arm.torque_max for arm in arms),
        )

    def _ideal_torque(self, i: int, lam: Floats, mu: Floats) -> Floats:
        """Mean torque over each tick, from the dynamics in its middle."""
        tick = self._tick
        arrived = np.diff(lam) <= 0.0
        mu_dot = np.where(arrived, 0.0, np.diff(mu) / tick)
        torque = self.cell.dynamics[i].torque(0.5 * (lam[:-1] + lam[1:]), 0.5 * (mu[:-1] + mu[1:]), mu_dot)
        return np.concatenate([np.zeros((1, torque.shape[1])), torque])

    def close(self) -> None:
        """Leave PyBullet; may be called twice."""
        if self._scene is not None:
            self._scene.close()

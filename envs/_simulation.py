"""Episodes of a cell, tick by tick: references along the paths, physics or none, clearance, arrival, violation.

Both environments run on this; it knows arms and time, not agents, spaces or rewards.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import combinations
from typing import Literal, final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armtempo.envs._bullet import pybullet
from armtempo.envs._kernels import control, moved_closer, observe, run_ideal, tip_positions, tracking_error
from armtempo.envs._observation import OTHER, OTHERS, OWN, SIZE
from armtempo.envs._scene import Scene
from armtempo.envs._world import State, World, pack
from armtempo.errors import InputError, UnknownNameError
from armtempo.planners import Cell, Mode, clearance_table
from armtempo.robots import Arm

Array = NDArray[np.float64]
Physics = Literal["bullet", "ideal"]

PHYSICS: tuple[Physics, ...] = ("bullet", "ideal")
MODES: tuple[Mode, ...] = ("speed", "acceleration")
CONTROLLER_GAIN = 0.2  # bandwidth of the joint controller, as a share of the tick rate
SETTLED_DISTANCE = 1e-3  # [m] of the tip from its goal, and
SETTLED_SPEED = 1e-2  # [m/s] of the tip,
SETTLED_TIME = 0.020  # [s] for which both must hold
IDEAL_FCL_BELOW = 0.05  # [m] above d_min: nearer than this the ideal clearance table asks FCL, not capsules


def _levers(arm: Arm) -> Array:
    """(n,) how far a point of the arm's shapes gets, at most, per radian or metre of each joint."""
    ends, radius = np.stack([arm.capsules.p0, arm.capsules.p1]), arm.capsules.radius
    reach = np.linalg.norm(ends, axis=2).max(axis=0) + radius
    q_max = np.maximum(np.abs(arm.position_min), np.abs(arm.position_max))
    most: Array = arm.levers(reach, q_max).max(axis=1, initial=0.0)
    return most


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class EpisodeTrace:
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

    time: Array
    lam: Array
    mu: Array
    q: tuple[Array, ...]
    torque: tuple[Array, ...]
    demand: tuple[Array, ...]
    clearance: Array
    path_error: Array
    arrival: Array
    violations: int
    torque_max: tuple[Array, ...]

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
class Simulation:
    """One cell, run in control periods.

    Args:
        cell: Arms on their paths.
        physics: ``bullet``: torque-controlled in PyBullet, FCL clearance at every tick. ``ideal``: on the paths,
            without tracking error, clearance from a table.
        mode: What a command in [0, 1] means, see ``PhasePlane.advance``.
        record: Keep a trace.

    Attributes:
        lam, mu: (A,) the references now.
        time: Instant [s].
        arrival: (A,) instants of arrival, nan before; in ``bullet`` known once the tip has settled.
        violated: Whether two arms came closer than ``d_min``.
        min_clearance: Smallest clearance so far [m].
    """

    def __init__(self, cell: Cell, *, physics: Physics = "bullet", mode: Mode = "speed", record: bool = False) -> None:
        if physics not in PHYSICS:
            raise UnknownNameError("physics", str(physics), PHYSICS)
        if mode not in MODES:
            raise UnknownNameError("mode", str(mode), MODES)
        self.cell, self.physics, self.mode, self.record = cell, physics, mode, record
        arms = len(cell.arms)
        width = max(arm.dof for arm in cell.arms)
        tables = []
        if physics == "ideal":
            below = cell.d_min + IDEAL_FCL_BELOW
            for i, j in combinations(range(arms), 2):
                tables.append((i, j, clearance_table(i, j, cell.arms, cell.paths, below)))
        self._world = pack(cell, mode, tables)
        self._tick, self._d_min = cell.physics_tick, cell.d_min  # kept: the configuration behind them is slow to ask
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
        self._block = np.empty((cell.ticks_per_period, 2 * arms + 1))  # a row per tick of a period, for ideal runs
        self._observation = np.zeros((arms, SIZE), dtype=np.float32)
        self._tips, self._tips_before, self._error = np.zeros((arms, 3)), np.zeros((arms, 3)), np.zeros(arms)
        self._scene: Scene | None = None
        if physics == "bullet":
            self._scene = Scene(cell)
            pybullet.setGravity(*cell.config.gravity_m_s2, physicsClientId=self._scene.client)
            pybullet.setPhysicsEngineParameter(
                numSolverIterations=10, deterministicOverlappingPairs=1, physicsClientId=self._scene.client
            )
        self.reset()

    def reset(self, late: ArrayLike = 0.0) -> None:
        """Back to the start, at rest; ``late`` (A,) [s]: how long each arm stands before it obeys its commands."""
        arms = len(self.cell.arms)
        self._late = np.broadcast_to(np.asarray(late, dtype=np.float64), (arms,)).copy()
        self._state = State(np.zeros(arms), np.zeros(arms), np.full(arms, np.nan))
        self.lam, self.mu = self._state.lam, self._state.mu
        self.arrival = np.full(arms, np.nan)
        self._settled_since = np.full(arms, np.nan)
        self._ticks = 0
        self.violated = False
        self._violations = 0
        self._q[:], self._qd[:] = self._starts, 0.0
        self._reference[:] = self._starts
        if self._scene is not None:
            self._scene.place(self._starts)
        nearest = self._nearest(math.inf)
        self.min_clearance = nearest
        self._rows: list[tuple[Array, ...]] = []
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
    def uncertain(self) -> NDArray[np.bool_]:
        """(A,) arms that may do less than they are told in this episode."""
        return self._late > 0.0

    def tracking_error(self) -> Array:
        """(A,) how far the tips are from their references now [m]."""
        error = np.zeros(self.arms)
        if self.physics == "bullet":
            tracking_error(self._world, self._state, self._q, error)
        return error

    @property
    def arms(self) -> int:
        """Number of arms."""
        return len(self.cell.arms)

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

    def step(self, commands: Array) -> None:
        """Run one control period under ``commands`` (A,) in [0, 1]; stops at the first tick with a violation."""
        if self.physics == "ideal":
            self._step_ideal(commands)
        else:
            for _ in range(len(self._block)):
                self._tick_bullet(commands)
                if self.violated:
                    break

    def _step_ideal(self, commands: Array) -> None:
        ran, self.violated, smallest = run_ideal(
            self._world, self._state, self._d_min, commands, self._late, self._ticks, len(self._block), self._block,
            OTHERS, len(OWN), len(OTHER), self._observation,
        )  # fmt: skip
        self._ticks += ran
        self._violations += self.violated
        self.arrival[:] = self._state.arrival
        self.min_clearance = min(self.min_clearance, smallest)
        if self.record:
            arms = self.arms
            self._rows += [
                (row[:arms].copy(), row[arms : 2 * arms].copy(), *[np.empty(0)] * 3, row[-1:].copy(), np.zeros(arms))
                for row in self._block[:ran]
            ]

    def _tick_bullet(self, commands: Array) -> None:
        assert self._scene is not None
        tick = self._tick
        control(
            self._world, self._state, commands, self._late, self.time, CONTROLLER_GAIN / tick, self._measured,
            self._reference, self._demand, self._torque,
        )  # fmt: skip
        self._scene.push(self._torque)
        self._scene.read(self._q, self._qd)
        self._ticks += 1
        nearest = self._nearest(self.min_clearance)
        self.min_clearance = min(self.min_clearance, nearest)
        if nearest < self._d_min:
            self.violated = True
            self._violations += 1
        if not np.isnan(self._state.arrival).all():
            self._settle(tick)
        if self.record:
            tracking_error(self._world, self._state, self._q, self._error)
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
        calm = ~np.isnan(self._state.arrival) & (distance < SETTLED_DISTANCE) & (speed < SETTLED_SPEED)
        self._settled_since = np.where(calm, np.fmin(self._settled_since, self.time), np.nan)
        done = np.isnan(self.arrival) & (self.time - self._settled_since >= SETTLED_TIME - 1e-9)
        self.arrival[done] = np.maximum(self._state.arrival, self._settled_since)[done]

    def observe(self) -> NDArray[np.float32]:
        """(A, 17) observations of all arms, in the order of ``ENTRIES``; a new array."""
        if self.physics == "bullet" or self._ticks == 0:
            observe(self._world, self._state, OTHERS, len(OWN), len(OTHER), self._observation)
        return self._observation.copy()

    def joint_positions(self) -> Array:
        """(A, n) joint positions now: measured, or on the path without physics [rad]."""
        if self.physics == "bullet":
            return self._q.copy()
        q = np.zeros_like(self._q)
        for i, path in enumerate(self.cell.paths):
            q[i, : path.dof] = path.evaluate(self.lam[i])[0]
        return q

    def trace(self) -> EpisodeTrace:
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
        return EpisodeTrace(
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

    def _ideal_torque(self, i: int, lam: Array, mu: Array) -> Array:
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

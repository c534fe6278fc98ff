"""Episodes of a blend cell, tick by tick: the reference along the path, physics or none, contour error, arrival.

It knows the arm and time, not spaces or rewards; the controller and the scene are those of the cells of several arms.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, final, get_args

import numpy as np

from armtempo.arrays import Floats
from armtempo.envs.blend._kernels import follow_ideal, measure_tip
from armtempo.envs.bodies import CONTROLLER_GAIN, SETTLED_DISTANCE, SETTLED_SPEED, SETTLED_TIME, Physics, TrackedArm
from armtempo.errors import InputError, UnknownNameError
from armtempo.planners import BlendCell, FeedOverride, LineSpeedProfile, PredictorCorrector
from armtempo.planners.cells import PROFILES, ProfileName

MappingName = Literal["exact", "paper"]
MAPPINGS: tuple[MappingName, ...] = get_args(MappingName)


_COLUMNS = (
    "time", "s", "v", "a", "j", "override", "q", "tip", "station", "contour_error", "line_speed", "arc_speed",
    "torque", "demand",
)  # fmt: skip


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class BlendTrace:
    """An episode at its ticks, T + 1 rows (row 0 is the start; torques of row k act from tick k - 1 to k).

    Attributes:
        cell: Where it was; of another path or other corners where the episode had some of its own.
        time: (T+1,) [s].
        s: (T+1,) length that the reference has travelled [m]; v, a, j: its speed [m/s], acceleration [m/s^2] and jerk.
        override: (T+1,) feed-rate override.
        q: (T+1, n) joint positions: measured, or of the reference without physics [rad, m].
        tip: (T+1, 3) where they put the tip [m].
        station: (T+1,) the place of the path nearest to it [m].
        contour_error: (T+1,) how far it is from there [m].
        line_speed: (T+1,) speed of the tip between ticks, point to point [m/s].
        arc_speed: (T+1,) the same along the path: what ``station`` gained.
        torque: (T+1, n) applied [N m, N]; demand: before clipping at the limits.
        torque_max: (n,) the limits.
        arrival: Instant of arrival [s]; nan where the arm did not arrive.
        left: Whether the tip left the tube around the path.
    """

    cell: BlendCell
    time: Floats
    s: Floats
    v: Floats
    a: Floats
    j: Floats
    override: Floats
    q: Floats
    tip: Floats
    station: Floats
    contour_error: Floats
    line_speed: Floats
    arc_speed: Floats
    torque: Floats
    demand: Floats
    torque_max: Floats
    arrival: float
    left: bool

    def __post_init__(self) -> None:
        for name in self.__slots__:
            value = getattr(self, name)
            if isinstance(value, np.ndarray):
                value.setflags(write=False)

    @property
    def torque_ratio_max(self) -> float:
        """Largest |applied torque| / limit."""
        return float(np.max(np.abs(self.torque) / self.torque_max))

    @property
    def torque_demand_ratio_max(self) -> float:
        """Largest |demanded torque| / limit."""
        return float(np.max(np.abs(self.demand) / self.torque_max))


@final
class BlendSimulation:
    """One arm on a blended path, run in control periods.

    Args:
        cell: The arm on its path.
        physics: ``bullet``: torque-controlled in PyBullet. ``ideal``: always on its reference.
        record: Keep a trace.
        model_error: The bodies in PyBullet are heavier by this share than the controller believes.

    Attributes:
        cell, profile: Of this episode.
        s, v, a: The reference: length [m], speed and acceleration along the path.
        tip, station, contour_error: Where the tip is (3,), the nearest place of the path, the distance to it [m].
        tip_speed: Speed of the tip over the last tick [m/s].
        speed_deviation: Mean distance of the tip speed from the profile's at full rate, over the last step [m/s].
        mean_contour_error: Over the last step [m].
        arrival: Instant of arrival, nan before; in ``bullet`` known once the tip has settled.
        left: Whether the tip is out of the tube.
    """

    def __init__(
        self, cell: BlendCell, *, physics: Physics = "bullet", record: bool = False, model_error: float = 0.0
    ) -> None:
        self._arm = TrackedArm(cell, physics=physics, model_error=model_error)
        self.physics, self.record = physics, record
        self._tick, self._ticks_per_period = cell.physics_tick, cell.ticks_per_period
        self._model = self._arm.model
        self._q, self._qd, self._reference = self._arm.q, self._arm.qd, self._arm.reference
        self._torque, self._demand = self._arm.torque, self._arm.demand
        self._scene = self._arm.scene
        self.tip: Floats = np.zeros(3)
        self.reset(cell, "line-speed", "exact")

    def reset(self, cell: BlendCell, profile: ProfileName, mapping: MappingName) -> None:
        """To the start of the path of ``cell`` (the arm is the same), at rest."""
        if profile not in PROFILES:
            raise UnknownNameError("profile", str(profile), PROFILES)
        if mapping not in MAPPINGS:
            raise UnknownNameError("mapping", str(mapping), MAPPINGS)
        self.cell, self._path, self._packed = cell, cell.path, cell.blended.packed
        self.profile: LineSpeedProfile = cell.profile(profile)
        self.feed = FeedOverride(
            self.profile, self.profile.limits, path=cell.blended if profile == "limit-aware" else None
        )
        self._paper = PredictorCorrector(cell.blended).start() if mapping == "paper" else None
        if self._paper is not None:
            self._paper.advance(np.zeros(1))  # the first tick
        self._end = math.nan  # instant at which the reference arrives
        self._goal = cell.blended.position(cell.blended.length)
        self._ticks = 0
        self.s = self.v = self.a = self.tip_speed = self.arc_speed = 0.0
        self.speed_deviation = self.mean_contour_error = 0.0
        self.arrival, self._settled_since, self.left = math.nan, math.nan, False
        self._arm.place(self._path.evaluate(0.0)[0])
        self.station, self.contour_error = measure_tip(self._model, self._packed, self._q[0], 0.0, self.tip)
        self._rows: list[tuple[float | Floats, ...]] = []
        self._keep()

    @property
    def time(self) -> float:
        """Instant [s]."""
        return self._ticks * self._tick

    @property
    def lag(self) -> float:
        """How far the tip is behind the reference along the path [m]."""
        return self.s - self.station

    @property
    def joint_speeds(self) -> Floats:
        """(n,) joint speeds now."""
        return np.array(self._qd[0])

    @property
    def demand(self) -> Floats:
        """(n,) torques asked for in the last tick, before clipping."""
        return np.array(self._demand[0])

    def joint_positions(self) -> Floats:
        """(1, n) joint positions now."""
        return self._q.copy()

    def step(self, override: float) -> None:
        """Run one control period with the feed rate asked for; stops at the first tick out of the tube."""
        feed, tick = self.feed, self._tick
        feed.request(override)
        done, sigma, rate = feed.done, feed.sigma, feed.override
        motion = feed.steps(tick, self._ticks_per_period)
        if feed.done and not done:  # the rest of the way at the rate before, inside the tick
            k = int(np.argmax(motion[:, 4] >= self.profile.duration))
            if k:
                sigma, rate = motion[k - 1, 4:6].tolist()
            rest = (self.profile.duration - sigma) / rate if rate > 0.0 else tick
            self._end = self.time + k * tick + min(rest, tick)
        full = self.profile.at(motion[:, 4])[1]  # speeds at full rate
        joints = self._joints(motion[:, 0])
        speeds, errors = (self._follow if self._scene is None else self._control)(motion, joints)
        self.speed_deviation = float(np.abs(speeds - full[: len(speeds)]).mean())
        self.mean_contour_error = float(errors.mean())

    def _control(self, motion: Floats, joints: Floats) -> tuple[Floats, Floats]:
        """The ticks of a period in PyBullet; speeds of the tip and contour errors at them."""
        seen = []
        for row, wanted in zip(motion.tolist(), joints, strict=True):
            self.s, self.v, self.a = row[:3]
            self._advance(wanted)
            seen.append((self.tip_speed, self.contour_error))
            if self.record:
                self._keep(row[3], row[5])
            if self.left:
                break
        speeds, errors = np.array(seen).T
        return speeds, errors

    def _follow(self, motion: Floats, joints: Floats) -> tuple[Floats, Floats]:
        """The ticks of a period always on the reference; speeds of the tip and contour errors at them."""
        n, tick = len(self._q[0]), self._tick
        rows = np.empty((len(joints), 7 + 3 * n))
        near = self.station + self.arc_speed * tick if self._ticks else float(motion[0, 0])
        begun, station = self._ticks, self.station
        ran = follow_ideal(
            self._model, self._packed, joints, self._reference, self._arm.coulomb, self._arm.torque_max,
            CONTROLLER_GAIN / tick, tick, near, self.cell.contour_error_max, self.tip, rows,
        )  # fmt: skip
        rows[0, 3] = (rows[0, 0] - station) / tick
        self._qd[0] = (self._reference[2] - self._reference[1]) / tick
        for k in range(ran) if self.record else (ran - 1,):
            self._ticks = begun + k + 1
            self.s, self.v, self.a = motion[k, :3].tolist()
            self.station, self.contour_error, self.tip_speed, self.arc_speed = rows[k, :4].tolist()
            self._q[0], self._torque[0], self._demand[0] = rows[k, 7:].reshape(3, n)
            self.tip = rows[k, 4:7].copy()
            if self.record:
                self._keep(*motion[k, [3, 5]].tolist())
        self.left = self.contour_error > self.cell.contour_error_max
        self._arrive()
        return rows[:ran, 2], rows[:ran, 1]

    def _joints(self, lengths: Floats) -> Floats:
        """(K, n) reference joints at these travelled lengths."""
        if self._paper is None:
            return self._path.inverse(self.cell.blended.position(lengths), lengths)
        return self._path.inverse(self._paper.advance(lengths), lengths)

    def _advance(self, joints: Floats) -> None:
        """One tick in PyBullet towards the reference ``joints`` (n,)."""
        tick = self._tick
        self._arm.advance(joints)
        self._ticks += 1
        before, station = self.tip.tolist(), self.station
        near = self.s if self._ticks == 1 else station + self.arc_speed * tick
        self.station, self.contour_error = measure_tip(self._model, self._packed, self._q[0], near, self.tip)
        self.tip_speed = math.dist(self.tip.tolist(), before) / tick
        self.arc_speed = (self.station - station) / tick
        self.left = self.contour_error > self.cell.contour_error_max
        self._arrive()

    def _arrive(self) -> None:
        """Arrival: with the reference, or at the later of its end and the first tick from which the tip is settled."""
        if math.isnan(self._end) or self._end > self.time + 1e-12 or not math.isnan(self.arrival):
            return
        if self._scene is None:
            self.arrival = self._end
            return
        calm = math.dist(self.tip, self._goal) < SETTLED_DISTANCE and self.tip_speed < SETTLED_SPEED
        if not calm:
            self._settled_since = math.nan
            return
        if math.isnan(self._settled_since):
            self._settled_since = self.time
        if self.time - self._settled_since >= SETTLED_TIME - 1e-9:
            self.arrival = max(self._end, self._settled_since)

    def _keep(self, jerk: float = 0.0, override: float = 1.0) -> None:
        self._rows.append(
            (
                self.time, self.s, self.v, self.a, jerk, override, self._q[0].copy(), self.tip.copy(), self.station,
                self.contour_error, self.tip_speed, self.arc_speed, self._torque[0].copy(), self._demand[0].copy(),
            )
        )  # fmt: skip

    def trace(self) -> BlendTrace:
        """What happened so far.

        Raises:
            InputError: Nothing was recorded.
        """
        if not self.record:
            raise InputError("this environment keeps no trace", remedy="make it with record=True")
        columns = [np.array(column) for column in zip(*self._rows, strict=True)]
        return BlendTrace(
            cell=self.cell,
            **dict(zip(_COLUMNS, columns, strict=True)),
            torque_max=self._arm.torque_max.copy(),
            arrival=self.arrival,
            left=self.left,
        )

    def close(self) -> None:
        """Leave PyBullet; may be called twice."""
        self._arm.close()

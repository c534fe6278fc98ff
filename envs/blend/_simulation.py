"""Episodes of a blend cell, tick by tick: the reference along the path, physics or none, contour error, arrival.

It knows the arm and time, not spaces or rewards; the controller and the scene are those of the cells of several arms.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, final

import numpy as np

from armtempo.arrays import Floats
from armtempo.envs.blend._kernels import follow_ideal, measure_tip
from armtempo.envs.blend._options import BlendOptions
from armtempo.envs.bodies import Controller, End, Recorder, Settling, Trace
from armtempo.planners import BlendCell, FeedOverride, LineSpeedProfile, PredictorCorrector
from armtempo.state import Stateful


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class BlendTrace(Trace[Floats]):
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
    s: Floats
    v: Floats
    a: Floats
    j: Floats
    override: Floats
    tip: Floats
    station: Floats
    contour_error: Floats
    line_speed: Floats
    arc_speed: Floats
    arrival: float
    left: bool

    @property
    def arrived(self) -> float:
        """The ``arrival``."""
        return self.arrival


@final
class BlendSimulation(Stateful):
    """One arm on a blended path, run in control periods.

    Args:
        cell: The arm on its path.
        options: Of its episodes; the family of paths and the time limit are not its business.
        record: Keep a trace.

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

    changing = (
        "cell", "feed", "_paper", "_end", "_ticks", "s", "v", "a", "tip_speed", "arc_speed", "speed_deviation",
        "mean_contour_error", "arrival", "left", "tip", "station", "contour_error", "_settling", "_controller",
        "_recorder",
    )  # fmt: skip

    def __init__(self, cell: BlendCell, options: BlendOptions, *, record: bool = False) -> None:
        self.physics, self.record = options.physics, record
        self._profile, self._mapping = options.profile, options.mapping
        self._tick, self._ticks_per_period = cell.physics_tick, cell.ticks_per_period
        self._model = cell.arm.model
        self._coulomb, self._torque_max = cell.arm.coulomb.copy(), cell.arm.torque_max.copy()
        self._controller = Controller(cell, options.physics, model_error=options.model_error)
        self._settling = Settling(1)
        self._recorder = Recorder(wanted=record, tick=self._tick)
        self.tip: Floats = np.zeros(3)
        self.reset(cell)

    def reset(self, cell: BlendCell) -> None:
        """To the start of the path of ``cell`` (the arm is the same), at rest."""
        self._take(cell)
        if self._paper is not None:
            self._paper.advance(np.zeros(1))  # the first tick
        self._end = math.nan  # instant at which the reference arrives
        self._ticks = 0
        self.s = self.v = self.a = self.tip_speed = self.arc_speed = 0.0
        self.speed_deviation = self.mean_contour_error = 0.0
        self.arrival, self.left = math.nan, False
        self._settling.reset()
        self._controller.reset(self._path.evaluate(0.0)[0])
        self.station, self.contour_error = measure_tip(self._model, self._packed, self._q[0], 0.0, self.tip)
        self._recorder.clear()
        if self.record:
            self._keep(jerk=0.0, override=1.0)

    def _take(self, cell: BlendCell) -> None:
        """The path of ``cell``, and what runs along it."""
        self.cell, self._path, self._packed = cell, cell.path, cell.blended.packed
        self.profile: LineSpeedProfile = cell.profile(self._profile)
        self.feed = FeedOverride(
            self.profile, self.profile.limits, path=cell.blended if self._profile == "limit-aware" else None
        )
        self._paper = PredictorCorrector(cell.blended).start() if self._mapping == "paper" else None
        self._goal = cell.blended.position(cell.blended.length)

    def _go_on(self, state: Mapping[str, Any]) -> None:
        if state["cell"] is not self.cell:
            self._take(state["cell"])
        super()._go_on(state)

    @property
    def _q(self) -> Floats:
        return self._controller.q

    @property
    def time(self) -> float:
        """Instant [s]."""
        return self._ticks * self._tick

    @property
    def end(self) -> End:
        """When the arm arrived, and whether the tip left the tube."""
        return End(self.arrival, self.left)

    @property
    def lag(self) -> float:
        """How far the tip is behind the reference along the path [m]."""
        return self.s - self.station

    @property
    def joint_speeds(self) -> Floats:
        """(n,) joint speeds now."""
        return np.array(self._controller.qd[0])

    @property
    def demand(self) -> Floats:
        """(n,) torques asked for in the last tick, before clipping."""
        return np.array(self._controller.demand[0])

    def joint_positions(self) -> Floats:
        """(1, n) joint positions now."""
        return self._q.copy()

    def step(self, override: Floats) -> None:
        """Run one control period with the feed rate (1,) asked for; stops at the first tick out of the tube."""
        feed, tick = self.feed, self._tick
        feed.request(float(override[0]))
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
        speeds, errors = (self._follow if self.physics == "ideal" else self._control)(motion, joints)
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
                self._keep(jerk=row[3], override=row[5])
            if self.left:
                break
        speeds, errors = np.array(seen).T
        return speeds, errors

    def _follow(self, motion: Floats, joints: Floats) -> tuple[Floats, Floats]:
        """The ticks of a period always on the reference; speeds of the tip and contour errors at them."""
        n, tick, controller = self._q.shape[1], self._tick, self._controller
        rows = np.empty((len(joints), 7 + 3 * n))
        near = self.station + self.arc_speed * tick if self._ticks else float(motion[0, 0])
        station = self.station
        ran = follow_ideal(
            self._model, self._packed, joints, controller.reference[:, 0], self._coulomb, self._torque_max,
            controller.gain, tick, near, self.cell.contour_error_max, self.tip, rows,
        )  # fmt: skip
        motion, rows = motion[:ran], rows[:ran]
        rows[0, 3] = (rows[0, 0] - station) / tick
        self._ticks += ran
        self.s, self.v, self.a = motion[-1, :3].tolist()
        self.station, self.contour_error, self.tip_speed, self.arc_speed = rows[-1, :4].tolist()
        joined = rows[:, 7:].reshape(ran, 3, 1, n)  # joint positions, torques, demand
        controller.put(*joined[-1])
        if self.record:
            q, torque, demand = np.moveaxis(joined[:, :, 0], 1, 0)
            self._recorder.extend(
                s=motion[:, 0], v=motion[:, 1], a=motion[:, 2], j=motion[:, 3], override=motion[:, 5], q=q,
                tip=rows[:, 4:7], station=rows[:, 0], contour_error=rows[:, 1], line_speed=rows[:, 2],
                arc_speed=rows[:, 3], torque=torque, demand=demand,
            )  # fmt: skip
        self.left = not self.contour_error <= self.cell.contour_error_max
        self._arrive()
        return rows[:, 2], rows[:, 1]

    def _joints(self, lengths: Floats) -> Floats:
        """(K, n) reference joints at these travelled lengths."""
        if self._paper is None:
            return self._path.inverse(self.cell.blended.position(lengths), lengths)
        return self._path.inverse(self._paper.advance(lengths), lengths)

    def _advance(self, joints: Floats) -> None:
        """One tick in PyBullet towards the reference ``joints`` (n,)."""
        tick = self._tick
        self._controller.track(joints[None])
        self._ticks += 1
        before, station = self.tip.tolist(), self.station
        near = self.s if self._ticks == 1 else station + self.arc_speed * tick
        self.station, self.contour_error = measure_tip(self._model, self._packed, self._q[0], near, self.tip)
        self.tip_speed = math.dist(self.tip.tolist(), before) / tick
        self.arc_speed = (self.station - station) / tick
        self.left = not self.contour_error <= self.cell.contour_error_max
        self._arrive()

    def _arrive(self) -> None:
        """Arrival: with the reference, or at the later of its end and the first tick from which the tip is settled."""
        if math.isnan(self._end) or self._end > self.time + 1e-12 or not math.isnan(self.arrival):
            return
        if self.physics == "ideal":
            self.arrival = self._end
            return
        distance = math.dist(self.tip, self._goal)
        self._settling.watch(self.time, np.array([self._end]), np.array([distance]), np.array([self.tip_speed]))
        self.arrival = float(self._settling.arrival[0])

    def _keep(self, *, jerk: float, override: float) -> None:
        """A row of the trace."""
        controller = self._controller
        self._recorder.add(
            s=self.s, v=self.v, a=self.a, j=jerk, override=override, q=self._q[0], tip=self.tip, station=self.station,
            contour_error=self.contour_error, line_speed=self.tip_speed, arc_speed=self.arc_speed,
            torque=controller.torque[0], demand=controller.demand[0],
        )  # fmt: skip

    def trace(self) -> BlendTrace:
        """What happened so far.

        Raises:
            InputError: Nothing was recorded.
        """
        return BlendTrace(
            **self._recorder.columns(),
            cell=self.cell,
            torque_max=self.cell.arm.torque_max,
            arrival=self.arrival,
            left=self.left,
        )

    def close(self) -> None:
        """Leave PyBullet; may be called twice."""
        self._controller.close()

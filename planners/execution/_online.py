r"""Speed scalings for the controllers of real arms, from where the arms are, over a link that may lose and delay.

**Contract.** The controller of arm i runs the arm's fastest motion; its time goes by ``factor`` seconds per second, so
the arm is at ``lambda_fast(s)`` with ``mu = factor mu_fast``, ``ds/dt = factor``. It sends its state as often as it
likes, takes an answer only if that answers a newer state than the one in force and is no older than ``hold_s`` after
its state, by its own clock, and where the answer in force gets older than that it takes the factor down to 0 within
``stop_s`` until a newer one comes. No clock is shared.

**Ramp.** With ``tau = f^2 (M mu_dot + Q mu^2) + f R mu + S + M mu f_dot`` a jump of f is a torque without bound, and
controllers do not ramp f. So f is the ratio of two motions of one phase plane: what ``advance`` makes of a command
within the limits, and the fastest.

**Safe.** An arm passes behind others as the plan says (``Precedence``): its limits never fall as others go on, and
others are at least where they were last seen, even if they stop at once. An answer is given only if, after all that
unheard and heard answers can do until they expire, the arm can still brake behind its limit within its torques, and if
the link breaks then, by its controller's own ramp. By induction some answer always can: the one before left it room.
Lost, late and doubled packets thus cost time; so do arms that are late, slow, or stop.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import final

import numpy as np

from armtempo.arrays import Floats
from armtempo.errors import InputError
from armtempo.planners.coordination.kernels import stays_behind
from armtempo.planners.execution._link import ArmState, Link, LinkReport, SpeedScaling
from armtempo.planners.exports import RobotMotion
from armtempo.planners.schedules import Schedule, ScheduleExecution
from armtempo.planners.topp import JointTrajectory, PhaseTrajectory
from armtempo.planners.topp.kernels import advance

SMALLEST_FAST_SHARE = 1e-3  # of an arm's largest fast speed: below it a ratio of speeds says little
MARGIN_SHARE = 1e-6  # of a path: how far behind a limit an arm is kept
FACTOR_BISECTIONS = 16
SLOWEST_RAMP = 0.01  # [1/s]
AT_ONCE = 1e9  # [1/s]
MOST_PERIODS = 1000  # that one ramp spans, after a gap in the states
RAMP_AHEAD_SHARE = 0.25  # of the time for which an answer may act: so far ahead its ramp is looked at, too
SPARE_PERIODS = 1.0  # what is kept in hand for the rounding of ramps to periods
NONE = np.empty(0)


@final
class OnlineExecution:
    """Where arms are in, speed scalings of their controllers out, for a schedule.

    Call ``report`` whenever a state comes, and ``scalings`` once per control period of the cell.

    Args:
        plan: The schedule; its passing order is kept, its times as far as the arms do.
        hold_s: For how long after a state its answer may act [s]: longer than the link takes both ways, or it stops the
            arms now and then; the longer, the earlier arms must brake for what they cannot see.
        stop_s: Within what time controllers stop by themselves when no answer comes [s].

    Raises:
        InputError: The times are none, or shorter than the control period.
        InfeasibleError: The schedule leads arms through cells of their charts that are not free.
    """

    def __init__(self, plan: Schedule, *, hold_s: float = 0.05, stop_s: float = 0.1) -> None:
        cell = plan.cell
        if not (math.isfinite(hold_s) and hold_s >= cell.control_period and math.isfinite(stop_s) and stop_s >= 0.0):
            raise InputError(
                f"hold_s of {hold_s} s and stop_s of {stop_s} s at a control period of {cell.control_period} s",
                remedy="hold an answer for some control periods, such as 0.05",
            )
        self.plan, self.hold_s, self.stop_s = plan, hold_s, stop_s
        self._execution = ScheduleExecution(plan)
        self._fastest = cell.fastest
        self._links = [Link(hold_s) for _ in cell.arms]
        self._lam, self._rate, self._age = np.zeros((3, len(cell.arms)))
        self._ticks = cell.ticks_per_period
        self._top = [float(motion.mu.max()) for motion in self._fastest]

    @property
    def period(self) -> float:
        """Between two calls of ``scalings`` [s]: the cell's control period."""
        return self.plan.cell.control_period

    def motion(self, rate_hz: float = 500.0) -> RobotMotion:
        """What controllers are to run: every arm's fastest motion. Never at factors but ours: arms would collide."""
        cell = self.plan.cell
        samples = [_sampler(motion) for motion in self._fastest]
        duration = max(motion.duration for motion in self._fastest)
        return RobotMotion.sampled(cell.arms, samples, duration=duration, rate_hz=rate_hz)

    def place(self, arm: int, time: float, factor: float) -> tuple[float, float]:
        """Place and rate on its path of an arm whose controller is at a time [s] of its motion, with a factor."""
        lam, mu, _ = self._fastest[arm].at(time)
        return float(lam), factor * float(mu)

    def report(self, state: ArmState) -> bool:
        """Take a state of an arm; False: a later one was there already.

        Raises:
            InputError: There is no such arm.
        """
        if state.arm >= len(self._links):
            raise InputError(f"a state of arm {state.arm}, and there are {len(self._links)}", remedy="count from 0")
        if not self._links[state.arm].hear(state):
            return False
        i, plane = state.arm, self.plan.cell.planes[state.arm]
        self._lam[i] = min(max(state.lam, self._lam[i]), plane.length)  # arms never go back: that is noise
        self._rate[i], self._age[i] = max(state.rate, 0.0), 0.0
        return True

    def scalings(self) -> list[SpeedScaling]:
        """Answers to the states that have none yet."""
        wanted = self._execution.commands(*self._expected())
        self._age += self.period
        return [
            self._answer(i, float(wanted[i]))
            for i, link in enumerate(self._links)
            if link.state is not None and link.answered_to < link.state.sequence
        ]

    @property
    def arrived(self) -> bool:
        """Whether all arms were seen at their ends."""
        return all(lam >= plane.length for lam, plane in zip(self._lam, self.plan.cell.planes, strict=True))

    @property
    def links(self) -> dict[str, LinkReport]:
        """What became of states and answers, by arm."""
        return {arm.name: link.report for arm, link in zip(self.plan.cell.arms, self._links, strict=True)}

    def _expected(self) -> tuple[Floats, Floats]:
        """Places and rates (A,) if all arms went on as they were last seen: what the plan goes by, not what is safe."""
        lam, mu = np.zeros(len(self._links)), np.zeros(len(self._links))
        for i, motion in enumerate(self._fastest):
            now = self._time(i, self._lam[i])
            fast = float(motion.at(now)[1])
            pace = min(self._rate[i] / fast, 1.0) if fast > 0.0 else 0.0  # a measured rate may be above the fastest
            lam[i], mu[i], _ = motion.at(min(now + pace * self._age[i], motion.duration))
            mu[i] *= pace
        return lam, mu

    def _time(self, i: int, lam: float) -> float:
        """When the fastest motion of arm i is at a place [s]."""
        motion = self._fastest[i]
        return float(motion.time_at(min(lam, float(motion.lam[-1]))))

    def _limit(self, i: int) -> float:
        """How far arm i may go while the others are where they were last seen; inf: to its end."""
        precedence = self._execution.precedence
        others = (j for j in range(len(self._links)) if (i, j) in precedence.limits)
        reach = [float(precedence.farthest(i, j, self._lam[j])) for j in others]
        length = self.plan.cell.planes[i].length
        limit = min(reach, default=math.inf)
        return math.inf if limit >= length else limit - MARGIN_SHARE * length

    def _answer(self, i: int, wanted: float) -> SpeedScaling:
        """The largest factor up to that of a command with which arm i can stop behind its limit."""
        link, limit, place = self._links[i], self._limit(i), float(self._lam[i])
        assert link.state is not None
        before = link.sent_factor if self._rate[i] > 0.0 else 0.0  # what was stopped starts from rest
        ticks = self._ticks * min(max(round(link.elapsed / self.period), 1), MOST_PERIODS)
        factor, lowest = (self._ramped(i, command, place, before, ticks) for command in (wanted, 0.0))
        now = link.state.factor
        up, down = (self._steepest(i, command, place, now) for command in (1.0, 0.0))
        ramp = up if factor > now else down
        spare = SPARE_PERIODS * self.period
        if math.isinf(limit) or self._stops(i, factor, down, place, limit, spare):
            return link.answer(factor, ramp)
        if not self._stops(i, lowest, down, place, limit, 0.0):
            link.emergencies += lowest > 0.0
            return link.answer(0.0, AT_ONCE)
        high = factor
        for _ in range(FACTOR_BISECTIONS):
            middle = 0.5 * (lowest + high)
            lowest, high = (middle, high) if self._stops(i, middle, down, place, limit, spare) else (lowest, middle)
        return link.answer(lowest, ramp if lowest > now else down)

    def _steepest(self, i: int, command: float, lam: float, factor: float) -> float:
        """How fast a factor may change towards a command [1/s], where the arm is now and a little farther on."""
        ahead = RAMP_AHEAD_SHARE * self.hold_s
        far = float(self._fastest[i].at(self._time(i, lam) + ahead)[0])
        changes = [self._ramped(i, command, place, factor, self._ticks) - factor for place in (lam, far)]
        return max(min(abs(change) for change in changes) / self.period, SLOWEST_RAMP)

    def _ramped(self, i: int, command: float, lam: float, factor: float, ticks: int) -> float:
        """The factor to which a command for some ticks leads from another, within the limits of the phase plane."""
        cell, motion = self.plan.cell, self._fastest[i]
        steps = cell.planes[i].edges.steps
        now = self._time(i, lam)
        mu = factor * float(motion.at(now)[1])
        place, speed, used = advance(steps, lam, mu, command, True, cell.physics_tick, ticks, NONE, NONE)
        then = self._time(i, place)
        fast = float(motion.at(then)[1])
        if fast > SMALLEST_FAST_SHARE * self._top[i] and place < cell.planes[i].length:
            return min(speed / fast, 1.0)
        return min(max((then - now) / max(used, 1e-12), 0.0), 1.0)

    def _stops(self, i: int, factor: float, ramp: float, lam: float, limit: float, spare: float) -> bool:
        """Whether arm i stays behind its limit if this factor is the last that it hears, or the next says: brake.

        After ``spare`` seconds more of its controller's time.
        """
        cell, motion = self.plan.cell, self._fastest[i]
        far = self._time(i, lam) + self._links[i].carried(factor, ramp) + spare * factor
        places, speeds, _ = motion.at(np.array([far, far + 0.5 * factor * factor * self.stop_s]))
        if places.max() > limit:
            return False
        return bool(
            stays_behind(
                cell.planes[i].edges.steps, float(places[0]), factor * float(speeds[0]), 0.0, -1.0, True,
                cell.control_period, cell.ticks_per_period, np.array([limit]),
            )
        )  # fmt: skip


def _sampler(motion: PhaseTrajectory) -> Callable[[Floats], JointTrajectory]:
    return lambda time: JointTrajectory.sample_at(motion, time)

"""What all arms of a cell do at the same instants, so that their controllers can run it on one clock."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self

import numpy as np

from armtempo.arrays import Floats
from armtempo.errors import InputError
from armtempo.planners.exports._interpolation import Interpolation, interpolation
from armtempo.planners.schedules import Schedule
from armtempo.planners.topp import JointTrajectory
from armtempo.robots import Arm

NANOSECONDS = 1_000_000_000  # in a second: the times of ROS are whole ones
MOST_POINTS = 1_000_000  # of a motion: no controller takes more
PARTS = 8  # of a period: so finely is a planned motion compared with what a controller makes of its points
REST_SPEED = 0.01  # [rad/s, m/s]: what ends slower than this ends; controllers refuse motions that end on the move


@dataclass(frozen=True, kw_only=True)
class MotionEvent:
    """Something that happens beside a motion.

    Attributes:
        time: When [s], from the start of the motion.
        arm: Whose it is.
        name: What it is called.
        duration: How long it takes [s]; the arm stands.
        gripper: What the gripper is to do.
        holds: What the arm holds from then on; None: nothing, or as before where the event says nothing of it.
    """

    time: float
    arm: str
    name: str
    duration: float = 0.0
    gripper: str | None = None
    holds: str | None = None


def _events(plan: Schedule) -> Iterator[MotionEvent]:
    """Those of the cell's tasks, when the plan has them."""
    motions = {arm.name: motion for arm, motion in zip(plan.cell.arms, plan.trajectories, strict=True)}
    for event in plan.cell.events:
        began = float(motions[event.arm].last_time_at(event.begins))  # it may wait there first
        duration = float(motions[event.arm].time_at(event.ends)) - began
        yield MotionEvent(time=began, arm=event.arm, name=event.name, duration=duration)


def time_base(duration: float, rate_hz: float) -> Floats:
    """(N,) instants [s] at a rate from 0, in whole nanoseconds; the last is the first at or after ``duration`` [s].

    Raises:
        InputError: The rate is no positive number, or gives far too many points.
    """
    if not (math.isfinite(rate_hz) and rate_hz > 0.0):
        raise InputError(f"a rate must be a positive number of Hz, got {rate_hz}", remedy="try 500")
    steps = duration * rate_hz
    if not steps <= MOST_POINTS or rate_hz > 0.1 * NANOSECONDS:
        raise InputError(f"{rate_hz:g} Hz gives {steps:.3g} points of each arm", remedy="give a lower rate")
    count = max(math.ceil(steps * (1.0 - 1e-12)), 1) + 1
    return np.round(np.arange(count) * (NANOSECONDS / rate_hz)) / NANOSECONDS


@dataclass(frozen=True, kw_only=True, eq=False)
class RobotMotion:
    """The joints of all arms at the same instants, at rest at both ends, with the events beside them.

    Attributes:
        arms: A of them.
        motions: One per arm; ``time`` is the same in all.
        finer: The same motions at more instants, whole parts of each period, for ``interpolation``; an arm's own points
            where no more of it is known.
        events: By time.

    Raises:
        InputError: The motions are not of these arms or not of one time base, an arm moves where they start or end, or
            an event is of no arm or outside the motion.
    """

    arms: tuple[Arm, ...]
    motions: tuple[JointTrajectory, ...]
    finer: tuple[JointTrajectory, ...]
    events: tuple[MotionEvent, ...] = ()

    def __post_init__(self) -> None:
        if not self.arms or not len(self.arms) == len(self.motions) == len(self.finer):
            raise InputError(f"{len(self.motions)} motions of {len(self.arms)} arms", remedy="give one for each arm")
        for arm, motion, finer in zip(self.arms, self.motions, self.finer, strict=True):
            self._check(arm, motion, finer)
        object.__setattr__(self, "motions", tuple(_ended(motion) for motion in self.motions))
        names = [arm.name for arm in self.arms]
        for event in self.events:
            if event.arm not in names or not 0.0 <= event.time <= self.duration:
                raise InputError(
                    f"event {event.name!r} of arm {event.arm!r} at {event.time:g} s is not within the motion",
                    remedy=f"arms {', '.join(names)}, times 0 to {self.duration:g} s",
                )

    def _check(self, arm: Arm, motion: JointTrajectory, finer: JointTrajectory) -> None:
        parts, rest = divmod(len(finer.time) - 1, max(len(motion.time) - 1, 1))
        same = np.array_equal(motion.time, self.motions[0].time) and not rest
        if len(motion.time) < 2 or not same or not np.allclose(finer.time[:: max(parts, 1)], motion.time, atol=1e-9):
            raise InputError(
                f"the motion of arm {arm.name!r} is not at the instants of the others",
                remedy="sample all arms at one time_base, and finer at whole parts of it",
            )
        if motion.joint_names != arm.joint_names:
            raise InputError(
                f"a motion of joints {', '.join(motion.joint_names)} is not of arm {arm.name!r}",
                remedy="give the motions in the order of the arms",
            )
        check_rest(arm, motion)

    @classmethod
    def sampled(
        cls,
        arms: Sequence[Arm],
        samples: Sequence[Callable[[Floats], JointTrajectory]],
        *,
        duration: float,
        rate_hz: float,
        events: Sequence[MotionEvent] = (),
    ) -> Self:
        """Motions at a rate.

        Args:
            arms: Whose.
            samples: For each arm, from instants (N,) [s] to what it does then; at rest from its arrival on.
            duration: Until the last arm arrives [s].
            rate_hz: Points per second.
            events: In any order.

        Raises:
            InputError: As ``time_base`` and ``RobotMotion``.
        """
        time = time_base(duration, rate_hz)
        shares = np.arange(PARTS) / PARTS
        between = np.append((time[:-1, None] + np.diff(time)[:, None] * shares).reshape(-1), time[-1])
        finer = tuple(sample(between) for sample in samples)
        return cls(
            arms=tuple(arms),
            motions=tuple(_every(one, PARTS) for one in finer),
            finer=finer,
            events=tuple(sorted(events, key=lambda event: event.time)),
        )

    @classmethod
    def of_schedule(cls, plan: Schedule, rate_hz: float = 500.0, events: Sequence[MotionEvent] = ()) -> Self:
        """The motions of a schedule at a rate, with the events of its tasks and more; raises as ``sampled``."""

        def sampler(arm: int) -> Callable[[Floats], JointTrajectory]:
            return lambda time: JointTrajectory.sample_at(plan.trajectories[arm], time)

        arms = plan.cell.arms
        samples = [sampler(arm) for arm in range(len(arms))]
        return cls.sampled(arms, samples, duration=plan.makespan, rate_hz=rate_hz, events=[*_events(plan), *events])

    @property
    def time(self) -> Floats:
        """(N,) instants [s], the same for all arms."""
        return self.motions[0].time

    @property
    def duration(self) -> float:
        """The last instant [s]."""
        return float(self.time[-1])

    @cached_property
    def joint_names(self) -> tuple[tuple[str, ...], ...]:
        """Of every arm, no name twice: where two arms share one, ``ARM_`` stands before all names.

        Raises:
            InputError: They are still not distinct.
        """
        own = tuple(arm.joint_names for arm in self.arms)
        if _distinct(own):
            return own
        headed = tuple(tuple(f"{arm.name}_{name}" for name in arm.joint_names) for arm in self.arms)
        if not _distinct(headed):
            raise InputError("two arms have joints of one name", remedy="give the arms of the cell other names")
        return headed

    @cached_property
    def interpolations(self) -> tuple[dict[str, Interpolation], ...]:
        """For every arm, what a ``cubic`` (q, qd) and a ``quintic`` (q, qd, qdd) controller makes of its points."""
        return tuple(
            {kind: interpolation(arm, motion, finer, kind) for kind in ("cubic", "quintic")}
            for arm, motion, finer in zip(self.arms, self.motions, self.finer, strict=True)
        )


def check_rest(arm: Arm, motion: JointTrajectory) -> None:
    """Check that a motion starts and ends at rest.

    Raises:
        InputError: It does not; controllers refuse it.
    """
    for where, row in (("starts", 0), ("ends", -1)):
        joint = int(np.abs(motion.qd[row]).argmax())
        if (speed := float(np.abs(motion.qd[row, joint]))) > REST_SPEED:
            raise InputError(
                f"arm {arm.name!r} moves where the motion {where}: joint {motion.joint_names[joint]!r} at "
                f"{speed:.3g} rad/s or m/s, and controllers start and end at rest",
                remedy="plan from rest to rest, or export it as csv",
                arm=arm.name,
            )


def _ended(motion: JointTrajectory) -> JointTrajectory:
    """The same motion whose last speed is 0: controllers refuse the last billionths, too."""
    qd = motion.qd.copy()
    qd[-1] = 0.0
    return replace(motion, qd=qd)


def _distinct(names: Sequence[Sequence[str]]) -> bool:
    every = [name for own in names for name in own]
    return len(set(every)) == len(every)


def _every(motion: JointTrajectory, parts: int) -> JointTrajectory:
    """Every so many rows of a motion."""
    rows = {name: getattr(motion, name)[::parts] for name in ("time", "q", "qd", "qdd", "torque")}
    return JointTrajectory(joint_names=motion.joint_names, **rows)

"""What goes between an arm's controller and us: its states, our answers, and what became of them."""

from __future__ import annotations

import math
import struct
import time
from collections import deque
from dataclasses import dataclass
from typing import Final, Self, final

from armtempo.errors import InputError, brief

NOTHING_HEARD: Final = -1  # of a state, before the first answer has arrived
STATE_FORMAT: Final = struct.Struct("<4sIqqdddd")  # mark, arm, sequence, heard, time, lam, rate, factor
SCALING_FORMAT: Final = struct.Struct("<4sIqdd")  # mark, arm, answers, factor, ramp
STATE_MARK: Final = b"ATs1"
SCALING_MARK: Final = b"ATf1"


@dataclass(frozen=True, kw_only=True, slots=True)
class ArmState:
    """Where an arm is, as its controller says.

    Attributes:
        arm: Its number in the cell.
        sequence: Of the state, rising from 0.
        time: When it was so, by the controller's own clock [s].
        lam: Place on its path [lambda].
        rate: Of the place [lambda/s].
        factor: That is in force, in [0, 1].
        heard: The sequence of the state whose answer is in force; -1 before there is one.

    Raises:
        InputError: They are no finite numbers, or the numbers of arm and state are negative.
    """

    arm: int
    sequence: int
    time: float
    lam: float
    rate: float
    factor: float
    heard: int = NOTHING_HEARD

    def __post_init__(self) -> None:
        numbers = (self.time, self.lam, self.rate, self.factor)
        finite = all(isinstance(one, float | int) and math.isfinite(one) for one in numbers)
        if (
            not finite
            or not 0.0 <= self.factor <= 1.0
            or self.arm < 0
            or self.sequence < 0
            or not NOTHING_HEARD <= self.heard < self.sequence
        ):
            raise InputError(
                f"state {brief(self.sequence)} of arm {brief(self.arm)} at {brief(self.lam)} with {brief(self.rate)}, "
                f"factor {brief(self.factor)}, heard {brief(self.heard)}, is none",
                remedy="give finite numbers, a factor in [0, 1], and what was heard before it",
            )

    def to_bytes(self) -> bytes:
        """For a datagram: 56 bytes, little-endian."""
        return STATE_FORMAT.pack(
            STATE_MARK, self.arm, self.sequence, self.heard, self.time, self.lam, self.rate, self.factor
        )

    @classmethod
    def from_bytes(cls, data: bytes) -> Self:
        """Read ``to_bytes``; raises InputError for anything else."""
        if len(data) != STATE_FORMAT.size or data[:4] != STATE_MARK:
            raise InputError(f"{len(data)} bytes are no state of an arm", remedy="send ArmState.to_bytes")
        _, arm, sequence, heard, at, lam, rate, factor = STATE_FORMAT.unpack(data)
        return cls(arm=arm, sequence=sequence, heard=heard, time=at, lam=lam, rate=rate, factor=factor)


@dataclass(frozen=True, kw_only=True, slots=True)
class SpeedScaling:
    """What an arm's controller is to do with its time.

    Attributes:
        arm: Whose.
        answers: The sequence of the state that it answers.
        factor: By which its time is to go slower, in [0, 1].
        ramp: How fast the factor in force may come nearer to it [1/s].
    """

    arm: int
    answers: int
    factor: float
    ramp: float

    def to_bytes(self) -> bytes:
        """For a datagram: 32 bytes, little-endian."""
        return SCALING_FORMAT.pack(SCALING_MARK, self.arm, self.answers, self.factor, self.ramp)

    @classmethod
    def from_bytes(cls, data: bytes) -> Self:
        """Read ``to_bytes``; raises InputError for anything else."""
        if len(data) != SCALING_FORMAT.size or data[:4] != SCALING_MARK:
            raise InputError(f"{len(data)} bytes are no speed scaling", remedy="send SpeedScaling.to_bytes")
        _, arm, answers, factor, ramp = SCALING_FORMAT.unpack(data)
        return cls(arm=arm, answers=answers, factor=factor, ramp=ramp)


@dataclass(frozen=True, kw_only=True, slots=True)
class LinkReport:
    """What became of an arm's states and of our answers.

    Attributes:
        received: States that were used.
        missed: States that never came, or too late.
        outdated: Those of them that came behind a later one.
        answered: Scalings that were sent.
        round_trip_mean: From an answer to the first state that has heard of it, mean [s]; nan before there is one.
        round_trip_max: The longest [s].
        emergencies: Answers that stop an arm at once, faster than its drives brake: the link was worse than promised.
    """

    received: int
    missed: int
    outdated: int
    answered: int
    round_trip_mean: float
    round_trip_max: float
    emergencies: int

    @property
    def loss_percent(self) -> float:
        """States that never came, or too late, in percent."""
        return 100.0 * self.missed / max(self.missed + self.received, 1)


@final
class Link:
    """One arm's side of it: the last state, the answers that may still act, and counts.

    Args:
        hold: For how long after a state its answer may act [s].
    """

    def __init__(self, hold: float) -> None:
        self.hold = hold
        self.state: ArmState | None = None
        self.answered_to = NOTHING_HEARD
        self.answered_time: float | None = None
        self.sent_factor = 0.0
        self.emergencies = 0
        self._pending: deque[tuple[int, float, float]] = deque()  # answered sequence, expiry, factor
        self._sent: dict[int, float] = {}  # answered sequence: when it was sent, by our clock
        self._counts = [0, 0, 0, 0]
        self._trips, self._trip_sum, self._trip_max = 0, 0.0, math.nan

    def hear(self, state: ArmState) -> bool:
        """Take a state, unless a later one is there; whether it was taken."""
        last = NOTHING_HEARD if self.state is None else self.state.sequence
        if state.sequence <= last:
            self._counts[2] += 1
            return False
        self._counts[0] += 1
        self._counts[1] += state.sequence - last - 1
        self.state = state
        while self._pending and (self._pending[0][0] < state.heard or self._pending[0][1] <= state.time):
            self._pending.popleft()
        if (sent := self._sent.get(state.heard)) is not None:
            trip = time.monotonic() - sent
            self._trips, self._trip_sum = self._trips + 1, self._trip_sum + trip
            self._trip_max = trip if math.isnan(self._trip_max) else max(self._trip_max, trip)
            self._sent = {sequence: at for sequence, at in self._sent.items() if sequence > state.heard}
        return True

    def answer(self, factor: float, ramp: float) -> SpeedScaling:
        """The answer to the last state, remembered for as long as it may act."""
        assert self.state is not None
        state = self.state
        self._pending.append((state.sequence, state.time + self.hold, factor))
        self._sent[state.sequence] = time.monotonic()
        self.answered_to, self.answered_time, self.sent_factor = state.sequence, state.time, factor
        self._counts[3] += 1
        return SpeedScaling(arm=state.arm, answers=state.sequence, factor=factor, ramp=ramp)

    @property
    def elapsed(self) -> float:
        """Between the last two states that were or are to be answered, by the controller's clock [s]."""
        assert self.state is not None
        return 0.0 if self.answered_time is None else self.state.time - self.answered_time

    def carried(self, factor: float, ramp: float) -> float:
        """How far the controller's time goes at most [s] until no answer acts any more, if this one is given now."""
        assert self.state is not None
        now, total, most = self.state.time, 0.0, factor
        until = now + self.hold
        for _, expiry, older in reversed(self._pending):  # the newer, the longer it acts
            total += most * max(until - max(expiry, now), 0.0)
            until = min(until, max(expiry, now))
            most = max(most, older)
        most = max(most, self.state.factor)
        lag = max(most - factor, 0.0)  # while it comes down to this one
        return total + most * max(until - now, 0.0) + 0.5 * lag * lag / ramp

    @property
    def report(self) -> LinkReport:
        """The counts until now."""
        received, missed, outdated, answered = self._counts
        return LinkReport(
            received=received,
            missed=missed,
            outdated=outdated,
            answered=answered,
            round_trip_mean=self._trip_sum / self._trips if self._trips else math.nan,
            round_trip_max=self._trip_max,
            emergencies=self.emergencies,
        )

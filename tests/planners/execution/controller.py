"""Simulated controllers of arms, as ``docs/execution.md`` asks of them, and a link that loses and delays.

Run as a program it is the other end of a UDP link, in a process of its own, on a clock of its own: 500 Hz.
"""

from __future__ import annotations

import heapq
import json
import socket
import struct
import sys
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
TICK_S = 0.002
STATE, SCALING = struct.Struct("<4sIqqdddd"), struct.Struct("<4sIqdd")


@dataclass
class Controller:
    """One arm's controller: its time goes by the factor in force, slowed and stopped by what it is not told of."""

    arm: int
    fast: Floats
    """(K, 3) instants, places and rates of the fastest motion."""
    pace: Floats
    """(T,) what operators, slider and protective stops make of its rate, tick by tick; the last one lasts."""
    hold_s: float
    stop_s: float
    s: float = 0.0
    factor: float = 0.0
    target: float = 0.0
    ramp: float = 0.0
    ticks: int = 0
    heard: int = -1
    heard_at: float = 0.0
    sent_at: dict[int, float] = field(default_factory=dict)
    dropped: int = 0
    round_trips: list[float] = field(default_factory=list)

    @property
    def now(self) -> float:
        return self.ticks * TICK_S

    @property
    def place(self) -> float:
        return float(np.interp(self.s, self.fast[:, 0], self.fast[:, 1]))

    def state(self) -> tuple[int, int, int, float, float, float, float]:
        """Arm, sequence, heard, time, place, rate, factor; once a tick."""
        rate = self.factor * self.pace[min(max(self.ticks - 1, 0), len(self.pace) - 1)]
        rate *= float(np.interp(self.s, self.fast[:, 0], self.fast[:, 2]))
        self.sent_at[self.ticks] = self.now
        return self.arm, self.ticks, self.heard, self.now, self.place, rate, self.factor

    def take(self, answers: int, factor: float, ramp: float) -> None:
        """An answer: of a newer state than the one in force, and not too old."""
        at = self.sent_at.get(answers)
        if at is None or answers <= self.heard or self.now - at > self.hold_s:
            self.dropped += 1
            return
        self.heard, self.heard_at, self.target, self.ramp = answers, at, factor, ramp
        self.round_trips.append(self.now - at)
        self.sent_at = {tick: when for tick, when in self.sent_at.items() if tick > answers}

    def tick(self) -> None:
        """Go on for one tick; without an answer that is new enough, slower and slower."""
        if self.now - self.heard_at >= self.hold_s:
            self.target, self.ramp = 0.0, 1.0 / max(self.stop_s, 1e-9)
        self.factor += min(max(self.target - self.factor, -self.ramp * TICK_S), self.ramp * TICK_S)
        pace = self.pace[min(self.ticks, len(self.pace) - 1)]
        self.s = min(self.s + self.factor * pace * TICK_S, float(self.fast[-1, 0]))
        self.ticks += 1


def disturbed(generator: np.random.Generator, duration: float) -> Floats:
    """A pace: late, slow, stopped at once for a while, or all of it."""
    pace = np.ones(int(4.0 * duration / TICK_S))
    kind = generator.integers(5)
    if kind in (1, 4):
        pace[: int(generator.uniform(0.0, duration) / TICK_S)] = 0.0
    if kind in (2, 4):
        pace *= generator.uniform(0.1, 1.0)
    if kind in (3, 4):
        for _ in range(generator.integers(1, 4)):
            begin = generator.integers(int(1.5 * duration / TICK_S))
            pace[begin : begin + int(generator.uniform(0.0, 0.5 * duration) / TICK_S)] = 0.0
    return pace


class Channel:
    """One direction of a link: packets are lost, or come after a random delay, in any order."""

    def __init__(self, generator: np.random.Generator, loss: float, jitter_s: float) -> None:
        self._generator, self._loss, self._jitter = generator, loss, jitter_s
        self._waiting: list[tuple[float, int, Any]] = []
        self._count = 0
        self.lost = 0

    def send(self, now: float, packet: Any) -> None:
        self._count += 1
        if self._generator.random() < self._loss:
            self.lost += 1
            return
        delay = self._generator.exponential(self._jitter) if self._jitter > 0.0 else 0.0
        heapq.heappush(self._waiting, (now + delay, self._count, packet))

    def arrived(self, now: float) -> list[Any]:
        out = []
        while self._waiting and self._waiting[0][0] <= now:
            out.append(heapq.heappop(self._waiting)[2])
        return out


def main(file: str, port: int) -> None:
    """Read arms and link from a file of ``run_over_udp``, run until all have arrived; a line of JSON tells."""
    task = np.load(file)
    generator = np.random.default_rng(int(task["seed"]))
    arms = int(task["arms"])
    hold_s, stop_s, timeout = float(task["hold_s"]), float(task["stop_s"]), float(task["timeout_s"])
    controllers = [Controller(i, task[f"fast_{i}"], task[f"pace_{i}"], hold_s, stop_s) for i in range(arms)]
    up, down = (Channel(generator, float(task["loss"]), float(task["jitter_s"])) for _ in range(2))
    channel = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    channel.setblocking(False)
    begin = due = time.monotonic()
    places, late = [], 0
    while not all(one.s >= one.fast[-1, 0] for one in controllers) and due - begin < timeout:
        while True:
            try:
                data = channel.recv(256)
            except BlockingIOError:
                break
            down.send(time.monotonic(), data)
        for packet in down.arrived(time.monotonic()):
            _, arm, answers, factor, ramp = SCALING.unpack(packet)
            controllers[arm].take(answers, factor, ramp)
        for one in controllers:
            one.tick()
            arm, *rest = one.state()
            up.send(time.monotonic(), STATE.pack(b"ATs1", arm, *rest))
        for packet in up.arrived(time.monotonic()):
            channel.sendto(packet, ("127.0.0.1", port))
        places.append([one.place for one in controllers])
        due += TICK_S
        late += time.monotonic() > due
        time.sleep(max(due - time.monotonic(), 0.0))
    for _ in range(20):  # the ends must arrive, too
        for one in controllers:
            one.ticks += 1
            arm, *rest = one.state()
            channel.sendto(STATE.pack(b"ATs1", arm, *rest), ("127.0.0.1", port))
        time.sleep(0.005)
    np.savez(Path(file).with_suffix(".out.npz"), places=np.array(places))
    trips = np.array([trip for one in controllers for trip in one.round_trips])
    told = {
        "arrived": all(one.s >= one.fast[-1, 0] for one in controllers),
        "time_s": len(places) * TICK_S, "late_ticks": late, "lost": up.lost + down.lost,
        "dropped": sum(one.dropped for one in controllers),
        "round_trip_mean_s": float(trips.mean()) if len(trips) else None,
        "round_trip_max_s": float(trips.max()) if len(trips) else None,
    }  # fmt: skip
    sys.stdout.write(json.dumps(told) + "\n")


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]))

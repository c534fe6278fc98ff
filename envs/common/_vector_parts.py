"""What batches of episodes are made with: random generators, threads, states, sums and infos."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise
from typing import Any, final

import numpy as np
from gymnasium.utils import seeding
from numpy.typing import NDArray

from armtempo.arrays import Bools, Floats
from armtempo.errors import InputError, brief
from armtempo.state import State, Stateful

Seeds = Sequence[int | None]
MOST_THINGS = 10**7  # environments, threads, cells: more is a slip


def count_of(number: int, what: str = "num_envs") -> int:
    """A number of things, one at least."""
    if isinstance(number, bool) or not (isinstance(number, int | np.integer) and 0 < number <= MOST_THINGS):
        raise InputError(f"{what} must be a whole number above 0, {MOST_THINGS} at most, got {brief(number)}")
    return int(number)


def sums_of(terms: Floats) -> Floats:
    """(E,) sums of terms (T, E) with the bits of Python's ``sum``, which environments add theirs up with.

    Since Python 3.12 that is more exact than one addition after another.
    """
    return np.array([sum(row) for row in terms.T.tolist()], dtype=np.float64)


def with_masks(values: Mapping[str, NDArray[Any]], mask: Bools) -> dict[str, Any]:
    """Infos of some environments as Gymnasium has them: values and ``_name`` (E,), whose they are."""
    return {**values, **{f"_{name}": mask for name in values}}


@final
class Generators(Stateful):
    """One generator of random numbers per environment, seeded as Gymnasium seeds that of a single one."""

    def __init__(self, count: int) -> None:
        self.each = [seeding.np_random(None)[0] for _ in range(count)]

    def _own_state(self) -> State:
        return {"words": self._words()}

    def _go_on(self, state: Mapping[str, Any]) -> None:
        for one, row in zip(self.each, state["words"].tolist(), strict=True):
            numbers = {"state": row[0] * 2**64 + row[1], "inc": row[2] * 2**64 + row[3]}
            own: Mapping[str, Any] = one.bit_generator.state
            one.bit_generator.state = {**own, "state": numbers, "has_uint32": row[4], "uinteger": row[5]}

    def seed(self, seeds: Seeds | None, mask: Bools) -> None:
        """Seed those of ``mask`` (E,) that have a seed."""
        for e in np.flatnonzero(mask).tolist() if seeds is not None else ():
            if seeds is not None and seeds[e] is not None:
                self.each[e] = seeding.np_random(seeds[e])[0]

    def _words(self) -> NDArray[np.uint64]:
        """(E, 6) all that they go on from."""
        rows = []
        for one in self.each:
            state: Mapping[str, Any] = one.bit_generator.state
            numbers = [state["state"]["state"], state["state"]["inc"]]  # of 128 bits
            halves = [half for number in numbers for half in divmod(number, 2**64)]
            rows.append([*halves, state["has_uint32"], state["uinteger"]])
        return np.array(rows, dtype=np.uint64)


@final
class Chunks:
    """Episodes shared out among threads.

    Args:
        episodes: E.
        threads: How many; None: one per core, if there are episodes enough.
        per_thread: Episodes that are worth a thread.

    Attributes:
        bounds: First and last (exclusive) episode of each.
    """

    def __init__(self, episodes: int, threads: int | None, per_thread: int = 1) -> None:
        fitting = max(1, min(os.cpu_count() or 1, episodes // per_thread))
        count = fitting if threads is None else min(count_of(threads, "threads"), episodes)
        self.bounds: list[tuple[int, int]] = list(pairwise(np.linspace(0, episodes, count + 1).astype(int).tolist()))
        self._pool = self._threads()

    def _threads(self) -> ThreadPoolExecutor | None:
        return ThreadPoolExecutor(len(self.bounds) - 1) if len(self.bounds) > 1 else None

    def __getstate__(self) -> dict[str, Any]:
        return {"bounds": self.bounds}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.bounds = state["bounds"]
        self._pool = self._threads()  # a copy has threads of its own

    def run(self, work: Callable[[int, int, int], None]) -> None:
        """``work(k, first, last)`` for every chunk k; the first in this thread, all at once."""
        others = [] if self._pool is None else [
            self._pool.submit(work, k, *bounds) for k, bounds in enumerate(self.bounds) if k
        ]  # fmt: skip
        work(0, *self.bounds[0])
        for other in others:
            other.result()

    def close(self) -> None:
        """End the threads; may be called twice."""
        if self._pool is not None:
            self._pool.shutdown()

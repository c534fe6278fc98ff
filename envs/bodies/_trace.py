"""What a simulation of any kind of cell is, and what it keeps of an episode."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any, Generic, NamedTuple, Protocol, TypeVar, final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armtempo.arrays import Floats
from armtempo.errors import InputError
from armtempo.planners import Cell
from armtempo.state import Stateful

CellT_co = TypeVar("CellT_co", bound=Cell, covariant=True)
TraceT_co = TypeVar("TraceT_co", bound="Trace[Any]", covariant=True)
PerArm = TypeVar("PerArm", Floats, tuple[Floats, ...])
CLIPPED_SHARE = 1e-3
"""Torques that are clipped by less than this share of their limit do not count as clipped."""


class End(NamedTuple):
    """How an episode stands."""

    arrived: float
    """Instant at which all that was to be done is done [s]; nan before."""
    violated: bool
    """Whether something happened that must not: arms too close to each other, a tip out of its tube."""


class Simulation(Protocol[CellT_co, TraceT_co]):
    """Episodes of a cell, control period by control period, one at a time.

    It knows arms and time, not agents, spaces or rewards. It has begun an episode once it is made.
    """

    @property
    def cell(self) -> CellT_co:
        """Of this episode: the arms are those it was made with, what they are to do may be drawn anew."""

    @property
    def time(self) -> float:
        """Instant [s]."""

    @property
    def end(self) -> End:
        """Whether the episode is over."""

    def step(self, command: Floats, /) -> None:
        """Run one control period; what the command's numbers mean is the kind's business."""

    def joint_positions(self) -> Floats:
        """(A, n) joint positions now, padded to the largest number of joints [rad, m]."""

    def trace(self) -> TraceT_co:
        """What happened so far, from row 0, the start, on; raises InputError where nothing was recorded."""

    def close(self) -> None:
        """Leave the physics engine; may be called twice."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Trace(Generic[PerArm]):
    """An episode at its ticks, T + 1 rows (row 0 is the start; torques of row k act from tick k - 1 to k).

    Its arrays are read-only. Cells of one arm have one array where those of several have one per arm, in a tuple.

    Attributes:
        time: (T+1,) [s].
        q: (T+1, n) joint positions: measured, or of the reference without physics [rad, m].
        torque: (T+1, n) applied [N m, N].
        demand: (T+1, n) the same before clipping at the limits.
        torque_max: (n,) the limits.
    """

    time: Floats
    q: PerArm
    torque: PerArm
    demand: PerArm
    torque_max: PerArm

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            for array in value if isinstance(value, tuple) else (value,):
                if isinstance(array, np.ndarray):
                    array.setflags(write=False)

    @property
    def arrived(self) -> float:
        """Instant at which all arms had arrived [s]; nan where they did not, or have no place to arrive at."""
        return math.nan

    @property
    def torque_ratio_max(self) -> float:
        """Largest |applied torque| / limit."""
        return max(float(np.max(shares)) for shares in self._shares(self.torque))

    @property
    def torque_demand_ratio_max(self) -> float:
        """Largest |demanded torque| / limit."""
        return max(float(np.max(shares)) for shares in self._shares(self.demand))

    @property
    def torque_clipped_fraction(self) -> float:
        """Share of joint torques that were clipped by more than a thousandth of their limit, until all had arrived."""
        until = self.time <= (self.arrived if math.isfinite(self.arrived) else np.inf)
        over = [
            (np.abs(demand)[until] > (1.0 + CLIPPED_SHARE) * limit).ravel()
            for demand, limit in zip(_per_arm(self.demand), _per_arm(self.torque_max), strict=True)
        ]
        return float(np.mean(np.concatenate(over)))

    def _shares(self, torques: PerArm) -> list[Floats]:
        """Of each arm, (T+1, n): the size of torques as a share of their limits."""
        pairs = zip(_per_arm(torques), _per_arm(self.torque_max), strict=True)
        return [np.abs(torque) / limit for torque, limit in pairs]


def _per_arm(values: Floats | tuple[Floats, ...]) -> tuple[Floats, ...]:
    return values if isinstance(values, tuple) else (values,)


@final
class Blocks(dict[str, list[NDArray[Any]]]):
    """Rows by name, in blocks that nobody writes to any more: a copy shares them."""

    def __deepcopy__(self, memo: dict[int, object]) -> Blocks:
        return Blocks({name: list(blocks) for name, blocks in self.items()})


@final
class Recorder(Stateful):
    """The columns of a trace, gathered row by row.

    Args:
        wanted: Whether to keep anything; if not, asking for columns is an error.
        tick: Time between rows [s].
    """

    changing = ("_blocks",)

    def __init__(self, *, wanted: bool, tick: float) -> None:
        self.wanted = wanted
        self._tick = tick
        self._blocks = Blocks()

    def check_state(self, state: Mapping[str, Any]) -> None:
        """Raise InputError for a state without a trace where one is kept, or the other way round."""
        super().check_state(state)
        if bool(state["blocks"]) != self.wanted:
            raise InputError(
                "the state's trace does not fit", remedy="make both environments with record=True, or neither"
            )

    def clear(self) -> None:
        """Begin anew."""
        self._blocks = Blocks()

    def add(self, **row: ArrayLike) -> None:
        """One row: every column's value at it, copied."""
        for name, value in row.items():
            self._blocks.setdefault(name, []).append(np.array(value)[None])

    def extend(self, **rows: NDArray[Any]) -> None:
        """K rows: every column's values (K, ...) at them, copied."""
        for name, values in rows.items():
            self._blocks.setdefault(name, []).append(values.copy())

    def columns(self) -> dict[str, NDArray[Any]]:
        """New arrays (T+1, ...) of all columns, and the ``time`` of the rows [s].

        Raises:
            InputError: Nothing was to be kept.
        """
        if not self.wanted:
            raise InputError("this environment keeps no trace", remedy="make it with record=True")
        columns = {name: np.concatenate(blocks) for name, blocks in self._blocks.items()}
        count = len(next(iter(columns.values())))
        return {"time": np.asarray(self._tick * np.arange(count), dtype=np.float64)} | columns

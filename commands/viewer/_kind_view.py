"""What a kind of cell shows in a page beside its arms; torques every kind has."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Generic, NamedTuple, TypeVar

import numpy as np

from armtempo.arrays import Floats
from armtempo.commands.viewer._panels import Curve, Line, Mark, Panel
from armtempo.planners.cells import CellBase
from armtempo.robots import UNLIMITED, Arm

__all__ = ["KindView", "Told", "per_arm", "torque_panels"]

CellT = TypeVar("CellT")
TraceT = TypeVar("TraceT")
ResultT = TypeVar("ResultT")


class Told(NamedTuple):
    """What the page says of a run in words."""

    brief: str
    """Beside the policy's name."""
    headline: str
    """Beside its picture."""
    mishap: str = ""
    """What went wrong, in a few words."""


def nothing_more(cell: Any, trace: Any) -> Mapping[str, Any]:
    """No columns or curves of its own."""
    return {}


def over_time(cell: Any, trace: Any) -> Floats:
    """(T, A) the share of the path that is behind each arm: of those that have no path, of the time."""
    share = trace.time / max(float(trace.time[-1]), 1e-12)
    return np.asarray(np.repeat(share[:, None], len(per_arm(trace.q)), axis=1))


def no_panels(cell: CellBase[Any], traces: Sequence[Any]) -> list[Panel]:
    """None."""
    return []


def only_the_time(cell: CellBase[Any], result: Any) -> Told:
    """How long the first episode was."""
    return Told(f"{result.trace.time[-1]:.3f} s", f"{result.trace.time[-1]:.4f} s")


@dataclass(frozen=True, kw_only=True)
class KindView(Generic[CellT, TraceT, ResultT]):
    """What pages show of a kind of cell; cells are those of the trace.

    Attributes:
        panels: Charts before those of the torques.
        columns: (T, k) arrays of a trace that these need, by name.
        curves: What is drawn below the lines of a run, by the panel's title.
        progress: (T, A) the share of its path that is behind each arm.
        told: Words for a run.
        usual: The policy that is shown where none is named; empty: the first of the kind's.
    """

    panels: Callable[[CellT, Sequence[TraceT]], list[Panel]] = no_panels  # type: ignore[assignment]
    columns: Callable[[CellT, TraceT], Mapping[str, Floats]] = nothing_more
    curves: Callable[[CellT, TraceT], Mapping[str, Sequence[Curve]]] = nothing_more
    progress: Callable[[CellT, TraceT], Floats] = over_time
    told: Callable[[CellT, ResultT], Told] = only_the_time  # type: ignore[assignment]
    usual: str = ""


def per_arm(values: Floats | tuple[Floats, ...]) -> tuple[Floats, ...]:
    """What a trace has of each arm."""
    return values if isinstance(values, tuple) else (values,)


def torque_panels(arms: Sequence[Arm]) -> list[Panel]:
    """Torques of every arm's joints as shares of their limits; none of arms that have no limits."""
    panels = []
    for i, arm in enumerate(arms):
        limited = [j for j in range(arm.dof) if arm.torque_max[j] < UNLIMITED and math.isfinite(arm.torque_max[j])]
        if limited:
            lines = [
                Line(
                    column=f"torque{i}",
                    index=j,
                    label=f"joint {j + 1}" if arm.dof < 4 else f"{j + 1}",
                    joint=j,
                    scale=100.0,
                    steps=True,
                )
                for j in limited
            ]
            panels.append(
                Panel(
                    title="Torques" if len(arms) == 1 else f"Torques, {arm.name}",
                    label="% of the limit" if arm.dof < 4 else "% of the limit, by joint",
                    unit="%",
                    digits=0,
                    lines=tuple(lines),
                    low=-112.0,
                    high=112.0,
                    marks=(Mark(at=-100.0), Mark(at=100.0)),
                    largest=True,
                )
            )
    return panels

r"""The methods by which schedules are planned.

``sequential``             one arm after the other, each in minimum time
``constant-speed``         constant acceleration over a quarter of the path at either end, constant speed between,
                           start delayed
``constant-acceleration``  constant acceleration over half the path and constant deceleration over the other,
                           start delayed
``delay``                  minimum time, start delayed ("method 1" of Lee1991 section 2.4)
``vci``                    velocity control intervals ("method 3", the paper's own)
``offset``                 minimum time, started at the first instant from which it runs through without a conflict
``interval``               minimum time for the first arm; the others shape their motions round those before them
``optimal``                the best plan found with all arms free to yield, in any order
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Literal

from armtempo.errors import InfeasibleError, InputError, UnknownNameError, brief
from armtempo.planners.cells import CoordinationCell, as_cell
from armtempo.planners.coordination import (
    GAP,
    delayed,
    offset,
    one_by_one,
    optimal,
    plan_vci,
    prioritised,
)
from armtempo.planners.schedules._orders import all_orders, best_of, promising_orders
from armtempo.planners.schedules._schedule import Schedule
from armtempo.planners.schedules._smoothing import smoothed
from armtempo.planners.schedules._trapezoidal import trapezoidal
from armtempo.planners.topp import LIMIT_EXCESS_MAX

SHIFTED = ("constant-speed", "constant-acceleration", "delay", "offset")
"""Methods that shift motions in time: in the best order of the arms, if none is asked for."""
SHAPED = ("vci", "interval")
"""Methods that shape motions by priority: in the order of the cell, if none is asked for."""
RAMPS = {"constant-speed": 0.25, "constant-acceleration": 0.5}  # shares of the path at either end


def _sequential(cell: CoordinationCell, order: tuple[int, ...]) -> Schedule:
    motions, order = one_by_one(cell.timing, order)
    return Schedule(method="sequential", cell=cell, trajectories=motions, order=order)


def _delay(cell: CoordinationCell, order: tuple[int, ...]) -> Schedule:
    motions = delayed(cell.timing, cell.fastest, order)
    return Schedule(method="delay", cell=cell, trajectories=motions, order=order)


def _offset(cell: CoordinationCell, order: tuple[int, ...]) -> Schedule:
    return Schedule(method="offset", cell=cell, trajectories=offset(cell.timing, order), order=order)


def _interval(cell: CoordinationCell, order: tuple[int, ...]) -> Schedule:
    return Schedule(method="interval", cell=cell, trajectories=prioritised(cell.timing, order), order=order)


def _optimal(
    cell: CoordinationCell, order: tuple[int, ...], *, gap: float = GAP, time_limit_s: float | None = None
) -> Schedule:
    motions, found = optimal(cell.timing, gap=gap, time_limit_s=time_limit_s)
    return Schedule(method="optimal", cell=cell, trajectories=motions, order=found)


def _ramped(cell: CoordinationCell, order: tuple[int, ...], method: str) -> Schedule:
    motions = delayed(cell.timing, tuple(trapezoidal(plane, RAMPS[method]) for plane in cell.planes), order)
    return Schedule(method=method, cell=cell, trajectories=motions, order=order)


def _vci(cell: CoordinationCell, order: tuple[int, ...], period: float | None = None) -> Schedule:
    try:
        period = cell.control_period if period is None else period
        motions, plans = plan_vci(cell.planes, cell.chart_between, order, period)
        if not cell.timing.is_free(motions):
            raise InfeasibleError(f"velocity control's motions in {cell.name!r} are not certified free")
        # its commands are not searched on the grid that the limits were refined for
        if any(not motion.certificate.excess <= LIMIT_EXCESS_MAX for motion in motions):
            raise InfeasibleError("velocity control's motions exceed a limit between stations", reason="grid")
    except InfeasibleError as refusal:
        try:  # the slave may not be able to stay behind everywhere, and yet have a way
            shaped = prioritised(cell.timing, order)
        except InfeasibleError:
            raise refusal from None
        return Schedule(
            method="vci",
            cell=cell,
            trajectories=shaped,
            order=order,
            fallback="interval",
            fallback_reason=refusal.message,
        )
    return Schedule(method="vci", cell=cell, trajectories=motions, order=order, vci=plans[order[-1]])


# In the order in which tables show them.
_PLANNERS: Mapping[str, Callable[[CoordinationCell, tuple[int, ...]], Schedule]] = {
    "sequential": _sequential,
    "constant-speed": partial(_ramped, method="constant-speed"),
    "constant-acceleration": partial(_ramped, method="constant-acceleration"),
    "delay": _delay,
    "vci": _vci,
    "offset": _offset,
    "interval": _interval,
    "optimal": _optimal,
}
METHODS = tuple(_PLANNERS)


def schedule(
    cell: CoordinationCell | str | Path,
    method: str,
    *,
    order: Sequence[int] | Literal["best", "file"] | None = None,
    period: float | None = None,
    gap: float | None = None,
    time_limit_s: float | None = None,
    smooth: bool = False,
) -> Schedule:
    """Plan when every arm of a cell moves.

    Args:
        cell: Arms on their paths, the first with priority; or a bundled name or file to build it from.
        method: One of ``METHODS``.
        order: Arms by priority, the first never yields; ``sequential`` keeps to it where that is safe, ``optimal`` does
            without it. ``best``: the one with the shortest plan, of all orders of five arms or fewer (``vci`` and
            ``interval``: of the six that are best for start delays, and the cell's). ``file``: as in the cell. Default:
            ``best`` for the methods that only shift motions in time, else ``file``.
        period: Step of ``vci`` [s] (default: the cell's control period).
        gap: ``optimal`` stops when its plan is proven to be within this share of the best (default: 0.005).
        time_limit_s: ``optimal`` refines no further after so long [s], once there is a plan (default: it goes on until
            nothing better is in sight, and the same cell gives the same plan, bit by bit).
        smooth: Every arm then makes its fastest motion within its jerk limits, started as early as keeps who passes
            first where; no plan where that takes more than start delays.

    Raises:
        UnknownNameError: No such method.
        InputError: ``order`` does not name every arm once, ``period``, ``gap`` or ``time_limit_s`` is out of range, or
            one of them is given to another method; or ``smooth``, and an arm has no jerk limits.
        CollisionError: The arms are too close where they start or where they end.
        InfeasibleError: The method has no solution here; the message says why, and what to try. That of ``optimal``
            has as its ``reason`` ``certified infeasible``, ``undecided`` or ``not holdable``.
    """
    if smooth:
        rough = schedule(cell, method, order=order, period=period, gap=gap, time_limit_s=time_limit_s)
        return smoothed(rough)
    cell = as_cell(cell, CoordinationCell)
    if not isinstance(method, str) or method not in _PLANNERS:
        raise UnknownNameError("method", method, METHODS)
    if period is not None and method != "vci":
        raise InputError(f"method {brief(method)} has no period: it is that of 'vci'")
    limits = {name: value for name, value in (("gap", gap), ("time_limit_s", time_limit_s)) if value is not None}
    if limits and method != "optimal":
        raise InputError(f"method {brief(method)} has no {' and no '.join(limits)}: only 'optimal' has")
    arms = tuple(range(len(cell.arms)))
    chosen = _checked_order(order, method, arms)
    if len(arms) == 1:
        if method in RAMPS:
            return _ramped(cell, (0,), method)
        return Schedule(method=method, cell=cell, trajectories=cell.fastest, order=(0,))
    cell.check_ends()
    if method == "optimal":
        return _optimal(cell, arms, **limits)
    plan = partial(_vci, cell, period=period) if method == "vci" else partial(_PLANNERS[method], cell)
    if chosen is None:
        return best_of(plan, all_orders(cell) if method in SHIFTED else promising_orders(cell))
    return plan(chosen)


def _checked_order(
    order: Sequence[int] | Literal["best", "file"] | None, method: str, arms: tuple[int, ...]
) -> tuple[int, ...] | None:
    """The order that is asked for; None: the best one."""
    if order == "file" or (order is None and method not in SHIFTED):
        return arms
    if order is None or order == "best":
        return None if method in (*SHIFTED, *SHAPED) else arms
    chosen = tuple(order) if isinstance(order, Collection) else ()
    if len(chosen) != len(arms) or any(arm not in chosen for arm in arms):
        raise InputError(
            f"order {brief(order)} must name each of the {len(arms)} arms once, by its index",
            remedy="or give best or file",
        )
    return chosen

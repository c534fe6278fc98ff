"""Schedules of motions with jerk limits, from others: who passes first where stays as it is."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from armtempo.arrays import Floats
from armtempo.errors import InfeasibleError
from armtempo.planners.coordination import order_delays
from armtempo.planners.schedules._schedule import Schedule
from armtempo.planners.topp import PhaseTrajectory

RAMPS = ("constant-speed", "constant-acceleration")
"""Methods whose motions are what they are: constant accelerations."""


def smoothed(plan: Schedule) -> Schedule:
    """Every arm's fastest motion within its jerk limits, started as early as keeps the plan's passing order.

    Raises:
        InputError: An arm has no jerk limits.
        InfeasibleError: It has no motion within them, or start delays do not suffice: arms wait for each other; or the
            method's motions are ramps of constant acceleration.
    """
    cell = plan.cell
    if plan.method in RAMPS:
        raise InfeasibleError(
            f"the accelerations of {plan.method} jump whatever the jerk limits",
            remedy="ask for delay, which shifts the fastest motions within them",
        )
    motions = cell.fastest_smooth
    if len(motions) > 1:
        starts = _starts(plan, motions)
        motions = tuple(motion.delayed(float(start)) for motion, start in zip(motions, starts, strict=True))
        if not cell.timing.is_free(motions):
            raise InfeasibleError(f"the motions with jerk limits in {cell.name!r} are not certified free")
    return Schedule(
        method=plan.method, cell=cell, trajectories=motions, order=plan.order, fallback=plan.fallback,
        fallback_reason=plan.fallback_reason, unsmoothed=plan,
    )  # fmt: skip


def _starts(plan: Schedule, motions: Sequence[PhaseTrajectory]) -> Floats:
    """When every arm starts [s]."""
    if plan.method != "sequential":
        return order_delays(plan.precedence, motions, [arm.name for arm in plan.cell.arms])
    starts, clock = np.zeros(len(motions)), 0.0
    for arm in plan.order:
        starts[arm], clock = clock, clock + motions[arm].duration
    return starts

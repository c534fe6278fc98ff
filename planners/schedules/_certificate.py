"""What a schedule asks of arms and space, computed apart from its planner."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from armtempo.planners.cells import CoordinationCell
from armtempo.planners.charts import CoordinationChart, Exclusion
from armtempo.planners.topp import PhaseTrajectory

CLEARANCE_PERIOD = 0.0002  # [s] between FCL distances
SAME_INSTANT = 1e-9  # [s]: rounding
MOST_HALVINGS = 24  # of the makespan, before a box that is not free counts as such


@dataclass(frozen=True, kw_only=True, slots=True)
class ScheduleCertificate:
    """What a schedule asks of arms and space, computed apart from its planner.

    Attributes:
        torque_ratio_max: Largest |torque| / limit, sampled ten times per interval from the robot model.
        speed_ratio_max: Largest mu / speed limit.
        jerk_ratio_max: Largest joint jerk / limit; 0 of motions without jerk limits.
        min_clearance: Smallest FCL distance between two arms [m], every 0.2 ms; infinite for one arm.
        certified_free: Whether the motion stays in cells of the chart that are certified free, between samples too.
        end_error: Largest distance of an arm's last row from the end of its path [lambda].
        dwell_error_max: By how much a dwell is longer or shorter than it is to be [s], at most.
        rules_broken: The rules of the cell (``after``, ``with``, zones) that the motions do not keep to, in words.
    """

    torque_ratio_max: float
    speed_ratio_max: float
    jerk_ratio_max: float
    min_clearance: float
    certified_free: bool
    end_error: float
    dwell_error_max: float = 0.0
    rules_broken: tuple[str, ...] = ()


def certify(cell: CoordinationCell, motions: Sequence[PhaseTrajectory]) -> ScheduleCertificate:
    """Worst ratios, smallest clearance and end error of motions, one per arm of a cell."""
    own = [motion.certificate for motion in motions]
    pairs = combinations(range(len(motions)), 2)
    makespan = max(motion.duration for motion in motions)
    return ScheduleCertificate(
        torque_ratio_max=max(one.torque_ratio_max for one in own),
        speed_ratio_max=max(one.speed_ratio_max for one in own),
        jerk_ratio_max=max(one.jerk_ratio_max for one in own),
        min_clearance=_min_clearance(cell, motions, makespan),
        certified_free=all(_is_covered(cell.chart_between(i, j), motions[i], motions[j], makespan) for i, j in pairs),
        end_error=max(one.end_error for one in own),
        dwell_error_max=max(one.dwell_error_max for one in own),
        rules_broken=tuple(rule.rule for rule in cell.exclusions if rule.certain and _is_broken(rule, motions)),
    )


def _is_broken(rule: Exclusion, motions: Sequence[PhaseTrajectory]) -> bool:
    """Whether both arms are inside their parts at some instant: told from the times, not from a chart."""
    inside = []
    for arm, (low, high) in zip(rule.arms, (rule.part_a, rule.part_b), strict=True):
        motion = motions[arm]
        enters = -np.inf if low <= 0.0 else float(motion.last_time_at(low))
        leaves = np.inf if high >= motion.lam[-1] else float(motion.time_at(high))
        inside.append((enters, leaves))
    (enters_a, leaves_a), (enters_b, leaves_b) = inside
    return max(enters_a, enters_b) < min(leaves_a, leaves_b) - SAME_INSTANT


def _min_clearance(cell: CoordinationCell, motions: Sequence[PhaseTrajectory], makespan: float) -> float:
    if len(motions) < 2:
        return float("inf")
    instants = np.append(np.arange(0.0, makespan, CLEARANCE_PERIOD), makespan)
    joints = [
        path.evaluate(motion.at(np.minimum(instants, motion.duration))[0])[0]
        for path, motion in zip(cell.paths, motions, strict=True)
    ]
    nearest = np.inf
    for q in zip(*joints, strict=True):
        nearest = min(nearest, cell.clearance.arms(q, cutoff=nearest).distance)
    return float(nearest)


def _is_covered(
    chart: CoordinationChart, motion_a: PhaseTrajectory, motion_b: PhaseTrajectory, makespan: float
) -> bool:
    """Cover two motions with boxes of their chart that are free, splitting those that are not until they are tiny."""
    sides = ((motion_a, chart.length_a), (motion_b, chart.length_b))

    def covered(start: float, stop: float, halvings: int) -> bool:
        boxes = []
        for motion, length in sides:
            low, high = motion.at(np.minimum([start, stop], motion.duration))[0]
            boxes.append((min(float(low), length), min(float(high), length)))
        if chart.is_free(boxes[0], boxes[1]):
            return True
        if halvings == 0:
            return False
        middle = 0.5 * (start + stop)
        return covered(start, middle, halvings - 1) and covered(middle, stop, halvings - 1)

    return covered(0.0, makespan, MOST_HALVINGS)

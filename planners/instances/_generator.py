r"""Random cells: arms that get into each other's way, drawn from a seed, certified, filtered and labelled.

Instance k of a seed is drawn from ``SeedSequence([seed, k])`` and nothing else, so it is the same whatever was
generated before it. A draw that cannot be used (a path leaves the joint limits, links touch, the arms do not meet) is
counted by its reason, and the next is made from the same stream.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from itertools import combinations
from pathlib import Path
from typing import Any, Literal

import numpy as np

from armtempo.configs import CellConfig, parse_cell_config
from armtempo.errors import (
    ArmtempoError,
    CollisionError,
    InfeasibleError,
    InputError,
    PathError,
    UnknownNameError,
    brief,
)
from armtempo.planners.cells import CoordinationCell, build_cell
from armtempo.planners.coordination import PriorityClass, optimal, pair_is_free
from armtempo.planners.instances._cell_draws import ARMS_OF, FAMILIES, draw_data
from armtempo.planners.instances._shaping import shaping_pays

Status = Literal["feasible", "certified infeasible", "undecided"]

MOST_DRAWS = 400  # before an instance is given up


@dataclass(frozen=True, kw_only=True)
class CellLabels:
    """What is known of a cell before anybody plans it.

    Attributes:
        status: ``feasible``: a plan exists (two arms that can hold still: the outer chart has a monotone path of
            free cells; else one was found). ``certified infeasible``: the blocked cells alone leave no monotone
            timing. ``undecided``: neither is proven.
        monotone: Whether every pair's outer chart has a monotone path of free cells from both starts to both ends.
        priority_class: ``free``, ``uniform``, ``mixed`` or ``infeasible``, as ``CoordinationCell.priority_class``.
        holdable: Per arm whether it can stand still wherever it is on its path.
        lower_bound: Certified lower bound on the makespan [s]; infinite if there is no timing.
        minimum_times: Per arm [s].
        regions: Collision regions of the planning charts of all pairs.
        undecided_share: Share of the planning charts' area that is undecided.
    """

    status: Status
    monotone: bool
    priority_class: PriorityClass
    holdable: tuple[bool, ...]
    lower_bound: float
    minimum_times: tuple[float, ...]
    regions: int
    undecided_share: float

    def record(self) -> dict[str, Any]:
        """The labels as JSON can hold them, units in the keys; an infinite bound is null."""
        return {
            "status": self.status,
            "monotone": self.monotone,
            "class": self.priority_class,
            "holdable": list(self.holdable),
            "lower_bound_s": self.lower_bound if math.isfinite(self.lower_bound) else None,
            "minimum_times_s": list(self.minimum_times),
            "regions": self.regions,
            "undecided_share": self.undecided_share,
        }

    @classmethod
    def from_record(cls, record: Mapping[str, Any]) -> CellLabels:
        """Back from ``record``."""
        bound = record["lower_bound_s"]
        return cls(
            status=record["status"],
            monotone=record["monotone"],
            priority_class=record["class"],
            holdable=tuple(record["holdable"]),
            lower_bound=math.inf if bound is None else bound,
            minimum_times=tuple(record["minimum_times_s"]),
            regions=record["regions"],
            undecided_share=record["undecided_share"],
        )

    def differences(self, other: CellLabels, *, tolerance: float = 1e-6) -> tuple[str, ...]:
        """Names of the labels that differ; numbers may by a share ``tolerance``: another processor rounds otherwise."""
        mine, theirs = asdict(self), asdict(other)
        same = {
            name: bool(np.shape(value) == np.shape(theirs[name]) and np.allclose(value, theirs[name], tolerance, 1e-9))
            if name in ("lower_bound", "minimum_times", "undecided_share")
            else value == theirs[name]
            for name, value in mine.items()
        }
        return tuple(name for name, equal in same.items() if not equal)


@dataclass(frozen=True, kw_only=True, eq=False)
class GeneratedCell:
    """One instance of the generator.

    Attributes:
        family: What kind of arms: one of ``FAMILIES``.
        seed: The generator's seed.
        index: Which instance of it.
        data: What the cell's file says, as plain values.
        cell: The cell, certified.
        labels: What is known of it.
        rejected: Draws before it that could not be used, by reason.
    """

    family: str
    seed: int
    index: int
    data: Mapping[str, Any]
    cell: CoordinationCell
    labels: CellLabels
    rejected: Mapping[str, int]


def label_cell(cell: CoordinationCell) -> CellLabels:
    """Status, class, bound, and what else is known of a cell. Charts are built if they are not yet.

    Cells of more than two arms, and arms that cannot hold still everywhere, are planned to find out.
    """
    charts = [cell.chart_between(i, j) for i, j in combinations(range(len(cell.arms)), 2)]
    monotone = all(bool(chart.passable[0, 0]) for chart in charts)
    status: Status = "undecided"
    if math.isinf(cell.lower_bound):
        status = "certified infeasible"
    elif monotone and ((len(cell.arms) == 2 and all(cell.holdable)) or _has_plan(cell)):
        status = "feasible"
    return CellLabels(
        status=status,
        monotone=monotone,
        priority_class=cell.priority_class,
        holdable=cell.holdable,
        lower_bound=cell.lower_bound,
        minimum_times=tuple(motion.duration for motion in cell.fastest),
        regions=sum(chart.regions for chart in charts),
        undecided_share=float(np.mean([chart.share(1) for chart in charts])) if charts else 0.0,
    )


def _has_plan(cell: CoordinationCell) -> bool:
    try:
        optimal(cell.timing, gap=np.inf)  # any plan will do
    except InfeasibleError:
        return False
    return True


def generate_cell(family: str, seed: int, index: int, *, arms: int | None = None) -> GeneratedCell:
    """Draw instance ``index`` of a seed: a certified cell whose arms conflict at full speed, labelled.

    Args:
        family: ``planar`` (two-link arms of the bundled URDF that face each other, through waypoints or along a line or
            an arc; some with gravity in their plane, some with friction), ``shaped`` (those of them in which full
            speed, with waiting where somebody must, takes longer than 1/0.97 of the optimum), ``ring`` (such arms on a
            circle, that swing their forearms through its middle), ``rows`` (in two rows that face each other, as along
            a conveyor), ``fixture`` (around a box in their middle, past whose corners they reach), ``panda``, ``iiwa``
            or ``ur5e`` (facing each other, 0.7 to 1.0 m apart, or on a circle; through random waypoints).
        seed: Not negative.
        index: Which instance of the seed, from 0.
        arms: How many, see ``ARMS_OF``; None: as few as the family has.

    Raises:
        UnknownNameError: No such family.
        InputError: A number is out of range.
        InfeasibleError: None of 400 draws could be used; ``rejected`` in its data says why.
    """
    if family not in FAMILIES:
        raise UnknownNameError("family", family, FAMILIES)
    if min(seed, index) < 0:
        raise InputError(f"seed and index must not be negative, got {seed} and {index}")
    possible = ARMS_OF[family]
    arms = possible[0] if arms is None else arms
    if arms not in possible:
        raise InputError(
            f"{brief(arms)} arms of family {brief(family)}", remedy=f"give one of {', '.join(map(str, possible))}"
        )
    generator = np.random.default_rng(np.random.SeedSequence([seed, index]))
    rejected: Counter[str] = Counter()
    name = cell_name(family, seed, index, arms=arms)
    for _ in range(MOST_DRAWS):
        data = {"kind": "coordination", "name": name, **draw_data(family, generator, arms)}
        try:
            cell = build_cell(config_of(name, data))
        except (PathError, CollisionError, InfeasibleError) as error:
            rejected[_reason(error)] += 1
            continue
        wrong = next((words for words, good in _wanted(family).items() if not good(cell)), None)
        if wrong is not None:
            rejected[wrong] += 1
            continue
        labels = label_cell(cell)
        return GeneratedCell(
            family=family, seed=seed, index=index, data=data, cell=cell, labels=labels, rejected=dict(rejected)
        )
    raise InfeasibleError(
        f"instance {index} of seed {seed}: none of {MOST_DRAWS} draws could be used",
        remedy="take another index, or fewer arms",
        rejected=dict(rejected),
    )


def cell_name(family: str, seed: int, index: int, *, arms: int = 2) -> str:
    """The name of a generated cell."""
    return f"{family}{arms if family == 'ring' or arms > 2 else ''}-{seed}-{index:04d}"


def config_of(name: str, data: Mapping[str, Any]) -> CellConfig:
    """The checked cell file of an instance."""
    return parse_cell_config(data, Path(f"{name}.yaml"))


def _reason(error: ArmtempoError) -> str:
    if isinstance(error, PathError):
        return "a path leaves the arm's reach or joint limits"
    if isinstance(error, InfeasibleError):
        return "an arm is too weak for its path"
    return (
        "links of one arm touch, or an obstacle"
        if "path of arm" in error.message
        else "the arms start or end too close"
    )


def _wanted(family: str) -> dict[str, Callable[[CoordinationCell], bool]]:
    """What a cell must be, one after the other, by the words for a draw that is not."""
    wanted: dict[str, Callable[[CoordinationCell], bool]] = {
        "the arms do not meet": _conflicts,
        "the minimum time depends on the grid": _well_posed,
    }
    if family == "shaped":
        wanted["shaping does not pay"] = shaping_pays
    return wanted


def _conflicts(cell: CoordinationCell) -> bool:
    """Whether every arm meets some other if all move in minimum time from the start."""
    meeting = {
        arm
        for i, j in combinations(range(len(cell.arms)), 2)
        if not pair_is_free(cell.chart_as_given(i, j), cell.fastest[i], cell.fastest[j])
        for arm in (i, j)
    }
    return len(meeting) == len(cell.arms)


def _well_posed(cell: CoordinationCell) -> bool:
    """Whether minimum times settle as the grid gets finer; an arm that just gets past a place may take for ever there.

    What a torque limit exceeded by 0.05 % gains would be larger than any gap to the bound.
    """
    return all(
        share < 0.01 and abs(plan.duration / fine.duration - 1.0) < 0.01
        for plan, (fine, share) in zip(cell.fastest, cell.bound_motions, strict=True)
    )

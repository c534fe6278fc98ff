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

from armtempo.arrays import Floats
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

Status = Literal["feasible", "certified infeasible", "undecided"]

MOST_DRAWS = 400  # before an instance is given up
PLANAR_LINKS = (0.37, 0.23)  # [m] of the planar arm
VERTICAL_SHARE = 0.2  # of planar cells: gravity lies in the plane of motion
FRICTION_SHARE = 0.3  # of planar cells: viscous friction
DRAWN_DIGITS = 4  # of drawn numbers, so that files of them stay short


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


def generate_cell(family: str, seed: int, index: int, *, arms: int = 2) -> GeneratedCell:
    """Draw instance ``index`` of a seed: a certified cell whose arms conflict at full speed, labelled.

    Args:
        family: ``planar`` (two-link arms of the bundled URDF that face each other, through waypoints or along a line or
            an arc; some with gravity in their plane, some with friction), ``ring`` (such arms on a circle, that swing
            their forearms through its middle), ``panda``, ``iiwa`` or ``ur5e`` (facing each other, 0.7 to 1.0 m apart,
            through random waypoints).
        seed: Not negative.
        index: Which instance of the seed, from 0.
        arms: How many; other than 2 for ``ring`` only.

    Raises:
        UnknownNameError: No such family.
        InputError: A number is out of range.
        InfeasibleError: None of 400 draws could be used; ``rejected`` in its data says why.
    """
    if family not in _FAMILIES:
        raise UnknownNameError("family", family, FAMILIES)
    if min(seed, index) < 0:
        raise InputError(f"seed and index must not be negative, got {seed} and {index}")
    if not 2 <= arms <= 8 or (arms != 2 and family != "ring"):
        raise InputError(f"{arms} arms of family {brief(family)}", remedy="give 2, or 2 to 8 for ring")
    generator = np.random.default_rng(np.random.SeedSequence([seed, index]))
    rejected: Counter[str] = Counter()
    name = cell_name(family, seed, index, arms=arms)
    for _ in range(MOST_DRAWS):
        data = {"kind": "coordination", "name": name, **_FAMILIES[family](generator, arms)}
        try:
            cell = build_cell(config_of(name, data))
        except (PathError, CollisionError, InfeasibleError) as error:
            rejected[_reason(error)] += 1
            continue
        if not _conflicts(cell):
            rejected["the arms do not meet"] += 1
            continue
        if not _well_posed(cell):
            rejected["the minimum time depends on the grid"] += 1
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
    return f"{family}{arms if family == 'ring' else ''}-{seed}-{index:04d}"


def config_of(name: str, data: Mapping[str, Any]) -> CellConfig:
    """The checked cell file of an instance."""
    return parse_cell_config(data, Path(f"{name}.yaml"))


def _reason(error: ArmtempoError) -> str:
    if isinstance(error, PathError):
        return "a path leaves the arm's reach or joint limits"
    if isinstance(error, InfeasibleError):
        return "an arm is too weak for its path"
    return "links of one arm touch" if "path of arm" in error.message else "the arms start or end too close"


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


def _numbers(values: Any) -> list[float]:
    return [round(float(value), DRAWN_DIGITS) + 0.0 for value in values]


def _ring(generator: np.random.Generator, arms: int) -> dict[str, Any]:
    """Planar arms on a circle so wide that a forearm gets past its neighbours' upper arms."""
    least = max(0.58, PLANAR_LINKS[0] + 1.17 * PLANAR_LINKS[1] / (2.0 * math.sin(math.pi / arms)))
    return _planar(generator, arms, least + generator.uniform(0.0, 0.02))


def _planar(generator: np.random.Generator, arms: int, ring: float | None = None) -> dict[str, Any]:
    """Planar arms about a middle to which every base is turned."""
    crossing = ring is not None
    ring = generator.uniform(0.30, 0.50) if ring is None else ring
    by_waypoints = generator.random() < 0.5
    vertical, rubs = generator.random() < VERTICAL_SHARE, generator.random() < FRICTION_SHARE
    entries = []
    for k in range(arms):
        angle = math.tau * k / arms + math.pi
        base = _numbers([ring * math.cos(angle), ring * math.sin(angle), 0.0])
        toward = round(math.remainder(angle + math.pi, math.tau), DRAWN_DIGITS) + 0.0
        entry: dict[str, Any] = {
            "name": f"arm_{k + 1}",
            "urdf": "planar_two_link.urdf",
            "base": {"position_m": base, "rpy_rad": [0.0, 0.0, toward]},
            "tip_link": "tool",
        }
        if rubs:
            entry["friction"] = {"viscous_nm_s_rad": _numbers(generator.uniform(0.0, [2.0, 0.5]))}
        if by_waypoints or crossing:
            waypoints = _through_the_middle(generator) if crossing else _anywhere(generator)
            entry["path"] = {"waypoints_rad": [_numbers(row) for row in waypoints]}
        else:
            entry["elbow"] = ("negative", "positive")[generator.integers(2)]
            entry["path"] = _planar_segment(generator, np.array(base[:2]), toward)
        entries.append(entry)
    return {
        "d_min_m": _numbers([generator.uniform(0.005, 0.02)])[0],
        "gravity_m_s2": [0.0, -9.81, 0.0] if vertical else [0.0, 0.0, -9.81],
        "chart_cells": 1024,
        "arms": entries,
    }


def _anywhere(generator: np.random.Generator) -> Floats:
    """Three to five joint positions (K, 2) that point more or less to the middle."""
    return generator.uniform([-1.3, -2.6], [1.3, 2.6], size=(generator.integers(3, 6), 2))


def _through_the_middle(generator: np.random.Generator) -> Floats:
    """A forearm that swings through the middle from one side to the other (5, 2): of many arms few others get past."""
    swing = np.linspace(1.0, -1.0, 5) * generator.choice([-1.0, 1.0]) * generator.uniform(2.5, 2.75)
    waypoints = np.column_stack([np.zeros(5), swing])
    waypoints += generator.uniform([-0.1, -0.15], [0.1, 0.15], size=(5, 2))
    return waypoints


def _planar_segment(generator: np.random.Generator, base: Any, toward: float) -> dict[str, Any]:
    """A line or an arc between two points within reach, on the side of the middle."""
    ways = generator.uniform(0.45, 0.97, size=2) * sum(PLANAR_LINKS)
    sides = toward + generator.uniform(-1.4, 1.4, size=2)
    start, end = (
        base + way * np.array([math.cos(side), math.sin(side)]) for way, side in zip(ways, sides, strict=True)
    )
    start, end = np.round(start, DRAWN_DIGITS), np.round(end, DRAWN_DIGITS)
    segment: dict[str, Any] = {"line": {"to_m": [*map(float, end), 0.0]}}
    if generator.random() < 0.5:
        across = np.array([start[1] - end[1], end[0] - start[0]])
        center = 0.5 * (start + end) + generator.uniform(-1.5, 1.5) * across
        segment = {"arc": {"to_m": [*map(float, end), 0.0], "center_m": [*(round(float(x), 12) for x in center), 0.0]}}
    return {"start_m": [*map(float, start), 0.0], "segments": [segment]}


@dataclass(frozen=True, kw_only=True)
class _Robot:
    """A robot, the middle of its random positions [rad] and how far they go to either side."""

    urdf: str
    middle: tuple[float, ...]
    spread: tuple[float, ...]


_ROBOTS = {
    "panda": _Robot(
        urdf="pybullet_data/franka_panda/panda.urdf",
        middle=(0.0, 0.3, 0.0, -1.9, 0.0, 2.2, 0.785),
        spread=(1.3, 0.5, 0.4, 0.5, 0.4, 0.4, 0.8),
    ),
    "iiwa": _Robot(
        urdf="pybullet_data/kuka_iiwa/model.urdf",
        middle=(0.0, 0.6, 0.0, -1.5, 0.0, 1.0, 0.0),
        spread=(1.4, 0.4, 0.3, 0.4, 0.4, 0.4, 0.8),
    ),
    "ur5e": _Robot(
        urdf="ur5e_like.urdf",
        middle=(0.0, -1.1, 1.6, -1.6, -1.57, 0.0),
        spread=(1.3, 0.4, 0.5, 0.5, 0.4, 0.8),
    ),
}


def _facing(robot: _Robot, generator: np.random.Generator) -> dict[str, Any]:
    apart = _numbers([generator.uniform(0.7, 1.0)])[0]
    entries = []
    for name, x, yaw in (("left", 0.0, 0.0), ("right", apart, math.pi)):
        turns = generator.uniform(-1.0, 1.0, size=(generator.integers(3, 6), len(robot.middle)))
        turns[[0, -1], 0] = generator.choice([-1.0, 1.0], 2) * generator.uniform(0.4, 1.0, 2)  # from and to a side
        waypoints = np.array(robot.middle) + turns * robot.spread
        entries.append(
            {
                "name": name,
                "urdf": robot.urdf,
                "base": {"position_m": [x, 0.0, 0.0], "rpy_rad": [0.0, 0.0, yaw]},
                "path": {"waypoints_rad": [_numbers(row) for row in waypoints]},
            }
        )
    return {
        "d_min_m": 0.02,
        "torque_reserve": 0.1,
        "physics_tick_s": 1.0 / 240.0,
        "control_period_s": 0.05,
        "chart_cells": 1024,
        "arms": entries,
    }


_FAMILIES: dict[str, Callable[[np.random.Generator, int], dict[str, Any]]] = {
    "planar": _planar,
    "ring": _ring,
    "panda": lambda generator, _: _facing(_ROBOTS["panda"], generator),
    "iiwa": lambda generator, _: _facing(_ROBOTS["iiwa"], generator),
    "ur5e": lambda generator, _: _facing(_ROBOTS["ur5e"], generator),
}
FAMILIES = tuple(_FAMILIES)

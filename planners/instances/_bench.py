"""Plans of many cells by many methods, audited by another engine, and what must hold of them."""

from __future__ import annotations

import math
import time
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import permutations
from typing import Any, Literal, Self

import numpy as np

from armtempo.errors import InfeasibleError
from armtempo.planners.cells import CoordinationCell
from armtempo.planners.instances._generator import CellLabels
from armtempo.planners.schedules import Engine, Schedule, audit_clearance, schedule

# They look at one order only.
ONE_ORDER_METHODS = ("constant-speed", "constant-acceleration", "delay", "vci", "offset", "interval")
PLAN_EXCESS_SHARE = 1e-3  # share of a limit that plans may exceed between stations
REFUSALS = ("certified infeasible", "undecided", "not holdable")  # what ``optimal`` may say
GAP_SLACK_PERCENT = 0.1  # of gap below zero that rounding explains


@dataclass(frozen=True, kw_only=True)
class BenchResult:
    """One cell planned by one method.

    Attributes:
        cell: The cell's name.
        family: What kind of arms.
        labels: What is known of the cell.
        method: The planner.
        makespan: In the best order of the arms [s]; infinite if there is no plan.
        gap_percent: Over the certified lower bound.
        seconds: Planning time, all orders together [s].
        reason: Why there is no plan, empty where there is one.
        fallback: The method that planned instead.
        orders: Of two arms, per order that was tried its makespan [s], None without a plan; of more, of the best one.
        min_clearance: Smallest distance of two arms by the audit [m]; None: not audited.
        violations: What is wrong with the plan: ``clearance``, ``torque``, ``speed``, ``acceleration``, ``end``.
    """

    cell: str
    family: str
    labels: CellLabels
    method: str
    makespan: float = math.inf
    gap_percent: float = math.inf
    seconds: float
    reason: str = ""
    fallback: str | None = None
    orders: Mapping[tuple[int, ...], float | None]
    min_clearance: float | None = None
    violations: tuple[str, ...] = ()

    @property
    def arms(self) -> int:
        """How many arms the cell has."""
        return len(self.labels.minimum_times)

    @property
    def solved(self) -> bool:
        """Whether there is a plan."""
        return not self.reason

    def record(self) -> dict[str, Any]:
        """As JSON can hold it, units in the keys."""
        return {
            "cell": self.cell,
            "family": self.family,
            "class": self.labels.priority_class,
            "status": self.labels.status,
            "method": self.method,
            "solved": self.solved,
            "makespan_s": self.makespan,
            "gap_percent": self.gap_percent,
            "planning_time_s": self.seconds,
            "reason": self.reason or None,
            "fallback": self.fallback,
            "min_clearance_m": self.min_clearance,
            "violations": list(self.violations),
            "makespan_by_order_s": {"-".join(map(str, order)): value for order, value in self.orders.items()},
        }

    @classmethod
    def from_record(cls, record: Mapping[str, Any], labels: CellLabels) -> Self:
        """Back from ``record``, with what is known of the cell."""
        orders = record["makespan_by_order_s"]
        return cls(
            cell=record["cell"],
            family=record["family"],
            labels=labels,
            method=record["method"],
            makespan=record["makespan_s"],
            gap_percent=record["gap_percent"],
            seconds=record["planning_time_s"],
            reason=record["reason"] or "",
            fallback=record["fallback"],
            orders={tuple(map(int, order.split("-"))): value for order, value in orders.items()},
            min_clearance=record["min_clearance_m"],
            violations=tuple(record["violations"]),
        )


def bench_cell(
    cell: CoordinationCell, labels: CellLabels, methods: Sequence[str], *, engine: Engine | None, family: str = ""
) -> list[BenchResult]:
    """Plan a cell by every method, and audit the plans.

    Methods that look at one order of the arms get the best of those that ``schedule`` tries; of two arms, both orders.
    Phase planes, charts, what they shut along each path, and the bound are there before the clock starts.

    Args:
        cell: What to plan.
        labels: What is known of it.
        methods: Names from ``METHODS``.
        engine: Audits clearances; None: nobody does.
        family: For the results.
    """
    _ = cell.lower_bound, cell.fastest, cell.timing.attainable
    for i, j in permutations(range(len(cell.arms)), 2):
        cell.timing.runs(i, j)  # kept for all methods: whichever came first would pay for it
    results = []
    for method in methods:
        own = tuple(range(len(cell.arms)))
        wanted: Sequence[tuple[int, ...] | Literal["best"]] = [own]
        if method in ONE_ORDER_METHODS:
            wanted = list(permutations(own)) if len(own) == 2 else ["best"]
        found: dict[tuple[int, ...], Schedule | None] = {}
        reason = ""
        start = time.perf_counter()
        for order in wanted:
            try:
                plan = schedule(cell, method, order=order)
                found[plan.order if order == "best" else order] = plan
            except InfeasibleError as refusal:
                found[own if order == "best" else order] = None
                reason = reason or str(refusal.data.get("reason") or refusal.message.split(":")[0])
        seconds = time.perf_counter() - start
        plans = [plan for plan in found.values() if plan is not None]
        best = min(plans, key=lambda plan: plan.makespan, default=None)
        violations, clearance = ((), None) if best is None else _audit(best, engine)
        results.append(
            BenchResult(
                cell=cell.name,
                family=family,
                labels=labels,
                method=method,
                makespan=math.inf if best is None else best.makespan,
                gap_percent=math.inf if best is None else best.gap_percent,
                seconds=seconds,
                reason="" if best is not None else reason,
                fallback=None if best is None else best.fallback,
                orders={order: None if plan is None else plan.makespan for order, plan in found.items()},
                min_clearance=clearance,
                violations=violations,
            )
        )
    return results


def _audit(plan: Schedule, engine: Engine | None) -> tuple[tuple[str, ...], float | None]:
    """What is wrong with a plan, and its smallest clearance [m]."""
    found, clearance = [], None
    if engine is not None:
        audit = audit_clearance(plan.cell, plan.trajectories, engine=engine)
        clearance = audit.min_clearance
        found += ["clearance"] if audit.violated else []
    motions = [motion.certificate for motion in plan.trajectories]  # relative to the limits less the reserve
    ratios = {
        "torque": max(m.torque_ratio_max for m in motions),
        "speed": max(m.speed_ratio_max for m in motions),
        "acceleration": max(m.acceleration_ratio_max for m in motions),
    }
    found += [name for name, ratio in ratios.items() if ratio > 1.0 + PLAN_EXCESS_SHARE]
    found += ["end"] if max(m.end_error for m in motions) > 1e-9 else []
    return tuple(found), clearance


@dataclass(frozen=True, kw_only=True)
class Claim:
    """Something that must hold of all results.

    Attributes:
        text: What.
        checked: On how many results or cells.
        broken: Where it does not: one line each.
    """

    text: str
    checked: int
    broken: tuple[str, ...]


def bench_claims(results: Sequence[BenchResult]) -> list[Claim]:
    """The claims that these results allow to check."""
    by_cell: dict[str, dict[str, BenchResult]] = {}
    for result in results:
        by_cell.setdefault(result.cell, {})[result.method] = result
    cells = list(by_cell.values())
    return [*_of_all(results), *_of_optimal(cells), *_of_vci(cells), *_of_delay(cells)]


def _claim(text: str, checks: Iterable[str]) -> Claim:
    """A claim from one line per check: empty where it holds, else where it does not."""
    lines = list(checks)
    return Claim(text=text, checked=len(lines), broken=tuple(line for line in lines if line))


def _of_all(results: Sequence[BenchResult]) -> list[Claim]:
    solved = [r for r in results if r.solved]
    return [
        _claim(
            "no plan violates a limit or d_min",
            (f"{r.cell}, {r.method}: {', '.join(r.violations)}" if r.violations else "" for r in solved),
        ),
        _claim(
            "makespan >= bound",
            (
                f"{r.cell}, {r.method}: {r.gap_percent:.3f} %" if r.gap_percent < -GAP_SLACK_PERCENT else ""
                for r in solved
            ),
        ),
        _claim(
            "what is certified infeasible is solved by nobody",
            (f"{r.cell}, {r.method}" if r.solved else "" for r in results if math.isinf(r.labels.lower_bound)),
        ),
    ]


def _of_optimal(cells: Sequence[Mapping[str, BenchResult]]) -> list[Claim]:
    found = [plans for plans in cells if "optimal" in plans]
    if not found:
        return []
    best = [plans["optimal"] for plans in found]
    due = [plans for plans in found if plans["optimal"].labels.monotone and all(plans["optimal"].labels.holdable)]
    gaps = [r.gap_percent for r in best if r.solved]
    median = float(np.median(gaps)) if gaps else 0.0
    others = [(plans["optimal"], r) for plans in due for r in plans.values() if r.solved and plans["optimal"].solved]
    return [
        _claim(
            "optimal solves every cell with a monotone free path and arms that can hold still",
            ("" if r.solved else f"{r.cell}: {r.reason}" for r in (plans["optimal"] for plans in due)),
        ),
        _claim(
            "where optimal has no plan it says certified infeasible, undecided or not holdable",
            ("" if r.reason in REFUSALS else f"{r.cell}: {r.reason}" for r in best if not r.solved),
        ),
        Claim(
            text="median gap of optimal < 2 %",
            checked=len(gaps),
            broken=() if median < 2.0 else (f"{median:.2f} %",),
        ),
        _claim(
            "optimal is the best of all methods (within 0.2 %)",
            (
                f"{r.cell}: {r.method} {r.makespan:.4f} s, optimal {one.makespan:.4f} s"
                if one.makespan > 1.002 * r.makespan
                else ""
                for one, r in others
            ),
        ),
    ]


def _of_vci(cells: Sequence[Mapping[str, BenchResult]]) -> list[Claim]:
    pairs = [(plans["vci"], plans["interval"]) for plans in cells if {"vci", "interval"} <= plans.keys()]
    planned = [
        (vci, order)
        for vci, interval in pairs
        for order, value in interval.orders.items()
        if value is not None and order in vci.orders  # of more than two arms each has its best one alone
    ]
    text = "vci has a plan in every order in which interval has one"
    checks = (f"{vci.cell}, order {order}" if vci.orders[order] is None else "" for vci, order in planned)
    return [_claim(text, checks)] if pairs else []


def _of_delay(cells: Sequence[Mapping[str, BenchResult]]) -> list[Claim]:
    pairs = [
        (plans["delay"], plans["vci"])
        for plans in cells
        if {"delay", "vci"} <= plans.keys() and plans["vci"].solved and plans["vci"].labels.priority_class == "uniform"
    ]
    checks = (
        f"{delay.cell}: delay {delay.makespan:.4f} s, vci {vci.makespan:.4f} s"
        if delay.makespan > 1.01 * vci.makespan
        else ""
        for delay, vci in pairs
    )
    return [_claim("delay <= vci + 1 % on uniform cells", checks)] if pairs else []

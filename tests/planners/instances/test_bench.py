"""What the benchmark claims: every claim holds of good results and is broken by bad ones."""

from __future__ import annotations

import dataclasses
import math

import pytest

from armtempo.planners import CoordinationCell, schedule
from armtempo.planners.instances import BenchResult, CellLabels, bench_cell, bench_claims, label_cell

BEST_ORDERS = {"vci": (0, 1), "interval": (1, 0)}


@pytest.fixture(scope="module")
def labels(lee1991: CoordinationCell) -> CellLabels:
    return label_cell(lee1991)


@pytest.fixture(scope="module")
def results(lee1991: CoordinationCell, labels: CellLabels) -> dict[str, BenchResult]:
    methods = ("sequential", "delay", "vci", "interval", "optimal")
    return {one.method: one for one in bench_cell(lee1991, labels, methods, engine="coal", family="planar")}


def broken(results: dict[str, BenchResult]) -> set[str]:
    return {claim.text for claim in bench_claims(list(results.values())) if claim.broken}


def test_all_methods_plan_the_papers_cell(results: dict[str, BenchResult], lee1991: CoordinationCell) -> None:
    for result in results.values():
        assert result.solved
        assert result.violations == ()
        assert result.min_clearance is not None
        assert result.min_clearance >= lee1991.d_min
        assert -0.1 < result.gap_percent < 80.0
    assert set(results["delay"].orders) == {(0, 1), (1, 0)}
    assert len(results["optimal"].orders) == 1
    assert broken(results) == set()
    assert all(claim.checked > 0 for claim in bench_claims(list(results.values())) if "infeasible" not in claim.text)


@pytest.mark.parametrize(
    ("method", "change", "words"),
    [
        ("vci", {"violations": ("clearance",)}, "violates"),
        ("vci", {"gap_percent": -0.5}, "bound"),
        ("optimal", {"makespan": math.inf, "gap_percent": math.inf, "reason": "time-out"}, "every cell"),
        ("optimal", {"makespan": math.inf, "gap_percent": math.inf, "reason": "time-out"}, "says"),
        ("optimal", {"gap_percent": 3.0}, "median"),
        ("optimal", {"makespan": 0.4}, "best of all"),
        ("vci", {"orders": {(0, 1): None, (1, 0): None}}, "in every order"),
        ("delay", {"makespan": 0.4}, "vci"),
    ],
)
def test_claims_can_be_broken(
    results: dict[str, BenchResult], method: str, change: dict[str, object], words: str
) -> None:
    worse = {**results, method: dataclasses.replace(results[method], **change)}  # type: ignore[arg-type]
    assert any(words in text for text in broken(worse))


def test_orders_that_only_one_method_has_tried_are_not_compared(results: dict[str, BenchResult]) -> None:
    """As of more than two arms, where each method keeps its best order."""
    kept = {name: dataclasses.replace(results[name], orders={order: 1.0}) for name, order in BEST_ORDERS.items()}
    assert not any("in every order" in text for text in broken({**results, **kept}))


def test_a_plan_of_what_is_infeasible_breaks_a_claim(results: dict[str, BenchResult], labels: CellLabels) -> None:
    impossible = dataclasses.replace(labels, lower_bound=math.inf)
    worse = {**results, "delay": dataclasses.replace(results["delay"], labels=impossible)}
    assert any("solved by nobody" in text for text in broken(worse))


def test_a_colliding_plan_is_reported(
    lee1991: CoordinationCell, labels: CellLabels, monkeypatch: pytest.MonkeyPatch
) -> None:
    def careless(cell: CoordinationCell, method: str, **_: object) -> object:
        return dataclasses.replace(schedule(cell, method), trajectories=cell.fastest)

    monkeypatch.setattr("armtempo.planners.instances._bench.schedule", careless)
    (result,) = bench_cell(lee1991, labels, ("delay",), engine="coal")
    assert result.violations == ("clearance",)

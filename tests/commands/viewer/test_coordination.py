"""Charts of cells of several arms."""

from __future__ import annotations

import numpy as np

from armtempo.agents import evaluate
from armtempo.commands.viewer import page_data
from armtempo.commands.viewer._coordination import forbidden_regions
from armtempo.planners import CoordinationCell


def test_forbidden_regions_hold_all_that_is_not_free_and_little_more(lee1991: CoordinationCell) -> None:
    chart = lee1991.chart
    regions = forbidden_regions(chart)
    share = float(((regions[:, 1] - regions[:, 0]) * (regions[:, 3] - regions[:, 2])).sum())
    share /= chart.length_a * chart.length_b
    assert 1.0 - chart.share(0) <= share + 1e-12
    assert share < 1.06 * (1.0 - chart.share(0))
    random = np.random.default_rng(0)
    for a, b in random.random((300, 2)) * [chart.length_a, chart.length_b]:
        inside = ((regions[:, 0] <= a) & (a < regions[:, 1]) & (regions[:, 2] <= b) & (b < regions[:, 3])).any()
        assert inside or chart.is_free(a, b)


def test_every_pair_that_meets_has_a_chart_and_every_arm_its_phase_plane(four_arms: CoordinationCell) -> None:
    data = page_data(evaluate(four_arms, ["delay"], physics="ideal"))
    titles = [panel["title"] for panel in data["panels"]]
    assert titles[1] == "Clearance"
    assert sum("," in title and title.startswith("arm") for title in titles) >= 4
    assert [f"Phase plane, arm{k}" in titles for k in range(4)] == [True] * 4
    (run,) = data["runs"]
    for panel in data["panels"]:
        assert {line["column"] for line in panel["lines"]} <= set(run["columns"])
        assert all(line["index"] < run["columns"][line["column"]]["shape"][1] for line in panel["lines"])
        assert panel["low"] is None or panel["high"] is None or panel["low"] < panel["high"]

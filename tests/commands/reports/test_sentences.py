"""What is said below a table when no policy finished: who was stopped by what."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from armtempo.agents import evaluate
from armtempo.commands.reports._blend import summary_sentence as of_blends
from armtempo.commands.reports._coordination import caption, summary_sentence
from armtempo.planners import BlendCell, CoordinationCell, load_cell


@pytest.mark.parametrize(
    ("policies", "options", "said"),
    [
        (["phase-plane"], {}, "No policy finished: phase-plane came closer than d_min."),
        (
            ["delay", "sequential"],
            {"max_episode_s": 0.1},
            "No policy finished: delay, sequential did not arrive in time.",
        ),
        (
            ["phase-plane", "sequential"],
            {"max_episode_s": 0.5},
            "No policy finished: phase-plane came closer than d_min; sequential did not arrive in time.",
        ),
    ],
)
def test_no_policy_finished(lee1991: CoordinationCell, policies: list[str], options: dict[str, Any], said: str) -> None:
    assert summary_sentence(evaluate(lee1991, policies, **options)).startswith(said)


def test_rules_and_distances_are_told_apart() -> None:
    """At full speed an arm passes where it should wait, far from the other."""
    cell = load_cell("scara-pair")
    alone = evaluate(cell, ["phase-plane"], physics="ideal")
    assert summary_sentence(alone).startswith("No policy finished: phase-plane broke a rule between arms.")
    both = evaluate(cell, ["phase-plane", "delay"], physics="ideal")
    assert summary_sentence(both).endswith(". Against a rule between arms: phase-plane.")


def test_on_the_way_there_is_no_bound(lee1991: CoordinationCell) -> None:
    for start, said in ((0.0, True), ((0.0, 0.3), False)):
        found = evaluate(
            lee1991, ["delay", "phase-plane"], episodes=3, seed=50000, physics="ideal", shield=True, start_phase=start
        )
        for text in (caption(found), summary_sentence(found)):
            assert ("lower bound" in text or "the quickest" in text) == said, text
            assert ("one after the other" in text or "one arm after the other" in text) == said
        assert "d_min" in caption(found)
        assert "needs" in summary_sentence(found) or said


def test_the_best_are_named_and_what_was_not_finished_is_counted(lee1991: CoordinationCell) -> None:
    found = evaluate(lee1991, ["delay", "phase-plane", "optimal"], physics="ideal", shield=True)
    delay, optimal = found.results["delay"], found.results["optimal"]
    assert summary_sentence(found).startswith(f"Best on line: delay ({delay.makespan_s:.4f} s); best of all: ")
    quicker = replace(optimal, makespan_s=0.3)
    told = summary_sentence(replace(found, results={**found.results, "optimal": quicker}, facts={
        **found.facts, "best": "optimal",
    }))  # fmt: skip
    assert "; best of all: optimal (0.3000 s).\n" in told
    two = evaluate(lee1991, ["delay", "phase-plane"], episodes=2, physics="ideal", shield=True)
    missing = {**two.results, "delay": replace(two.results["delay"], finished=1)}
    assert "counted as the time limit: delay 1 of 2." in summary_sentence(replace(two, results=missing))


def test_an_arm_off_its_path(lee1991: CoordinationCell) -> None:
    late = evaluate(lee1991, ["delay"], max_episode_s=0.1)
    off = {"delay": replace(late.results["delay"], path_error_max_m=0.0345, torque_demand_ratio_max=67.0)}
    said = summary_sentence(replace(late, results=off))
    assert said == "No policy finished: delay left the path by 34.5 mm (torque up to 67 x)."


def test_no_policy_arrived_within_its_limits(lee2006: BlendCell) -> None:
    late = evaluate(lee2006, ["constant", "line-speed"], max_episode_s=0.1)
    start = "No policy arrived within its limits: "
    assert of_blends(late) == f"{start}constant, line-speed did not arrive in time."
    one, other = late.results.values()
    left = replace(one, left=1, contour_error_max_m=0.0123)
    arrived = replace(other, finished=1, normal_acceleration_ratio_max=7.61)
    assert of_blends(replace(late, results={"constant": left, "mine": arrived})) == (
        f"{start}constant left the tube around the path (12.3 mm off); "
        "mine asked for 7.61 x the limit of the normal acceleration."
    )

"""Baselines of blend cells and their evaluation: the paper's figures, who keeps which limits, what is reported."""

from __future__ import annotations

import json

import numpy as np
import pytest

from armtempo.agents import (
    BLEND_POLICIES,
    BlendEvaluation,
    blend_baseline,
    evaluate,
    highest_rate,
    in_blends,
)
from armtempo.errors import InputError, UnknownNameError
from armtempo.planners import BlendCell, CoordinationCell
from armtempo.planners.cells import motion_demand


@pytest.fixture(scope="module")
def evaluation(lee2006: BlendCell) -> BlendEvaluation:
    return evaluate(lee2006)


def test_every_baseline_arrives_on_the_path(evaluation: BlendEvaluation) -> None:
    assert tuple(evaluation.results) == BLEND_POLICIES
    for result in evaluation.results.values():
        assert (result.finished, result.left) == (1, 0)
        assert result.contour_error_max_m < 1e-8
        assert result.torque_demand_ratio_max < 0.75
        assert result.duration_s is not None


def test_line_speed_is_the_papers_run(evaluation: BlendEvaluation) -> None:
    result = evaluation.results["line-speed"]
    assert result.plan_duration_s == pytest.approx(1.86883, abs=5e-6)
    assert result.duration_s == pytest.approx(1.86883, abs=0.002)
    assert result.blend_speed_min_m_s == pytest.approx(1.0)
    assert result.chord_speed_error_max_m_s == pytest.approx(0.438e-3, abs=2e-6)  # the paper: 0.4 mm/s
    assert result.arc_speed_error_max_m_s == pytest.approx(0.328e-3, abs=2e-6)
    assert result.normal_acceleration_ratio_max == pytest.approx(25.7 / 5.0, abs=0.01)
    assert result.jerk_ratio_max > 3.0


def test_limit_aware_and_constant_keep_all_limits(evaluation: BlendEvaluation) -> None:
    for name in ("limit-aware", "limit-aware-smooth", "constant"):
        result = evaluation.results[name]
        assert result.normal_acceleration_ratio_max <= 1.0 + 1e-6
        assert result.jerk_ratio_max <= 1.0 + 1e-6
        assert result.arc_speed_error_max_m_s is not None
        assert result.arc_speed_error_max_m_s < 1e-7
    durations = [
        evaluation.results[name].duration_s or 0.0 for name in ("limit-aware-smooth", "limit-aware", "constant")
    ]
    assert durations == sorted(durations)
    assert durations[0] < 1.05 * 1.86883  # all limits for 5 % more time


def test_the_constant_rate_is_the_highest(lee2006: BlendCell) -> None:
    rate = highest_rate(lee2006)
    profile = lee2006.line_speed
    s, v, a, j = profile.at(np.linspace(0.0, profile.duration, 30001))
    assert motion_demand(lee2006, s, rate * v, rate**2 * a, rate**3 * j).ratio_max == pytest.approx(1.0, abs=1e-5)
    peak = float(lee2006.blended.curvature(np.linspace(0.0, profile.length, 30001)).max())
    assert rate == pytest.approx(np.sqrt(5.0 / peak), rel=1e-5)


def test_blend_windows_are_those_of_the_path(evaluation: BlendEvaluation) -> None:
    trace = evaluation.results["line-speed"].trace
    seconds = in_blends(trace).sum() * 0.002
    assert seconds == pytest.approx(0.2703 + 0.2697, abs=0.006)  # the paper: 0.272 s each


def test_heavier_bodies_cost_more_where_it_accelerates_more(lee2006: BlendCell) -> None:
    result = evaluate(lee2006, ("line-speed", "limit-aware-smooth"), model_error=0.1).results
    errors = {name: r.contour_error_max_m for name, r in result.items()}
    assert errors["line-speed"] > 1.5 * errors["limit-aware-smooth"] > 1e-4


def test_policies_meet_the_same_random_paths(lee2006: BlendCell) -> None:
    random = evaluate(
        lee2006, ("limit-aware", "random"), family="polyline", episodes=2, seed=3, physics="ideal"
    ).results
    first, second = (result.trace.cell.blended.length for result in random.values())
    assert first == second != lee2006.blended.length
    assert random["limit-aware"].finished == 2
    assert random["limit-aware"].normal_acceleration_ratio_max <= 1.0 + 1e-6
    again = evaluate(lee2006, ("random",), family="polyline", episodes=2, seed=3, physics="ideal").results
    assert again["random"].reward == random["random"].reward
    assert random["random"].plan_duration_s is None


def test_cubics_of_another_shape_meet_smooth_baselines(lee2006: BlendCell) -> None:
    result = evaluate(lee2006.variant(shape_factor=2.0), ("limit-aware-smooth",), physics="ideal").results
    assert result["limit-aware-smooth"].trace.cell.config.blend.curve == "quintic"
    assert result["limit-aware-smooth"].finished == 1


def test_results_are_numbers_with_units(evaluation: BlendEvaluation) -> None:
    from armtempo.commands.console._output import plain

    data = json.loads(json.dumps(plain(evaluation.to_dict()), allow_nan=False))
    assert data["piece_lengths_m"] == pytest.approx([0.25, 0.270321, 0.351920, 0.269653, 0.526930], abs=1e-6)
    assert set(data["policies"]) == set(BLEND_POLICIES)
    assert "trace" not in data["policies"]["random"]
    assert data["policies"]["line-speed"]["chord_speed_error_max_m_s"] > 0.0


def test_wrong_requests_are_refused(lee1991: CoordinationCell, lee2006: BlendCell) -> None:
    with pytest.raises(UnknownNameError, match=r"unknown policy 'vci' \(known: constant, limit-aware"):
        evaluate(lee2006, ("vci",))
    with pytest.raises(UnknownNameError, match="limit-aware-smooth"):
        blend_baseline("limit-aware-smoth")
    with pytest.raises(InputError, match="episodes must be at least 1"):
        evaluate(lee2006, episodes=0)
    with pytest.raises(UnknownNameError, match="option of evaluations in blend cells 'master_late_s'"):
        evaluate(lee2006, master_late_s=0.1)  # type: ignore[call-overload]
    with pytest.raises(UnknownNameError, match="option of evaluations in coordination cells 'family'"):
        evaluate(lee1991, family="zigzag")  # type: ignore[call-overload]


def test_plans_and_arrivals_are_of_the_same_episodes(lee2006: BlendCell) -> None:
    """Heavier bodies in a narrow tube: full rate leaves it on the given path and arrives nowhere."""
    narrow = lee2006.config.model_copy(update={"contour_error_max_m": 1.5e-4})
    cell = BlendCell.of(narrow, lee2006.arm, lee2006.segments)
    none = evaluate(cell, ("line-speed",), model_error=0.1).results["line-speed"]
    assert (none.finished, none.plan_duration_s, none.duration_s) == (0, None, None)
    some = evaluate(cell, ("line-speed",), family="zigzag", episodes=4, model_error=0.1).results["line-speed"]
    assert 0 < some.finished < 4
    assert some.plan_duration_s == pytest.approx(some.duration_s, abs=0.03)

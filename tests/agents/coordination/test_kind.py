"""The comparison of policies: numbers, units, ranges, errors."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest

from armtempo.agents import COORDINATION_POLICIES, CoordinationEvaluation, evaluate
from armtempo.agents.coordination._order_policies import ORDER_POLICIES
from armtempo.envs import BlendOptions, CoordinationOptions, Disturbance
from armtempo.errors import InputError, UnknownNameError
from armtempo.planners import METHODS, BlendCell, CoordinationCell, load_cell
from armtempo.planners.topp import Mode

KEYS = {
    "plan_makespan_s",
    "makespan_s",
    "saving_percent",
    "gap_percent",
    "plan_gap_percent",
    "min_clearance_m",
    "torque_ratio_max",
    "torque_demand_ratio_max",
    "torque_clipped_fraction",
    "path_error_max_m",
    "violations",
    "finished",
    "reward",
    "planning_time_s",
}


@pytest.fixture(scope="module")
def bullet(lee1991: CoordinationCell) -> CoordinationEvaluation:
    return evaluate(lee1991)


def test_the_dictionary_is_json_with_every_policy(bullet: CoordinationEvaluation) -> None:
    content = json.loads(json.dumps(bullet.to_dict(), allow_nan=False))
    assert content["cell"] == "lee1991"
    assert list(content["policies"]) == [name for name in COORDINATION_POLICIES if name not in ORDER_POLICIES]
    for numbers in content["policies"].values():
        assert set(numbers) >= KEYS
    assert content["sequential_s"] == pytest.approx(0.572, abs=0.001)
    assert content["lower_bound_s"] <= content["policies"]["optimal"]["plan_makespan_s"]


def test_no_gap_is_negative(bullet: CoordinationEvaluation) -> None:
    for name, result in bullet.results.items():
        for gap in (result.gap_percent, result.plan_gap_percent):
            assert gap is None or gap >= -0.1, name


def test_numbers_are_those_of_the_traces(bullet: CoordinationEvaluation, lee1991: CoordinationCell) -> None:
    for name, result in bullet.results.items():
        trace = result.trace
        assert (result.plan_makespan_s is None) == (name not in METHODS)
        assert (result.schedule is None) == (name not in METHODS)
        assert result.violations == trace.violations
        assert 0.99 < result.torque_ratio_max <= 1.0
        assert result.torque_demand_ratio_max == pytest.approx(result.torque_ratio_max, abs=1e-6)
        assert result.torque_clipped_fraction == 0.0
        assert result.path_error_max_m == trace.path_error.max()
        if result.finished:
            assert result.makespan_s == trace.makespan
            assert result.saving_percent == pytest.approx(
                100.0 * (1.0 - trace.makespan / lee1991.sequential_makespan), abs=1e-9
            )
            expected = sum(1.0 - arrival / lee1991.sequential_makespan for arrival in trace.arrival)
            assert result.reward == pytest.approx(expected, abs=1e-9)
        else:
            assert result.makespan_s is None
            assert result.gap_percent is None
            assert result.violations == 1
            assert result.reward < -4.0
    assert bullet.results["phase-plane"].finished == 0


def test_saving_is_the_papers(bullet: CoordinationEvaluation) -> None:
    for name in ("vci", "delay", "optimal"):
        saving = bullet.results[name].saving_percent
        assert saving is not None
        assert 40.0 < saving < 45.0


def test_episodes_seeds_and_progress(lee1991: CoordinationCell) -> None:
    calls: list[tuple[str, int]] = []
    one = evaluate(
        lee1991,
        ("random", "delay"),
        episodes=3,
        seed=4,
        physics="ideal",
        master_late_s=0.12,
        on_episode=lambda name, episode: calls.append((name, episode)),
    )
    two = evaluate(lee1991, ("random", "delay"), episodes=3, seed=4, physics="ideal", master_late_s=0.12)
    assert calls == [(name, k) for name in ("random", "delay") for k in range(3)]
    assert one.results["delay"].finished == 3
    assert one.options.master_late_s == 0.12
    for name in one.results:
        first, again = one.results[name].to_dict(), two.results[name].to_dict()
        first.pop("planning_time_s")
        again.pop("planning_time_s")
        assert first == again
    alone = evaluate(lee1991, ("random",), episodes=1, seed=5, physics="ideal", master_late_s=0.12)
    np.testing.assert_array_equal(  # the seeds count up
        alone.results["random"].trace.lam,
        evaluate(lee1991, ("random",), episodes=1, seed=5, physics="ideal", master_late_s=0.12)
        .results["random"]
        .trace.lam,
    )


@pytest.mark.parametrize("mode", ["speed", "acceleration"])
def test_ideal_and_bullet_agree(lee1991: CoordinationCell, bullet: CoordinationEvaluation, mode: Mode) -> None:
    ideal = evaluate(lee1991, ("delay", "vci"), physics="ideal", mode=mode)
    for name, result in ideal.results.items():
        assert result.makespan_s == pytest.approx(bullet.results[name].makespan_s, rel=0.02)
        assert result.path_error_max_m == 0.0
        assert result.torque_ratio_max <= 1.001


def test_errors(lee1991: CoordinationCell) -> None:
    with pytest.raises(UnknownNameError, match=r"policy 'optmal'.*did you mean 'optimal'"):
        evaluate(lee1991, ("optmal",))
    with pytest.raises(InputError, match="episodes must be at least 1"):
        evaluate(lee1991, ("delay",), episodes=0)
    for episodes in (2.0, True, "2"):
        wrong: Any = episodes
        with pytest.raises(InputError, match="episodes must be a whole number, got"):
            evaluate(lee1991, ("delay",), episodes=wrong)
    no_name: Any = [3]
    with pytest.raises(UnknownNameError, match="unknown policy 3 "):
        evaluate(lee1991, no_name)


def test_every_policy_meets_the_same_disturbances_and_they_are_told(lee1991: CoordinationCell) -> None:
    result = evaluate(lee1991, ["delay", "vci"], episodes=4, physics="ideal", disturbance="late")
    content = json.loads(json.dumps(result.to_dict(), allow_nan=False))
    assert content["disturbance"] == "late"
    times = [content["policies"][name]["makespans_s"] for name in ("delay", "vci")]
    assert len(set(times[0])) == 4
    assert content["best_online"] in ("delay", "vci")
    best = content["policies"][content["best_online"]]
    assert (best["ratio_to_best_online"], best["ratio_interval"]) == (1.0, [1.0, 1.0])
    ratio = result.results["vci"].ratio_to_best_online
    assert ratio == pytest.approx(np.mean(times[1]) / np.mean(times[0])) or content["best_online"] == "vci"
    low, high = content["policies"]["vci"]["makespan_interval_s"]
    assert low < content["policies"]["vci"]["makespan_s"] < high


def test_what_is_not_finished_counts_as_the_time_limit(lee1991: CoordinationCell) -> None:
    asked: dict[str, Any] = {"episodes": 4, "physics": "ideal", "shield": True, "disturbance": "late"}
    names = ["delay", "vci", "phase-plane"]
    free = evaluate(lee1991, names, **asked)
    slowest = [max(time for time in result.makespans_s if time is not None) for result in free.results.values()]
    limit = min(slowest) - 0.01
    cut = evaluate(lee1991, names, **asked, max_episode_s=limit)
    for name, result in cut.results.items():
        before = [time for time in free.results[name].makespans_s if time is not None]
        assert result.finished == sum(time is not None for time in result.makespans_s) < 4
        if result.finished:
            assert result.makespan_s == pytest.approx(np.mean([min(time, limit) for time in before]), abs=0.005)
            assert result.ratio_to_best_online is None  # nobody finished every episode
        else:
            assert result.makespan_s is None
    assert any(result.finished for result in cut.results.values())
    assert (cut.facts["best"], cut.facts["best_online"]) == (None, None)
    assert free.facts["best"] in names
    limit = min(slowest) + 1e-4
    within = evaluate(lee1991, names, **asked, max_episode_s=limit)
    best = within.results[within.facts["best_online"]]
    assert best.finished == 4
    for result in within.results.values():
        if result.finished:
            counted = [limit if time is None else time for time in result.makespans_s]
            assert result.ratio_to_best_online == pytest.approx(np.mean(counted) / (best.makespan_s or 0.0))
    assert any(0 < result.finished < 4 for result in within.results.values())


def test_on_the_way_nothing_is_held_against_whole_paths(lee1991: CoordinationCell) -> None:
    asked: dict[str, Any] = {"physics": "ideal", "shield": True, "disturbance": "late", "seed": 50000}
    for start in (0.0, (0.0, 0.0), 0.2, (0.0, 0.3)):
        found = evaluate(lee1991, ["phase-plane", "delay"], episodes=2, start_phase=start, **asked).to_dict()
        known = start in (0.0, (0.0, 0.0))
        for name in ("sequential_s", "lower_bound_s", "clairvoyant_s"):
            assert (found[name] is not None) == known
        full_speed, plan = found["policies"]["phase-plane"], found["policies"]["delay"]
        assert full_speed["finished"] == 2  # the plan, of whole paths, may wait for ever
        for name in ("saving_percent", "gap_percent", "regret_percent"):
            assert (full_speed[name] is not None) == known
        assert (plan["plan_gap_percent"] is not None) == known


def test_options_are_a_record_or_keywords_or_both(lee1991: CoordinationCell) -> None:
    options = CoordinationOptions(physics="ideal", master_late_s=0.1)
    result = evaluate(lee1991, ["delay"], options=options, mode="acceleration")
    assert result.options == CoordinationOptions(physics="ideal", master_late_s=0.1, mode="acceleration")
    assert (result.facts["master_late_s"], result.facts["mode"]) == (0.1, "acceleration")
    assert "disturbance" not in result.to_dict()


def test_bodies_can_be_heavier_than_the_plans_believe(lee1991: CoordinationCell) -> None:
    """As in cells of one arm: the environment has had it all along."""
    exact, heavy = (evaluate(lee1991, ["delay"], model_error=error) for error in (0.0, 0.1))
    assert heavy.results["delay"].path_error_max_m > 2.0 * exact.results["delay"].path_error_max_m
    assert heavy.to_dict()["model_error"] == 0.1
    assert "model_error" not in exact.to_dict()


def test_a_disturbance_of_ones_own_is_told_as_json(lee1991: CoordinationCell) -> None:
    result = evaluate(lee1991, ["delay"], physics="ideal", disturbance=Disturbance(late_s=(0.1, 0.1)))
    assert json.loads(json.dumps(result.to_dict()))["disturbance"]["late_s"] == [0.1, 0.1]


def test_only_options_that_were_given_and_do_not_belong_are_named() -> None:
    with pytest.raises(UnknownNameError, match=r"^unknown option of evaluations in blend cells 'shield' \(") as caught:
        evaluate(load_cell("lee2006", BlendCell), ["line-speed"], shield=True, physics="ideal")  # type: ignore[call-overload]
    assert caught.value.data["known"] == ["family", "max_episode_s", "model_error", "physics"]
    for cell, options in (("lee2006", {"profile": "limit-aware"}), ("chung", {"action_mode": "gains"})):
        run: Any = evaluate  # a policy brings these itself
        with pytest.raises(UnknownNameError, match=next(iter(options))):
            run(load_cell(cell, None), ["random"], **options)


def test_the_record_of_another_kind_is_refused(lee1991: CoordinationCell) -> None:
    run: Any = evaluate
    with pytest.raises(InputError, match=r"options are BlendOptions, .* kind coordination \(give CoordinationOptions"):
        run(lee1991, ["delay"], options=BlendOptions(physics="ideal"))


def test_a_name_is_no_cell() -> None:
    run: Any = evaluate
    with pytest.raises(InputError, match=r"needs a built cell, got 'lee1991' \(give one that load_cell returned\)"):
        run("lee1991")

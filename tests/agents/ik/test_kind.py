"""Baselines of IK cells and their evaluation: the paper's figures, and what each does near and beyond the limits."""

from __future__ import annotations

import json

import numpy as np
import pytest

from armtempo.agents import IK_POLICIES, IKEvaluation, action_mode_of, evaluate, ik_policy
from armtempo.envs import FeedbackIKEnv
from armtempo.errors import UnknownNameError
from armtempo.planners import BlendCell, IKCell


@pytest.fixture(scope="module")
def evaluation(chung: IKCell) -> IKEvaluation:
    return evaluate(chung)


@pytest.fixture(scope="module")
def beyond(chung: IKCell) -> IKEvaluation:
    policies = ("feedback-ff", "feedback-damped", "newton")
    return evaluate(chung, policies, family="partly-unreachable", seed=1, physics="ideal")


def test_the_law_without_feed_forward_has_the_papers_error(evaluation: IKEvaluation) -> None:
    """|P_d'| / K_p = 6.72 mm at most, to the control period's second order."""
    assert tuple(evaluation.results) == IK_POLICIES
    result = evaluation.results["feedback"]
    assert result.position_error_max_m == pytest.approx(6.7162e-3, rel=3e-3)
    speed = np.linalg.norm(evaluation.cell.target.velocity, axis=1).max()
    assert result.position_error_max_m == pytest.approx(speed / 50.9, rel=3e-3)


def test_feed_forward_is_far_better_and_damping_costs_nothing_where_nothing_is_singular(
    evaluation: IKEvaluation,
) -> None:
    plain, fed, damped = (evaluation.results[name] for name in ("feedback", "feedback-ff", "feedback-damped"))
    assert fed.position_error_max_m < 2e-5 < plain.position_error_max_m / 300.0
    assert damped.position_error_max_m == pytest.approx(fed.position_error_max_m, rel=1e-6)
    assert fed.reward > -0.01 > plain.reward
    for result in (plain, fed, damped):
        assert result.damped_fraction == result.capped_fraction == 0.0
        assert result.joint_speed_ratio_max == pytest.approx(0.571, abs=2e-3)  # the shoulder's
        assert result.torque_demand_ratio_max < 0.3
        assert result.succeeded == 1


def test_newton_lags_by_half_a_period(evaluation: IKEvaluation) -> None:
    speed = np.linalg.norm(evaluation.cell.target.velocity, axis=1).max()
    half = 0.5 * evaluation.cell.control_period
    assert evaluation.results["newton"].position_error_max_m == pytest.approx(speed * half, rel=5e-3)


def test_random_actions_are_lost(evaluation: IKEvaluation) -> None:
    random = evaluation.results["random"]
    assert random.succeeded == 0
    assert random.reward == min(result.reward for result in evaluation.results.values())
    assert random.joint_speed_ratio_max <= 1.0 + 1e-9


def test_out_of_reach_the_damped_law_stays_calm_and_the_undamped_ones_do_not(beyond: IKEvaluation) -> None:
    """All stay within the caps, which the environment holds; undamped ones run into them and lose the orientation."""
    damped = beyond.results["feedback-damped"]
    for name in ("feedback-ff", "newton"):
        wild = beyond.results[name]
        assert wild.orientation_error_max_rad > 1.0 > 5.0 * damped.orientation_error_max_rad
        assert wild.capped_fraction > 5.0 * damped.capped_fraction
        assert wild.position_error_rms_m > damped.position_error_rms_m
        assert wild.reward < damped.reward
    for result in beyond.results.values():
        assert result.joint_speed_ratio_max <= 1.0 + 1e-9
        assert result.torque_ratio_max <= 1.0
    assert damped.position_error_final_m < 1e-5  # back on the target
    assert damped.damped_fraction > 0.1


def test_through_a_singularity_the_damped_law_hardly_asks_for_more_than_the_caps(chung: IKCell) -> None:
    results = evaluate(chung, ("feedback-damped", "newton"), family="near-singular", seed=2, physics="ideal").results
    damped, newton = results["feedback-damped"], results["newton"]
    assert damped.damped_fraction > 0.1
    assert damped.capped_fraction < 0.05
    assert damped.position_error_max_m < 5e-3
    assert damped.orientation_error_max_rad < 5e-3
    assert damped.succeeded == 1
    assert damped.reward > newton.reward


def test_heavier_bodies_are_followed_by_looking_at_the_joints(chung: IKCell) -> None:
    exact, heavy = (
        evaluate(chung, ("feedback-ff",), family="smooth", model_error=error).results["feedback-ff"]
        for error in (0.0, 0.2)
    )
    assert heavy.position_error_max_m < 1e-3
    assert heavy.position_error_rms_m > exact.position_error_rms_m


def test_policies_meet_the_same_random_targets(chung: IKCell) -> None:
    results = evaluate(chung, ("feedback-ff", "random"), family="smooth", seed=3, physics="ideal").results
    first, second = (result.trace.cell for result in results.values())
    assert first is not second
    np.testing.assert_array_equal(first.target.position, second.target.position)
    again = evaluate(chung, ("random",), family="smooth", seed=3, physics="ideal").results
    assert again["random"].reward == results["random"].reward


def test_the_law_at_every_tick_and_its_gains_scheduled(evaluation: IKEvaluation, chung: IKCell) -> None:
    """On the given target both are Euler's run; out of reach, scheduled gains keep the orientation."""
    for name in ("law", "law-scheduled"):
        assert evaluation.results[name].position_error_max_m == pytest.approx(3.04e-6, abs=2e-8)
    found = evaluate(chung, ("law", "law-scheduled"), family="partly-unreachable", seed=1, physics="ideal").results
    assert found["law-scheduled"].orientation_error_rms_rad < 0.5 * found["law"].orientation_error_rms_rad
    assert found["law-scheduled"].reward > found["law"].reward + 0.1


def test_results_are_numbers_with_units(evaluation: IKEvaluation) -> None:
    from armtempo.commands.console._output import plain

    data = json.loads(json.dumps(plain(evaluation.to_dict()), allow_nan=False))
    assert data["control_period_s"] == 0.01
    assert set(data["policies"]) == set(IK_POLICIES)
    assert "trace" not in data["policies"]["random"]
    assert data["policies"]["feedback"]["position_error_rms_m"] == pytest.approx(4.75e-3, rel=1e-2)


def test_wrong_requests_are_refused(chung: IKCell, lee2006: BlendCell) -> None:
    with pytest.raises(UnknownNameError, match=r"unknown policy 'vci' \(known: feedback, feedback-damped"):
        evaluate(chung, ("vci",))
    with pytest.raises(UnknownNameError, match="feedback-ff"):
        ik_policy("feedback-f")
    with pytest.raises(UnknownNameError, match="unknown family of targets 'zigzag'"):
        evaluate(chung, family="zigzag")  # type: ignore[call-overload]
    with pytest.raises(UnknownNameError, match="unknown family of paths 'smooth'"):
        evaluate(lee2006, family="smooth")  # type: ignore[call-overload]
    with pytest.raises(UnknownNameError, match="option of evaluations in ik cells 'master_late_s'"):
        evaluate(chung, master_late_s=0.1)  # type: ignore[call-overload]


@pytest.mark.parametrize("name", IK_POLICIES)
def test_policies_act_anew_in_another_cell(chung: IKCell, name: str) -> None:
    """What a policy keeps of one target does not leak into the next."""
    policy, fresh = ik_policy(name), ik_policy(name)
    env = FeedbackIKEnv(chung, action_mode=action_mode_of(name), family="smooth", physics="ideal")
    observation, _ = env.reset(seed=1)
    policy.act(observation, env)
    observation, _ = env.reset(seed=2)
    policy.reset(5)
    fresh.reset(5)
    action = policy.act(observation, env)
    np.testing.assert_array_equal(action, fresh.act(observation, env))
    assert env.action_space.contains(action)
    env.close()

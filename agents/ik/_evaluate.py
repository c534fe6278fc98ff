"""Run the baselines of an IK cell and compare how closely they follow its target, and at what cost."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from armtempo.agents.ik._baselines import IK_POLICIES, IKPolicy, action_mode_of, ik_policy
from armtempo.agents.policies import (
    LearnedOneArmPolicy,
    check_fits,
    chosen_policies,
    find_agent,
    is_agent_name,
    run_to_end,
)
from armtempo.arrays import Floats
from armtempo.envs import FeedbackIKEnv, IKTrace, Physics
from armtempo.planners import IKCell
from armtempo.planners.cells import TargetFamilyName


@dataclass(frozen=True, kw_only=True, eq=False)
class IKPolicyResult:
    """What a policy did; worst cases over all episodes, rms over all their ticks and the start.

    Attributes:
        position_error_rms_m: Distance of the tip from its target [m]; max and final (at the target's end) likewise.
        orientation_error_rms_rad: Angle of the rotation that is left [rad]; likewise.
        joint_speed_ratio_max: Largest |speed of a joint, from tick to tick| / cap.
        torque_ratio_max: Largest |applied torque| / limit.
        torque_demand_ratio_max: Largest |demanded torque| / limit, before clipping.
        damped_fraction: Share of the ticks nearer to singular than where the cell's law is damped.
        capped_fraction: Share of the ticks in which a cap or limit cut what was asked for.
        succeeded: Episodes with rms errors below the cell's scales.
        reward: Mean reward.
    """

    position_error_rms_m: float
    position_error_max_m: float
    position_error_final_m: float
    orientation_error_rms_rad: float
    orientation_error_max_rad: float
    orientation_error_final_rad: float
    joint_speed_ratio_max: float
    torque_ratio_max: float
    torque_demand_ratio_max: float
    damped_fraction: float
    capped_fraction: float
    succeeded: int
    reward: float
    trace: IKTrace = field(repr=False)

    def to_dict(self) -> dict[str, Any]:
        """The numbers, by name."""
        return {name: getattr(self, name) for name in self.__dataclass_fields__ if name != "trace"}


@dataclass(frozen=True, kw_only=True, eq=False)
class IKEvaluation:
    """Policies compared in one IK cell.

    Attributes:
        cell: The cell.
        physics: ``bullet`` or ``ideal``.
        family: Of the targets.
        model_error: By which share the simulated bodies are heavier than the controller believes.
        episodes: Episodes per policy.
        seed: Seed of the first episode.
        results: By policy.
    """

    cell: IKCell
    physics: Physics
    family: TargetFamilyName
    model_error: float
    episodes: int
    seed: int
    results: dict[str, IKPolicyResult]

    def to_dict(self) -> dict[str, Any]:
        """Everything but the traces, units in the keys."""
        config = self.cell.config
        return {
            "cell": self.cell.name,
            "physics": self.physics,
            "family": self.family,
            "model_error": self.model_error,
            "episodes": self.episodes,
            "seed": self.seed,
            "duration_s": self.cell.duration,
            "control_period_s": self.cell.control_period,
            "error_scale_m": config.error_scale_m,
            "error_scale_rad": config.error_scale_rad,
            "position_gain_1_s": config.law.position_gain_1_s,
            "damping": config.law.damping,
            "policies": {name: result.to_dict() for name, result in self.results.items()},
        }


def evaluate_ik(
    cell: IKCell,
    policies: Sequence[str] | None = None,
    *,
    episodes: int = 1,
    seed: int = 0,
    physics: Physics = "bullet",
    family: TargetFamilyName = "given",
    model_error: float = 0.0,
    on_episode: Callable[[str, int], None] | None = None,
) -> IKEvaluation:
    """Run every policy for some episodes.

    Args:
        cell: Where.
        policies: Names out of ``IK_POLICIES`` or of learned agents (``sac:path/to/file.npz``); None: all of
            ``IK_POLICIES``.
        episodes: Episodes per policy; on the given target baselines other than ``random`` do the same in each.
        seed: Seed of the first episode; the following ones count up, and every policy meets the same targets.
        physics: ``bullet`` or ``ideal``.
        family: Targets: the ``given`` one, or drawn by seed.
        model_error: By which share the simulated bodies are heavier than the controller believes.
        on_episode: Called with policy and episode number after each, for progress bars.

    Raises:
        UnknownNameError: A policy or a family that does not exist; the message lists those that do.
    """
    chosen = chosen_policies(policies, IK_POLICIES, episodes)
    results = {}
    for name in chosen:
        learned = is_agent_name(name)
        mode = find_agent(name).header.settings.get("action_mode", "speeds") if learned else action_mode_of(name)
        env = FeedbackIKEnv(
            cell,
            action_mode=mode,
            family=family,
            physics=physics,
            model_error=model_error,
            record=True,
        )
        try:
            results[name] = _evaluate_one(env, name, episodes, seed, on_episode)
        finally:
            env.close()
    return IKEvaluation(
        cell=cell,
        physics=physics,
        family=family,
        model_error=model_error,
        episodes=episodes,
        seed=seed,
        results=results,
    )


def _policy(name: str, env: FeedbackIKEnv) -> IKPolicy:
    if not is_agent_name(name):
        return ik_policy(name)
    agent = find_agent(name)
    check_fits(name, agent, env, "feedback-ik")
    return LearnedOneArmPolicy(agent)


def _evaluate_one(
    env: FeedbackIKEnv, name: str, episodes: int, seed: int, on_episode: Callable[[str, int], None] | None
) -> IKPolicyResult:
    policy = _policy(name, env)
    traces, rewards, succeeded = [], [], 0
    for episode in range(episodes):
        reward, info = run_to_end(env, policy, seed + episode)
        traces.append(env.trace)
        rewards.append(reward)
        succeeded += bool(info["is_success"])
        if on_episode is not None:
            on_episode(name, episode)

    def over_all(of: Callable[[IKTrace], Floats]) -> Floats:
        return np.concatenate([of(trace) for trace in traces])

    position, orientation = over_all(lambda t: t.position_error), over_all(lambda t: t.orientation_error)
    return IKPolicyResult(
        position_error_rms_m=float(np.sqrt(np.mean(position**2))),
        position_error_max_m=float(position.max()),
        position_error_final_m=max(float(trace.position_error[-1]) for trace in traces),
        orientation_error_rms_rad=float(np.sqrt(np.mean(orientation**2))),
        orientation_error_max_rad=float(orientation.max()),
        orientation_error_final_rad=max(float(trace.orientation_error[-1]) for trace in traces),
        joint_speed_ratio_max=float(over_all(lambda t: np.abs(t.joint_speed) / t.cell.arm.speed_max).max()),
        torque_ratio_max=float(over_all(lambda t: np.abs(t.torque) / t.torque_max).max()),
        torque_demand_ratio_max=float(over_all(lambda t: np.abs(t.demand) / t.torque_max).max()),
        damped_fraction=float(over_all(lambda t: t.damped.astype(np.float64)).mean()),
        capped_fraction=float(over_all(lambda t: t.capped.astype(np.float64)).mean()),
        succeeded=succeeded,
        reward=float(np.mean(rewards)),
        trace=traces[0],
    )

"""IK cells in evaluations: who sets the joint speeds, how closely the target is followed, and at what cost."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import final

import numpy as np

from armtempo.agents.evaluation import Kind, Runner, keywords_of, play
from armtempo.agents.ik._baselines import IK_POLICIES, action_mode_of, ik_policy
from armtempo.agents.ik._result import IKResult
from armtempo.agents.policies import Policy, find_agent, is_agent_name, learned_policy
from armtempo.arrays import Floats, Floats32
from armtempo.envs import FeedbackIKEnv, IKOptions, IKTrace
from armtempo.planners import IKCell


@dataclass(frozen=True, kw_only=True, eq=False)
class IKEpisode:
    """An episode: what happened, the sum of its rewards, and whether rms errors stayed below the cell's scales."""

    trace: IKTrace
    reward: float
    succeeded: bool


@dataclass(frozen=True, kw_only=True, eq=False)
class IKRunner:
    """A policy in an environment that records."""

    env: FeedbackIKEnv
    policy: Policy[Floats32, Floats32]

    def run(self, seed: int, on_step: Callable[[], None] | None = None) -> IKEpisode:
        """One episode to its end; ``on_step`` is called when it begins, and after every decision."""
        reward, info = play(self.env, self.policy, seed, on_step=on_step)
        return IKEpisode(trace=self.env.trace, reward=reward, succeeded=bool(info["is_success"]))

    def close(self) -> None:
        """Close the environment."""
        self.env.close()


@final
class IKKind(Kind[IKCell, IKOptions, IKEpisode, IKResult]):
    """One arm whose tip follows a pose over time."""

    name = "ik"
    options_type = IKOptions
    result_type = IKResult
    settled = ("action_mode",)
    always_told = ("physics", "family", "model_error")
    policies = IK_POLICIES

    def open(
        self,
        cell: IKCell,
        policy: str,
        options: IKOptions,
        *,
        before: Runner[IKEpisode] | None = None,
    ) -> IKRunner:
        """An environment with the actions of the policy."""
        learned = is_agent_name(policy)
        mode = find_agent(policy).header.settings.get("action_mode", "speeds") if learned else action_mode_of(policy)
        env = FeedbackIKEnv(cell, record=True, **(keywords_of(options) | {"action_mode": mode}))
        try:
            who = learned_policy(policy, env, "feedback-ik") if learned else ik_policy(policy)
        except BaseException:
            env.close()
            raise
        return IKRunner(env=env, policy=who)

    def measure(self, cell: IKCell, runs: Sequence[IKEpisode], seed: int) -> IKResult:
        """Figures over the episodes."""
        traces = [run.trace for run in runs]

        def over_all(of: Callable[[IKTrace], Floats]) -> Floats:
            return np.concatenate([of(trace) for trace in traces])

        position, orientation = over_all(lambda t: t.position_error), over_all(lambda t: t.orientation_error)
        return IKResult(
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
            reward=float(np.mean([run.reward for run in runs])),
            succeeded=sum(run.succeeded for run in runs),
            trace=traces[0],
        )

    def head(self, cell: IKCell) -> Mapping[str, object]:
        """The target, the scales of its errors and the law."""
        position, orientation = cell.error_scales
        return {
            "duration_s": cell.duration,
            "control_period_s": cell.control_period,
            "error_scale_m": position,
            "error_scale_rad": orientation,
            "position_gain_1_s": cell.law.position_gain_1_s,
            "damping": cell.law.damping,
        }

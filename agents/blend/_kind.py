"""Blend cells in evaluations: who overrides the feed rate, and how well line speed, path and limits are held."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import final

import numpy as np

from armtempo.agents.blend._baselines import (
    BLEND_POLICIES,
    BlendBaseline,
    ConstantRate,
    blend_baseline,
    planning_time,
)
from armtempo.agents.blend._result import BlendResult, in_blends, reference_demand, speed_errors
from armtempo.agents.evaluation import Kind, Runner, keywords_of, play
from armtempo.agents.policies import Policy, find_agent, is_agent_name, learned_policy
from armtempo.arrays import Floats, Floats32
from armtempo.envs import BlendOptions, BlendTrace, BlendTrackingEnv
from armtempo.planners import BlendCell


@dataclass(frozen=True, kw_only=True, eq=False)
class BlendEpisode:
    """An episode.

    Attributes:
        trace: What happened.
        reward: The sum.
        plan_duration_s: Of the plan on the episode's own path [s], infinite where it stands; None: there is no plan.
        planning_time_s: It took that long on the given path [s].
    """

    trace: BlendTrace
    reward: float
    plan_duration_s: float | None
    planning_time_s: float


@dataclass(frozen=True, kw_only=True, eq=False)
class BlendRunner:
    """A policy in an environment that records; ``curve``: of blends that take the place of the cell's."""

    env: BlendTrackingEnv
    policy: Policy[Floats32, Floats32]
    curve: str | None
    planning_time_s: float

    def run(self, seed: int, on_step: Callable[[], None] | None = None) -> BlendEpisode:
        """One episode to its end; ``on_step`` is called when it begins, and after every decision."""
        reward, _ = play(self.env, self.policy, seed, {"curve": self.curve}, on_step)
        trace = self.env.trace
        plan = None
        if isinstance(self.policy, ConstantRate):
            rate = self.policy.rate_of(trace.cell)
            plan = self.env.reference_time / rate if rate > 0.0 else math.inf
        return BlendEpisode(trace=trace, reward=reward, plan_duration_s=plan, planning_time_s=self.planning_time_s)

    def close(self) -> None:
        """Close the environment."""
        self.env.close()


@final
class BlendKind(Kind[BlendCell, BlendOptions, BlendEpisode, BlendResult]):
    """One arm on a blended path."""

    name = "blend"
    options_type = BlendOptions
    result_type = BlendResult
    settled = ("profile", "mapping")
    always_told = ("physics", "family", "model_error")
    policies = BLEND_POLICIES

    def open(
        self,
        cell: BlendCell,
        policy: str,
        options: BlendOptions,
        *,
        before: Runner[BlendEpisode] | None = None,
    ) -> BlendRunner:
        """An environment with the profile and the mapping of the policy."""
        baseline = _learned(policy) if is_agent_name(policy) else blend_baseline(policy)
        settled = {"profile": baseline.profile, "mapping": baseline.mapping}
        env = BlendTrackingEnv(cell, record=True, **(keywords_of(options) | settled))
        try:
            who = learned_policy(policy, env, "blend-tracking") if baseline.make is None else baseline.make()
            planning = planning_time(cell, baseline)
        except BaseException:
            env.close()
            raise
        return BlendRunner(env=env, policy=who, curve=baseline.curve, planning_time_s=planning)

    def measure(self, cell: BlendCell, runs: Sequence[BlendEpisode], seed: int) -> BlendResult:
        """Figures over the episodes."""
        traces = [run.trace for run in runs]
        finished = [run for run in runs if math.isfinite(run.trace.arrival)]
        arrivals = [run.trace.arrival for run in finished]
        plans = [run.plan_duration_s for run in finished if run.plan_duration_s is not None]
        demands = [reference_demand(trace) for trace in traces]
        arc = np.concatenate([speed_errors(trace)[0] for trace in traces])
        chord = np.concatenate([speed_errors(trace)[1] for trace in traces])
        contour = np.concatenate([trace.contour_error for trace in traces])
        slowest = [float(trace.v[in_blends(trace)].min()) for trace in traces if in_blends(trace).any()]
        return BlendResult(
            plan_duration_s=float(np.mean(plans)) if plans else None,
            duration_s=float(np.mean(arrivals)) if arrivals else None,
            blend_speed_min_m_s=min(slowest, default=None),
            arc_speed_error_max_m_s=_largest(arc),
            arc_speed_error_rms_m_s=_rms(arc),
            chord_speed_error_max_m_s=_largest(chord),
            chord_speed_error_rms_m_s=_rms(chord),
            contour_error_max_m=float(contour.max()),
            contour_error_rms_m=float(np.sqrt(np.mean(contour**2))),
            normal_acceleration_ratio_max=max(demand.normal_ratio_max for demand in demands),
            jerk_ratio_max=max(demand.jerk_ratio_max for demand in demands),
            torque_ratio_max=max(trace.torque_ratio_max for trace in traces),
            torque_demand_ratio_max=max(trace.torque_demand_ratio_max for trace in traces),
            reward=float(np.mean([run.reward for run in runs])),
            finished=len(arrivals),
            left=sum(trace.left for trace in traces),
            planning_time_s=runs[0].planning_time_s,
            trace=traces[0],
        )

    def head(self, cell: BlendCell) -> Mapping[str, object]:
        """The path and the limits along it."""
        limits = cell.limits
        return {
            "length_m": cell.blended.length,
            "piece_lengths_m": np.diff(cell.blended.breakpoints),
            "line_speed_m_s": limits.speed,
            "acceleration_limit_m_s2": limits.acceleration,
            "normal_acceleration_limit_m_s2": limits.normal,
            "jerk_limit_m_s3": limits.jerk,
            "contour_error_allowed_m": cell.contour_error_max,
        }


def _learned(name: str) -> BlendBaseline:
    """What an episode of a learned agent needs: the settings that it was trained in."""
    settings = find_agent(name).header.settings
    return BlendBaseline(
        profile=settings.get("profile", "line-speed"), mapping=settings.get("mapping", "exact"), curve=None, make=None
    )


def _largest(errors: Floats) -> float | None:
    return float(np.abs(errors).max()) if errors.size else None


def _rms(errors: Floats) -> float | None:
    return float(np.sqrt(np.mean(errors**2))) if errors.size else None

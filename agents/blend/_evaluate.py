"""Run the baselines of a blend cell and compare how well they hold line speed, path and limits."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from armtempo.agents.blend._baselines import (
    BLEND_POLICIES,
    BlendBaseline,
    BlendPolicy,
    ConstantRate,
    blend_baseline,
    planning_time,
)
from armtempo.agents.policies import (
    LearnedOneArmPolicy,
    check_fits,
    chosen_policies,
    find_agent,
    is_agent_name,
    run_to_end,
)
from armtempo.arrays import Bools, Floats
from armtempo.envs import BlendTrace, BlendTrackingEnv, Physics
from armtempo.planners import BlendCell
from armtempo.planners.blends import Blend
from armtempo.planners.cells import FamilyName, MotionDemand, motion_demand


@dataclass(frozen=True, kw_only=True, eq=False)
class BlendPolicyResult:
    """What a policy did; means over the episodes that finished, worst cases over all. None where there is no number.

    Speed errors are those of the tip against its reference, tick by tick, in the blends alone.

    Attributes:
        plan_duration_s: Mean duration of its plan [s], over the episodes that finished like ``duration_s``; None for
            policies without one.
        duration_s: Mean instant of arrival [s].
        blend_speed_min_m_s: Lowest line speed of the reference in a blend [m/s].
        arc_speed_error_max_m_s: Largest error of the speed along the path [m/s]; rms likewise.
        chord_speed_error_max_m_s: Largest error of the speed from point to point [m/s]; rms likewise.
        contour_error_max_m: Largest distance of the tip from the path [m]; rms likewise.
        normal_acceleration_ratio_max: Largest normal acceleration of the reference / limit.
        jerk_ratio_max: Largest jerk of the reference, as a vector, / limit; between jumps of the curvature.
        torque_ratio_max: Largest |applied torque| / limit.
        torque_demand_ratio_max: Largest |demanded torque| / limit, before clipping.
        left: Episodes in which the tip left the tube around the path.
        finished: Episodes in which the arm arrived.
        reward: Mean reward.
        planning_time_s: Time to blend the given path, to find the joints along it and to plan the profile [s].
    """

    plan_duration_s: float | None
    duration_s: float | None
    blend_speed_min_m_s: float | None
    arc_speed_error_max_m_s: float | None
    arc_speed_error_rms_m_s: float | None
    chord_speed_error_max_m_s: float | None
    chord_speed_error_rms_m_s: float | None
    contour_error_max_m: float
    contour_error_rms_m: float
    normal_acceleration_ratio_max: float
    jerk_ratio_max: float
    torque_ratio_max: float
    torque_demand_ratio_max: float
    left: int
    finished: int
    reward: float
    planning_time_s: float
    trace: BlendTrace = field(repr=False)

    def to_dict(self) -> dict[str, Any]:
        """The numbers, by name."""
        return {name: getattr(self, name) for name in self.__dataclass_fields__ if name != "trace"}


@dataclass(frozen=True, kw_only=True, eq=False)
class BlendEvaluation:
    """Policies compared in one blend cell.

    Attributes:
        cell: The cell.
        physics: ``bullet`` or ``ideal``.
        family: Of the paths.
        model_error: By which share the simulated bodies are heavier than the controller believes.
        episodes: Episodes per policy.
        seed: Seed of the first episode.
        results: By policy.
    """

    cell: BlendCell
    physics: Physics
    family: FamilyName
    model_error: float
    episodes: int
    seed: int
    results: dict[str, BlendPolicyResult]

    def to_dict(self) -> dict[str, Any]:
        """Everything but the traces, units in the keys."""
        limits = self.cell.limits
        return {
            "cell": self.cell.name,
            "physics": self.physics,
            "family": self.family,
            "model_error": self.model_error,
            "episodes": self.episodes,
            "seed": self.seed,
            "length_m": self.cell.blended.length,
            "piece_lengths_m": np.diff(self.cell.blended.breakpoints),
            "line_speed_m_s": limits.speed,
            "acceleration_limit_m_s2": limits.acceleration,
            "normal_acceleration_limit_m_s2": limits.normal,
            "jerk_limit_m_s3": limits.jerk,
            "contour_error_allowed_m": self.cell.contour_error_max,
            "policies": {name: result.to_dict() for name, result in self.results.items()},
        }


def run_blend_episode(
    env: BlendTrackingEnv, policy: BlendPolicy, seed: int | None = None, options: dict[str, Any] | None = None
) -> tuple[BlendTrace, float]:
    """One episode to its end, in an ``env`` made with ``record``; returns its trace and the sum of all rewards."""
    total, _ = run_to_end(env, policy, seed, options)
    return env.trace, total


def evaluate_blend(
    cell: BlendCell,
    policies: Sequence[str] | None = None,
    *,
    episodes: int = 1,
    seed: int = 0,
    physics: Physics = "bullet",
    family: FamilyName = "given",
    model_error: float = 0.0,
    on_episode: Callable[[str, int], None] | None = None,
) -> BlendEvaluation:
    """Run every policy for some episodes.

    Args:
        cell: Where.
        policies: Names out of ``BLEND_POLICIES`` or of learned agents (``ppo:path/to/file.npz``); None: all of
            ``BLEND_POLICIES``.
        episodes: Episodes per policy; on the given path baselines other than ``random`` do the same in each.
        seed: Seed of the first episode; the following ones count up, and every policy meets the same paths.
        physics: ``bullet`` or ``ideal``.
        family: Paths: the ``given`` one, or drawn by seed.
        model_error: By which share the simulated bodies are heavier than the controller believes.
        on_episode: Called with policy and episode number after each, for progress bars.

    Raises:
        UnknownNameError: A policy or a family that does not exist; the message lists those that do.
    """
    results = {}
    for name in chosen_policies(policies, BLEND_POLICIES, episodes):
        baseline = _learned(name) if is_agent_name(name) else blend_baseline(name)
        env = BlendTrackingEnv(
            cell,
            profile=baseline.profile,
            mapping=baseline.mapping,
            family=family,
            physics=physics,
            model_error=model_error,
            record=True,
        )
        try:
            if is_agent_name(name):
                check_fits(name, find_agent(name), env, "blend-tracking")
            results[name] = _evaluate_one(env, name, baseline, episodes, seed, on_episode)
        finally:
            env.close()
    return BlendEvaluation(
        cell=cell,
        physics=physics,
        family=family,
        model_error=model_error,
        episodes=episodes,
        seed=seed,
        results=results,
    )


def _learned(name: str) -> BlendBaseline:
    """A learned agent, with the settings that it was trained in."""
    agent = find_agent(name)
    settings = agent.header.settings
    return BlendBaseline(
        profile=settings.get("profile", "line-speed"),
        mapping=settings.get("mapping", "exact"),
        curve=None,
        make=lambda: LearnedOneArmPolicy(agent),
    )


def _evaluate_one(
    env: BlendTrackingEnv,
    name: str,
    baseline: BlendBaseline,
    episodes: int,
    seed: int,
    on_episode: Callable[[str, int], None] | None,
) -> BlendPolicyResult:
    planning = planning_time(env.cell, baseline)
    policy = baseline.make()
    traces, rewards, plans = [], [], []
    for episode in range(episodes):
        trace, reward = run_blend_episode(env, policy, seed + episode, {"curve": baseline.curve})
        traces.append(trace)
        rewards.append(reward)
        if isinstance(policy, ConstantRate):
            rate = policy.rate_of(trace.cell)
            plans.append(env.reference_time / rate if rate > 0.0 else math.inf)
        if on_episode is not None:
            on_episode(name, episode)
    finished = [math.isfinite(trace.arrival) for trace in traces]
    arrivals = [trace.arrival for trace in traces if math.isfinite(trace.arrival)]
    plans = [plan for plan, arrived in zip(plans, finished, strict=False) if arrived]
    demands = [reference_demand(trace) for trace in traces]
    arc = np.concatenate([speed_errors(trace)[0] for trace in traces])
    chord = np.concatenate([speed_errors(trace)[1] for trace in traces])
    contour = np.concatenate([trace.contour_error for trace in traces])
    slowest = [float(trace.v[in_blends(trace)].min()) for trace in traces if in_blends(trace).any()]
    return BlendPolicyResult(
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
        left=sum(trace.left for trace in traces),
        finished=len(arrivals),
        reward=float(np.mean(rewards)),
        planning_time_s=planning,
        trace=traces[0],
    )


def _largest(errors: Floats) -> float | None:
    return float(np.abs(errors).max()) if errors.size else None


def _rms(errors: Floats) -> float | None:
    return float(np.sqrt(np.mean(errors**2))) if errors.size else None


def in_blends(trace: BlendTrace) -> Bools:
    """(T+1,) ticks that the reference spends inside blends, from their beginning to their end."""
    path = trace.cell.blended
    inside = np.zeros(len(trace.s), dtype=bool)
    before = np.concatenate([trace.s[:1], trace.s[:-1]])
    for piece, low, high in zip(path.pieces, path.breakpoints[:-1], path.breakpoints[1:], strict=True):
        if isinstance(piece, Blend):
            inside |= (before >= low) & (trace.s <= high) & (trace.s > before)
    return inside


def speed_errors(trace: BlendTrace) -> tuple[Floats, Floats]:
    """Speed of the tip minus that of its reference, in the ticks inside blends: along the path, and point to point."""
    tick = float(trace.time[1] - trace.time[0])
    inside = in_blends(trace)
    wanted = np.diff(trace.s, prepend=trace.s[0])[inside] / tick
    return trace.arc_speed[inside] - wanted, trace.line_speed[inside] - wanted


def reference_demand(trace: BlendTrace) -> MotionDemand:
    """What the reference asks for at the ticks."""
    return motion_demand(trace.cell, trace.s, trace.v, trace.a, trace.j)

"""Cells of several arms in evaluations: who acts, what is measured, and against what."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, final

import numpy as np

from armtempo.agents.coordination._baselines import COORDINATION_POLICIES, FULL_SPEED, make_policy
from armtempo.agents.coordination._order_policies import ORDER_POLICIES
from armtempo.agents.coordination._result import CoordinationResult, counted, safe_makespan
from armtempo.agents.evaluation import Interval, Kind, Runner, keywords_of, mean_interval, play, ratio_interval
from armtempo.agents.policies import Actions, Observations, Policy, is_agent_name, learned_policy, options_of_agent
from armtempo.envs import CoordinationEnv, CoordinationOptions, CoordinationTrace, disturbed_motion
from armtempo.envs.coordination import time_limit
from armtempo.errors import InfeasibleError
from armtempo.planners import METHODS, CoordinationCell, Schedule, schedule
from armtempo.planners.schedules import clairvoyant

ONLINE = ("vci", "delay", FULL_SPEED, *ORDER_POLICIES)
"""Classical policies that react while they act, or leave that to the shield: agents are held against their best."""


@dataclass(frozen=True, kw_only=True, eq=False)
class CoordinationEpisode:
    """An episode.

    Attributes:
        trace: What happened.
        reward: Of all arms together.
        changed: Decisions that the shield changed, of ``decided``; both 0 without a shield.
        plan: Of the policy; None: it has none.
        planning_time_s: It took that long [s].
        time_limit_s: The episode would have been cut off then [s].
    """

    trace: CoordinationTrace
    reward: float
    changed: int
    decided: int
    plan: Schedule | None
    planning_time_s: float | None
    time_limit_s: float


@dataclass(frozen=True, kw_only=True, eq=False)
class CoordinationRunner:
    """A policy for all arms in an environment that records."""

    env: CoordinationEnv
    policy: Policy[Observations, Actions]
    plan: Schedule | None = None
    planning_time_s: float | None = None

    def run(self, seed: int, on_step: Callable[[], None] | None = None) -> CoordinationEpisode:
        """One episode to its end; ``on_step`` is called when it begins, and after every decision."""
        reward, infos = play(self.env, self.policy, seed, on_step=on_step)
        return CoordinationEpisode(
            trace=self.env.trace,
            reward=reward,
            changed=sum(info.get("shield_changed", 0) for info in infos.values()),
            decided=sum(info.get("shield_steps", 0) for info in infos.values()),
            plan=self.plan,
            planning_time_s=self.planning_time_s,
            time_limit_s=limit_of(self.env.cell, self.env.options),
        )

    def close(self) -> None:
        """Close the environment."""
        self.env.close()


@final
class CoordinationKind(Kind[CoordinationCell, CoordinationOptions, CoordinationEpisode, CoordinationResult]):
    """Cells of several arms."""

    name = "coordination"
    options_type = CoordinationOptions
    result_type = CoordinationResult
    always_told = ("physics", "mode", "master_late_s")
    may_refuse = True
    policies = COORDINATION_POLICIES

    def open(
        self,
        cell: CoordinationCell,
        policy: str,
        options: CoordinationOptions,
        *,
        before: Runner[CoordinationEpisode] | None = None,
    ) -> CoordinationRunner:
        """Plan, where the policy is a planner, and open an environment, or go on in the one before."""
        began = time.perf_counter()
        plan = schedule(cell, policy) if policy in METHODS else None
        planning = time.perf_counter() - began if plan is not None else None
        if is_agent_name(policy):
            options = options_of_agent(policy, options)
        taken_over = before is not None and before.env.options == options
        env = (
            before.env
            if before is not None and taken_over
            else CoordinationEnv(cell, record=True, **keywords_of(options))
        )
        try:
            who = learned_policy(policy, env) if is_agent_name(policy) else make_policy(policy, cell, plan)
        except BaseException:
            if not taken_over:
                env.close()
            raise
        return CoordinationRunner(env=env, policy=who, plan=plan, planning_time_s=planning)

    def usual_policies(self, options: CoordinationOptions) -> Sequence[str]:
        """Without a shield nobody can be asked to let others pass."""
        return self.policies if options.shield else [name for name in self.policies if name not in ORDER_POLICIES]

    def measure(self, cell: CoordinationCell, runs: Sequence[CoordinationEpisode], seed: int) -> CoordinationResult:
        """Figures over the episodes; those beside other policies come with ``compare``."""
        traces = [run.trace for run in runs]
        plan = runs[0].plan
        times = tuple(safe_makespan(trace) for trace in traces)
        makespans = counted(times, runs[0].time_limit_s)
        makespan = float(np.mean(makespans)) if makespans else None
        clearance = min(float(trace.clearance.min()) for trace in traces)
        decided = sum(run.decided for run in runs)
        return CoordinationResult(
            plan_makespan_s=plan.makespan if plan is not None else None,
            makespan_s=makespan,
            makespans_s=times,
            makespan_interval_s=mean_interval(makespans, seed) if makespans else None,
            ratio_to_best_online=None,
            ratio_interval=None,
            saving_percent=None if makespan is None else 100.0 * (1.0 - makespan / cell.sequential_makespan),
            gap_percent=None if makespan is None else 100.0 * (makespan / cell.lower_bound - 1.0),
            regret_percent=None,
            plan_gap_percent=plan.gap_percent if plan is not None else None,
            min_clearance_m=clearance if math.isfinite(clearance) else None,
            torque_ratio_max=max(trace.torque_ratio_max for trace in traces),
            torque_demand_ratio_max=max(trace.torque_demand_ratio_max for trace in traces),
            torque_clipped_fraction=float(np.mean([trace.torque_clipped_fraction for trace in traces])),
            path_error_max_m=max(float(trace.path_error.max()) for trace in traces),
            violations=sum(trace.violations for trace in traces),
            interventions=sum(run.changed for run in runs) / decided if decided else None,
            finished=sum(time is not None for time in times),
            reward=float(np.mean([run.reward for run in runs])),
            planning_time_s=runs[0].planning_time_s,
            trace=traces[0],
            schedule=plan,
        )

    def head(self, cell: CoordinationCell) -> Mapping[str, object]:
        """Smallest distance, sequential time and certified bound."""
        return {
            "d_min_m": cell.d_min,
            "sequential_s": cell.sequential_makespan,
            "lower_bound_s": cell.lower_bound,
        }

    def compare(
        self,
        cell: CoordinationCell,
        options: CoordinationOptions,
        results: Mapping[str, CoordinationResult],
        *,
        episodes: int,
        seed: int,
    ) -> tuple[Mapping[str, CoordinationResult], Mapping[str, object]]:
        """Every policy against the best classical on-line one, and against who knows the disturbances beforehand.

        ``best_online`` is that one, ``best`` the quickest of all that ran.

        ``clairvoyant_s``, behind a disturbed first arm: in each episode, the makespan of who knows of the disturbance
        beforehand and lets the first arm pass undelayed [s]. Where the first arm yields, less may be possible.

        Where episodes start on the way nothing is held against that, the bound or the sequential time: all are of whole
        paths.
        """
        whole = not options.on_the_way
        known = None
        if (options.disturbance or options.master_late_s) and whole and options.first_alone:
            env = CoordinationEnv(cell, **keywords_of(options))
            try:
                known = clairvoyant_makespans(env, episodes, seed)
            finally:
                env.close()
        best, limit = best_online(results, episodes), limit_of(cell, options)
        times = {name: counted(result.makespans_s, limit) for name, result in results.items()}
        compared = {
            name: replace(
                result,
                saving_percent=result.saving_percent if whole else None,
                gap_percent=result.gap_percent if whole else None,
                plan_gap_percent=result.plan_gap_percent if whole else None,
                regret_percent=_regret(times[name], known or ()),
                **_ratio(times[name], times[best] if best else [], seed),
            )
            for name, result in results.items()
        }
        facts = {"clairvoyant_s": known, "best_online": best, "best": best_of(results, episodes)}
        return compared, facts if whole else {**facts, "sequential_s": None, "lower_bound_s": None}


def best_online(results: Mapping[str, CoordinationResult], episodes: int) -> str | None:
    """The classical on-line policy (``ONLINE``) with the smallest mean makespan, of those always safe and there."""
    return best_of({name: result for name, result in results.items() if name in ONLINE}, episodes)


def best_of(results: Mapping[str, CoordinationResult], episodes: int) -> str | None:
    """The policy with the smallest mean makespan, of those always safe and there; of equals see ``quickest``."""
    return quickest(
        {
            name: result.makespan_s
            for name, result in results.items()
            if result.makespan_s is not None and result.finished == episodes
        }
    )


def quickest(means: Mapping[str, float]) -> str | None:
    """Whose mean is the smallest; of equals a classical on-line policy, then the first by name. None: nobody's."""
    return min(means, key=lambda name: (means[name], name not in ONLINE, name), default=None)


def limit_of(cell: CoordinationCell, options: CoordinationOptions) -> float:
    """After how long an episode is cut off [s]."""
    return time_limit(cell, options.max_episode_s)[1]


def _regret(makespans: Sequence[float], known: Sequence[float]) -> float | None:
    """How far the mean makespan is above that of who knew [%]."""
    if not makespans or not known:
        return None
    return 100.0 * (float(np.mean(makespans) / np.mean(known)) - 1.0)


def _ratio(makespans: Sequence[float], best: Sequence[float], seed: int) -> dict[str, Any]:
    """Mean makespan over that of the best on-line policy and its interval."""
    ratio: float | None = None
    interval: Interval | None = None
    if makespans and best:
        ratio = float(np.mean(makespans) / np.mean(best))
        interval = ratio_interval(makespans, best, seed)
    return {"ratio_to_best_online": ratio, "ratio_interval": interval}


def clairvoyant_makespans(env: CoordinationEnv, episodes: int, seed: int) -> tuple[float, ...] | None:
    """Makespans of the best answers to the disturbed first arm; None where the others find none."""
    makespans = []
    for episode in range(episodes):
        _, infos = env.reset(seed=seed + episode)
        first = disturbed_motion(env.cell, 0, infos[env.possible_agents[0]]["disturbance"], mode=env.options.mode)
        try:
            motions = clairvoyant(env.cell, {0: first})
        except InfeasibleError:
            return None
        makespans.append(max(motion.duration for motion in motions))
    return tuple(makespans)

"""Run policies in the environment and compare them with the sequential time and with the certified bound."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, overload

import numpy as np

from armtempo.agents.blend import BlendEvaluation, evaluate_blend
from armtempo.agents.coordination._baselines import POLICIES, make_policy
from armtempo.agents.evaluation import Interval, mean_interval, ratio_interval
from armtempo.agents.ik import IKEvaluation, evaluate_ik
from armtempo.agents.policies import Policy, chosen_policies, is_agent_name, learned_policy
from armtempo.envs import CoordinationEnv, CoordinationTrace, Physics, disturbed_motion
from armtempo.errors import InfeasibleError, InputError
from armtempo.planners import METHODS, BlendCell, CoordinationCell, IKCell, Schedule, schedule
from armtempo.planners.cells import FamilyName, TargetFamilyName
from armtempo.planners.schedules import clairvoyant
from armtempo.planners.topp import Mode

ONLINE = ("vci", "delay")
"""Classical policies that react while they act: learned agents are held against the better of them."""


@dataclass(frozen=True, kw_only=True, eq=False)
class PolicyResult:
    """What a policy did; means over the episodes that finished, worst cases over all. None where there is no number.

    Attributes:
        plan_makespan_s: Makespan of its plan [s].
        makespan_s: Mean instant at which the last arm arrived [s].
        makespans_s: That instant in each episode [s]; None where an arm did not arrive or two came too close.
        makespan_interval_s: 95 % bootstrap interval of the mean [s].
        saving_percent: Share of the sequential time (minimum times added) that it saves.
        gap_percent: How far the simulated makespan is above the certified bound.
        plan_gap_percent: How far that of the plan is.
        min_clearance_m: Smallest distance of two arms at any tick [m].
        torque_ratio_max: Largest |applied torque| / limit.
        torque_demand_ratio_max: Largest |demanded torque| / limit, before clipping.
        torque_clipped_fraction: Share of joint torques that were clipped by more than 0.1 % of their limit.
        path_error_max_m: Largest distance of a tip from its reference on the path [m].
        violations: Ticks with a clearance below d_min, all episodes together (an episode ends on its first).
        finished: Episodes in which all arms arrived.
        reward: Mean reward, all arms together.
        interventions: Share of the decisions that the shield changed; None without a shield.
        planning_time_s: Time to plan [s]; on-line policies plan while they act.
    """

    plan_makespan_s: float | None
    makespan_s: float | None
    makespans_s: tuple[float | None, ...]
    makespan_interval_s: Interval | None
    saving_percent: float | None
    gap_percent: float | None
    plan_gap_percent: float | None
    min_clearance_m: float | None
    torque_ratio_max: float
    torque_demand_ratio_max: float
    torque_clipped_fraction: float
    path_error_max_m: float
    violations: int
    finished: int
    reward: float
    interventions: float | None
    planning_time_s: float | None
    trace: CoordinationTrace = field(repr=False)
    schedule: Schedule | None = field(repr=False)

    def to_dict(self) -> dict[str, Any]:
        """The numbers, by name."""
        return {name: getattr(self, name) for name in self.__dataclass_fields__ if name not in ("trace", "schedule")}


@dataclass(frozen=True, kw_only=True, eq=False)
class Evaluation:
    """Policies compared in one cell.

    Attributes:
        cell: The cell.
        physics: ``bullet`` or ``ideal``.
        mode: ``speed`` or ``acceleration``.
        episodes: Episodes per policy.
        seed: Seed of the first episode.
        master_late_s: How late the master started [s].
        options: Shield, disturbance, observation noise and start phase, where they were asked for.
        results: By policy.
        refused: Policies whose schedule does not exist in this cell, and why.
        clairvoyant_s: Behind a disturbed first arm: in each episode, the makespan of who knows of the disturbance
            beforehand and lets the first arm pass undelayed [s]. Where the first arm yields, less may be possible.
    """

    cell: CoordinationCell
    physics: Physics
    mode: Mode
    episodes: int
    seed: int
    master_late_s: float
    options: dict[str, Any]
    results: dict[str, PolicyResult]
    refused: dict[str, str]
    clairvoyant_s: tuple[float, ...] | None = None

    def to_dict(self) -> dict[str, Any]:
        """Everything but the traces, units in the keys."""
        return {
            "cell": self.cell.name,
            "physics": self.physics,
            "mode": self.mode,
            "episodes": self.episodes,
            "seed": self.seed,
            "master_late_s": self.master_late_s,
            **self.options,
            "d_min_m": self.cell.d_min,
            "sequential_s": self.cell.sequential_makespan,
            "lower_bound_s": self.cell.lower_bound,
            "clairvoyant_s": self.clairvoyant_s,
            "best_online": self.best_online,
            "policies": {
                name: result.to_dict() | {"regret_percent": self.regret(name)} | self._against_best(name)
                for name, result in self.results.items()
            },
            "refused": self.refused,
        }

    def regret(self, name: str) -> float | None:
        """How far a policy's mean makespan is above ``clairvoyant_s`` [%], over the episodes that it finished."""
        pairs = [
            (own, best)
            for own, best in zip(self.results[name].makespans_s, self.clairvoyant_s or (), strict=False)
            if own is not None
        ]
        if not pairs:
            return None
        own_times, best_times = np.array(pairs).T
        return 100.0 * (float(own_times.mean() / best_times.mean()) - 1.0)

    @property
    def best_online(self) -> str | None:
        """The classical on-line policy (``ONLINE``) with the smallest mean makespan, of those always safe and there."""
        good = [
            (result.makespan_s, name)
            for name, result in self.results.items()
            if name in ONLINE and result.makespan_s is not None and result.finished == self.episodes
        ]
        return min(good)[1] if good else None

    def ratio(self, name: str) -> tuple[float, Interval] | None:
        """A policy's mean makespan over that of ``best_online``, and its 95 % bootstrap interval.

        Over the episodes that both finished; None where there are none.
        """
        if self.best_online is None:
            return None
        pairs = [
            (own, best)
            for own, best in zip(
                self.results[name].makespans_s, self.results[self.best_online].makespans_s, strict=True
            )
            if own is not None and best is not None
        ]
        if not pairs:
            return None
        own_times, best_times = np.array(pairs).T
        return float(own_times.mean() / best_times.mean()), ratio_interval(own_times, best_times, self.seed)

    def _against_best(self, name: str) -> dict[str, Any]:
        ratio = self.ratio(name)
        return {
            "ratio_to_best_online": None if ratio is None else ratio[0],
            "ratio_interval": None if ratio is None else ratio[1],
        }


def run_episode(env: CoordinationEnv, policy: Policy, seed: int | None = None) -> tuple[CoordinationTrace, float]:
    """One episode to its end, in an ``env`` made with ``record``; returns its trace and the sum of all rewards."""
    trace, total, _ = _run_episode(env, policy, seed)
    return trace, total


def _run_episode(
    env: CoordinationEnv, policy: Policy, seed: int | None
) -> tuple[CoordinationTrace, float, dict[str, dict[str, Any]]]:
    """That, and the last info of every agent."""
    observations, _ = env.reset(seed=seed)
    policy.reset(seed)
    total = 0.0
    last: dict[str, dict[str, Any]] = {}
    while env.agents:
        seen = {agent: observations[agent] for agent in env.agents}
        observations, rewards, _, _, infos = env.step(policy.act(seen, env))
        total += sum(rewards.values())
        last |= infos
    return env.trace, total, last


@overload
def evaluate(
    cell: CoordinationCell,
    policies: Sequence[str] | None = None,
    *,
    episodes: int = 1,
    seed: int = 0,
    physics: Physics = "bullet",
    mode: Mode = "speed",
    master_late_s: float = 0.0,
    shield: bool = False,
    disturbance: str | None = None,
    observation_noise: float = 0.0,
    start_phase: float | tuple[float, float] = 0.0,
    on_episode: Callable[[str, int], None] | None = None,
) -> Evaluation: ...
@overload
def evaluate(
    cell: BlendCell,
    policies: Sequence[str] | None = None,
    *,
    episodes: int = 1,
    seed: int = 0,
    physics: Physics = "bullet",
    family: FamilyName = "given",
    model_error: float = 0.0,
    on_episode: Callable[[str, int], None] | None = None,
) -> BlendEvaluation: ...
@overload
def evaluate(
    cell: IKCell,
    policies: Sequence[str] | None = None,
    *,
    episodes: int = 1,
    seed: int = 0,
    physics: Physics = "bullet",
    family: TargetFamilyName = "given",
    model_error: float = 0.0,
    on_episode: Callable[[str, int], None] | None = None,
) -> IKEvaluation: ...
def evaluate(
    cell: CoordinationCell | BlendCell | IKCell,
    policies: Sequence[str] | None = None,
    *,
    episodes: int = 1,
    seed: int = 0,
    physics: Physics = "bullet",
    mode: Mode = "speed",
    master_late_s: float = 0.0,
    shield: bool = False,
    disturbance: str | None = None,
    observation_noise: float = 0.0,
    start_phase: float | tuple[float, float] = 0.0,
    family: FamilyName | TargetFamilyName = "given",
    model_error: float = 0.0,
    on_episode: Callable[[str, int], None] | None = None,
) -> Evaluation | BlendEvaluation | IKEvaluation:
    """Run every policy for some episodes.

    Args:
        cell: Where; of blend and IK cells ``evaluate_blend`` and ``evaluate_ik`` tell more.
        policies: Names out of ``POLICIES`` (``BLEND_POLICIES``, ``IK_POLICIES``), or of learned agents: ``ppo:NAME``
            for one that comes with armtempo, ``ppo:path/to/file.npz`` for a file. None: all ``POLICIES`` that have a
            plan here.
        episodes: Episodes per policy; baselines other than ``random`` do the same in each.
        seed: Seed of the first episode; the following ones count up.
        physics: ``bullet`` or ``ideal``.
        mode: ``speed`` or ``acceleration``.
        master_late_s: How long the first arm stands at its start [s].
        shield: Admit only actions from which all arms can still stop in time and go on.
        disturbance: Of the first arm, by name: see ``DISTURBANCES``. Every policy meets the same ones.
        observation_noise: Standard deviation of the noise on what agents see.
        start_phase: Where on their paths the arms start, as a share: a number, or (lowest, highest).
        family: Of the paths of a blend cell, or the targets of an IK cell.
        model_error: In these: the simulated bodies are heavier by this share than the controller believes.
        on_episode: Called with policy and episode number after each, for progress bars.

    Raises:
        UnknownNameError: A policy that does not exist; the message lists those that do.
        InfeasibleError: A named policy has no schedule in this cell.
        InputError: A learned agent that is for something else, or whose file is damaged.
    """
    asked: dict[str, Any] = {
        name: value
        for name, value in (
            ("shield", shield),
            ("disturbance", disturbance),
            ("observation_noise", observation_noise),
            ("start_phase", start_phase),
        )
        if value
    }
    if not isinstance(cell, CoordinationCell):
        if mode != "speed" or master_late_s or asked:
            names = ", ".join(("mode", "master_late_s", *asked))
            raise InputError(f"{names} are for cells of several arms", remedy="leave them out")
        one_arm: Any = evaluate_blend if isinstance(cell, BlendCell) else evaluate_ik
        result: BlendEvaluation | IKEvaluation = one_arm(
            cell,
            policies,
            episodes=episodes,
            seed=seed,
            physics=physics,
            family=family,
            model_error=model_error,
            on_episode=on_episode,
        )
        return result
    if family != "given" or model_error:
        raise InputError("family and model_error are for blend cells and ik cells", remedy="leave them out")
    chosen = chosen_policies(policies, POLICIES, episodes)
    env = CoordinationEnv(cell, physics=physics, mode=mode, master_late_s=master_late_s, record=True, **asked)
    try:
        results, refused = {}, {}
        known = (
            clairvoyant_makespans(env, episodes, seed) if (disturbance or master_late_s) and not start_phase else None
        )
        for name in chosen:
            began = time.perf_counter()
            try:
                plan = schedule(cell, name) if name in METHODS else None
            except InfeasibleError as error:
                if policies is not None:
                    raise
                refused[name] = str(error)
                continue
            planning = time.perf_counter() - began if plan is not None else None
            results[name] = _evaluate_one(env, name, plan, planning, episodes, seed, on_episode)
    finally:
        env.close()
    return Evaluation(
        cell=cell,
        physics=physics,
        mode=mode,
        episodes=episodes,
        seed=seed,
        master_late_s=master_late_s,
        options=asked,
        results=results,
        refused=refused,
        clairvoyant_s=known,
    )


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


def _evaluate_one(
    env: CoordinationEnv,
    name: str,
    plan: Schedule | None,
    planning: float | None,
    episodes: int,
    seed: int,
    on_episode: Callable[[str, int], None] | None,
) -> PolicyResult:
    cell = env.cell
    policy = learned_policy(name, env) if is_agent_name(name) else make_policy(name, cell, plan)
    traces, rewards, changed, decided = [], [], 0, 0
    for episode in range(episodes):
        trace, reward, infos = _run_episode(env, policy, seed + episode)
        changed += sum(info.get("shield_changed", 0) for info in infos.values())
        decided += sum(info.get("shield_steps", 0) for info in infos.values())
        traces.append(trace)
        rewards.append(reward)
        if on_episode is not None:
            on_episode(name, episode)
    times = [trace.makespan if math.isfinite(trace.makespan) and not trace.violations else None for trace in traces]
    makespans = [time for time in times if time is not None]
    makespan = float(np.mean(makespans)) if makespans else None
    clearance = min(float(trace.clearance.min()) for trace in traces)
    return PolicyResult(
        plan_makespan_s=plan.makespan if plan is not None else None,
        makespan_s=makespan,
        makespans_s=tuple(times),
        makespan_interval_s=mean_interval(makespans, seed) if makespans else None,
        saving_percent=None if makespan is None else 100.0 * (1.0 - makespan / cell.sequential_makespan),
        gap_percent=None if makespan is None else 100.0 * (makespan / cell.lower_bound - 1.0),
        plan_gap_percent=plan.gap_percent if plan is not None else None,
        min_clearance_m=clearance if math.isfinite(clearance) else None,
        torque_ratio_max=max(trace.torque_ratio_max for trace in traces),
        torque_demand_ratio_max=max(trace.torque_demand_ratio_max for trace in traces),
        torque_clipped_fraction=float(np.mean([trace.torque_clipped_fraction for trace in traces])),
        path_error_max_m=max(float(trace.path_error.max()) for trace in traces),
        violations=sum(trace.violations for trace in traces),
        finished=len(makespans),
        reward=float(np.mean(rewards)),
        interventions=changed / decided if decided else None,
        planning_time_s=planning,
        trace=traces[0],
        schedule=plan,
    )

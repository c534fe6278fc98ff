"""What agents that see graphs are shown: decisions of a policy that runs ahead, and what became of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from armtempo.agents.policies import flat_rows
from armtempo.arrays import Bools, Floats, Floats32
from armtempo.envs import BatchSimulation

GO, HOLD = 1.5, -1.5  # actions: beyond their ends, so that small errors of a network change nothing
OTHERWISE = 0.1  # of the arms' decisions is gone on with something else: what comes of that is shown, too


@dataclass(frozen=True, kw_only=True, eq=False)
class Demonstrations:
    """D decisions of all arms of an episode.

    Attributes:
        rows: (D, n) what they saw, as ``flat_rows`` has it.
        actions: (D, arms) what the teacher did: ``GO`` or ``HOLD``; 0 for arms that are absent or there.
        returns: (D,) the team's reward from then on.
    """

    rows: Floats32
    actions: Floats32
    returns: Floats32

    @classmethod
    def joined(cls, parts: Sequence[Demonstrations]) -> Demonstrations:
        """One after the other."""
        return cls(
            rows=np.concatenate([part.rows for part in parts]),
            actions=np.concatenate([part.actions for part in parts]),
            returns=np.concatenate([part.returns for part in parts]),
        )


def demonstrate(simulation: BatchSimulation, seed: int, hold_periods: int) -> Demonstrations:
    """One episode of each of a simulation, decided by the policy ``search+hold`` every ``hold_periods``.

    Args:
        simulation: With ``observation="graph"``, ``orders="search+stop"`` and ``reward="team"``.
        seed: Of the first episode, and of what is done otherwise.
        hold_periods: Control periods between decisions.
    """
    random = np.random.default_rng(seed)
    simulation.seed(seed)
    simulation.reset()
    rows: list[Floats32] = []
    actions: list[Floats32] = []
    rewards: list[Floats] = []
    running: list[Bools] = []
    active = np.ones(simulation.episodes, dtype=np.bool_)
    graph, period = simulation.graph, simulation.cell.control_period
    assert graph is not None
    while active.any():
        rows.append(flat_rows(*graph.graphs))
        holds = _holds(simulation, active) > 0.5 * hold_periods * period
        taught = np.zeros((simulation.episodes, graph.graphs.nodes.shape[1]), dtype=np.float32)
        on_the_way = np.isnan(simulation.arrival)
        taught[:, : simulation.arms] = np.where(on_the_way, np.where(holds, HOLD, GO), 0.0)
        actions.append(taught)
        other = random.random(holds.shape) < OTHERWISE
        at_rest = simulation.mu <= 0.0
        done = np.where(other & at_rest, ~holds, holds)
        running.append(active.copy())
        earned = np.zeros(simulation.episodes)
        for _ in range(hold_periods):
            if not active.any():
                break
            simulation.step(np.where(done, 0.0, 1.0), active)
            earned[active] += simulation.rewards[active, 0]
            active = active & ~(simulation.terminated | simulation.truncated).all(axis=1)
        rewards.append(earned)
    there = np.array(running)
    returns = np.cumsum(np.array(rewards)[::-1], axis=0)[::-1].astype(np.float32)
    return Demonstrations(rows=np.array(rows)[there], actions=np.array(actions)[there], returns=returns[there])


def _holds(simulation: BatchSimulation, active: Bools) -> Floats:
    """(E, A) for how long the teacher holds arms back; it need not be asked where nobody at rest is to be late."""
    assert simulation.graph is not None
    late = simulation.graph.delays[:, : simulation.arms] > 0.0
    at_rest = (simulation.mu <= 0.0) & np.isnan(simulation.arrival)
    asked = active & (late & at_rest).any(axis=1) & ~simulation.stands.any(axis=1)
    holds: Floats = simulation.hold_back(asked) if asked.any() else np.zeros(simulation.lam.shape)
    return holds

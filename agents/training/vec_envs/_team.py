"""Episodes of cells with any numbers of arms as a ``VecEnv`` of stable-baselines3: a row decides for all their arms."""

from __future__ import annotations

import time
from collections.abc import Sequence
from itertools import pairwise
from typing import Any, final

import numpy as np
from gymnasium.spaces import Box
from numpy.typing import NDArray
from stable_baselines3.common.vec_env.base_vec_env import VecEnvStepReturn

from armtempo.agents.policies import FLAT_SIZE, flat_rows
from armtempo.agents.training.vec_envs._whole import WholeVecEnv
from armtempo.arrays import Bools, Floats, Floats32
from armtempo.envs import GRAPH_ARMS, BatchSimulation
from armtempo.envs.common import Chunks
from armtempo.errors import InputError


@final
class TeamVecEnv(WholeVecEnv):
    """Row e is episode e: what all its arms see (``flat_rows`` of the graph), and the actions of all, arm by arm.

    Rewards are the team's. An action is held for ``hold_periods`` control periods, or until its episode is over.

    Args:
        simulations: Episodes with ``observation="graph"`` and ``reward="team"``, of one cell each.
        action_size: Numbers of an arm's action.
        hold_periods: For how long an action is held.
        threads: How many simulations run at the same time.

    Raises:
        InputError: A simulation shows no graph.
    """

    def __init__(
        self, simulations: Sequence[BatchSimulation], *, action_size: int = 1, hold_periods: int = 1, threads: int = 1
    ) -> None:
        if any(one.graph is None for one in simulations):
            raise InputError("episodes that show no graph", remedy='make them with observation="graph"')
        self.simulations, self._size, self._hold = tuple(simulations), action_size, hold_periods
        ends = np.cumsum([0, *(one.episodes for one in simulations)]).tolist()
        self._spans = [slice(first, last) for first, last in pairwise(ends)]
        seen = Box(-2.0, 2.0, (FLAT_SIZE,), dtype=np.float32)
        self.render_mode = None
        super().__init__(ends[-1], seen, Box(-1.0, 1.0, (GRAPH_ARMS * action_size,), dtype=np.float32))
        self._chunks = Chunks(len(self.simulations), min(threads, len(self.simulations)))
        self._rows = np.zeros((self.num_envs, *seen.shape), dtype=np.float32)
        self._returns, self._steps = np.zeros(self.num_envs), np.zeros(self.num_envs, dtype=np.int64)
        self._began = time.perf_counter()

    def seed(self, seed: int | None = None) -> Sequence[int | None]:
        """Seed the next reset: episode e gets seed + e; None: something random."""
        drawn = int(np.random.default_rng().integers(2**31)) if seed is None else seed
        self._seeds = [drawn + e for e in range(self.num_envs)]
        return self._seeds

    def reset(self) -> Floats32:
        """Start all episodes; uses up the seeds."""
        for one, span in zip(self.simulations, self._spans, strict=True):
            one.seed(self._seeds[span])
            one.reset()
            self._see(one, span)
        self._reset_seeds()
        self._returns[:], self._steps[:] = 0.0, 0
        return self._rows.copy()

    def _see(self, one: BatchSimulation, span: slice) -> None:
        assert one.graph is not None
        self._rows[span] = flat_rows(*one.graph.graphs)

    def leave_undisturbed(self, share: float) -> None:
        """From their next reset on about this share of the episodes is neither disturbed nor late nor elsewhere.

        In every cell the first ones; where they are few the shares of the cells differ, and their mean does not.
        """
        for one, span in zip(self.simulations, self._spans, strict=True):
            one.undisturbed[:] = np.arange(one.episodes) < round(share * span.stop) - round(share * span.start)

    def step_async(self, actions: NDArray[Any]) -> None:
        """Keep the actions for ``step_wait``."""
        self._actions = np.clip(actions.reshape(self.num_envs, GRAPH_ARMS, self._size), -1.0, 1.0).astype(np.float64)

    def step_wait(self) -> VecEnvStepReturn:
        """Step all episodes; those that have ended begin again."""
        rewards, dones = np.zeros(self.num_envs), np.zeros(self.num_envs, dtype=np.bool_)
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]

        def part(_: int, first: int, last: int) -> None:
            for one, span in zip(self.simulations[first:last], self._spans[first:last], strict=True):
                self._run(one, span, rewards[span], dones[span], infos)

        self._chunks.run(part)
        return self._rows.copy(), rewards.astype(np.float32), dones, infos

    def _run(
        self, one: BatchSimulation, span: slice, rewards: Floats, dones: Bools, infos: list[dict[str, Any]]
    ) -> None:
        """The step of one cell's episodes: fill ``rewards`` and ``dones`` (E,), and what infos tell of an end."""
        commands = 0.5 * (self._actions[span, : one.arms, 0] + 1.0)
        priority = self._actions[span, : one.arms, 1] if self._size > 1 else None
        for _ in range(self._hold):
            active = ~dones
            if not active.any():
                break
            one.step(commands, active, priority)
            rewards[active] += one.rewards[active, 0]
            self._steps[span][active] += 1
            dones |= (one.terminated | one.truncated).all(axis=1)
        self._returns[span] += rewards
        self._see(one, span)
        if not dones.any():
            return
        for e in np.flatnonzero(dones).tolist():
            row = span.start + e
            arrival = one.arrival[e]
            infos[row] = {
                "terminal_observation": self._rows[row].copy(),
                "TimeLimit.truncated": bool(one.truncated[e].any()),
                "episode": {
                    "r": float(self._returns[row]),
                    "l": int(self._steps[row]),
                    "t": round(time.perf_counter() - self._began, 6),
                },
                "makespan_s": float(arrival.max()),
                "is_success": bool(not np.isnan(arrival).any() and not one.violated[e]),
            }
            self._returns[row], self._steps[row] = 0.0, 0
        one.reset(dones.copy())
        self._see(one, span)

    def get_state(self) -> dict[str, NDArray[Any]]:
        """All that the episodes continue from, exactly."""
        state = {
            f"cell.{k}.{name}": value
            for k, one in enumerate(self.simulations)
            for name, value in one.get_state().items()
        }
        return {**state, "vec.returns": self._returns.copy(), "vec.steps": self._steps.copy()}

    def set_state(self, state: dict[str, NDArray[Any]]) -> None:
        """Continue from there."""
        self._returns[:], self._steps[:] = state["vec.returns"], state["vec.steps"]
        for k, (one, span) in enumerate(zip(self.simulations, self._spans, strict=True)):
            start = f"cell.{k}."
            one.set_state({name.removeprefix(start): value for name, value in state.items() if name.startswith(start)})
            self._see(one, span)

    def close(self) -> None:
        """End the threads."""
        self._chunks.close()
        for one in self.simulations:
            one.close()

    @property
    def whole(self) -> Any:
        """This: the simulations have nothing in common but their rows."""
        return self

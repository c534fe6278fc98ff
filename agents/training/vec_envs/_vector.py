"""Our vector environments as a ``VecEnv`` of stable-baselines3: one row per learner of every episode."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Any, final

import numpy as np
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray
from stable_baselines3.common.vec_env.base_vec_env import VecEnvStepReturn

from armtempo.agents.training.vec_envs._whole import WholeVecEnv
from armtempo.arrays import Bools
from armtempo.envs import CoordinationVectorEnv, VectorBase
from armtempo.errors import InputError


@final
class VectorVecEnv(WholeVecEnv):
    """Row ``e L + k`` is learner k of L in episode e.

    An episode of a row is that of its environment: ``dones`` of an environment's rows are true together, when all its
    agents have ended, and then only (see ``ParallelVecEnv``). Who ended before earns 0 until then, or the team's share.

    Args:
        vector: The environments, which begin anew in the step that ends an episode (``SAME_STEP``). Episode e gets
            seed + e.
        reward_scale: Multiplies rewards; the returns in infos are unscaled.
        cut_penalty: What it costs to ask for 1 more than the shield of a ``CoordinationVectorEnv`` lets through, per
            step. Held by the shield, an arm may ask for what it likes; this way it learns to slow down by itself.

    Raises:
        InputError: The environments begin anew in the step after; a penalty where there is no shield's cut.
    """

    def __init__(self, vector: VectorBase[Any], reward_scale: float = 1.0, cut_penalty: float = 0.0) -> None:
        if vector.autoreset_mode != AutoresetMode.SAME_STEP:
            raise InputError(
                f"autoreset_mode is {vector.autoreset_mode.value!r}", remedy="make them with autoreset_mode=SAME_STEP"
            )
        if cut_penalty and not isinstance(vector, CoordinationVectorEnv):
            raise InputError(f"cut_penalty is {cut_penalty:g}, and no shield cuts here", remedy="leave it out")
        self.vector, self._scale, self._cut_penalty = vector, reward_scale, cut_penalty
        self._rows_each = vector.rows_per_env
        self.render_mode = None
        super().__init__(vector.num_envs * self._rows_each, *vector.row_spaces)
        self._nothing: dict[str, Any] = {}  # infos of running episodes: one object, as nobody writes to it
        self._returns = np.zeros(self.num_envs)
        self._steps = np.zeros(self.num_envs, dtype=np.int64)
        self._began = time.perf_counter()

    def seed(self, seed: int | None = None) -> Sequence[int | None]:
        """Seed the next reset: episode e gets seed + e; None: something random."""
        drawn = int(np.random.default_rng().integers(2**31)) if seed is None else seed
        self._seeds = [drawn + row // self._rows_each for row in range(self.num_envs)]
        return self._seeds

    def reset(self) -> Any:
        """Start all episodes; uses up the seeds."""
        observations, _ = self.vector.reset(seed=self._seeds[:: self._rows_each])
        self._reset_seeds()
        self._returns[:], self._steps[:] = 0.0, 0
        return self.vector.to_rows(observations)

    def step_async(self, actions: NDArray[Any]) -> None:
        """Keep the actions for ``step_wait``."""
        self._actions = self.vector.from_rows(actions)

    def step_wait(self) -> VecEnvStepReturn:
        """Step all environments; episodes that have ended begin again."""
        vector = self.vector
        observations, rewards, terminated, truncated, told = vector.step(self._actions)
        if self._cut_penalty and isinstance(vector, CoordinationVectorEnv):
            rewards = rewards - self._cut_penalty * vector.shield_cut
        earned = vector.to_rows(rewards)
        self._returns += earned
        self._steps += 1
        infos = [self._nothing] * self.num_envs
        over: Bools = told.get("_final_obs", np.zeros(vector.num_envs, dtype=np.bool_))
        if over.any():
            self._finish(np.flatnonzero(over).tolist(), vector.to_rows(truncated & ~terminated), told, infos)
        dones = np.repeat(over, self._rows_each)
        return vector.to_rows(observations), (self._scale * earned).astype(np.float32), dones, infos

    def _finish(self, ended: list[int], cut: Bools, told: dict[str, Any], infos: list[dict[str, Any]]) -> None:
        """Tell the rows of these episodes about their end: what SB3 asks for, and the episodes' own figures."""
        last, seconds = self.vector.to_rows(told["final_obs"]), round(time.perf_counter() - self._began, 6)
        figures = {
            name: values
            for name, values in told["final_info"].items()
            if not name.startswith("_") and values.ndim == 1  # of the episode, not of its arms
        }
        for e in ended:
            for row in range(e * self._rows_each, (e + 1) * self._rows_each):
                infos[row] = {name: values[e].item() for name, values in figures.items()} | {
                    "terminal_observation": _row(last, row),
                    "TimeLimit.truncated": bool(cut[row]),
                    "episode": {"r": float(self._returns[row]), "l": int(self._steps[row]), "t": seconds},
                }
                self._returns[row], self._steps[row] = 0.0, 0

    def get_state(self) -> dict[str, NDArray[Any]] | None:
        """All that the episodes continue from, exactly; None where it is not in arrays, as tasks drawn for each."""
        header, state = self.vector.header(), self.vector.get_state()
        changing = {f"batch.{name}": value for name, value in state.items() if name not in header}
        if not all(isinstance(value, np.ndarray) for value in changing.values()):
            return None
        return {**changing, "vec.returns": self._returns.copy(), "vec.steps": self._steps.copy()}

    def set_state(self, state: dict[str, NDArray[Any]]) -> None:
        """Continue from there."""
        self._returns[:], self._steps[:] = state["vec.returns"], state["vec.steps"]
        changing = {name.removeprefix("batch."): array for name, array in state.items() if name.startswith("batch.")}
        self.vector.set_state({**self.vector.header(), **changing})

    def close(self) -> None:
        """Close the environments."""
        self.vector.close()

    @property
    def whole(self) -> Any:
        """The vector."""
        return self.vector


def _row(observations: Any, row: int) -> Any:
    """What one row sees, a copy."""
    if isinstance(observations, dict):
        return {name: values[row].copy() for name, values in observations.items()}
    return observations[row].copy()

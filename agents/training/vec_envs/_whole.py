"""The part of a ``VecEnv`` of stable-baselines3 whose rows are all one object's: what is asked of a row goes to it."""

from __future__ import annotations

import time
from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray
from stable_baselines3.common.vec_env import VecEnv
from stable_baselines3.common.vec_env.base_vec_env import VecEnvIndices


class WholeVecEnv(VecEnv):
    """Rows that are stepped, saved and asked together.

    Args:
        whole: Has ``get_state``, ``set_state`` and ``close``.
        rows: How many.
        seen: Space of what a row sees.
        actions: Space of its actions.
    """

    def __init__(self, whole: Any, rows: int, seen: gymnasium.Space[Any], actions: gymnasium.Space[Any]) -> None:
        self._whole = whole
        self.render_mode = None
        super().__init__(rows, seen, actions)
        self._nothing: dict[str, Any] = {}  # infos of running episodes: one object, as nobody writes to it
        self._returns = np.zeros(rows)
        self._steps = np.zeros(rows, dtype=np.int64)
        self._began = time.perf_counter()

    def _end(self, row: int) -> dict[str, Any]:
        """What SB3's monitor tells of an episode of a row that is over."""
        seconds = round(time.perf_counter() - self._began, 6)
        told = {"r": float(self._returns[row]), "l": int(self._steps[row]), "t": seconds}
        self._returns[row], self._steps[row] = 0.0, 0
        return told

    def get_state(self) -> dict[str, NDArray[Any]]:
        """All that the episodes continue from, exactly."""
        mine = {"vec.returns": self._returns.copy(), "vec.steps": self._steps.copy()}
        return {**{f"batch.{name}": array for name, array in self._whole.get_state().items()}, **mine}

    def set_state(self, state: dict[str, NDArray[Any]]) -> None:
        """Continue from there."""
        self._returns[:], self._steps[:] = state["vec.returns"], state["vec.steps"]
        self._whole.set_state(
            {name.removeprefix("batch."): array for name, array in state.items() if name.startswith("batch.")}
        )

    def close(self) -> None:
        """Close it."""
        self._whole.close()

    def get_attr(self, attr_name: str, indices: VecEnvIndices = None) -> list[Any]:
        """An attribute, of this or of the whole, for each row."""
        value = getattr(self if attr_name == "render_mode" else self._whole, attr_name)
        return [value for _ in self._get_indices(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: VecEnvIndices = None) -> None:
        """Set an attribute of the whole."""
        setattr(self._whole, attr_name, value)

    def env_method(
        self, method_name: str, *method_args: Any, indices: VecEnvIndices = None, **method_kwargs: Any
    ) -> list[Any]:
        """Call a method of the whole, once; its result for each row."""
        result = getattr(self._whole, method_name)(*method_args, **method_kwargs)
        return [result for _ in self._get_indices(indices)]

    def env_is_wrapped(
        self, wrapper_class: type[gymnasium.Wrapper[Any, Any, Any, Any]], indices: VecEnvIndices = None
    ) -> list[bool]:
        """There are no Gymnasium wrappers."""
        return [False for _ in self._get_indices(indices)]

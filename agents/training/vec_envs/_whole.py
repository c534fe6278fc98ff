"""What a ``VecEnv`` of stable-baselines3 has to answer for each row, where one object steps them all."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any

import gymnasium
from stable_baselines3.common.vec_env import VecEnv
from stable_baselines3.common.vec_env.base_vec_env import VecEnvIndices


class WholeVecEnv(VecEnv, ABC):
    """Attributes and methods of the rows are those of ``whole``."""

    @property
    @abstractmethod
    def whole(self) -> Any:
        """What steps all rows."""

    def get_attr(self, attr_name: str, indices: VecEnvIndices = None) -> list[Any]:
        """An attribute of the whole, for each row."""
        value = getattr(self.whole, attr_name)
        return [value for _ in self._get_indices(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: VecEnvIndices = None) -> None:
        """Set an attribute of the whole."""
        setattr(self.whole, attr_name, value)

    def env_method(
        self, method_name: str, *method_args: Any, indices: VecEnvIndices = None, **method_kwargs: Any
    ) -> list[Any]:
        """Call a method of the whole, once; its result for each row."""
        result = getattr(self.whole, method_name)(*method_args, **method_kwargs)
        return [result for _ in self._get_indices(indices)]

    def env_is_wrapped(
        self, wrapper_class: type[gymnasium.Wrapper[Any, Any, Any, Any]], indices: VecEnvIndices = None
    ) -> list[bool]:
        """There are no Gymnasium wrappers."""
        return [False for _ in self._get_indices(indices)]

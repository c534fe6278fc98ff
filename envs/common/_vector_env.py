"""Many environments at once: what their vector forms share, whatever happens in an episode."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from typing import Any, ClassVar, Generic, TypeVar

import numpy as np
from gymnasium.spaces import Space
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import ArrayLike, NDArray

from armtempo.arrays import Bools, Floats, Floats32
from armtempo.envs.common._actions import finite_numbers
from armtempo.envs.common._options import OptionsT, check_names, options_of, read_seed
from armtempo.envs.common._saved import SavedEnvs
from armtempo.envs.common._vector_parts import Seeds
from armtempo.errors import ActionError, InputError, brief
from armtempo.state import State, Stateful


class Batch(Stateful, ABC):
    """E episodes of a kind that are stepped together, arrays in and out. What it returns is new: it writes elsewhere.

    Episodes of several arms have an axis of arms: (E, A, ...). They are over when all of it is.
    """

    @property
    @abstractmethod
    def name(self) -> str:
        """The cell's."""

    @property
    @abstractmethod
    def observations(self) -> Floats32:
        """(E, ..., size) now."""

    @property
    @abstractmethod
    def rewards(self) -> Floats:
        """(E, ...) of the last step."""

    @property
    @abstractmethod
    def terminated(self) -> Bools:
        """(E, ...)."""

    @property
    @abstractmethod
    def truncated(self) -> Bools:
        """(E, ...)."""

    @property
    @abstractmethod
    def made_of(self) -> State:
        """What tells them apart from others, beside their cell: plain values by name."""

    @abstractmethod
    def reset(self, mask: Bools, seeds: Seeds | None, options: Mapping[str, Any]) -> dict[str, Any]:
        """Begin new episodes, those of ``mask`` (E,); what infos tell of them.

        Args:
            mask: Which.
            seeds: One for each of all E; a None goes on with what is drawn, as no seeds at all do.
            options: Of this reset, with names that the vector knows.
        """

    @abstractmethod
    def step(self, actions: Floats, active: Bools) -> None:
        """Run a step of the ``active`` (E,) under ``actions`` in [-1, 1]; rewards of the others are 0."""

    @abstractmethod
    def figures(self, over: Bools) -> dict[str, Any]:
        """What infos tell of episodes that have ended just now, ``over`` (E,)."""

    @abstractmethod
    def close(self) -> None:
        """End the threads; may be called twice."""


BatchT = TypeVar("BatchT", bound=Batch)


class VectorBase(SavedEnvs, VectorEnv[Floats32, Floats32, NDArray[Any]], Generic[BatchT]):
    """Gymnasium's vector environment over a ``Batch``: seeds, resets of some, automatic resets, infos, states.

    A *row* is what one agent sees and does: an environment, unless a subclass has several agents in each.

    Args:
        batch: The episodes.
        num_envs: E.
        seen: Space of what one environment sees.
        actions: Space of its actions.
        autoreset_mode: ``NEXT_STEP`` or ``SAME_STEP`` of Gymnasium's ``AutoresetMode``, or its value.
    """

    changing = ("batch", "_over")
    reset_options: ClassVar[tuple[str, ...]] = ()
    """Names of what ``reset`` may be given for one episode, beside ``reset_mask``."""

    def __init__(
        self,
        batch: BatchT,
        num_envs: int,
        *,
        seen: Space[Any],
        actions: Space[Any],
        autoreset_mode: AutoresetMode | str,
    ) -> None:
        self.batch, self.num_envs = batch, num_envs
        self.autoreset_mode = autoreset_of(autoreset_mode)
        self.metadata: dict[str, Any] = {"render_modes": [], "autoreset_mode": self.autoreset_mode}
        self.render_mode = None
        self.single_observation_space, self.single_action_space = seen, actions
        self.observation_space = batch_space(seen, num_envs)
        self.action_space = batch_space(actions, num_envs)
        self._over: Bools = np.zeros(num_envs, dtype=np.bool_)
        self._begun = False

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Floats32, dict[str, Any]]:
        """Begin new episodes.

        Args:
            seed: Environment k gets ``seed + k``, or a sequence of seeds.
            options: May give ``reset_mask`` (E,), which environments (the first time it is all of them), and the reset
                options that the class names.

        Raises:
            UnknownNameError: No such option.
            InputError: An option cannot be used, mask or seeds are not one for each environment, or all is closed.
        """
        self._check_open()
        given, mask = self._read_options(options)
        seeds = spread(seed, self.num_envs)
        begun = mask if self._begun else np.ones(self.num_envs, dtype=np.bool_)
        infos = self.batch.reset(begun, seeds, given)
        if isinstance(seed, int | np.integer):
            self._np_random, self._np_random_seed = seeding.np_random(int(seed))
        self._over[begun] = False
        self._begun = True
        return self.batch.observations, infos

    def _read_options(self, options: Any) -> tuple[dict[str, Any], Bools]:
        """The options of a reset but for its mask, and the mask."""
        known = ("reset_mask", *self.reset_options)
        given = {} if options is None else options
        if not isinstance(given, Mapping):
            raise InputError(
                f"options must map names to values, got {brief(given)}", remedy=f"known: {', '.join(known)}"
            )
        check_names(*(("reset option", name, known) for name in given))
        mask = given.get("reset_mask")
        mask = np.ones(self.num_envs, dtype=np.bool_) if mask is None else mask
        if not (isinstance(mask, np.ndarray) and mask.dtype == bool and mask.shape == (self.num_envs,) and mask.any()):
            raise InputError("reset_mask must be an array of truth values, one per environment, not all False")
        return {name: value for name, value in given.items() if name != "reset_mask"}, mask.copy()

    def step(self, actions: ArrayLike) -> tuple[Floats32, Floats, Bools, Bools, dict[str, Any]]:
        """Run one step; environments whose episode was over begin anew instead (``NEXT_STEP``).

        Raises:
            ActionError: The actions are not finite numbers in an array of the action space's shape, nothing was reset
                yet, or all is closed.
        """
        if self.closed:
            raise ActionError("the environments are closed", remedy="make new ones")
        if not self._begun:
            raise ActionError("no episode has begun", remedy="call reset before step")
        batch, again = self.batch, self._over
        batch.step(read_many(actions, self.action_space.shape or ()), ~again)
        infos = batch.reset(again, None, {}) if again.any() else {}
        rewards, terminated, truncated = batch.rewards, batch.terminated, batch.truncated
        over: Bools = np.asarray((terminated | truncated).reshape(self.num_envs, -1).all(axis=1))
        self._over = over.copy()
        if over.any():
            figures = batch.figures(over)
            if self.autoreset_mode == AutoresetMode.SAME_STEP:
                infos |= {"final_obs": batch.observations, "_final_obs": over}
                infos |= {"final_info": figures, "_final_info": over.copy()}
                infos |= batch.reset(over, None, {})
                self._over[:] = False
            else:
                infos |= figures
        return batch.observations, rewards, terminated, truncated, infos

    def made_of(self) -> State:
        """The cell's name, how many there are, and what the batch says."""
        mode = self.autoreset_mode.value
        return {"cell": self.batch.name, "num_envs": self.num_envs, "autoreset_mode": mode, **self.batch.made_of}

    def _check_open(self) -> None:
        if self.closed:
            raise InputError("the environments are closed", remedy="make new ones")

    def _was_reset(self) -> bool:
        return self._begun

    def _go_on(self, state: Mapping[str, Any]) -> None:
        super()._go_on(state)
        self._begun = True

    def close_extras(self, **_: Any) -> None:
        """End the threads."""
        self.batch.close()

    @property
    def row_spaces(self) -> tuple[Space[Any], Space[Any]]:
        """Of what a row sees, and of its actions."""
        return self.single_observation_space, self.single_action_space

    @property
    def rows_per_env(self) -> int:
        """Rows of an environment."""
        return 1

    def to_rows(self, values: NDArray[Any]) -> NDArray[Any]:
        """What ``step`` returns, (E, ...), by rows."""
        return values

    def from_rows(self, actions: NDArray[Any]) -> NDArray[Any]:
        """Actions by rows, as ``step`` takes them."""
        return actions


def ideal_options(
    kind: type[OptionsT], keywords: Mapping[str, Any], taker: Callable[..., object], render_mode: str | None = None
) -> OptionsT:
    """The options of many environments at once, which are without physics unless somebody asks for it.

    Args:
        kind: The record of options.
        keywords: Some of its fields.
        taker: What was called with them.
        render_mode: What it was given.

    Raises:
        InputError: Somebody does, or wants pictures; as ``options_of`` raises.
    """
    options = options_of(kind, {"physics": "ideal", **keywords}, taker)
    physics = keywords.get("physics", "ideal")
    if physics != "ideal" or render_mode is not None:
        what = f"physics {brief(physics)}" if physics != "ideal" else f"render_mode {brief(render_mode)}"
        raise InputError(
            f"many environments at once run without physics and pictures, got {what}",
            remedy='use physics="ideal", or gymnasium.make_vec(..., vectorization_mode="sync")',
        )
    return options


def spread(seed: int | Sequence[int | None] | None, count: int) -> list[int | None]:
    """One seed per environment, as Gymnasium has it: ``seed + k``, or a sequence of them.

    Raises:
        InputError: The sequence is not that long, or one is no seed.
    """
    given: object = seed
    if isinstance(given, np.ndarray):
        given = given.tolist()
    if isinstance(given, Sequence) and not isinstance(given, str | bytes):
        if len(given) != count:
            raise InputError(f"{len(given)} seeds for {count} episodes", remedy="give one for each, or a single number")
        return [read_seed(one) for one in given]
    first = read_seed(given)
    return [None] * count if first is None else [first + k for k in range(count)]


def autoreset_of(mode: AutoresetMode | str) -> AutoresetMode:
    """``NEXT_STEP`` or ``SAME_STEP``.

    Raises:
        InputError: It is neither.
    """
    known = (AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP)
    if not isinstance(mode, AutoresetMode | str) or mode not in (*known, *(one.value for one in known)):
        raise InputError(f"autoreset_mode is {brief(mode)}", remedy="use AutoresetMode.NEXT_STEP or SAME_STEP")
    return AutoresetMode(mode)


def read_many(actions: ArrayLike, shape: tuple[int, ...]) -> Floats:
    """Actions of many environments, clipped to [-1, 1], with the bits of ``read_actions``.

    Raises:
        ActionError: They are not finite numbers of that shape.
    """
    values = finite_numbers(actions, len(shape) * math.prod(shape))
    if values is None or values.shape != shape:
        got = brief(actions) if values is None else f"shape {values.shape}"
        raise ActionError(
            f"actions must be finite numbers in an array of shape {shape}, got {got}",
            remedy="clip them to [-1, 1] and replace NaN before step",
        )
    return np.clip(values, -1.0, 1.0)


def as_commands(actions: Floats) -> Floats:
    """Actions in [-1, 1] as commands in [0, 1], with the bits of ``read_action``."""
    return np.asarray(0.5 * (actions + 1.0), dtype=np.float64)

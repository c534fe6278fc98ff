"""Many episodes of a pose that moves at once, without physics: Gymnasium's vector form of ``FeedbackIKEnv``."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise
from pathlib import Path
from typing import Any, final

import numpy as np
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import ArrayLike, NDArray

from armtempo.arrays import Bools, Floats, Floats32
from armtempo.envs.bodies import Physics
from armtempo.envs.common import autoreset_of, check_ideal, check_names, check_time_limit, count_of, read_many, spread
from armtempo.envs.ik._env import REWARD_WEIGHTS, ik_cell, ik_spaces
from armtempo.envs.ik._observation import AHEAD, IKView, observe_ik
from armtempo.envs.ik._options import ActionMode
from armtempo.envs.ik._periods import IKEpisodes, look_ahead, make_drive, run_ik_periods
from armtempo.errors import ActionError, InputError
from armtempo.planners import IKCell
from armtempo.planners.cells import TargetFamilyName, draw_target
from armtempo.planners.ik.kernels import Targets as IKTargets

PER_THREAD = 4  # episodes that are worth a thread
FOREVER = 1e9  # ticks


class _TargetStore:
    """Targets of different lengths in one array each, (S, R, ...), at the physics ticks; grows as they need it."""

    def __init__(self, slots: int, joints: int, step: float) -> None:
        self._step = step
        self.starts: Floats = np.zeros((slots, joints))
        self.ticks = np.zeros(slots, dtype=np.int64)
        self._arrays: list[Floats] = [np.zeros((slots, 0, *shape)) for shape in ((3,), (3, 3), (3,), (3,))]

    @property
    def targets(self) -> IKTargets:
        """As the kernels read them: a row per tick."""
        position, rotation, velocity, turning = self._arrays
        return IKTargets(position, rotation, velocity, turning, 1, self._step)

    def put(self, slot: int, cell: IKCell) -> None:
        """The target and the start of ``cell``, instead of what is there."""
        target = cell.target
        rows = cell.ticks + 1
        missing = rows - self._arrays[0].shape[1]
        if missing > 0:
            self._arrays = [np.pad(a, [(0, 0), (0, missing), *[(0, 0)] * (a.ndim - 2)]) for a in self._arrays]
        given = (target.position, target.rotation, target.velocity, target.angular_velocity)
        for array, values in zip(self._arrays, given, strict=True):
            array[slot, :rows] = values[::2]
        self.starts[slot], self.ticks[slot] = cell.start, cell.ticks


@final
class FeedbackIKVectorEnv(VectorEnv[Floats32, Floats32, NDArray[Any]]):
    """E ``FeedbackIKEnv`` at once (``gymnasium.make_vec("armtempo/FeedbackIK-v0", num_envs=E)``), without physics.

    For n joints observations are (E, 3 n + 28), actions (E, n), or (E, 4) of ``gains``, rewards (E,). Environment k of
    seed s has the bits of a single one with ``physics="ideal"`` and seed s + k. Infos hold, at the end of an episode,
    ``is_success``, ``position_error_rms_mm`` and ``orientation_error_rms_rad``, after a reset
    ``duration_s``; arrays (E,) with a mask each (``_is_success``...), as Gymnasium has it. In ``SAME_STEP`` those of
    the end are in ``final_info``, the last observations in ``final_obs``.

    Drawing a target takes longer than some hundred steps. With ``targets`` so many are drawn when the environments are
    made, and episodes take one of them at random.

    Args:
        num_envs: E.
        cell: As in ``FeedbackIKEnv``.
        action_mode: As in ``FeedbackIKEnv``; so are those below that are not told here.
        family: Of the targets, or several: environments, or the ``targets``, take them in turn.
        targets: How many are drawn beforehand; None: one for every episode.
        target_seed: Of these.
        physics: ``ideal``.
        hold_periods: Control periods that are one step, with the same action, less at an episode's end; rewards are
            added up. For training: what gains do to an error shows seconds later.
        max_episode_s: Time limit [s].
        autoreset_mode: ``NEXT_STEP`` or ``SAME_STEP`` of Gymnasium's ``AutoresetMode``, or its value.
        threads: How many share the episodes; None: one per core, if there are episodes enough.

    Raises:
        InputError: Physics is ``bullet``: make that with ``vectorization_mode="sync"``.
        PathError: No target of a family suits the arm.
    """

    def __init__(
        self,
        num_envs: int = 1,
        cell: IKCell | str | Path = "chung",
        *,
        action_mode: ActionMode = "speeds",
        family: TargetFamilyName | Sequence[TargetFamilyName] = "given",
        targets: int | None = None,
        target_seed: int = 0,
        physics: Physics = "ideal",
        render_mode: str | None = None,
        hold_periods: int = 1,
        max_episode_s: float | None = None,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        threads: int | None = None,
    ) -> None:
        check_ideal(physics, render_mode)
        self.autoreset_mode = autoreset_of(autoreset_mode)
        check_time_limit(max_episode_s)
        self.num_envs = count_of(num_envs)
        families = (family,) if isinstance(family, str) else tuple(family)
        self.cell = ik_cell(cell, action_mode, families)
        self.family: tuple[TargetFamilyName, ...] = families
        self.metadata: dict[str, Any] = {"render_modes": [], "autoreset_mode": self.autoreset_mode}
        self.render_mode = None
        self.single_observation_space, self.single_action_space = ik_spaces(self.cell, action_mode)
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        longest = FOREVER if max_episode_s is None else (max_episode_s - 1e-9) / self.cell.physics_tick
        self._limit = math.ceil(min(max(longest, 1.0), FOREVER))
        self._hold = count_of(hold_periods, "hold_periods")
        E, n = self.num_envs, self.cell.arm.dof
        self._drive = make_drive(self.cell, by_gains=action_mode == "gains")
        self._store = self._stored(targets, target_seed)
        self._episodes = IKEpisodes(
            np.zeros(E, dtype=np.int64), np.zeros(E, dtype=np.int64), np.zeros((E, 3, n)), np.zeros((E, n)), np.ones(E),
            np.zeros((E, 6)), np.zeros((E, n)), np.zeros((E, 2)), np.zeros((E, 4)),
        )  # fmt: skip
        self._ahead: Floats = np.zeros((E, len(AHEAD), 6))
        self._over, self._begun = np.zeros(E, dtype=np.bool_), False
        self._generators = [seeding.np_random(None)[0] for _ in range(E)]
        fitting = max(1, min(os.cpu_count() or 1, E // PER_THREAD))
        count = fitting if threads is None else min(count_of(threads, "threads"), E)
        self._chunks = list(pairwise(np.linspace(0, E, count + 1).astype(int).tolist()))
        self._pool = ThreadPoolExecutor(count) if count > 1 else None

    def _stored(self, targets: int | None, seed: int) -> _TargetStore:
        """All targets that are drawn beforehand; or room for one per episode."""
        cell, given = self.cell, set(self.family) == {"given"}
        count = count_of(targets, "targets") if targets is not None else self.num_envs
        if not (isinstance(seed, int | np.integer) and seed >= 0):
            raise InputError(f"target_seed must be a whole number, 0 or more, got {seed!r}")
        if targets is not None and count < len(self.family):
            raise InputError(f"{count} targets for {len(self.family)} families", remedy="draw one of each at least")
        self._drawn_before = given or targets is not None
        store = _TargetStore(1 if given else count, cell.arm.dof, cell.physics_tick)
        random = np.random.default_rng(seed)
        for slot in range(len(store.ticks)) if self._drawn_before else ():
            store.put(slot, draw_target(cell, self.family[slot % len(self.family)], random))
        return store

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Floats32, dict[str, Any]]:
        """Begin new episodes.

        Args:
            seed: Environment k gets ``seed + k``, or a sequence of seeds.
            options: May give ``reset_mask`` (E,), which environments; the first time it is all of them.

        Raises:
            UnknownNameError: No such option.
            InputError: The mask, or seeds, are not one for each environment.
        """
        if self.closed:
            raise InputError("the environments are closed", remedy="make new ones")
        given = {} if options is None else options
        if not isinstance(given, Mapping):
            raise InputError(f"options must map names to values, got {given!r}", remedy="known: reset_mask")
        check_names(*(("reset option", name, ("reset_mask",)) for name in given))
        mask = given.get("reset_mask", np.ones(self.num_envs, dtype=np.bool_))
        if not (isinstance(mask, np.ndarray) and mask.dtype == bool and mask.shape == (self.num_envs,) and mask.any()):
            raise InputError("reset_mask must be an array of truth values, one per environment, not all False")
        begun = mask.copy() if self._begun else np.ones(self.num_envs, dtype=np.bool_)
        seeds = spread(seed, self.num_envs)
        if isinstance(seed, int | np.integer):
            self._np_random, self._np_random_seed = seeding.np_random(int(seed))
        for e in np.flatnonzero(begun).tolist():
            if seeds[e] is not None:
                self._generators[e] = seeding.np_random(seeds[e])[0]
        answer = self._begin(begun)
        self._begun = True
        return answer

    def _begin(self, begun: Bools) -> tuple[Floats32, dict[str, Any]]:
        episodes, store = self._episodes, self._store
        for e in np.flatnonzero(begun).tolist():
            slot, family, random = e, self.family[e % len(self.family)], self._generators[e]
            if not self._drawn_before:
                store.put(slot, draw_target(self.cell, family, random))
            else:
                slot = int(random.integers(len(store.ticks)))
            episodes.slot[e], episodes.tick[e] = slot, 0
            episodes.reference[e], episodes.hardness[e] = store.starts[slot], 1.0
            for array in (episodes.speeds, episodes.demand, episodes.squares, episodes.shares):
                array[e] = 0.0
        self._over[begun] = False
        q, now = np.ascontiguousarray(episodes.reference[:, 2]), episodes.tick[:, None]
        look_ahead(self.cell.arm.model, store.targets, episodes.slot, q, now, begun, episodes.error[:, None])
        duration = store.ticks[episodes.slot] * self.cell.physics_tick
        return self._observed(begun), {"duration_s": np.where(begun, duration, 0.0), "_duration_s": begun}

    def _observed(self, changed: Bools) -> Floats32:
        """What is seen now; of ``changed`` episodes what is ahead has to be looked at."""
        episodes, targets, cell = self._episodes, self._store.targets, self.cell
        slot, tick = episodes.slot, episodes.tick
        last = self._store.ticks[slot]
        q = np.ascontiguousarray(episodes.reference[:, 2])
        rows = np.minimum(tick[:, None] + cell.ticks_per_period * np.array(AHEAD), last[:, None])
        look_ahead(cell.arm.model, targets, slot, q, rows, changed, self._ahead)
        return observe_ik(cell, IKView(
            q, (q - episodes.reference[:, 1]) / cell.physics_tick, q, episodes.error, targets.velocity[slot, tick],
            targets.angular_velocity[slot, tick], self._ahead, cell.singular_value(q), episodes.demand, tick / last,
        ))  # fmt: skip

    def step(self, actions: ArrayLike) -> tuple[Floats32, Floats, Bools, Bools, dict[str, Any]]:
        """Run ``hold_periods``; environments whose episode was over begin anew instead (``NEXT_STEP``).

        Raises:
            ActionError: The actions are not (E, n) finite numbers, (E, 4) of ``gains``, or nothing was reset yet.
        """
        if self.closed:
            raise ActionError("the environments are closed", remedy="make new ones")
        if not self._begun:
            raise ActionError("no episode has begun", remedy="call reset before step")
        again = self._over.copy()
        self._run(read_many(actions, self.action_space.shape or ()), ~again)
        episodes, cell = self._episodes, self.cell
        duration = self._store.ticks[episodes.slot] * cell.physics_tick
        rewards = np.zeros(self.num_envs)
        for weight, share in zip(REWARD_WEIGHTS.values(), episodes.shares.T, strict=True):
            rewards += weight * (-share * cell.control_period / duration)
        rewards[again] = 0.0
        terminated = ~again & (episodes.tick >= self._store.ticks[episodes.slot])
        truncated = ~again & ~terminated & (episodes.tick >= self._limit)
        self._over = terminated | truncated
        infos: dict[str, Any] = {}
        observations = self._observed(~again)
        if again.any():
            observations, infos = self._begin(again)
        if self._over.any():
            ended = self._figures(terminated)
            if self.autoreset_mode == AutoresetMode.SAME_STEP:
                over = self._over.copy()
                infos |= {"final_obs": observations, "_final_obs": over, "final_info": ended, "_final_info": over}
                observations, begun = self._begin(over)
                infos |= begun
            else:
                infos |= ended
        return observations, rewards, terminated, truncated, infos

    def _run(self, actions: Floats, active: Bools) -> None:
        def part(first: int, last: int) -> None:
            run_ik_periods(
                self._drive, self._store.targets, self._store.ticks, self._episodes, first, last, active, actions,
                self.cell.ticks_per_period, self._hold, self._limit,
            )  # fmt: skip

        others = [] if self._pool is None else [self._pool.submit(part, *chunk) for chunk in self._chunks[1:]]
        part(*self._chunks[0])
        for other in others:
            other.result()

    def _figures(self, terminated: Bools) -> dict[str, Any]:
        over, config = self._over.copy(), self.cell.config
        position, orientation = np.sqrt(self._episodes.squares / np.maximum(self._episodes.tick, 1)[:, None]).T
        close = (position < config.error_scale_m) & (orientation < config.error_scale_rad)
        figures = {
            "is_success": terminated & close,
            "position_error_rms_mm": np.where(over, 1e3 * position, np.nan),
            "orientation_error_rms_rad": np.where(over, orientation, np.nan),
        }
        return figures | {f"_{name}": over for name in figures}

    def get_state(self) -> dict[str, NDArray[Any]]:
        """All that changes, as arrays; ``set_state`` of environments made alike goes on from there with the same bits.

        Raises:
            InputError: Nothing was reset yet, or targets are drawn for every episode.
        """
        random = json.dumps([one.bit_generator.state for one in self._generators]).encode()
        arrays = {name: array.copy() for name, array in (self._changing() | self._constant()).items()}
        return arrays | {"random": np.frombuffer(random, np.uint8)}

    def _changing(self) -> dict[str, NDArray[Any]]:
        if not (self._drawn_before and self._begun):
            raise InputError(
                "there is no state before a reset, nor where targets are drawn for every episode",
                remedy="call reset, or draw targets beforehand: targets=64",
            )
        return {**self._episodes._asdict(), "ahead": self._ahead, "over": self._over}

    def _constant(self) -> dict[str, NDArray[Any]]:
        """What tells these environments from others."""
        by_gains = np.array([self._drive.by_gains])
        return {"starts": self._store.starts, "ticks": self._store.ticks, "by_gains": by_gains}

    def set_state(self, state: dict[str, NDArray[Any]]) -> None:
        """Go on from ``get_state``, after a reset.

        Raises:
            InputError: It is the state of other environments, or these have none.
        """
        own = self._changing()
        for name, array in (own | self._constant()).items():
            if name not in state or state[name].shape != array.shape or state[name].dtype != array.dtype:
                raise self._misfit(name)
        for name, array in self._constant().items():
            if (state[name] != array).any():
                raise self._misfit(name)
        if "random" not in state:
            raise self._misfit("random")
        for name, array in own.items():
            array[...] = state[name]
        for one, drawn in zip(self._generators, json.loads(state["random"].tobytes()), strict=True):
            one.bit_generator.state = drawn

    def _misfit(self, name: str) -> InputError:
        return InputError(
            f"the state's {name} does not fit {self.num_envs} environments of {self.cell.name!r}",
            remedy="make them with the same arguments",
        )

    def close_extras(self, **_: Any) -> None:
        """End the threads."""
        if self._pool is not None:
            self._pool.shutdown()

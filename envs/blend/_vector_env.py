"""Many episodes on blended paths at once, without physics: Gymnasium's vector form of ``BlendTrackingEnv``."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, TypedDict, Unpack, final

from gymnasium.vector import AutoresetMode

from armtempo.envs.blend._batch import BlendBatch
from armtempo.envs.blend._observation import BLEND_ENTRIES
from armtempo.envs.blend._options import BlendOptions, MappingName
from armtempo.envs.bodies import Physics
from armtempo.envs.common import VectorBase, action_space, count_of, families_of, ideal_options, observation_space
from armtempo.planners import BlendCell
from armtempo.planners.cells import FamilyName, ProfileName, as_cell


class BlendVectorKeywords(TypedDict, total=False):
    """``BlendKeywords``, but with several families."""

    physics: Physics
    profile: ProfileName
    mapping: MappingName
    family: FamilyName | Sequence[FamilyName]
    model_error: float
    max_episode_s: float | None


@final
class BlendTrackingVectorEnv(VectorBase[BlendBatch]):
    """E ``BlendTrackingEnv`` at once (``gymnasium.make_vec("armtempo/BlendTracking-v0", num_envs=E)``), no physics.

    Observations (E, 15), actions (E, 1), rewards (E,). Environment k of seed s has the bits of a single one with
    ``physics="ideal"`` and seed s + k. Infos hold, at the end of an episode, ``is_success``, ``left`` and ``arrival_s``
    (nan: none), after a reset ``length_m``, ``duration_s`` and ``corners``; arrays (E,) with a mask each
    (``_is_success``...), as Gymnasium has it. In ``SAME_STEP`` those of the end are in ``final_info``, the last
    observations in ``final_obs``.

    Drawing a path takes longer than some hundred steps. With ``paths`` so many are drawn when the environments are
    made, and episodes take one of them at random. They are also quicker to step the fewer paths there are.

    Args:
        num_envs: E.
        cell: As in ``BlendTrackingEnv``.
        paths: How many are drawn beforehand; None: one for every episode.
        path_seed: Of these.
        render_mode: None: there are no pictures.
        autoreset_mode: ``NEXT_STEP`` or ``SAME_STEP`` of Gymnasium's ``AutoresetMode``, or its value.
        threads: How many share the episodes; None: one per core, if there are episodes enough.
        **options: As ``BlendOptions`` has them; ``physics`` is ``ideal``. ``family`` may be several: environments, or
            the ``paths``, take them in turn.

    Raises:
        InputError: Physics is ``bullet``: make that with ``vectorization_mode="sync"``.
        PathError: No path of a family can be followed.
    """

    def __init__(
        self,
        num_envs: int = 1,
        cell: BlendCell | str | Path = "lee2006",
        *,
        paths: int | None = None,
        path_seed: int = 0,
        render_mode: str | None = None,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        threads: int | None = None,
        **options: Unpack[BlendVectorKeywords],
    ) -> None:
        families = families_of(options.get("family", "given"))
        of_each: list[dict[str, Any]] = [{**options, "family": family} for family in families]
        checked, *_ = [ideal_options(BlendOptions, one, BlendTrackingVectorEnv, render_mode) for one in of_each]
        self.cell, self.family = as_cell(cell, BlendCell), families
        count = count_of(num_envs)
        batch = BlendBatch(
            self.cell, count, options=checked, families=families, paths=(paths, path_seed), threads=threads
        )
        seen, actions = observation_space(BLEND_ENTRIES), action_space()
        super().__init__(batch, count, seen=seen, actions=actions, autoreset_mode=autoreset_mode)

"""Many episodes of a pose that moves at once, without physics: Gymnasium's vector form of ``FeedbackIKEnv``."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, TypedDict, Unpack, final

from gymnasium.vector import AutoresetMode

from armtempo.envs.bodies import Physics
from armtempo.envs.common import VectorBase, count_of, families_of, ideal_options
from armtempo.envs.ik._batch import IKBatch
from armtempo.envs.ik._env import ik_spaces
from armtempo.envs.ik._options import ActionMode, IKOptions
from armtempo.planners import IKCell
from armtempo.planners.cells import TargetFamilyName, as_cell


class IKVectorKeywords(TypedDict, total=False):
    """``IKKeywords``, but with several families."""

    physics: Physics
    action_mode: ActionMode
    family: TargetFamilyName | Sequence[TargetFamilyName]
    model_error: float
    max_episode_s: float | None


@final
class FeedbackIKVectorEnv(VectorBase[IKBatch]):
    """E ``FeedbackIKEnv`` at once (``gymnasium.make_vec("armtempo/FeedbackIK-v0", num_envs=E)``), without physics.

    For n joints observations are (E, 3 n + 28), actions (E, n), or (E, 4) of ``gains``, rewards (E,). Environment k of
    seed s has the bits of a single one with ``physics="ideal"`` and seed s + k. Infos hold, at the end of an episode,
    ``is_success``, ``position_error_rms_m`` and ``orientation_error_rms_rad``, after a reset ``duration_s``; arrays
    (E,) with a mask each (``_is_success``...), as Gymnasium has it. In ``SAME_STEP`` those of the end are in
    ``final_info``, the last observations in ``final_obs``. (``position_error_rms_mm`` goes with the next release.)

    Drawing a target takes longer than some hundred steps. With ``targets`` so many are drawn when the environments are
    made, and episodes take one of them at random.

    Args:
        num_envs: E.
        cell: As in ``FeedbackIKEnv``.
        targets: How many are drawn beforehand; None: one for every episode.
        target_seed: Of these.
        render_mode: None: there are no pictures.
        hold_periods: Control periods that are one step, with the same action, less at an episode's end; rewards are
            added up. For training: what gains do to an error shows seconds later.
        autoreset_mode: ``NEXT_STEP`` or ``SAME_STEP`` of Gymnasium's ``AutoresetMode``, or its value.
        threads: How many share the episodes; None: one per core, if there are episodes enough.
        **options: As ``IKOptions`` has them; ``physics`` is ``ideal``. ``family`` may be several: environments, or the
            ``targets``, take them in turn.

    Raises:
        InputError: Physics is ``bullet``: make that with ``vectorization_mode="sync"``.
        PathError: No target of a family suits the arm.
    """

    def __init__(
        self,
        num_envs: int = 1,
        cell: IKCell | str | Path = "chung",
        *,
        targets: int | None = None,
        target_seed: int = 0,
        render_mode: str | None = None,
        hold_periods: int = 1,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        threads: int | None = None,
        **options: Unpack[IKVectorKeywords],
    ) -> None:
        families = families_of(options.get("family", "given"))
        of_each: list[dict[str, Any]] = [{**options, "family": family} for family in families]
        checked, *_ = [ideal_options(IKOptions, one, FeedbackIKVectorEnv, render_mode) for one in of_each]
        self.cell, self.family = as_cell(cell, IKCell), families
        count = count_of(num_envs)
        batch = IKBatch(
            self.cell, count, options=checked, families=families, targets=(targets, target_seed),
            hold_periods=hold_periods, threads=threads,
        )  # fmt: skip
        seen, actions = ik_spaces(self.cell, checked.action_mode)
        super().__init__(batch, count, seen=seen, actions=actions, autoreset_mode=autoreset_mode)

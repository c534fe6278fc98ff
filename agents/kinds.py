"""Every kind of cell that policies can be evaluated in, and the one way to do it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Unpack, overload

from armtempo.agents.blend import BlendKind, BlendResult
from armtempo.agents.coordination import CoordinationKind, CoordinationResult
from armtempo.agents.evaluation import Evaluation, Kind, OnEpisode, audited, check_audit, evaluate_kind, options_for
from armtempo.agents.ik import IKKind, IKResult
from armtempo.envs.blend import BlendKeywords, BlendOptions
from armtempo.envs.coordination import CoordinationKeywords, CoordinationOptions
from armtempo.envs.ik import IKKeywords, IKOptions
from armtempo.errors import InputError, UnknownNameError, brief
from armtempo.planners import BlendCell, CoordinationCell, IKCell
from armtempo.planners.cells import CellBase

CoordinationEvaluation = Evaluation[CoordinationCell, CoordinationOptions, CoordinationResult]
BlendEvaluation = Evaluation[BlendCell, BlendOptions, BlendResult]
IKEvaluation = Evaluation[IKCell, IKOptions, IKResult]

KINDS: dict[str, Kind[Any, Any, Any, Any]] = {
    "coordination": CoordinationKind(),
    "blend": BlendKind(),
    "ik": IKKind(),
}
"""By the ``kind`` of a cell's file."""


def kind_named(name: str) -> Kind[Any, Any, Any, Any]:
    """A kind of cell.

    Raises:
        UnknownNameError: There is none of that name.
    """
    if name not in KINDS:
        raise UnknownNameError("kind of cell", name, KINDS)
    return KINDS[name]


@overload
def evaluate(
    cell: CoordinationCell,
    policies: Sequence[str] | str | None = None,
    *,
    episodes: int = 1,
    seed: int = 0,
    options: CoordinationOptions | None = None,
    on_episode: OnEpisode | None = None,
    audit: bool = False,
    **keywords: Unpack[CoordinationKeywords],
) -> CoordinationEvaluation: ...
@overload
def evaluate(
    cell: BlendCell,
    policies: Sequence[str] | str | None = None,
    *,
    episodes: int = 1,
    seed: int = 0,
    options: BlendOptions | None = None,
    on_episode: OnEpisode | None = None,
    audit: bool = False,
    **keywords: Unpack[BlendKeywords],
) -> BlendEvaluation: ...
@overload
def evaluate(
    cell: IKCell,
    policies: Sequence[str] | str | None = None,
    *,
    episodes: int = 1,
    seed: int = 0,
    options: IKOptions | None = None,
    on_episode: OnEpisode | None = None,
    audit: bool = False,
    **keywords: Unpack[IKKeywords],
) -> IKEvaluation: ...
def evaluate(
    cell: CellBase[Any],
    policies: Sequence[str] | str | None = None,
    *,
    episodes: int = 1,
    seed: int = 0,
    options: Any = None,
    on_episode: OnEpisode | None = None,
    audit: bool = False,
    **keywords: Any,
) -> Evaluation[Any, Any, Any]:
    """Run every policy for some episodes, in a cell of any kind.

    Args:
        cell: Where.
        policies: Names of the cell's kind (``COORDINATION_POLICIES``, ``BLEND_POLICIES``, ``IK_POLICIES``), or of
            learned agents: ``ppo:path/to/file.npz``. None: all of the kind that have a plan here.
        episodes: Episodes per policy; where nothing is drawn, baselines other than ``random`` do the same in each.
        seed: Seed of the first episode; the following ones count up, and every policy meets the same episodes.
        options: What is asked of the episodes: ``CoordinationOptions``, ``BlendOptions``, ``IKOptions``.
        on_episode: Called with policy and episode number after each, for progress bars.
        audit: Ask the other physics engine what it makes of every tick of the first episode (``other_engine_rad``).
        keywords: Options by name, in place of those of ``options``.

    Raises:
        UnknownNameError: A policy or an option that does not exist in this kind of cell; the message lists those that
            do.
        InfeasibleError: A named policy has no plan in this cell.
        InputError: An option that an episode cannot have, an audit of ``ideal``, or a learned agent that is for
            something else, or whose file is damaged.
    """
    if not isinstance(cell, CellBase):
        raise InputError(f"evaluate needs a built cell, got {brief(cell)}", remedy="give one that load_cell returned")
    kind = kind_named(cell.kind)
    asked = options_for(kind, options, keywords)
    if audit:
        check_audit(asked)  # before hours of episodes
    evaluation = evaluate_kind(
        kind,
        cell,
        policies,
        asked,
        episodes=episodes,
        seed=seed,
        on_episode=on_episode,
    )
    return audited(evaluation) if audit else evaluation

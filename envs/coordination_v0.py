"""``coordination_v0``: several arms on given paths, one agent each; PettingZoo's usual entry points."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Unpack

from pettingzoo.utils.conversions import parallel_to_aec
from pettingzoo.utils.env import AECEnv

from armtempo.envs.coordination import CoordinationEnv, CoordinationKeywords, CoordinationVectorEnv
from armtempo.planners import CoordinationCell

__all__ = ["CoordinationEnv", "env", "parallel_env", "raw_env", "vector_env"]

parallel_env = CoordinationEnv
raw_env = CoordinationEnv
vector_env = CoordinationVectorEnv


def env(
    cell: CoordinationCell | str | Path = "lee1991",
    *,
    render_mode: str | None = None,
    record: bool = False,
    **options: Unpack[CoordinationKeywords],
) -> AECEnv[str, Any, Any]:
    """The same environment in turns (AEC); arguments as ``parallel_env``."""
    return parallel_to_aec(CoordinationEnv(cell, render_mode=render_mode, record=record, **options))

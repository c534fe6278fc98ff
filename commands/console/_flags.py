"""Flags that several commands have, and the checks of their values."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Literal

import tyro

from armtempo.errors import ArmtempoError, InputError, brief

TRAINING_SEED_MAX = 2**32 - 1
"""What numpy's older generators take, which the training libraries use."""
MOST_THINGS = 10**12

CellName = Annotated[tyro.conf.Positional[str], tyro.conf.arg(metavar="CELL")]
JsonFile = Annotated[str | None, tyro.conf.arg(name="json", metavar="FILE", help_behavior_hint="(default: none)")]
OutFolder = Annotated[
    Path | None, tyro.conf.arg(name="out", metavar="DIR", help_behavior_hint="(default: results/<cell>)")
]
Names = Annotated[tuple[str, ...], tyro.conf.arg(metavar="NAME ...")]
AllNames = Annotated[tuple[str, ...], tyro.conf.arg(metavar="NAME ...", help_behavior_hint="(default: all)")]
Seed = Annotated[int, tyro.conf.arg(metavar="K")]
PhysicsName = Literal["bullet", "mujoco", "ideal"]
DisturbanceName = Annotated[
    Literal["none", "late", "slow", "stop-and-go", "any", "all-late", "all-slow", "all-stop-and-go", "all-any"],
    tyro.conf.arg(metavar="NAME"),
]


def check_seed(seed: int | None, most: int = 2**63 - 1) -> None:
    """Raise ArmtempoError for a seed below 0, or too large for all that is seeded with it."""
    if seed is not None and seed < 0:
        raise ArmtempoError(f"--seed must not be negative, got {brief(seed)}", remedy="try --seed 0")
    if seed is not None and seed > most:
        raise ArmtempoError(f"--seed must be at most {most}, got {brief(seed)}", remedy="try --seed 0")


def check_count(option: str, count: int | None, example: int) -> None:
    """Raise ArmtempoError for a number of things below 1, or beyond counting."""
    if count is not None and not 1 <= count <= MOST_THINGS:
        bound = "at least 1" if count < 1 else f"at most {MOST_THINGS}"
        raise ArmtempoError(f"{option} must be {bound}, got {brief(count)}", remedy=f"try {option} {example}")


def check_period(option: str, period: float | None, example: str) -> None:
    """Refuse a period that is no step, before anything is computed.

    Raises:
        InputError: It is not a positive number of seconds.
    """
    if period is not None and not (math.isfinite(period) and period > 0.0):
        raise InputError(f"{option} must be a positive number of seconds, got {period}", remedy=f"try {example}")

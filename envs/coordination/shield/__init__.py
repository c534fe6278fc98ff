"""The shield: lets through only commands after which all arms can still stop and go on."""

from __future__ import annotations

from armtempo.envs.coordination.shield._batch import admit_all, draw_shielded
from armtempo.envs.coordination.shield._kernels import NOBODY_WAITS, Orders
from armtempo.envs.coordination.shield._shield import (
    EpisodeShield,
    Foresight,
    Shield,
    asked_orders,
    plan_of,
    shield_tables,
    shield_work,
)
from armtempo.envs.coordination.shield._trial import CHANNELS, REQUESTS, ShieldTrial, shield_trial
from armtempo.envs.coordination.shield._turning import keep_orders

__all__ = [
    "CHANNELS",
    "EpisodeShield",
    "Foresight",
    "NOBODY_WAITS",
    "Orders",
    "REQUESTS",
    "Shield",
    "ShieldTrial",
    "admit_all",
    "asked_orders",
    "draw_shielded",
    "keep_orders",
    "plan_of",
    "shield_tables",
    "shield_trial",
    "shield_work",
]

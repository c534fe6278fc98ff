"""The shield: lets through only commands after which all arms can still stop and go on."""

from __future__ import annotations

from armtempo.envs.coordination.shield._batch import admit_all, draw_shielded
from armtempo.envs.coordination.shield._shield import EpisodeShield, Shield, plan_of, shield_tables, shield_work
from armtempo.envs.coordination.shield._trial import REQUESTS, ShieldTrial, shield_trial

__all__ = [
    "EpisodeShield",
    "REQUESTS",
    "Shield",
    "ShieldTrial",
    "admit_all",
    "draw_shielded",
    "plan_of",
    "shield_tables",
    "shield_trial",
    "shield_work",
]

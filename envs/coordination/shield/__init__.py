"""The shield: lets through only commands after which all arms can still stop and go on."""

from __future__ import annotations

from armtempo.envs.coordination.shield._batch import admit_all, draw_shielded, note_all
from armtempo.envs.coordination.shield._deciding import (
    BETTER_SHARE,
    DECIDE_EVERY,
    OrderWork,
    hold_back_all,
    look_all,
)
from armtempo.envs.coordination.shield._episode_shield import EpisodeShield, plan_of
from armtempo.envs.coordination.shield._keeper import OrderKeeper
from armtempo.envs.coordination.shield._kernels import NOBODY_WAITS, Orders
from armtempo.envs.coordination.shield._shield import (
    Foresight,
    Shield,
    asked_orders,
    foreseen,
    shield_tables,
    shield_work,
)
from armtempo.envs.coordination.shield._stops_seen import StopsSeen, still_standing, stops_seen
from armtempo.envs.coordination.shield._trial import CHANNELS, REQUESTS, ShieldTrial, shield_trial
from armtempo.envs.coordination.shield._turning import keep_orders

__all__ = [
    "BETTER_SHARE",
    "DECIDE_EVERY",
    "CHANNELS",
    "EpisodeShield",
    "Foresight",
    "NOBODY_WAITS",
    "OrderKeeper",
    "OrderWork",
    "Orders",
    "REQUESTS",
    "Shield",
    "ShieldTrial",
    "StopsSeen",
    "admit_all",
    "asked_orders",
    "draw_shielded",
    "foreseen",
    "hold_back_all",
    "keep_orders",
    "look_all",
    "note_all",
    "plan_of",
    "shield_tables",
    "shield_trial",
    "shield_work",
    "still_standing",
    "stops_seen",
]

"""Compiled loops that other rooms call. Not public: they change without notice."""

from __future__ import annotations

from armtempo.planners.line_speed._feed_override import PackedFeed, advance_often, start_warp, turn
from armtempo.planners.line_speed._profile import profile_state

__all__ = ["PackedFeed", "advance_often", "profile_state", "start_warp", "turn"]

"""Speed along a blended path: the paper's profile, the limit-aware one, the feed override."""

from __future__ import annotations

from armtempo.planners.line_speed._feed_override import FeedOverride
from armtempo.planners.line_speed._limit_aware import limit_aware_profile
from armtempo.planners.line_speed._limits import LineSpeedLimits
from armtempo.planners.line_speed._profile import LineSpeedCertificate, LineSpeedProfile

__all__ = [
    "FeedOverride",
    "LineSpeedCertificate",
    "LineSpeedLimits",
    "LineSpeedProfile",
    "limit_aware_profile",
]

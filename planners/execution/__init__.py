"""Real arms on line: from where they are to speed scalings of their controllers. Public as ``armtempo.execution``."""

from __future__ import annotations

from armtempo.planners.execution._link import ArmState, LinkReport, SpeedScaling
from armtempo.planners.execution._online import OnlineExecution
from armtempo.planners.execution._udp import serve

__all__ = ["ArmState", "LinkReport", "OnlineExecution", "SpeedScaling", "serve"]

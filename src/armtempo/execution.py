"""Real arms on line: where they are in, speed scalings of their controllers out.

Every arm's controller runs the arm's fastest motion, its time slowed by a factor in [0, 1], as ros2_controllers' speed
scaling and the speed slider of Universal Robots do. ``OnlineExecution`` says the factors, so that arms that are late,
slow or stopped cost time and never a collision. ``docs/execution.md`` says how to connect it.
"""

from __future__ import annotations

from armtempo.planners.execution import ArmState, LinkReport, OnlineExecution, SpeedScaling, serve

__all__ = ["ArmState", "LinkReport", "OnlineExecution", "SpeedScaling", "serve"]

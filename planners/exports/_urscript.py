"""Motions as programs of Universal Robots' controllers: one ``servoj`` for every period, of one arm each."""

from __future__ import annotations

import json

import numpy as np

from armtempo.errors import InputError
from armtempo.planners.exports._robot_motion import RobotMotion

RATES_HZ = (500.0, 125.0)  # of e-Series controllers, and of CB3's
JOINTS = 6
LOOKAHEAD_S, GAIN = 0.03, 1000  # least delay and a stiff loop, within servoj's 0.03 to 0.2 s and 100 to 2000
START_WITHIN_RAD = 0.01
STOP_RAD_S2 = 4.0

HEAD = """def {name}():
  # {arm} of {joints} over {duration:.3f} s, by armtempo. All arms' programs share one clock: start them together.
  def armtempo_event(name, gripper):
    textmsg("armtempo event: ", name)  # drive your gripper here; it must not take time
  end
  q = get_actual_joint_positions()
  if {away}:
    popup("not at the start of the motion", title="armtempo", error=True, blocking=True)
    halt
  end
"""


def urscript(motion: RobotMotion, arm: int) -> str:
    """The program of one arm, which stops unless the arm is at the start of its motion.

    Raises:
        InputError: The arm is no UR, by its joints, or the rate is not that of its controller.
    """
    robot, own = motion.arms[arm], motion.motions[arm]
    if robot.dof != JOINTS or robot.model.prismatic.any():
        raise InputError(
            f"URScript drives six revolute joints, and arm {robot.name!r} has {robot.dof} joints",
            remedy="export it as joint-trajectory",
        )
    period = float(np.diff(own.time).mean())
    rate = next((rate for rate in RATES_HZ if abs(rate * period - 1.0) < 1e-6), None)
    if rate is None:
        raise InputError(
            f"URScript runs at 500 Hz (e-Series) or 125 Hz (CB3), not at {1.0 / period:g} Hz",
            remedy="give --rate-hz 500",
        )
    start = own.q[0].tolist()
    away = " or ".join(f"norm(q[{j}] - {_number(value)}) > {START_WITHIN_RAD}" for j, value in enumerate(start))
    head = HEAD.format(
        name="armtempo_motion", arm=_comment(robot.name), joints=_comment(", ".join(own.joint_names)),
        duration=motion.duration, away=away,
    )  # fmt: skip
    settings = f"t={1.0 / rate:g}, lookahead_time={LOOKAHEAD_S:g}, gain={GAIN}"
    events = [event for event in motion.events if event.arm == robot.name]
    lines = []
    for time, q in zip(own.time[1:].tolist(), own.q[1:].tolist(), strict=True):
        while events and events[0].time < time:
            lines.append(f"  armtempo_event({_text(events[0].name)}, {_text(events[0].gripper or '')})")
            events.pop(0)
        lines.append(f"  servoj([{', '.join(map(_number, q))}], {settings})")
    lines += [f"  armtempo_event({_text(event.name)}, {_text(event.gripper or '')})" for event in events]
    return head + "\n".join([*lines, f"  stopj({STOP_RAD_S2:g})", "end", ""])


def _number(value: float) -> str:
    """To a billionth of a radian, without an exponent."""
    return f"{value + 0.0:.9f}"


def _text(value: str) -> str:
    """A string, as scripts have it: no escapes, no quotes inside."""
    return json.dumps(value.encode("ascii", "replace").decode().replace('"', "'").replace("\\", "/"))


def _comment(value: str) -> str:
    return " ".join(value.encode("ascii", "replace").decode().split())

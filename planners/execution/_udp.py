"""The link as UDP datagrams, for controllers that speak no ROS."""

from __future__ import annotations

import socket
import time
from typing import Any

from armtempo.errors import InputError
from armtempo.planners.execution._link import ArmState
from armtempo.planners.execution._online import OnlineExecution

LARGEST_DATAGRAM = 256  # bytes; states have 48


def serve(execution: OnlineExecution, channel: socket.socket, *, timeout_s: float) -> bool:
    """Answer states over a bound UDP socket, once per control period, until all arms have arrived.

    An answer goes to where the arm's last state came from. Datagrams that are no states are left alone.

    Args:
        execution: Of a schedule.
        channel: Datagrams of ``ArmState.to_bytes`` in, of ``SpeedScaling.to_bytes`` out.
        timeout_s: After which it gives up [s].

    Returns:
        Whether all arms have arrived.
    """
    begin = due = time.monotonic()
    sources: dict[int, Any] = {}
    while not execution.arrived:
        due = max(due + execution.period, time.monotonic())
        if due - begin > timeout_s:
            return False
        while (left := due - time.monotonic()) > 0.0:
            channel.settimeout(left)
            try:
                data, source = channel.recvfrom(LARGEST_DATAGRAM)
                state = ArmState.from_bytes(data)
                if execution.report(state):
                    sources[state.arm] = source
            except (TimeoutError, BlockingIOError, InputError):
                continue
        for scaling in execution.scalings():
            channel.sendto(scaling.to_bytes(), sources[scaling.arm])
    return True

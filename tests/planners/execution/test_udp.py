"""Over a loopback socket, against controllers in another process on their own 500 Hz clock, with jitter and loss.

``ARMTEMPO_LINK_RUNS`` says how many disturbed runs (``make link``: 200); ``pytest -s`` prints latency and loss.
"""

from __future__ import annotations

import json
import os
import socket
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from armtempo.execution import OnlineExecution, serve
from armtempo.planners import Schedule
from tests.planners.execution import controller
from tests.planners.execution.conftest import fast_rows, too_close

RUNS = int(os.environ.get("ARMTEMPO_LINK_RUNS", "6"))
HOLD_S, STOP_S, LOSS, JITTER_S, TIMEOUT_S = 0.05, 0.1, 0.1, 0.002, 30.0


def run_over_udp(
    plan: Schedule, seed: int, folder: Path
) -> tuple[OnlineExecution, dict[str, Any], np.ndarray[Any, Any]]:
    """One disturbed run; our side, what the other process tells, and places at all of its ticks."""
    generator, fast = np.random.default_rng(seed), fast_rows(plan.cell)
    longest = max(float(rows[-1, 0]) for rows in fast)
    paces = {f"pace_{i}": controller.disturbed(generator, longest) for i in range(len(fast))}
    file = folder / f"{seed}.npz"
    task: dict[str, Any] = {
        "seed": seed, "arms": len(fast), "hold_s": HOLD_S, "stop_s": STOP_S, "loss": LOSS, "jitter_s": JITTER_S,
        "timeout_s": TIMEOUT_S, **paces, **{f"fast_{i}": rows for i, rows in enumerate(fast)},
    }  # fmt: skip
    np.savez(file, **task)
    online = OnlineExecution(plan, hold_s=HOLD_S, stop_s=STOP_S)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as channel:
        channel.bind(("127.0.0.1", 0))
        command = [sys.executable, str(controller.__file__), str(file), str(channel.getsockname()[1])]
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
            assert serve(online, channel, timeout_s=2.0 * TIMEOUT_S)
            told = json.loads(process.communicate(timeout=TIMEOUT_S)[0])
    return online, told, np.load(file.with_suffix(".out.npz"))["places"]


@pytest.mark.parametrize("seed", range(RUNS))
def test_no_disturbed_run_over_a_bad_link_comes_too_close(
    seed: int, plans: dict[str, Schedule], tmp_path: Path
) -> None:
    name = ("lee1991", "mixed-priority")[seed % 2]
    online, told, places = run_over_udp(plans[name], seed, tmp_path)
    assert told["arrived"]
    assert too_close(plans[name].cell, places) == 0
    assert all(link.received > 10 for link in online.links.values())
    link = max(online.links.values(), key=lambda one: one.loss_percent)
    sys.stdout.write(
        f"\n{name} {seed}: {told['time_s']:.3f} s (plan {plans[name].makespan:.3f}), round trip mean "
        f"{1e3 * told['round_trip_mean_s']:.1f} max {1e3 * told['round_trip_max_s']:.1f} ms, lost {told['lost']}, too "
        f"late {told['dropped']}, states lost or late {link.loss_percent:.0f} %, emergencies "
        f"{sum(one.emergencies for one in online.links.values())}, late ticks {told['late_ticks']}"
    )


def test_a_silent_controller_is_given_up(plans: dict[str, Schedule]) -> None:
    with (
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as channel,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger,
    ):
        channel.bind(("127.0.0.1", 0))
        stranger.sendto(b"hello", channel.getsockname())
        assert not serve(OnlineExecution(plans["lee1991"]), channel, timeout_s=0.1)

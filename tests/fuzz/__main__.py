"""``python -m tests.fuzz``: tries damaged inputs, prints what came of them, ends with 1 if one was a fault."""

from __future__ import annotations

import argparse
import json
import logging
import os
import sys
import tempfile
from collections.abc import Callable
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Any

os.environ.setdefault("ARMTEMPO_CACHE", "off")

from tests.fuzz import _environments, _files
from tests.fuzz._harness import Fuzzer, Outcome, fuzz, summary


def _late(module: str, name: str, folder: Path) -> Fuzzer:
    """From a module that is imported where it is used: torch."""
    made: Callable[[Path], Fuzzer] = getattr(__import__(f"tests.fuzz.{module}", fromlist=[name]), name)
    return made(folder)


FUZZERS: dict[str, tuple[Callable[[Path], Any], int]] = {
    "cell": (_files.cell_files, 6),
    "train": (_files.training_files, 12),
    "sweep": (_files.sweep_files, 6),
    "urdf": (_files.urdf_files, 16),
    "waypoints": (_files.waypoint_files, 12),
    "trajectories": (_files.trajectory_files, 12),
    "agents": (_files.agent_files, 12),
    "instances": (_files.instance_files, 5),
    "checkpoints": (partial(_late, "_checkpoints", "checkpoint_files"), 5),
    "journals": (partial(_late, "_journals", "journal_files"), 2),
    "commands": (partial(_late, "_command_line", "command_lines"), 2),
    "coordination": (_environments.environment("armtempo/Coordination-v0", parallel=True), 4),
    "yielding": (_environments.environment("armtempo/Yielding-v0"), 3),
    "yielding-many": (_environments.environment("armtempo/Yielding-v0", many=True), 2),
    "blend": (_environments.environment("armtempo/BlendTracking-v0"), 1),
    "blend-many": (_environments.environment("armtempo/BlendTracking-v0", many=True), 1),
    "ik": (_environments.environment("armtempo/FeedbackIK-v0"), 1),
    "ik-many": (_environments.environment("armtempo/FeedbackIK-v0", many=True), 1),
}
"""By name: how one starts, and its share of the inputs in percent."""


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz", description=__doc__)
    parser.add_argument("names", nargs="*", help=f"fuzzers; all: {', '.join(FUZZERS)}")
    parser.add_argument("--count", type=int, default=3000, help="inputs of all fuzzers together")
    parser.add_argument("--first", type=int, default=0, help="number of the first input of each")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--kept", type=Path, default=Path("out/fuzz"), help="folder for inputs that were faults")
    parser.add_argument("--json", type=Path, help="write what came of it there")
    given = parser.parse_args()
    if unknown := sorted(set(given.names) - set(FUZZERS)):
        parser.error(f"no fuzzer {unknown[0]!r}; known: {', '.join(FUZZERS)}")
    return given


def main() -> int:
    given = _arguments()
    logging.disable(logging.WARNING)  # thousands of them
    names = given.names or list(FUZZERS)
    shares = sum(FUZZERS[name][1] for name in names)
    outcomes: list[Outcome] = []
    for name in names:
        start, share = FUZZERS[name]
        numbers = range(given.first, given.first + max(1, given.count * share // shares))
        with tempfile.TemporaryDirectory() as folder:
            outcomes.append(fuzz(name, start, numbers, given.seed, given.kept.resolve(), Path(folder)))
        sys.stdout.write(outcomes[-1].told())
        sys.stdout.flush()
    sys.stdout.write(f"{summary(outcomes)}\n")
    if given.json is not None:
        given.json.write_text(json.dumps([asdict(one) for one in outcomes]), encoding="utf-8")
    return int(any(one.faults for one in outcomes))


if __name__ == "__main__":
    sys.exit(main())

"""``armtempo bench``: planning methods, their time over the number of arms, learned agents, heavier arms."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from armtempo.commands.bench._agents import bench_agents
from armtempo.commands.bench._arms import bench_arms
from armtempo.commands.bench._coordination import bench_coordination
from armtempo.commands.bench._errors import bench_errors

__all__ = ["BENCHES", "bench"]

BENCHES: Mapping[str, Callable[..., None]] = {
    "coordination": bench_coordination,
    "arms": bench_arms,
    "agents": bench_agents,
    "errors": bench_errors,
}
"""What there is to measure, by name."""


def bench() -> None:
    """Benchmarks: coordination (all methods on a set of cells), arms (time over their number), agents, errors."""
    # for the list of commands; main dispatches the line itself

"""``armtempo bench errors``: arms that are heavier than planned, under the shield."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from functools import partial
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
import tyro

from armtempo.commands.console import JsonFile, Names, Output, kept_results, new_table, number
from armtempo.errors import InfeasibleError, InputError

if TYPE_CHECKING:
    from rich.table import Table

    from armtempo.envs import CoordinationEnv
    from armtempo.planners import CoordinationCell

POLICIES = ("full-speed", "random")
Shares = Annotated[tuple[float, ...], tyro.conf.arg(metavar="SHARE ...")]


def bench_errors(
    *,
    cells: Names = ("mixed-priority",),
    rings: int = 2,
    seed: int = 7,
    errors: Shares = (0.02, 0.05, 0.1),
    reserves: Shares = (0.0, 0.05, 0.1),
    episodes: Annotated[int, tyro.conf.arg(metavar="N")] = 50,
    json_file: JsonFile = None,
) -> None:
    """Run arms that are heavier than planned, at full speed and at random under the shield, in PyBullet.

    Off and along: largest distance of a tip from its path, and from its place on it, at the ends of control periods.
    Lost: mean makespan above that of the same episodes without error and torque reserve, on the paths exactly. In every
    episode the first arm is late, slow, or stops and goes.

    Args:
        cells: Bundled cells, or files.
        rings: Generated rings of three arms besides: the first feasible ones of the seed.
        seed: The generator's.
        errors: By what shares bodies are heavier.
        reserves: Torque reserves that the cells are planned with.
        episodes: Per cell, error, reserve and policy.
        json_file: Write the same figures there as JSON, units in the keys; "-" for nothing but JSON on stdout.
    """
    from armtempo.planners import build_cell, load_cell  # late, as the others here: --help is to be quick

    if episodes < 1 or rings < 0:
        raise InputError(f"--episodes must be positive and --rings not negative, got {episodes} and {rings}")
    output = Output(json_file)
    chosen = [load_cell(name) for name in cells]
    chosen += _feasible_rings(rings, seed)
    entries: list[dict[str, Any]] = []
    total = len(chosen) * (1 + len(errors)) * len(reserves) * len(POLICIES)
    arguments = {"cells": [cell.config.model_dump(mode="json") for cell in chosen], "episodes": episodes}
    with (
        kept_results("bench errors", arguments) as kept,
        output.progress("Simulating", total) as (progress, task),
    ):
        output.taken_over(kept)
        for k, base in enumerate(chosen):
            progress.update(task, description=f"Simulating {base.name}")
            exact = {
                policy: kept.result(f"{k} {base.name} {policy}", partial(_makespans, base, policy, episodes))
                for policy in POLICIES
            }
            for reserve in reserves:
                cell = build_cell(base.config.model_copy(update={"torque_reserve": reserve}))
                for error, policy in itertools.product((0.0, *errors), POLICIES):
                    unit = f"{k} {base.name} {policy} {reserve} {error}"
                    entries.append(kept.result(unit, partial(_entry, cell, error, policy, exact[policy])))
                    progress.advance(task)
    output.table(_tabulate(entries, episodes))
    output.json({"seed": seed, "episodes": episodes, "runs": entries})


def _feasible_rings(count: int, seed: int) -> list[CoordinationCell]:
    """The first rings of three arms that are feasible."""
    from armtempo.planners import generate_cell

    drawn = (generate_cell("ring", seed, index, arms=3) for index in itertools.count())
    return [ring.cell for ring in itertools.islice((one for one in drawn if one.labels.status == "feasible"), count)]


def _makespans(cell: CoordinationCell, policy: str, episodes: int) -> list[float]:
    """Of the episodes on the paths exactly [s]."""
    from armtempo.envs import CoordinationEnv

    env = CoordinationEnv(cell, physics="ideal", shield=True, disturbance="any")
    try:
        return [run[0] for run in _run(env, policy, episodes)]
    finally:
        env.close()


def _entry(cell: CoordinationCell, error: float, policy: str, exact: Sequence[float]) -> dict[str, Any]:
    """What became of one policy with bodies of one error."""
    from armtempo.envs import CoordinationEnv
    from armtempo.planners.cells import needed_torque_reserve

    entry: dict[str, Any] = {
        "cell": cell.name,
        "model_error": error,
        "torque_reserve": cell.torque_reserve,
        "needed_torque_reserve": needed_torque_reserve(cell, error),
        "policy": policy,
        "refused": None,
    }
    try:
        env = CoordinationEnv(cell, physics="bullet", shield=True, disturbance="any", model_error=error)
    except InfeasibleError as refusal:
        return entry | {"refused": refusal.message}
    try:
        runs = list(_run(env, policy, len(exact)))
    finally:
        env.close()
    makespan, violated, off, along, clipped = (np.array(values) for values in zip(*runs, strict=True))
    arrived = np.isfinite(makespan)
    return entry | {
        "violations": int(violated.sum()),
        "not_arrived": int((~arrived).sum()),
        "off_path_m": float(off.max()),
        "along_path_m": float(along.max()),
        "clipped_share": float(clipped.mean()),
        "makespan_s": float(makespan[arrived].mean()) if arrived.any() else None,
        "lost_share": float((makespan / exact)[arrived].mean() - 1.0) if arrived.any() else None,
    }


def _run(env: CoordinationEnv, policy: str, episodes: int) -> Iterator[tuple[float, bool, float, float, float]]:
    """Per episode its makespan [s], whether arms came too close, largest errors off and along [m], share clipped."""
    simulation = env.simulation
    for episode in range(episodes):
        generator = np.random.default_rng(episode)
        env.reset(seed=episode)
        off = along = 0.0
        clipped = periods = 0
        while env.agents:
            drawn = generator.uniform(-1.0, 1.0, (env.num_agents, 1)).astype(np.float32)
            asked = np.ones_like(drawn) if policy == "full-speed" else drawn
            env.step(dict(zip(env.agents, asked, strict=True)))
            if simulation.physics != "ideal":
                errors = simulation.path_errors()
                off, along = max(off, float(errors[0].max())), max(along, float(errors[1].max()))
                clipped, periods = clipped + simulation.clipped, periods + 1
        yield float(np.max(simulation.arrival)), simulation.violated, off, along, clipped / max(periods, 1)


def _tabulate(entries: Sequence[dict[str, Any]], episodes: int) -> Table:
    table = new_table(
        f"Bodies heavier than planned, under the shield ({episodes} episodes each)",
        "the first arm disturbed; errors and clipping in the last ticks of control periods; "
        "lost: to the paths exactly, with no reserve",
    )
    for head in ("cell", "error\n\\[%]", "reserve\n\\[%]", "needed\n\\[%]", "policy", "too close", "not there"):
        table.add_column(head, justify="left" if head in ("cell", "policy") else "right")
    for head in ("off path\n\\[mm]", "along it\n\\[mm]", "clipped\n\\[%]", "makespan\n\\[s]", "lost\n\\[%]"):
        table.add_column(head, justify="right")
    for e in entries:
        shares = [number(100.0 * e[k], 2) for k in ("model_error", "torque_reserve", "needed_torque_reserve")]
        if e["refused"] is not None:
            table.add_row(e["cell"], *shares, e["policy"], "refused")
            continue
        lost = None if e["lost_share"] is None else 100.0 * e["lost_share"]
        table.add_row(
            e["cell"], *shares, e["policy"], str(e["violations"]), str(e["not_arrived"]),
            number(1e3 * e["off_path_m"], 3), number(1e3 * e["along_path_m"], 3), number(100.0 * e["clipped_share"], 2),
            number(e["makespan_s"], 4), number(lost, 2),
        )  # fmt: skip
    return table

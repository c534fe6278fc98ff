"""``armtempo cells``: what cells there are, or one of them in numbers."""

from __future__ import annotations

from itertools import combinations
from typing import TYPE_CHECKING, Annotated, Any

import tyro

from armtempo.commands._output import JsonFile, Output, new_table, number, open_cell, shown

if TYPE_CHECKING:
    from armtempo.planners import Cell


def cells(
    cell: Annotated[tyro.conf.Positional[str | None], tyro.conf.arg(metavar="[CELL]", help_behavior_hint="")] = None,
    *,
    json_file: JsonFile = None,
) -> None:
    """List the cells that come with armtempo, or show one and check that its arms can do their paths.

    `armtempo cells generate --help` explains how to make random ones.

    Args:
        cell: A bundled cell's name, or your own YAML file: show its arms, limits, path lengths, minimum times and
            clearances. Without it: list the bundled cells.
        json_file: Write the same figures there as JSON, units in the keys; "-" for nothing but JSON on stdout.
    """
    output = Output(json_file)
    if cell is None:
        _list(output)
    else:
        _show(open_cell(cell, output), output)


def _list(output: Output) -> None:
    from armtempo.configs import bundled_cells, load_cell_config

    table = new_table("Bundled cells", "armtempo cells CELL shows one; your own YAML file goes wherever a name does")
    table.add_column("cell", style="bold", no_wrap=True)
    table.add_column("arms", justify="right")
    table.add_column("d_min\n\\[mm]", justify="right")
    table.add_column("what it shows")
    entries = []
    for name in bundled_cells():
        config = load_cell_config(name)
        table.add_row(name, str(len(config.arms)), f"{1e3 * config.d_min_m:g}", shown(config.description))
        entries.append(
            {
                "cell": name,
                "description": config.description,
                "arms": [arm.name for arm in config.arms],
                "d_min_m": config.d_min_m,
                "file": str(config.source),
            }
        )
    output.table(table)
    output.json(entries)


CLASSES = {
    "free": "The arms do not meet at full speed.",
    "uniform": "One arm goes first everywhere: a start delay is optimal.",
    "mixed": "Each arm must go first somewhere, or yield on the way: timing must be shaped.",
    "infeasible": "No timing keeps the arms apart.",
}


def describe(cell: Cell) -> dict[str, Any]:
    """A cell in numbers, units in the keys; clearances are None for a single arm."""
    between = {}
    for where, share in (("start", 0.0), ("end", 1.0)):
        q = [path.evaluate(share * path.length)[0] for path in cell.paths]
        between[f"clearance_at_{where}_m"] = cell.clearance.arms(q).distance if len(cell.arms) > 1 else None
    arms = []
    for arm, path, fastest, holdable in zip(cell.arms, cell.paths, cell.fastest, cell.holdable, strict=True):
        arms.append(
            {
                "name": arm.name,
                "urdf": str(arm.urdf),
                "joints": arm.dof,
                "base_m": arm.T_world_base[:3, 3],
                "torque_limit_nm": arm.torque_max,
                "speed_limit_rad_s": arm.speed_max,
                f"path_length_{path.unit}": path.length,
                "minimum_time_s": fastest.duration,
                "holdable": holdable,
                "torque_ratio_max": fastest.certificate.torque_ratio_max,
                f"peak_path_speed_{path.unit}_s": float(fastest.mu.max()),
            }
        )
    charts = [cell.chart_between(*pair) for pair in combinations(range(len(cell.arms)), 2)]
    return {
        "cell": cell.name,
        "description": cell.config.description,
        "file": str(cell.config.source),
        "d_min_m": cell.d_min,
        "clearance_reserve_m": cell.config.clearance_reserve_m,
        "physics_tick_s": cell.physics_tick,
        "control_period_s": cell.control_period,
        **between,
        "obstacles": [obstacle.name for obstacle in cell.config.obstacles],
        "sequential_s": cell.sequential_makespan,
        "lower_bound_s": cell.lower_bound,
        "priority_class": cell.priority_class if len(cell.arms) > 1 else None,
        "collision_regions": sum(chart.regions for chart in charts) if charts else None,
        "arms": arms,
    }


def _show(cell: Cell, output: Output) -> None:
    with output.progress(f"Measuring {cell.name}"):
        facts = describe(cell)
    table = new_table(
        shown(f"{cell.name}: {cell.config.description}"), "arms in priority order: the first is the master"
    )
    table.add_column("arm", style="bold", no_wrap=True)
    for head in ("robot", "base x, y, z\n\\[m]"):
        table.add_column(head)
    for head in (
        "torque limits\n\\[N m]",
        "path",
        "minimum\ntime \\[s]",
        "peak torque\n\\[x limit]",
        "peak speed",
    ):
        table.add_column(head, justify="right")
    for arm, path, entry in zip(cell.arms, cell.paths, facts["arms"], strict=True):
        unit = path.unit
        table.add_row(
            shown(arm.name),
            shown(arm.urdf.stem),
            ", ".join(f"{x:g}" for x in entry["base_m"]),
            ", ".join(f"{x:g}" for x in entry["torque_limit_nm"]),
            f"{number(entry[f'path_length_{unit}'], 4)} {unit}",
            number(entry["minimum_time_s"], 4),
            number(entry["torque_ratio_max"], 4),
            f"{number(entry[f'peak_path_speed_{unit}_s'], 2)} {unit}/s",
        )
    output.table(table)
    if len(cell.arms) > 1:
        output.say(
            f"Clearance where they start {number(facts['clearance_at_start_m'], 1, 1e3)} mm, where they end "
            f"{number(facts['clearance_at_end_m'], 1, 1e3)} mm; required d_min {1e3 * cell.d_min:g} mm, "
            f"plans keep {1e3 * cell.config.clearance_reserve_m:g} mm more."
        )
        sequential, bound = facts["sequential_s"], facts["lower_bound_s"]
        line = f"One after the other {number(sequential, 4)} s"
        possible = bound < float("inf")
        line += f"; no timing is quicker than {number(bound, 4)} s (certified)" if possible else ""
        line += "" if possible else " without regard to each other; [red]no timing at all keeps d_min (certified)[/]"
        output.say(f"{line}.")
        output.say(CLASSES[facts["priority_class"]])
    still = [entry["name"] for entry in facts["arms"] if not entry["holdable"]]
    if still:
        output.say(f"Cannot hold still everywhere on the path: {', '.join(still)}.")
    bodies = "obstacles and of the arms' own links" if cell.obstacles else "the arms' own links"
    output.say(f"Certified: the paths keep clear of {bodies}. File: {shown(cell.config.source)}")
    output.json(facts)

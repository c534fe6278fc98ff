"""``armtempo cells``: what cells there are, or one of them in numbers."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from itertools import combinations
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
import tyro

from armtempo.commands.console import JsonFile, Output, find_bound, new_table, number, open_cell, shown
from armtempo.commands.reports import gain_warning, gain_x_period

if TYPE_CHECKING:
    from armtempo.planners import BlendCell, CoordinationCell, IKCell


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
        opened = open_cell(cell, output)
        SHOWN[opened.kind](opened, output)


def _list(output: Output) -> None:
    # late: pydantic; --help is to be quick
    from armtempo.configs import AnyCellConfig, SharedSpaceConfig, bundled_cells, load_cell_config

    table = new_table("Bundled cells", "armtempo cells CELL shows one; your own YAML file goes wherever a name does")
    table.add_column("cell", style="bold", no_wrap=True)
    table.add_column("kind", no_wrap=True)
    table.add_column("arms", justify="right")
    table.add_column("d_min\n\\[mm]", justify="right")
    table.add_column("what it shows")
    entries = []
    for name in bundled_cells():
        config: AnyCellConfig = load_cell_config(name)
        d_min = config.d_min_m if isinstance(config, SharedSpaceConfig) else None
        distance = "–" if d_min is None else f"{1e3 * d_min:g}"
        table.add_row(name, config.kind, str(len(config.arms)), distance, shown(config.description))
        entries.append(
            {
                "cell": name,
                "kind": config.kind,
                "description": config.description,
                "arms": [arm.name for arm in config.arms],
                "d_min_m": d_min,
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


def describe_coordination(cell: CoordinationCell) -> dict[str, Any]:
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
        "start_delays": _start_delays(cell) if len(cell.arms) > 1 else None,
        "collision_regions": sum(chart.regions for chart in charts) if charts else None,
        "rules": list(dict.fromkeys(rule.rule for rule in cell.exclusions)),
        "arms": arms,
    }


def _start_delays(cell: CoordinationCell) -> dict[str, Any]:
    """Start delays in the best order of the arms, and in that of the file."""
    from armtempo.errors import InfeasibleError  # late, as the others: --help is to be quick
    from armtempo.planners import schedule

    out: dict[str, Any] = {}
    orders: tuple[Literal["best", "file"], ...] = ("best", "file")
    for which in orders:
        try:
            plan = schedule(cell, "delay", order=which)
        except InfeasibleError:
            out[which] = None
            continue
        out[which] = {"order": [cell.arms[i].name for i in plan.order], "makespan_s": plan.makespan}
    return out


def _best_order(facts: dict[str, Any]) -> str:
    """Which order of the arms start delays are best in, and what that gains."""
    best, own = facts["start_delays"]["best"], facts["start_delays"]["file"]
    if best is None:
        return "In no order of the arms do start delays alone keep them apart."
    line = f"Start delays are best with {' before '.join(shown(arm) for arm in best['order'])}"
    line += f": {number(best['makespan_s'], 4)} s"
    if own is None:
        return f"{line}; in the order of the file there is no such plan."
    return line + (f", {number(own['makespan_s'], 4)} s as in the file." if own != best else ", as in the file.")


def _show_coordination(cell: CoordinationCell, output: Output) -> None:
    with output.progress(f"Measuring {cell.name}") as (progress, task):
        find_bound(cell, lambda words: progress.update(task, description=words))
        facts = describe_coordination(cell)
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
            ", ".join(_torque(x) for x in entry["torque_limit_nm"]),
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
        output.say(_best_order(facts))
        for rule in facts["rules"]:
            output.say(f"Rule: {shown(rule)}.")
    still = [entry["name"] for entry in facts["arms"] if not entry["holdable"]]
    if still:
        output.say(f"Cannot hold still everywhere on the path: {', '.join(still)}.")
    bodies = "obstacles and of the arms' own links" if cell.obstacles else "the arms' own links"
    output.say(f"Certified: the paths keep clear of {bodies}. File: {shown(cell.config.source)}")
    output.json(facts)


def describe_blend(cell: BlendCell) -> dict[str, Any]:
    """A blend cell in numbers, units in the keys."""
    blended, limits, blend = cell.blended, cell.limits, cell.config.blend
    pieces = []
    for k, piece in enumerate(blended.pieces):
        low, high = blended.breakpoints[k : k + 2]
        entry: dict[str, Any] = {"kind": type(piece).__name__.lower(), "length_m": high - low}
        entry["start_s"], entry["end_s"] = (float(t) for t in cell.line_speed.time_at([low, high]))
        entry["curvature_max_1_m"] = float(blended.curvature(np.linspace(low, high, 401)[1:-1]).max())
        pieces.append(entry)
    return {
        "cell": cell.name,
        "kind": "blend",
        "description": cell.config.description,
        "file": str(cell.config.source),
        "physics_tick_s": cell.physics_tick,
        "control_period_s": cell.control_period,
        "robot": str(cell.arm.urdf),
        "elbow": cell.config.arm.elbow,
        "start_rad": cell.config.arm.path.start_rad,
        "torque_limit_nm": cell.arm.torque_max,
        "speed_limit_rad_s": cell.arm.speed_max,
        "curve": blend.curve,
        "length_m": blended.length,
        "pieces": pieces,
        "corner_distance_m": blended.deviation,
        "continuity": blended.continuity,
        "line_speed_m_s": limits.speed,
        "acceleration_limit_m_s2": limits.acceleration,
        "normal_acceleration_limit_m_s2": limits.normal,
        "jerk_limit_m_s3": limits.jerk,
        "line_speed_duration_s": cell.line_speed.duration,
        "limit_aware_duration_s": cell.limit_aware.duration,
    }


def _show_blend(cell: BlendCell, output: Output) -> None:
    with output.progress(f"Measuring {cell.name}"):
        facts = describe_blend(cell)
    normal = facts["normal_acceleration_limit_m_s2"]
    elbow = facts["elbow"]
    branch = f"{cell.arm.dof} joints" if elbow is None else f"elbow {elbow}"
    table = new_table(
        shown(f"{cell.name}: {cell.config.description}"),
        f"arm {shown(cell.arm.urdf.stem)}, {branch}; times at line speed {cell.limits.speed:g} m/s",
    )
    table.add_column("piece", style="bold", no_wrap=True)
    for head in ("length\n\\[mm]", "from\n\\[s]", "to\n\\[s]", "curvature\n\\[1/m]", "normal acc.\n\\[x limit]"):
        table.add_column(head, justify="right")
    for piece in facts["pieces"]:
        table.add_row(
            piece["kind"],
            number(piece["length_m"], 2, 1e3),
            number(piece["start_s"], 4),
            number(piece["end_s"], 4),
            number(piece["curvature_max_1_m"], 2),
            number(piece["curvature_max_1_m"] * cell.limits.speed**2 / normal, 2),
        )
    output.table(table)
    output.say(
        f"{number(facts['length_m'], 2, 1e3)} mm take {number(facts['line_speed_duration_s'], 4)} s at line speed, "
        f"{number(facts['limit_aware_duration_s'], 4)} s within the limits across the path too."
    )
    jumps = [k + 1 for k, order in enumerate(facts["continuity"]) if order < 2]
    if jumps:
        where = ", ".join(f"{1e3 * cell.blended.breakpoints[k]:.1f}" for k in jumps)
        output.say(f"The curvature jumps at {where} mm: what keeps the jerk has to stop there.")
    output.say(f"Certified: the path keeps clear of the arm's own links. File: {shown(cell.config.source)}")
    output.json(facts)


def describe_ik(cell: IKCell) -> dict[str, Any]:
    """An IK cell in numbers, units in the keys; errors and speeds are those of the law's own run, tick by tick."""
    run, target, law = cell.nominal, cell.target, cell.config.law
    speed, turning = (np.linalg.norm(rate, axis=1).max() for rate in (target.velocity, target.angular_velocity))
    return {
        "cell": cell.name,
        "kind": "ik",
        "description": cell.config.description,
        "file": str(cell.config.source),
        "physics_tick_s": cell.physics_tick,
        "control_period_s": cell.control_period,
        "robot": str(cell.arm.urdf),
        "joints": cell.arm.dof,
        "joint_names": list(cell.arm.joint_names),
        "start_rad": cell.start,
        "torque_limit_nm": cell.arm.torque_max,
        "speed_limit_rad_s": cell.arm.speed_max,
        "duration_s": cell.duration,
        "target_speed_max_m_s": float(speed),
        "target_turning_max_rad_s": float(turning),
        "position_gain_1_s": law.position_gain_1_s,
        "approach_gain_1_s": law.approach_gain_1_s,
        "normal_gain_1_s": law.normal_gain_1_s,
        "gain_x_period_max": gain_x_period(cell),
        "damping": law.damping,
        "task_rows": len(cell.solver.task),
        "position_error_start_m": float(run.position_error[0]),
        "orientation_error_start_rad": float(run.orientation_error[0]),
        "position_error_max_m": float(run.position_error.max()),
        "orientation_error_max_rad": float(run.orientation_error.max()),
        "joint_speed_max_rad_s": np.abs(run.qd).max(axis=0),
        "singular_value_min": float(cell.singular_value(run.q).min()),
        "shares": run.share,
    }


def _show_ik(cell: IKCell, output: Output) -> None:
    with output.progress(f"Measuring {cell.name}"):
        facts = describe_ik(cell)
    arm = cell.arm
    table = new_table(
        shown(f"{cell.name}: {cell.config.description}"),
        f"arm {shown(arm.urdf.stem)}; peak speeds are those of the law's own run along the target",
    )
    table.add_column("joint", style="bold", no_wrap=True)
    for head in ("start", "range", "speed\ncap", "peak\nspeed", "torque limit\n\\[N m]"):
        table.add_column(head, justify="right")
    for j, name in enumerate(arm.joint_names):
        table.add_row(
            shown(name),
            number(float(cell.start[j]), 4),
            f"{arm.position_min[j]:.3g} to {arm.position_max[j]:.3g}",
            number(float(arm.speed_max[j]), 2),
            number(float(facts["joint_speed_max_rad_s"][j]), 3),
            _torque(arm.torque_max[j]),
        )
    output.table(table)
    output.say(
        f"The target lasts {number(facts['duration_s'], 2)} s and moves at up to "
        f"{number(facts['target_speed_max_m_s'], 3)} m/s and {number(facts['target_turning_max_rad_s'], 3)} rad/s. "
        f"The law alone stays within {1e3 * facts['position_error_max_m']:.2g} mm of it; the smallest singular value "
        f"on the way is {number(facts['singular_value_min'], 3)}, damped is below {facts['damping']:g}."
    )
    if warning := gain_warning(cell):
        output.say(f"[red]{warning}[/]")
    output.say(
        "Looked at, not certified: at postures of that run the drives can hold the arm, and it does not touch itself. "
        f"File: {shown(cell.config.source)}"
    )
    output.json(facts)


def _torque(limit: float) -> str:
    from armtempo.robots import UNLIMITED

    return "–" if limit >= UNLIMITED else f"{limit:g}"


SHOWN: Mapping[str, Callable[[Any, Output], None]] = {
    "coordination": _show_coordination,
    "blend": _show_blend,
    "ik": _show_ik,
}
"""By kind of cell."""

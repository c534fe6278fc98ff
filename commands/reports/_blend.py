"""``armtempo evaluate`` of a blend cell: how well policies hold line speed, path and limits."""

from __future__ import annotations

from typing import TYPE_CHECKING

from armtempo.commands.console import Output, new_table, number
from armtempo.commands.reports._one_arm import Report, circumstances

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.figure import Figure

    from armtempo.agents import BlendEvaluation

OVER = 1.0 + 1e-3  # share of a limit from which the table prints it red: what ticks can resolve


def _tabulate(evaluation: BlendEvaluation, output: Output) -> None:
    cell, limits = evaluation.cell, evaluation.cell.limits
    paths = circumstances(evaluation.family, evaluation.episodes, evaluation.model_error, "paths")
    table = new_table(
        f"{cell.name} in simulation ({evaluation.physics}, tick {1e3 * cell.physics_tick:g} ms, "
        f"decision every {1e3 * cell.control_period:g} ms{paths})",
        f"line speed {limits.speed:g} m/s, slowest and errors (along the path, from point to point) inside the blends; "
        f"shares of limits: normal acceleration {limits.normal:.4g} m/s^2, jerk {limits.jerk:g} m/s^3, joint torques",
    )
    table.add_column("policy", no_wrap=True)
    for head in (
        "plan\n\\[s]",
        "simul.\n\\[s]",
        "slowest\n\\[mm/s]",
        "arc err.\n\\[mm/s]",
        "chord err.\n\\[mm/s]",
        "contour\n\\[mm]",
        "normal\n\\[x]",
        "jerk\n\\[x]",
        "torque\n\\[x]",
        "reward",
        "done",
        "left",
    ):
        table.add_column(head, justify="right")

    def share(ratio: float) -> str:
        return f"[red]{number(ratio, 3)}[/]" if ratio > OVER else number(ratio, 3)

    for name, r in evaluation.results.items():
        table.add_row(
            name,
            number(r.plan_duration_s, 3),
            number(r.duration_s, 3),
            number(r.blend_speed_min_m_s, 0, 1e3),
            _error(r.arc_speed_error_max_m_s),
            _error(r.chord_speed_error_max_m_s),
            _error(r.contour_error_max_m),
            share(r.normal_acceleration_ratio_max),
            share(r.jerk_ratio_max),
            share(r.torque_demand_ratio_max),
            number(r.reward, 3),
            f"{r.finished}/{evaluation.episodes}"
            if r.finished == evaluation.episodes
            else f"[bold red]{r.finished}/{evaluation.episodes}[/]",
            f"[bold red]{r.left}[/]" if r.left else "0",
        )
    output.table(table)
    output.say(reading(evaluation))


def _error(value: float | None) -> str:
    """An error in thousandths of its unit; what would be zero to three digits says how small it is."""
    if value is None or value == 0.0 or value >= 5e-7:
        return number(value, 3, 1e3)
    return f"{1e3 * value:.0e}" if value >= 1e-10 else "<1e-7"


def reading(evaluation: BlendEvaluation) -> str:
    """What the table says, in a sentence or two."""
    results, limits = evaluation.results, evaluation.cell.limits
    said = []
    if (r := results.get("line-speed")) is not None and r.duration_s is not None:
        said.append(
            f"line-speed holds {1e3 * limits.speed:g} mm/s through the corners at "
            f"{number(r.normal_acceleration_ratio_max, 1)} x the limit of the normal acceleration"
        )
    keeping = {
        name: r
        for name, r in results.items()
        if r.finished == evaluation.episodes
        and max(r.normal_acceleration_ratio_max, r.jerk_ratio_max, r.torque_demand_ratio_max) <= OVER
    }
    if keeping:
        quickest = min(keeping, key=lambda name: keeping[name].duration_s or 0.0)
        text = f"{quickest} keeps all limits in {number(keeping[quickest].duration_s, 3)} s"
        if "constant" in keeping and quickest != "constant":
            text += f" (at a constant rate: {number(keeping['constant'].duration_s, 3)} s)"
        said.append(text)
    return "; ".join(said) + "." if said else "No policy arrived within its limits."


def _policies() -> Sequence[str]:
    from armtempo.agents import BLEND_POLICIES

    return BLEND_POLICIES


def _figures(evaluation: BlendEvaluation) -> dict[str, Figure]:
    from armtempo.commands.figures._blend import evaluation_figures

    return evaluation_figures(evaluation)


blend_report = Report(policies=_policies, tabulate=_tabulate, figures=_figures)

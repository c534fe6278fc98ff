"""Reports of blend cells: how well policies hold line speed, path and limits."""

from __future__ import annotations

from typing import TYPE_CHECKING

from armtempo.commands.console import LIMIT_RESOLVED, number
from armtempo.commands.reports._report import Report, one_arm_suffix, reasons

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from armtempo.agents import BlendEvaluation


def title_suffix(evaluation: BlendEvaluation) -> str:
    """Random paths, heavier bodies."""
    return one_arm_suffix(evaluation, "paths")


def caption(evaluation: BlendEvaluation) -> str:
    """Where speeds and errors are those of, and the limits."""
    limits = evaluation.cell.limits
    return (
        f"line speed {limits.speed:g} m/s, slowest and errors (along the path, from point to point) inside the blends; "
        f"shares of limits: normal acceleration {limits.normal:.4g} m/s^2, jerk {limits.jerk:g} m/s^3, joint torques"
    )


def summary_sentence(evaluation: BlendEvaluation) -> str:
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
        and max(r.normal_acceleration_ratio_max, r.jerk_ratio_max, r.torque_demand_ratio_max) <= LIMIT_RESOLVED
    }
    if keeping:
        quickest = min(keeping, key=lambda name: keeping[name].duration_s or 0.0)
        text = f"{quickest} keeps all limits in {number(keeping[quickest].duration_s, 3)} s"
        if "constant" in keeping and quickest != "constant":
            text += f" (at a constant rate: {number(keeping['constant'].duration_s, 3)} s)"
        said.append(text)
    return f"{'; '.join(said)}." if said else f"No policy arrived within its limits: {reasons(_why_not(evaluation))}."


def _why_not(evaluation: BlendEvaluation) -> dict[str, list[str]]:
    """The policies that did not arrive within the limits, by what stood in their way."""
    found: dict[str, list[str]] = {}
    for name, r in evaluation.results.items():
        shares = {
            "the normal acceleration": r.normal_acceleration_ratio_max,
            "the jerk": r.jerk_ratio_max,
            "a torque": r.torque_demand_ratio_max,
        }
        limit = max(shares, key=lambda what: shares[what])
        if r.left:
            why = f"left the tube around the path ({1e3 * r.contour_error_max_m:.3g} mm off)"
        elif r.finished < evaluation.episodes:
            why = "did not arrive in time"
        else:
            why = f"asked for {shares[limit]:.3g} x the limit of {limit}"
        found.setdefault(why, []).append(name)
    return found


def figures(evaluation: BlendEvaluation) -> dict[str, Figure]:
    """Path, speeds, accelerations, torques."""
    from armtempo.commands.figures._blend import evaluation_figures

    return evaluation_figures(evaluation)


BLEND_REPORT = Report(title_suffix=title_suffix, caption=caption, summary_sentence=summary_sentence, figures=figures)

"""Reports of IK cells: how closely policies follow the target, and at what cost."""

from __future__ import annotations

from typing import TYPE_CHECKING

from armtempo.commands.console import significant
from armtempo.commands.reports._report import Report, one_arm_suffix

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from armtempo.agents import IKEvaluation
    from armtempo.planners import IKCell

LARGEST_SETTLING_PRODUCT = (
    2.0  # of gain and period with which errors die out: a period multiplies them by 1 - gain x period
)


def gain_x_period(cell: IKCell) -> float:
    """The largest gain of the law times the control period."""
    law = cell.law
    turning = (law.approach_gain_1_s, law.normal_gain_1_s)[: 1 if law.error == "quaternion" else 2]
    gains = (law.position_gain_1_s, *(turning if cell.solver.task[:, 3:].any() else ()))
    return max(gains) * cell.control_period


def gain_warning(cell: IKCell) -> str:
    """A sentence where the gains are too high for the control period, else nothing."""
    product = gain_x_period(cell)
    if product <= LARGEST_SETTLING_PRODUCT:
        return ""
    return (
        f"The largest gain x period is {product:.3g}: above {LARGEST_SETTLING_PRODUCT:g} a law that decides every "
        f"{1e3 * cell.control_period:g} ms makes its errors grow; lower the gains or the period."
    )


def title_suffix(evaluation: IKEvaluation) -> str:
    """Random targets, heavier bodies."""
    return one_arm_suffix(evaluation, "targets")


def caption(evaluation: IKEvaluation) -> str:
    """Whose errors these are, and what the heads mean."""
    cell = evaluation.cell
    position, orientation = cell.error_scales
    product = f"{gain_x_period(cell):.3g}"
    product = f"[bold red]{product}[/]" if gain_warning(cell) else product
    return (
        f"errors of a law that decides every {1e3 * cell.control_period:g} ms, largest gain x period {product}; "
        f"damped: share of the time below a singular value of {cell.damping:g}; "
        "cut: share in which a cap or limit cut what was asked for; "
        f"good: rms errors below {1e3 * position:g} mm and {orientation:g} rad"
    )


def summary_sentence(evaluation: IKEvaluation) -> str:
    """What the table says, in a sentence or two."""
    results = evaluation.results
    said = []
    plain, fed = results.get("feedback"), results.get("feedback-ff")
    if plain is not None and fed is not None:
        more = plain.position_error_rms_m / fed.position_error_rms_m
        said.append(f"feed-forward makes the rms position error {significant(more)} times smaller")
    best = max(results, key=lambda name: results[name].reward)
    if len(results) > 1:
        said.append(f"the highest return is that of {best}")
    lost = [name for name, r in results.items() if r.orientation_error_max_rad > 1.0 and name != "random"]
    if lost:
        said.append(f"{', '.join(lost)} lost the orientation by more than 1 rad on the way")
    text = "; ".join(said)
    text = f"{text[:1].upper()}{text[1:]}." if text else ""
    return " ".join(filter(None, (gain_warning(evaluation.cell), text)))


def figures(evaluation: IKEvaluation) -> dict[str, Figure]:
    """Path, errors, joint speeds, torques."""
    from armtempo.commands.figures._ik import evaluation_figures

    return evaluation_figures(evaluation)


IK_REPORT = Report(title_suffix=title_suffix, caption=caption, summary_sentence=summary_sentence, figures=figures)

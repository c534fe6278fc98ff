"""``armtempo evaluate`` of an IK cell: how closely policies follow its target, and at what cost."""

from __future__ import annotations

from typing import TYPE_CHECKING

from armtempo.commands.console import Output, new_table, number
from armtempo.commands.reports._one_arm import Report, circumstances

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.figure import Figure

    from armtempo.agents import IKEvaluation
    from armtempo.planners import IKCell

OVER = 1.0 + 1e-3  # share of a limit from which the table prints it red: what ticks can resolve
SETTLING = 2.0  # largest gain x period with which errors die out: a period multiplies them by 1 - gain x period


def gain_x_period(cell: IKCell) -> float:
    """The largest gain of the law times the control period."""
    law = cell.config.law
    turning = (law.approach_gain_1_s, law.normal_gain_1_s)[: 1 if law.error == "quaternion" else 2]
    gains = (law.position_gain_1_s, *(turning if cell.solver.task[:, 3:].any() else ()))
    return max(gains) * cell.control_period


def unsettled(cell: IKCell) -> str:
    """A sentence where the gains are too high for the control period, else nothing."""
    product = gain_x_period(cell)
    if product <= SETTLING:
        return ""
    return (
        f"The largest gain x period is {product:.3g}: above {SETTLING:g} a law that decides every "
        f"{1e3 * cell.control_period:g} ms makes its errors grow; lower the gains or the period."
    )


def _tabulate(evaluation: IKEvaluation, output: Output) -> None:
    cell, config = evaluation.cell, evaluation.cell.config
    given = circumstances(evaluation.family, evaluation.episodes, evaluation.model_error, "targets")
    product = f"{gain_x_period(cell):.3g}"
    product = f"[bold red]{product}[/]" if unsettled(cell) else product
    table = new_table(
        f"{cell.name} in simulation ({evaluation.physics}, tick {1e3 * cell.physics_tick:g} ms, "
        f"decision every {1e3 * cell.control_period:g} ms{given})",
        f"errors of a law that decides every {1e3 * cell.control_period:g} ms, largest gain x period {product}; "
        f"damped: share of the time below a singular value of {config.law.damping:g}; "
        "cut: share in which a cap or limit cut what was asked for; "
        f"good: rms errors below {1e3 * config.error_scale_m:g} mm and {config.error_scale_rad:g} rad",
    )
    table.add_column("policy", no_wrap=True)
    for head in (
        "position\nrms \\[mm]",
        "\nmax",
        "\nfinal",
        "orient.\nrms \\[rad]",
        "\nmax",
        "speed\n\\[x cap]",
        "torque\n\\[x limit]",
        "damped\n\\[%]",
        "cut\n\\[%]",
        "reward",
        "good",
    ):
        table.add_column(head, justify="right")
    for name, r in evaluation.results.items():
        torque = number(r.torque_demand_ratio_max, 3)
        good = f"{r.succeeded}/{evaluation.episodes}"
        table.add_row(
            name,
            _digits(1e3 * r.position_error_rms_m),
            _digits(1e3 * r.position_error_max_m),
            _digits(1e3 * r.position_error_final_m),
            _digits(r.orientation_error_rms_rad),
            _digits(r.orientation_error_max_rad),
            number(r.joint_speed_ratio_max, 3),
            f"[red]{torque}[/]" if r.torque_demand_ratio_max > OVER else torque,
            number(r.damped_fraction, 1, 100.0),
            number(r.capped_fraction, 1, 100.0),
            number(r.reward, 4),
            good if r.succeeded == evaluation.episodes else f"[bold red]{good}[/]",
        )
    output.table(table)
    output.say(reading(evaluation))


def _digits(value: float) -> str:
    """Three digits that count; no more zeros than a reader can see through."""
    return f"{value:.1e}" if 0.0 < value < 1e-3 else f"{value:.3g}"


def reading(evaluation: IKEvaluation) -> str:
    """What the table says, in a sentence or two."""
    results = evaluation.results
    said = []
    plain, fed = results.get("feedback"), results.get("feedback-ff")
    if plain is not None and fed is not None:
        more = plain.position_error_rms_m / fed.position_error_rms_m
        said.append(f"feed-forward makes the rms position error {_digits(more)} times smaller")
    best = max(results, key=lambda name: results[name].reward)
    if len(results) > 1:
        said.append(f"the highest return is that of {best}")
    lost = [name for name, r in results.items() if r.orientation_error_max_rad > 1.0 and name != "random"]
    if lost:
        said.append(f"{', '.join(lost)} lost the orientation by more than 1 rad on the way")
    text = "; ".join(said)
    text = f"{text[:1].upper()}{text[1:]}." if text else ""
    return " ".join(filter(None, (unsettled(evaluation.cell), text)))


def _policies() -> Sequence[str]:
    from armtempo.agents import IK_POLICIES

    return IK_POLICIES


def _figures(evaluation: IKEvaluation) -> dict[str, Figure]:
    from armtempo.commands.figures._ik import evaluation_figures

    return evaluation_figures(evaluation)


ik_report = Report(policies=_policies, tabulate=_tabulate, figures=_figures)

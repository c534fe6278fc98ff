"""``armtempo evaluate`` of an IK cell: how closely policies follow its target, and at what cost."""

from __future__ import annotations

from typing import TYPE_CHECKING

from armtempo.commands._evaluate_one_arm import Report, circumstances
from armtempo.commands._output import Output, new_table, number

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.figure import Figure

    from armtempo.agents import IKEvaluation

OVER = 1.0 + 1e-3  # share of a limit from which the table prints it red: what ticks can resolve


def _tabulate(evaluation: IKEvaluation, output: Output) -> None:
    cell, config = evaluation.cell, evaluation.cell.config
    given = circumstances(evaluation.family, evaluation.episodes, evaluation.model_error, "targets")
    table = new_table(
        f"{cell.name} in simulation ({evaluation.physics}, tick {1e3 * cell.physics_tick:g} ms, "
        f"decision every {1e3 * cell.control_period:g} ms{given})",
        f"errors of a law that decides every {1e3 * cell.control_period:g} ms, gain x period "
        f"{config.law.position_gain_1_s * cell.control_period:.3g}; damped: share of the time below a singular value "
        f"of {config.law.damping:g}; cut: share in which a cap or limit cut what was asked for; good: rms errors below "
        f"{1e3 * config.error_scale_m:g} mm and {config.error_scale_rad:g} rad",
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
        said.append(f"{best} has the highest return")
    lost = [name for name, r in results.items() if r.orientation_error_max_rad > 1.0 and name != "random"]
    if lost:
        said.append(f"{', '.join(lost)} lost the orientation by more than 1 rad on the way")
    text = "; ".join(said)
    return f"{text[:1].upper()}{text[1:]}." if text else ""


def _policies() -> Sequence[str]:
    from armtempo.agents import IK_POLICIES

    return IK_POLICIES


def _figures(evaluation: IKEvaluation) -> dict[str, Figure]:
    from armtempo.commands._ik_figures import evaluation_figures

    return evaluation_figures(evaluation)


ik_report = Report(policies=_policies, tabulate=_tabulate, figures=_figures)

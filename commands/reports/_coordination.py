"""Reports of cells of several arms: makespans against one arm after the other and the certified bound."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from typing import TYPE_CHECKING, Any

from armtempo.commands.console import number
from armtempo.commands.reports._report import Report, heavier, reasons

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from armtempo.agents import CoordinationEvaluation, CoordinationResult
    from armtempo.planners import CoordinationCell

TOO_CLOSE, RULE_BROKEN = "too close", "against a rule between arms"
TIED_MAKESPANS = 1e-4  # [s] makespans this close share the bold print
TOLD_ELSEWHERE = ("physics", "mode", "master_late_s", "model_error")  # options that the title tells in its own words


def title_suffix(evaluation: CoordinationEvaluation) -> str:
    """What was asked of the episodes."""
    from armtempo.agents import asked_options

    options = evaluation.options
    late = f"; master late by {_milliseconds(options.master_late_s)} ms" if options.master_late_s else ""
    asked = {name: value for name, value in asked_options(options).items() if name not in TOLD_ELSEWHERE}
    others = "".join(f"; {_said(name, value)}" for name, value in asked.items())
    several = f"; {evaluation.episodes} episodes" if evaluation.episodes > 1 else ""
    return late + others + heavier(options.model_error) + several


def _said(name: str, value: Any) -> str:
    """An option of the evaluation in the words of the command."""
    what = name.replace("_", " ")
    return what if value is True else f"{what} {_value(value)}"


def _value(value: Any) -> str:
    """A number or a range of them, or a name."""
    return " to ".join(f"{end:g}" for end in value) if isinstance(value, tuple) else str(value)


def _milliseconds(late: float | tuple[float, float]) -> str:
    return _value(tuple(1e3 * end for end in late)) if isinstance(late, tuple) else f"{1e3 * late:g}"


def caption(evaluation: CoordinationEvaluation) -> str:
    """What makespans and clearances are held against."""
    cell = evaluation.cell
    said = f"d_min {1e3 * cell.d_min:g} mm, plans keep {1e3 * cell.clearance_reserve:g} mm more"
    if evaluation.options.on_the_way:
        return said
    return (
        f"certified lower bound {cell.lower_bound:.4f} s; one after the other {cell.sequential_makespan:.4f} s; {said}"
    )


def _finished(results: Mapping[str, CoordinationResult]) -> dict[str, CoordinationResult]:
    """The policies that arrived without coming too close, quickest first."""
    good = [(name, r) for name, r in results.items() if r.makespan_s is not None and not r.violations]
    return dict(sorted(good, key=lambda item: item[1].makespan_s or 0.0))


def _why_not(cell: CoordinationCell, results: Mapping[str, CoordinationResult]) -> dict[str, list[str]]:
    """The policies that did not finish, by what stood in their way."""
    from armtempo.envs.bodies import SETTLED_DISTANCE

    found: dict[str, list[str]] = {}
    for name, r in results.items():
        if r.violations:
            why = "came closer than d_min" if _mishap(cell, r) == TOO_CLOSE else "broke a rule between arms"
        elif r.path_error_max_m > SETTLED_DISTANCE:
            why = f"left the path by {1e3 * r.path_error_max_m:.3g} mm (torque up to {r.torque_demand_ratio_max:.3g} x)"
        else:
            why = "did not arrive in time"
        found.setdefault(why, []).append(name)
    return found


def best(evaluation: CoordinationEvaluation) -> Collection[str]:
    """The quickest that are safe."""
    good = {name: r.makespan_s for name, r in _finished(evaluation.results).items() if r.makespan_s is not None}
    least = min(good.values(), default=0.0)
    return [name for name, makespan in good.items() if makespan <= least + TIED_MAKESPANS]


def summary_sentence(evaluation: CoordinationEvaluation) -> str:
    """What who knows beforehand takes, where that is known, and what the table says."""
    known = evaluation.facts["clairvoyant_s"]
    ahead = ""
    if known:
        ahead = f"Who knows beforehand what happens to the first arm takes {sum(known) / len(known):.4f} s (mean).\n"
    return ahead + _best_ones(evaluation) + _about_the_arms(evaluation)


def _best_ones(evaluation: CoordinationEvaluation) -> str:
    """The best on-line policy and the best of all, of those that finished every episode; how many did not."""
    text = ""
    for what, name in (("on line", evaluation.facts["best_online"]), ("of all", evaluation.facts["best"])):
        if name is not None:
            text += f"{'best' if text else 'Best'} {what}: {name} ({evaluation.results[name].makespan_s:.4f} s); "
    text = f"{text[:-2]}.\n" if text else ""
    missing = {name: evaluation.episodes - r.finished for name, r in evaluation.results.items() if r.finished}
    unfinished = [f"{name} {count}" for name, count in missing.items() if count]
    if unfinished:
        text += f"Not finished, and counted as the time limit: {', '.join(unfinished)} of {evaluation.episodes}.\n"
    return text


def _about_the_arms(evaluation: CoordinationEvaluation) -> str:
    """What the table says, in a sentence: about vci where it is among those that finished, else about the quickest."""
    good = _finished(evaluation.results)
    if not good:
        return f"No policy finished: {reasons(_why_not(evaluation.cell, evaluation.results))}."
    name = "vci" if "vci" in good else next(iter(good))
    r = good[name]
    assert r.makespan_s is not None
    text = f"{name} needs {r.makespan_s:.3f} s"
    if r.saving_percent is not None and abs(r.saving_percent) >= 0.5:
        verb = "saves" if r.saving_percent > 0 else "loses"
        text = f"{name} {verb} {abs(r.saving_percent):.0f} % against one arm after the other ({r.makespan_s:.3f} s"
        text += f" instead of {evaluation.cell.sequential_makespan:.3f} s)"
    if r.gap_percent is not None:
        text += f", {number(r.gap_percent, 1)} % above the certified lower bound"
    quickest = next(iter(good))
    rival = good[quickest].makespan_s
    if rival is not None and quickest != name and rival < r.makespan_s - TIED_MAKESPANS:
        gap = good[quickest].gap_percent
        text += f" ({quickest}, the quickest: " + (f"{rival:.3f} s)" if gap is None else f"{number(gap, 1)} %)")
    wrong = {name: _mishap(evaluation.cell, r) for name, r in evaluation.results.items() if r.violations}
    by_kind = [(what, [name for name, why in wrong.items() if why == what]) for what in (TOO_CLOSE, RULE_BROKEN)]
    told = " ".join(f"{what.capitalize()}: {', '.join(names)}." for what, names in by_kind if names)
    return f"{text}. {told or 'No arm ever came closer than d_min.'}"


def _mishap(cell: CoordinationCell, result: CoordinationResult) -> str:
    """What ended an episode: arms too close, or where a rule between them forbids it."""
    near = result.min_clearance_m
    return TOO_CLOSE if near is not None and near < cell.d_min else RULE_BROKEN


def evaluation_figures(evaluation: CoordinationEvaluation) -> dict[str, Figure]:
    """Figures of an evaluation by file name; those of the plans where the policies have some."""
    from armtempo.commands.figures import _phase as _phase_figures
    from armtempo.commands.figures import _space as _space_figures
    from armtempo.commands.figures import _time as _time_figures
    from armtempo.commands.figures._workspace import workspace

    cell, results = evaluation.cell, evaluation.results
    bound = math.nan if evaluation.options.on_the_way else cell.lower_bound
    schedules = {name: r.schedule for name, r in results.items() if r.schedule is not None}
    traces = {name: r.trace for name, r in results.items() if r.trace is not None}
    emphasised = _time_figures.best_shown(_finished(results) or results)
    figures = {
        "overview": _time_figures.overview(evaluation),
        "time_lines": _time_figures.time_lines(
            cell, {name: _time_figures.simulated_speeds(trace) for name, trace in traces.items()}, bound
        ),
        "workspace": workspace(cell),
    }
    if emphasised in traces:
        figures["torque"] = _time_figures.torques(
            schedules.get(emphasised),
            traces[emphasised],
            cell,
            title=f"Torques: {emphasised}, {evaluation.options.physics}",
        )
    if len(cell.arms) > 1:
        figures["clearance"] = _time_figures.clearances(
            cell, schedules, traces, emphasised, f"Clearance between the arms, {evaluation.options.physics}"
        )
        figures["coordination_chart"] = _space_figures.coordination_chart(cell, pair=_space_figures.meeting(cell)[0])
        if schedules:
            figures["relative_motion"] = _space_figures.relative_trajectories(cell, schedules, emphasised)
    if emphasised in schedules:
        figures["phase_plane"] = _phase_figures.phase_plane(
            schedules[emphasised], f"Motions in the phase plane: {emphasised}"
        )
    return figures


COORDINATION_REPORT = Report(
    title_suffix=title_suffix,
    caption=caption,
    summary_sentence=summary_sentence,
    figures=evaluation_figures,
    best=best,
)

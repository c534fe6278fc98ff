"""``armtempo evaluate``: every policy in the simulation, in one table and a few pictures."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, Any, Literal

import tyro

from armtempo.commands.console import (
    CellName,
    JsonFile,
    OutFolder,
    Output,
    default_folder,
    new_table,
    number,
    open_cell,
)
from armtempo.errors import ArmtempoError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from armtempo.agents import Evaluation, PolicyResult
    from armtempo.planners import BlendCell, IKCell

NARROW = 100  # below this many columns the table leaves two out
TIE = 1e-4  # [s] makespans this close share the bold print


def evaluate(
    cell: CellName,
    *,
    policies: Annotated[tuple[str, ...], tyro.conf.arg(metavar="NAME ...", help_behavior_hint="(default: all)")] = (),
    episodes: Annotated[int, tyro.conf.arg(metavar="N")] = 1,
    seed: Annotated[int, tyro.conf.arg(metavar="K")] = 0,
    physics: Literal["bullet", "ideal"] = "bullet",
    mode: Literal["speed", "acceleration"] = "speed",
    master_late: Annotated[float, tyro.conf.arg(metavar="S")] = 0.0,
    shield: bool = False,
    disturbance: Annotated[
        Literal["none", "late", "slow", "stop-and-go", "any"], tyro.conf.arg(metavar="NAME")
    ] = "none",
    observation_noise: Annotated[float, tyro.conf.arg(metavar="SIGMA")] = 0.0,
    start_phase: Annotated[tuple[float, ...], tyro.conf.arg(metavar="SHARE [SHARE]")] = (),
    family: Literal[
        "given", "polyline", "zigzag", "line-arc", "smooth", "near-singular", "partly-unreachable"
    ] = "given",
    model_error: Annotated[float, tyro.conf.arg(metavar="SHARE")] = 0.0,
    json_file: JsonFile = None,
    out: OutFolder = None,
    figures: bool = True,
) -> None:
    """Run policies in the simulated cell, compare them with each other and with the certified optimum, draw pictures.

    Args:
        cell: A bundled cell's name (see "armtempo cells"), or your own YAML file.
        policies: Policies to run: phase-plane, sequential, constant-speed, constant-acceleration, delay, vci,
            offset, interval, optimal, random; in blend cells line-speed, limit-aware, limit-aware-smooth,
            constant, random; in ik cells feedback, feedback-ff, feedback-damped, newton, law,
            law-scheduled, random. A learned agent is ppo:NAME (one that comes with armtempo) or ppo:FILE.npz, with
            sac: or tqc: if these made it.
        episodes: Episodes per policy; the table shows the worst clearance, torque and path error of all.
        seed: Seed of the first episode; the next ones count on from it.
        physics: "bullet" simulates the arms with torque control in PyBullet, "ideal" moves them exactly as commanded.
        mode: What an action means: a share of the highest safe speed, or of the admissible accelerations.
        master_late: Seconds by which the first arm starts late, which the others do not know.
        shield: Change actions from which the arms could not all stop in time and go on.
        disturbance: What happens to the first arm, drawn for every episode: it starts late, is slow, stops and goes.
        observation_noise: Standard deviation of the noise on what agents see.
        start_phase: Where on their paths the arms start, as a share: one number, or the lowest and the highest of a
            range to draw from.
        family: Paths of a blend cell (polyline, zigzag, line-arc) or targets of an ik cell (smooth, near-singular,
            partly-unreachable): the given one, or as many random ones as there are episodes.
        model_error: In a blend or ik cell: the simulated bodies are heavier by this share than the controller believes.
        json_file: Write the same figures there as JSON, units in the keys; "-" for nothing but JSON on stdout.
        out: Folder for the PNG files.
        figures: Draw pictures.
    """
    _check_numbers(episodes, seed, master_late, observation_noise, start_phase)
    coordination = _asked(shield, disturbance, observation_noise, start_phase)
    output = Output(json_file)
    built = open_cell(cell, output)
    from armtempo import agents
    from armtempo.planners import BlendCell, CoordinationCell

    if not isinstance(built, CoordinationCell):
        _check_one_arm_options(built, physics, mode, master_late, model_error, family, coordination)
        from armtempo.commands.reports._one_arm import evaluate_one_arm

        if isinstance(built, BlendCell):
            from armtempo.commands.reports._blend import blend_report as report
        else:
            from armtempo.commands.reports._ik import ik_report as report
        evaluate_one_arm(
            built, tuple(dict.fromkeys(policies)), output, report, out=out, figures=figures, family=family,
            episodes=episodes, seed=seed, physics=physics, model_error=model_error,
        )  # fmt: skip
        return
    if family != "given" or model_error:
        raise ArmtempoError("--family and --model-error are for blend cells and ik cells", remedy="leave them out")
    chosen = tuple(dict.fromkeys(policies)) or None
    with output.progress("Simulating", len(chosen or agents.POLICIES) * episodes) as (progress, task):

        def on_episode(policy: str, episode: int) -> None:
            progress.update(task, description=f"Simulating {policy}, episode {episode + 1}", advance=1)

        result = agents.evaluate(
            built,
            chosen,
            episodes=episodes,
            seed=seed,
            physics=physics,
            mode=mode,
            master_late_s=master_late,
            on_episode=on_episode,
            **coordination,
        )
    _tabulate(result, output, master_late)
    output.json(result.to_dict())
    if figures:
        from armtempo.commands.figures._write import draw

        folder = default_folder(built, out)
        with output.progress("Drawing"):
            drawn = evaluation_figures(result)
        output.pictures(folder, draw(drawn, folder, output))


def _check_numbers(
    episodes: int, seed: int, master_late: float, observation_noise: float, start_phase: tuple[float, ...]
) -> None:
    if episodes < 1:
        raise ArmtempoError(f"--episodes must be at least 1, got {episodes}", remedy="try --episodes 1")
    if seed < 0:
        raise ArmtempoError(f"--seed must not be negative, got {seed}", remedy="try --seed 0")
    for option, value, example in (
        ("--master-late must be a number of seconds", master_late, "0.1"),
        ("--observation-noise must be a number", observation_noise, "0.01"),
    ):
        if not (math.isfinite(value) and value >= 0.0):
            raise ArmtempoError(f"{option}, 0 or more, got {value}", remedy=f"try {example}")
    shares = all(0.0 <= share < 1.0 for share in start_phase)
    if len(start_phase) > 2 or not shares or list(start_phase) != sorted(start_phase):
        raise ArmtempoError(
            f"--start-phase must be one share of a path from 0 to below 1, or the ends of a range, got {start_phase}",
            remedy="try --start-phase 0 0.3",
        )


def _asked(shield: bool, disturbance: str, observation_noise: float, start_phase: tuple[float, ...]) -> dict[str, Any]:
    """Options of cells of several arms, as ``agents.evaluate`` takes them, where they were given."""
    options: dict[str, Any] = {
        "shield": shield,
        "disturbance": None if disturbance == "none" else disturbance,
        "observation_noise": observation_noise,
        "start_phase": start_phase[0] if len(start_phase) == 1 else start_phase,
    }
    return {name: value for name, value in options.items() if value}


def _check_one_arm_options(
    cell: BlendCell | IKCell,
    physics: str,
    mode: str,
    master_late: float,
    model_error: float,
    family: str,
    coordination: Mapping[str, Any],
) -> None:
    from armtempo.planners import BlendCell
    from armtempo.planners.cells import PATH_FAMILIES, TARGET_FAMILIES

    if mode != "speed" or master_late:
        raise ArmtempoError("--mode and --master-late are for cells of several arms", remedy="leave them out")
    if coordination:
        names = ", ".join(f"--{name.replace('_', '-')}" for name in coordination)
        raise ArmtempoError(f"{names}: for cells of several arms", remedy="leave them out")
    if model_error and physics == "ideal":
        raise ArmtempoError("--model-error needs bodies, and --physics ideal has none", remedy="take --physics bullet")
    known = PATH_FAMILIES if isinstance(cell, BlendCell) else TARGET_FAMILIES
    if family not in known:
        raise ArmtempoError(
            f"--family {family} does not exist in {cell.config.kind} cells", remedy=f"use one of {', '.join(known)}"
        )


def _finished(results: Mapping[str, PolicyResult]) -> dict[str, PolicyResult]:
    """The policies that arrived without coming too close, quickest first."""
    good = [(name, r) for name, r in results.items() if r.makespan_s is not None and not r.violations]
    return dict(sorted(good, key=lambda item: item[1].makespan_s or 0.0))


def _tabulate(evaluation: Evaluation, output: Output, master_late: float) -> None:
    cell, results = evaluation.cell, evaluation.results
    late = f"; master late by {1e3 * master_late:g} ms" if master_late else ""
    late += "".join(f"; {_said(name, value)}" for name, value in evaluation.options.items())
    late += f"; {evaluation.episodes} episodes" if evaluation.episodes > 1 else ""
    table = new_table(
        f"{cell.name} in simulation ({evaluation.physics}, tick {1e3 * cell.physics_tick:g} ms, "
        f"decision every {1e3 * cell.control_period:g} ms{late})",
        f"certified lower bound {cell.lower_bound:.4f} s; one after the other {cell.sequential_makespan:.4f} s; "
        f"d_min {1e3 * cell.d_min:g} mm, plans keep {1e3 * cell.config.clearance_reserve_m:g} mm more",
    )
    table.add_column("policy", no_wrap=True)
    roomy = output.console.width >= NARROW
    several, best_online = evaluation.episodes > 1, evaluation.best_online
    heads = ["plan\n\\[s]", "simul.\n\\[s]"]
    heads += ["95 %\nof mean"] if several else []
    heads += [f"ratio to\n{best_online}"] if several and best_online else []
    known = evaluation.clairvoyant_s
    heads += ["saving\n\\[%]", "gap\n\\[%]", *(["regret\n\\[%]"] if known else [])]
    heads += ["clear.\n\\[mm]", "torque\n\\[x limit]"]
    heads += ["demand\n\\[x limit]", "clipped\n\\[%]"] if roomy and not several else []
    shielded = any(r.interventions is not None for r in results.values())
    heads += ["path\nerr. \\[mm]", "too close\n\\[ticks]"] + (["shield\n\\[% changed]"] if shielded else [])
    for head in heads:
        table.add_column(head, justify="right")
    good = _finished(results)
    best = min((r.makespan_s for r in good.values() if r.makespan_s is not None), default=0.0)
    for name, r in results.items():
        bold = name in good and r.makespan_s is not None and r.makespan_s <= best + TIE
        clearance = number(r.min_clearance_m, 2, 1e3)
        row = [
            name,
            number(r.plan_makespan_s, 4 if roomy else 3),
            number(r.makespan_s, 4 if roomy else 3),
            *([_interval(r.makespan_interval_s, 4)] if several else []),
            *([_ratio(evaluation, name)] if several and best_online else []),
            number(r.saving_percent, 1),
            number(r.gap_percent, 2),
            *([number(evaluation.regret(name), 2)] if known else []),
            f"[red]{clearance}[/]" if r.violations else clearance,
            number(r.torque_ratio_max, 3),
        ]
        if roomy and not several:
            row += [number(r.torque_demand_ratio_max, 3), number(r.torque_clipped_fraction, 1, 100.0)]
        row += [number(r.path_error_max_m, 3, 1e3), f"[bold red]{r.violations}[/]" if r.violations else "0"]
        row += [number(r.interventions, 2, 100.0)] if shielded else []
        table.add_row(*row, style="bold" if bold else None)
    for name in evaluation.refused:
        table.add_row(name, "none", *["–"] * (len(table.columns) - 2))
    output.table(table)
    if known:
        output.say(f"Who knows beforehand what happens to the first arm takes {sum(known) / len(known):.4f} s (mean).")
    output.say(reading(evaluation))
    for name, why in evaluation.refused.items():
        output.say(f"{name} has no plan: {why}")


def _said(name: str, value: Any) -> str:
    """An option of the evaluation in the words of the command."""
    what = name.replace("_", " ")
    if value is True:
        return what
    return f"{what} {' to '.join(f'{v:g}' for v in value) if isinstance(value, tuple) else value}"


def _interval(interval: tuple[float, float] | None, digits: int) -> str:
    return "–" if interval is None else f"{interval[0]:.{digits}f}–\n{interval[1]:.{digits}f}"


def _ratio(evaluation: Evaluation, name: str) -> str:
    """Ratio to the best on-line classical policy and its interval."""
    ratio = evaluation.ratio(name)
    return "–" if ratio is None else f"{ratio[0]:.3f}\n({ratio[1][0]:.3f}–\n{ratio[1][1]:.3f})"


def reading(evaluation: Evaluation) -> str:
    """What the table says, in a sentence: about vci where it is among those that finished, else about the quickest."""
    good = _finished(evaluation.results)
    if not good:
        return "No policy finished without coming closer than d_min."
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
    if rival is not None and quickest != name and rival < r.makespan_s - TIE:
        text += f" ({quickest}, the quickest: {number(good[quickest].gap_percent, 1)} %)"
    wrong = [policy for policy, result in evaluation.results.items() if result.violations]
    text += f". Too close: {', '.join(wrong)}." if wrong else ". No arm ever came closer than d_min."
    return text


def evaluation_figures(evaluation: Evaluation) -> dict[str, Figure]:
    """Figures of an evaluation by file name; those of the plans where the policies have some."""
    from armtempo.commands.figures import _phase as _phase_figures
    from armtempo.commands.figures import _space as _space_figures
    from armtempo.commands.figures import _time as _time_figures

    cell, results = evaluation.cell, evaluation.results
    schedules = {name: r.schedule for name, r in results.items() if r.schedule is not None}
    traces = {name: r.trace for name, r in results.items() if r.trace is not None}
    emphasised = _time_figures.best_shown(_finished(results) or results)
    figures = {
        "overview": _time_figures.overview(evaluation),
        "time_lines": _time_figures.time_lines(
            cell, {name: _time_figures.simulated_speeds(trace) for name, trace in traces.items()}, cell.lower_bound
        ),
        "workspace": _space_figures.workspace(cell),
    }
    if emphasised in traces:
        figures["torque"] = _time_figures.torques(
            schedules.get(emphasised), traces[emphasised], cell, title=f"Torques: {emphasised}, {evaluation.physics}"
        )
    if len(cell.arms) > 1:
        figures["clearance"] = _time_figures.clearances(
            cell, schedules, traces, emphasised, f"Clearance between the arms, {evaluation.physics}"
        )
        figures["coordination_chart"] = _space_figures.coordination_chart(cell, pair=_space_figures.meeting(cell)[0])
        if schedules:
            figures["relative_motion"] = _space_figures.relative_trajectories(cell, schedules, emphasised)
    if emphasised in schedules:
        figures["phase_plane"] = _phase_figures.phase_plane(
            schedules[emphasised], f"Motions in the phase plane: {emphasised}"
        )
    return figures

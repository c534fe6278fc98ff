"""Figures over time: torques with their limits, clearance with d_min, time lines; and the overview of an evaluation."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from armtempo.arrays import Floats
from armtempo.commands.figures._space import draw_chart, draw_relative, meeting, relative_motion
from armtempo.commands.figures._style import (
    FORBIDDEN,
    FORBIDDEN_EDGE,
    HALO,
    INK,
    MUTED,
    arm_color,
    new_figure,
    policy_color,
    policy_line,
    styled,
)
from armtempo.planners import CoordinationCell, PhaseTrajectory, Schedule

if TYPE_CHECKING:
    from armtempo.agents import CoordinationEvaluation, CoordinationResult
    from armtempo.envs import CoordinationTrace


CLEARANCE_SAMPLES = 300  # of a plan
WIDE = 10.0  # times d_min: arms that are farther apart leave the picture
FEW_JOINTS = 2  # of an arm, whose torques are told apart by their dashes
WRONG = "#B00020"
LIMIT: dict[str, Any] = {"color": WRONG, "linewidth": 1.0, "linestyle": (0, (5, 2)), "zorder": 2.0}
SIMULATED: dict[str, Any] = {"linewidth": 2.4, "alpha": 0.8, "zorder": 4.0}


def best_shown(names: Mapping[str, object]) -> str:
    """The policy that figures emphasise: the paper's, else the first."""
    return "vci" if "vci" in names else next(iter(names), "")


def _planned_torque(trajectory: PhaseTrajectory) -> tuple[Floats, Floats]:
    """Instants (2N,) and torques (2N, n): jumps between the rows of a plan stay jumps."""
    instants = np.stack([trajectory.time[:-1], trajectory.time[1:]], axis=1)
    torque = trajectory.torque()
    return instants.reshape(-1), torque.reshape(-1, torque.shape[-1])


@styled
def torques(
    plan: Schedule | None, trace: CoordinationTrace | None = None, cell: CoordinationCell | None = None, title: str = ""
) -> Figure:
    """Torque of every joint over time with its limits: planned, and simulated where there is a trace.

    Args:
        plan: A schedule, or None for a policy without one.
        trace: An episode of the simulation.
        cell: Needed without ``plan``.
        title: Of the figure.
    """
    cell = plan.cell if plan is not None else cell
    assert cell is not None
    rows = max(arm.dof for arm in cell.arms)
    figure = new_figure(1.2 + 3.9 * len(cell.arms), 1.2 + 1.9 * rows)
    if title:
        figure.suptitle(title, fontsize=10.5, weight="bold", x=0.01, ha="left")
    planned: dict[str, Any] = {"linewidth": 1.8, "zorder": 5.0}
    if trace is not None:  # thin on what was simulated
        planned |= {"linewidth": 0.9, "color": INK}
    grid = figure.subplots(rows, len(cell.arms), sharex=True, squeeze=False)
    for i, arm in enumerate(cell.arms):
        for axes in grid[arm.dof :, i]:
            axes.set_axis_off()
        if plan is not None:
            instants, torque = _planned_torque(plan.trajectories[i])
            _draw_torques(grid[:, i], instants, torque, {"color": arm_color(i)} | planned)
        if trace is not None:
            simulated = {"color": arm_color(i), "drawstyle": "steps-post", **SIMULATED}
            _draw_torques(grid[:, i], trace.time, trace.torque[i], simulated)
        for j, axes in enumerate(grid[: arm.dof, i]):
            _frame_torque(axes, float(arm.torque_max[j]))
            axes.set_title(f"{arm.name}, joint {j + 1}", color=arm_color(i))
        grid[arm.dof - 1, i].set_xlabel("time [s]")
    for axes in grid[: cell.arms[0].dof, 0]:
        axes.set_ylabel("torque [N m]")
    handles = [Line2D([], [], label="limit", **LIMIT)]
    if plan is not None:
        handles.append(Line2D([], [], label="planned", **{"color": MUTED} | planned))
    if trace is not None:
        handles.append(Line2D([], [], color=MUTED, label="applied in simulation", **SIMULATED))
    figure.legend(handles=handles, loc="outside lower center", ncols=3)
    return figure


def _draw_torques(column: Iterable[Axes], instants: Floats, torque: Floats, style: Mapping[str, Any]) -> None:
    """Torques (T, n) of an arm, one picture for each joint."""
    for axes, values in zip(column, torque.T, strict=False):  # arms of fewer joints leave pictures empty
        axes.plot(instants, values, **style)


def _frame_torque(axes: Axes, limit: float) -> None:
    """The limit on both sides."""
    for sign in (-1.0, 1.0):
        axes.axhline(sign * limit, **LIMIT)
    if np.isfinite(limit):
        axes.set_ylim(-1.25 * limit, 1.25 * limit)


def planned_clearance(plan: Schedule) -> tuple[Floats, Floats]:
    """Instants and FCL distances between the arms [m] along a plan."""
    instants, lam = relative_motion(plan, CLEARANCE_SAMPLES)
    joints = [path.evaluate(lam[:, i])[0] for i, path in enumerate(plan.cell.paths)]
    return instants, np.array([plan.cell.clearance.arms(q).distance for q in zip(*joints, strict=True)])


def _draw_clearance(
    axes: Axes, cell: CoordinationCell, curves: Mapping[str, tuple[Floats, Floats]], emphasised: str
) -> list[Line2D]:
    lines = []
    for name, (instants, clearance) in curves.items():
        lines += axes.plot(instants, 1e3 * clearance, label=name, **policy_line(name, emphasised))
    low = 1e3 * cell.d_min
    # The narrow places count: arms that are far apart for a while may leave the picture.
    peaks = [float(clearance[np.isfinite(clearance)].max(initial=0.0)) for _, clearance in curves.values()]
    typical = 1e3 * float(np.median(peaks)) if peaks else 0.0
    top = 1.25 * max(min(typical, WIDE * low) if low > 0.0 else typical, 2.0 * low)
    axes.axhspan(0.0, low, color=FORBIDDEN, zorder=0.5)
    axes.axhline(low, color=FORBIDDEN_EDGE, linewidth=1.2, zorder=2.0)
    roomy = low > 0.06 * top  # for a word below the line
    axes.annotate(
        f"too close: below d_min = {low:g} mm",
        (1.0, low),
        (-4, -3 if roomy else 3),
        xycoords=axes.get_yaxis_transform(),
        textcoords="offset points",
        ha="right",
        va="top" if roomy else "bottom",
        color="#7A3535",
        fontsize=8.5,
        path_effects=HALO if not roomy else (),
        zorder=7.0,
    )
    axes.set(xlabel="time [s]", ylabel="clearance between the arms [mm]", ylim=(0.0, top), xlim=(0.0, None))
    return lines


@styled
def clearances(
    cell: CoordinationCell,
    plans: Mapping[str, Schedule],
    traces: Mapping[str, CoordinationTrace] | None = None,
    emphasised: str = "vci",
    title: str = "Clearance between the arms",
) -> Figure:
    """Smallest distance between the arms over time with d_min: simulated where there are traces, else planned."""
    figure = new_figure(7.4, 4.6)
    axes = figure.add_subplot(title=title)
    if traces:
        curves = {name: (trace.time, trace.clearance) for name, trace in traces.items()}
        if emphasised in plans:
            axes.plot(
                *_in_mm(planned_clearance(plans[emphasised])),
                color=INK,
                linewidth=0.9,
                zorder=6.0,
                label=f"{emphasised}, planned",
            )
    else:
        curves = {name: planned_clearance(plan) for name, plan in plans.items()}
    _draw_clearance(axes, cell, curves, emphasised)
    figure.legend(loc="outside right center")
    return figure


def _in_mm(curve: tuple[Floats, Floats]) -> tuple[Floats, Floats]:
    return curve[0], 1e3 * curve[1]


@styled
def time_lines(
    cell: CoordinationCell,
    speeds: Mapping[str, tuple[Floats, Floats, Floats]],
    bound: float,
    title: str = "Time lines: who moves when, and how fast",
) -> Figure:
    """One band per policy: the first arm's speed upwards, the others' downwards, a mark where each arrives.

    Args:
        cell: Whose arms they are.
        speeds: By policy: instants (T,) [s], mu (T, arms), arrival (arms,) [s] (NaN: never).
        bound: Certified lower bound on the makespan [s]; NaN: none.
        title: Of the figure.
    """
    figure = new_figure(8.6, 1.3 + 0.82 * len(speeds))
    axes = figure.add_subplot(title=title)
    top = max((float(mu.max(initial=0.0)) for _, mu, _ in speeds.values()), default=0.0) or 1.0
    finite = [float(np.nanmax(arrival)) for _, _, arrival in speeds.values() if np.isfinite(arrival).any()]
    last = max([*finite, *(float(instants[-1]) for instants, *_ in speeds.values() if not finite)], default=1.0)
    for row, motion in enumerate(speeds.values()):
        _draw_time_line(axes, -float(row), motion, top, last)
    if np.isfinite(bound):
        axes.axvline(bound, color=INK, linewidth=1.0, linestyle=(0, (4, 3)), zorder=2.0)
        _say(axes, f"certified bound {bound:.3f} s", (bound, 0.52), (-4, 0), ha="right")
    axes.set_yticks([-float(row) for row in range(len(speeds))], list(speeds))
    for label, name in zip(axes.get_yticklabels(), speeds, strict=True):
        label.set_color(policy_color(name))
        label.set_fontweight("bold")
    axes.tick_params(axis="y", length=0)
    axes.spines["left"].set_visible(False)
    axes.grid(visible=False, axis="y")
    axes.set(xlabel="time [s]", xlim=(0.0, 1.10 * last), ylim=(0.35 - len(speeds), 0.65))
    handles = []
    for i, arm in enumerate(cell.arms):
        word = f"{arm.name}: speed on its path, {'upwards' if i == 0 else 'downwards'}"
        handles.append(Line2D([], [], color=arm_color(i), linewidth=6, alpha=0.6, label=word))
    figure.legend(handles=handles, loc="outside lower center", ncols=2)
    return figure


def _draw_time_line(axes: Axes, y: float, motion: tuple[Floats, Floats, Floats], top: float, last: float) -> None:
    """One band at the height ``y``; ``top`` is the speed that fills it, ``last`` the instant at which pictures end."""
    instants, mu, arrival = motion
    shown = instants <= 1.02 * last
    axes.axhline(y, color=MUTED, linewidth=0.7, zorder=1.0)
    for i in range(mu.shape[1]):
        side, color = (1.0 if i == 0 else -1.0), arm_color(i)
        edge = y + side * 0.40 * mu[shown, i] / top
        alpha = 0.55 if i < 2 else 0.35
        axes.fill_between(instants[shown], y, edge, color=color, alpha=alpha, linewidth=0.0, zorder=3.0)
        axes.plot(instants[shown], edge, color=color, linewidth=1.2, zorder=4.0)
        if np.isfinite(arrival[i]):
            axes.plot([arrival[i]] * 2, [y, y + side * 0.40], color=color, linewidth=1.6, zorder=5.0)
            if i == 0 or mu.shape[1] == 2 or arrival[i] == np.nanmax(arrival):  # of more arms words would lie on words
                _say(axes, f"{arrival[i]:.3f} s", (arrival[i], y + side * 0.23), (4, 0), color=color, zorder=6.0)
    if not np.isfinite(arrival).all():
        stopped = min(float(instants[-1]), last)
        axes.plot(stopped, y, "x", color=WRONG, markersize=7, markeredgewidth=2.0, zorder=6.0)
        _say(axes, f"not finished, stopped at {instants[-1]:.3f} s", (stopped, y), (8, 0), color=WRONG, zorder=6.0)


def _say(axes: Axes, text: str, place: tuple[float, float], aside: tuple[int, int], **style: Any) -> None:
    """A few words beside a place in the picture."""
    axes.annotate(text, place, aside, textcoords="offset points", va="center", fontsize=8.5, path_effects=HALO, **style)


def planned_speeds(plan: Schedule, samples: int = 500) -> tuple[Floats, Floats, Floats]:
    """Instants, mu (T, arms) and arrivals (arms,) of a plan, for ``time_lines``."""
    instants = np.linspace(0.0, plan.makespan, samples)
    mu = np.stack([trajectory.at(instants)[1] for trajectory in plan.trajectories], axis=1)
    return instants, mu, np.array([trajectory.duration for trajectory in plan.trajectories])


def simulated_speeds(trace: CoordinationTrace) -> tuple[Floats, Floats, Floats]:
    """The same of an episode."""
    return trace.time, trace.mu, trace.arrival


def _draw_bars(axes: Axes, results: Mapping[str, CoordinationResult], bound: float, sequential: float) -> None:
    """Makespans, the quickest at the top, with saving if known; policies that do not finish at the bottom."""
    ordered = sorted(results.items(), key=lambda item: item[1].makespan_s or np.inf)
    longest = max([result.makespan_s or 0.0 for _, result in ordered] + [sequential])
    for row, (name, result) in enumerate(ordered):
        if result.makespan_s is None:
            axes.barh(
                -row,
                longest,
                height=0.62,
                color="none",
                edgecolor=policy_color(name),
                hatch="////",
                linewidth=0.8,
                alpha=0.5,
            )
            why = "too close" if result.violations else "not finished"
            axes.annotate(
                why, (0.0, -row), (6, 0), textcoords="offset points", va="center", color=WRONG, path_effects=HALO
            )
            continue
        axes.barh(-row, result.makespan_s, height=0.62, color=policy_color(name), alpha=0.9)
        if result.plan_makespan_s is not None:
            axes.plot([result.plan_makespan_s] * 2, [-row - 0.31, -row + 0.31], color="white", linewidth=1.6)
        saved = result.saving_percent or 0.0
        word = f"{result.makespan_s:.3f} s" + (f"  {-saved:+.0f} %".replace("-", "−") if abs(saved) >= 0.5 else "")
        axes.annotate(word, (result.makespan_s, -row), (5, 0), textcoords="offset points", va="center", fontsize=9)
    axes.set_yticks(
        [-row for row in range(len(ordered))], [name.replace("constant-", "constant-\n") for name, _ in ordered]
    )
    axes.tick_params(axis="y", length=0)
    axes.grid(visible=False, axis="y")
    axes.spines["left"].set_visible(False)
    axes.set(
        xlabel="makespan in simulation [s], white mark: as planned",
        xlim=(0.0, 1.30 * longest),
        ylim=(-0.1 - len(ordered), 0.6),
    )
    known = any(result.saving_percent is not None for result in results.values())
    axes.set_title("Makespan" + (", and what it saves against one after the other" if known else ""))
    if not np.isfinite(bound):
        return
    axes.axvline(bound, color=INK, linewidth=1.0, linestyle=(0, (4, 3)))
    axes.annotate(
        f"certified bound {bound:.3f} s",
        (bound, 0.0),
        (5, 4),
        xycoords=axes.get_xaxis_transform(),
        textcoords="offset points",
        fontsize=8.5,
        va="bottom",
        path_effects=HALO,
    )


def _draw_torque_shares(axes: Axes, cell: CoordinationCell, trace: CoordinationTrace, name: str) -> None:
    """Torque of every joint as a share of its limit, in simulation; of many joints the most loaded one stands out."""
    few = max(arm.dof for arm in cell.arms) <= FEW_JOINTS and len(cell.arms) <= 2
    for i, arm in enumerate(cell.arms):
        shares = 100.0 * trace.torque[i] / arm.torque_max
        style: dict[str, Any] = {"where": "post", "color": arm_color(i)}
        for j, share in enumerate(shares.T if few else np.abs(shares).T):
            if few:
                label, dashes = f"{arm.name}, joint {j + 1}", ("-", (0, (3, 1.5)))[j]
                axes.step(trace.time, share, linestyle=dashes, linewidth=1.7, label=label, zorder=3.0 + i, **style)
            else:
                axes.step(trace.time, share, linewidth=0.7, alpha=0.4, zorder=3.0, **style)
        if not few:
            most = np.abs(shares).max(axis=1)
            axes.step(trace.time, most, linewidth=1.8, label=arm.name, zorder=4.0 + i, **style)
    for limit in (-100.0, 100.0) if few else (100.0,):
        axes.axhline(limit, **LIMIT)
    what = "torque applied" if few else "size of the torque applied"
    axes.set(xlabel="time [s]", ylabel=f"{what} [% of its limit]", xlim=(0.0, None))
    axes.set_ylim(-112.0 if few else 0.0, 112.0)
    axes.set_title(f"Torque of every joint, {name}" + ("" if few else ": the most loaded bold"))
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.13), ncols=4, fontsize=8.5, columnspacing=1.0)


@styled
def overview(evaluation: CoordinationEvaluation) -> Figure:
    """An evaluation at a glance: relative motion in the chart, makespans, clearance and torques over time."""
    cell, results = evaluation.cell, evaluation.results
    emphasised = best_shown(results)
    pair = len(cell.arms) > 1
    figure = new_figure(12.6, 8.6 if pair else 4.6)
    figure.set_layout_engine("constrained", w_pad=0.10, h_pad=0.10)
    columns = figure.add_gridspec(2 if pair else 1, 2, width_ratios=(1.0, 1.12) if pair else None)
    bar_axes = figure.add_subplot(columns[0, 1])
    torque_axes = figure.add_subplot(columns[-1, 1 if pair else 0])
    safe = {name: result for name, result in results.items() if not result.violations}
    if pair:
        chart_axes, clearance_axes = figure.add_subplot(columns[0, 0]), figure.add_subplot(columns[1, 0])
        shown = meeting(cell)[0]
        draw_chart(chart_axes, cell, pair=shown)
        motions = {name: (r.trace.time, r.trace.lam) for name, r in results.items() if r.trace is not None}
        draw_relative(chart_axes, cell, motions, emphasised, shown)
        chart_axes.set_title("Relative motion around the collision region")
        curves = {name: (r.trace.time, r.trace.clearance) for name, r in results.items() if r.trace is not None}
        lines = _draw_clearance(clearance_axes, cell, curves, emphasised)
        clearance_axes.set_title("Clearance over time")
        figure.legend(handles=lines, loc="outside lower center", ncols=len(lines))
    bound = np.nan if evaluation.options.on_the_way else cell.lower_bound
    _draw_bars(bar_axes, results, bound, cell.sequential_makespan)
    name = emphasised if emphasised in safe else next(iter(safe), emphasised)
    if (trace := results[name].trace) is not None:
        _draw_torque_shares(torque_axes, cell, trace, name)
    return figure

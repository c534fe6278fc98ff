"""Phase-plane figures: velocity control intervals (Lee1991 Figs. 3, 4), motions (Fig. 6), running time (Fig. 8)."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

import numpy as np
from matplotlib.figure import Figure

from armtempo.arrays import Floats
from armtempo.commands.figures._style import HALO, INK, MUTED, arm_color, new_figure, note, styled
from armtempo.errors import InfeasibleError
from armtempo.planners import CoordinationCell, PhasePlane, Schedule, schedule

Case = Literal[3, 4]

# Steps dT [s] that are looked through for a correction that shows a case well: long enough to be seen.
PERIODS = (0.010, 0.008, 0.012, 0.006, 0.005, 0.004, 0.003, 0.002, 0.001)


@dataclass(frozen=True, kw_only=True, slots=True)
class Correction:
    """One velocity control interval of a slave, step by step.

    Attributes:
        case: The paper's figure: 3, the last step is adjusted; 4, an earlier one.
        period: Step dT [s].
        start: Instant at which the interval begins [s].
        collision: C, the station that must not be passed [lambda].
        before: (K, 2) states (lambda, mu) on the way to the interval.
        fastest: (I + 1, 2) states after every step at full speed: passes C.
        braking: (I + 1, 2) after every step of maximum braking: the interval is the shortest that stays behind C.
        modified: (I + 1, 2) the motion that was chosen.
        beyond: (m, 2) full acceleration after the braked (case 3) or adjusted (case 4) steps.
        command: Of the adjusted step, in [0, 1].
    """

    case: Case
    period: float
    start: float
    collision: float
    before: Floats
    fastest: Floats
    braking: Floats
    modified: Floats
    beyond: Floats
    command: float

    @property
    def steps(self) -> int:
        """Length I of the interval in steps."""
        return len(self.modified) - 1


def _run(plane: PhasePlane, commands: list[float], dt: float, start: Floats) -> Floats:
    """(len(commands) + 1, 2) states after each step."""
    states = [start]
    for command in commands:
        lam, mu, _ = plane.advance(float(states[-1][0]), float(states[-1][1]), command, dt, mode="acceleration")
        states.append(np.array([lam, mu]))
    return np.array(states)


def find_correction(cell: CoordinationCell, case: Case, periods: tuple[float, ...] = PERIODS) -> Correction | None:
    """A correction of the slave that shows one of the paper's cases: at best the first of its plan, two steps long.

    Args:
        cell: Two arms.
        case: 3 (Fig. 3) or 4 (Fig. 4).
        periods: Steps dT [s] to try, the best to look at first.

    Returns:
        None if no period brings the case about.
    """
    spare: Correction | None = None
    for period in periods:
        try:
            plan = schedule(cell, "vci", period=period)
        except InfeasibleError:
            continue
        if plan.vci is None:
            return None
        for number, (last, first, adjusted, _) in enumerate(plan.vci.history):
            if (adjusted == last) != (case == 3) or last == first:
                continue
            if number == 0 and last - first == 1:
                return _rebuild(cell, plan, number, period)
            if spare is None:
                spare = _rebuild(cell, plan, number, period)
    return spare


def _rebuild(cell: CoordinationCell, plan: Schedule, number: int, period: float) -> Correction:
    assert plan.vci is not None
    master, slave = plan.order
    plane = cell.planes[slave]
    chart = cell.chart if plan.order == (0, 1) else cell.chart.swapped
    last, first, adjusted = (int(k) for k in plan.vci.history[number, :3])
    command = float(plan.vci.history[number, 3])
    commands = [1.0] * first
    for k, begin, changed, value in plan.vci.history[:number]:  # what earlier corrections have left before this one
        for step, settled in [*((s, 0.0) for s in range(int(begin), int(changed))), (int(changed), float(value))]:
            if step < first:
                commands[step] = settled
        for step in range(int(changed) + 1, min(int(k) + 1, first)):
            commands[step] = 1.0
    before = _run(plane, commands, period, np.zeros(2))
    steps = last - first + 1
    chosen = [0.0] * (adjusted - first) + [command] + [1.0] * (last - adjusted)
    # C where it was last asked: as the planner does, with the master's place at the beginning of a check
    master_lam = float(plan.trajectories[master].at((last + 1) * period - min(period, 1e-4))[0])
    case: Case = 3 if adjusted == last else 4
    if case == 3:
        braked = _run(plane, [0.0] * (steps - 1), period, before[-1])[-1]
    else:
        braked = _run(plane, chosen[: adjusted - first + 1], period, before[-1])[-1]
    return Correction(
        case=case,
        period=period,
        start=first * period,
        collision=float(chart.closure[min(int(master_lam / chart.step_a), chart.resolution)]),
        before=before,
        fastest=_run(plane, [1.0] * steps, period, before[-1]),
        braking=_run(plane, [0.0] * steps, period, before[-1]),
        modified=_run(plane, chosen, period, before[-1]),
        beyond=_run(plane, [1.0] * (last - adjusted + 2), period, braked),
        command=command,
    )


def _trace(plane: PhasePlane, states: Floats) -> Floats:
    """The states of one step after the other joined as phase-plane curves: mu^2 is all but linear in lambda."""
    pieces = []
    for (lam, mu), (lam_next, mu_next) in pairwise(states):
        w = np.linspace(0.0, 1.0, 20)
        pieces.append(np.stack([lam + w * (lam_next - lam), np.sqrt(mu**2 + w * (mu_next**2 - mu**2))], axis=1))
    return np.concatenate(pieces)


@styled
def velocity_control(cell: CoordinationCell, correction: Correction, title: str = "") -> Figure:
    """One velocity control interval in the slave's phase plane (Lee1991 Fig. 3 or 4, curves (a) to (d))."""
    plane = cell.planes[1]
    figure = new_figure(7.6, 4.7)
    axes = figure.add_subplot()
    which = "the last step is adjusted" if correction.case == 3 else "an earlier step is adjusted"
    axes.set_title(title or f"Velocity control interval: {which}")
    after = "braking" if correction.case == 3 else "the adjusted step"
    curves = (
        ("(a) minimum-time trajectory", correction.fastest, MUTED, "-", 1.6),
        (f"(b) maximum acceleration after {after}", correction.beyond, "#0072B2", (0, (4, 2)), 1.6),
        ("(c) maximum deceleration: finds the VCI", correction.braking, "#009E73", "-", 1.6),
        ("(d) modified trajectory", correction.modified, arm_color(1), "-", 3.0),
    )
    for label, states, color, style, width in curves:
        z = 5.0 if width > 2 else 6.0 if style != "-" else 4.0
        axes.plot(*_trace(plane, states).T, color=color, linestyle=style, linewidth=width, label=label, zorder=z)
        axes.plot(*states[1:].T, "o", color=color, markersize=4.5, zorder=7.0)
    axes.plot(*_trace(plane, correction.before).T, color=arm_color(1), linewidth=3.0, zorder=3.0)
    axes.plot(*correction.before[1:].T, "o", color=arm_color(1), markersize=4.5, zorder=7.0)
    drawn = np.concatenate([states for _, states, *_ in curves] + [correction.before[-3:]])
    low, high = drawn.min(axis=0), drawn.max(axis=0)
    room = 0.10 * (high - low)
    axes.set(xlim=(low[0] - room[0], high[0] + room[0]), ylim=(low[1] - 2.2 * room[1], high[1] + room[1]))
    axes.axvspan(correction.collision, high[0] + room[0], color="#F6EBEB", zorder=0.5)
    axes.axvline(correction.collision, color="#B00020", linewidth=1.4, zorder=2.0)
    end = 1e3 * (correction.start + correction.steps * correction.period)
    axes.annotate(
        f"collision point C\nat t = {end:.0f} ms",
        (correction.collision, low[1] - 2.2 * room[1]),
        (5, 6),
        textcoords="offset points",
        color="#B00020",
        va="bottom",
        path_effects=HALO,
        zorder=9.0,
    )
    lam, mu = correction.before[-1]
    axes.annotate(
        f"VCI begins, t = {1e3 * correction.start:.0f} ms\n{correction.steps} steps of {1e3 * correction.period:g} ms",
        (lam, mu),
        (-8, 30),
        textcoords="offset points",
        ha="right",
        va="bottom",
        path_effects=HALO,
        zorder=9.0,
        arrowprops={"arrowstyle": "-", "color": MUTED, "linewidth": 0.8},
    )
    unit = cell.paths[1].unit
    axes.set(xlabel=f"slave's position on its path [{unit}]", ylabel=f"speed on the path μ [{unit}/s]")
    figure.legend(loc="outside lower center", ncols=2)
    return figure


def _moving(plan: Schedule, i: int) -> tuple[Floats, Floats, float]:
    """lambda, mu (rows) of an arm's motion, and how long it stands before it [s]."""
    trajectory = plan.trajectories[i]
    standing = int(np.argmax(trajectory.lam > trajectory.lam[0]))
    first = max(standing - 1, 0)
    return trajectory.lam[first:], trajectory.mu[first:], float(trajectory.time[first])


@styled
def phase_plane(plan: Schedule, title: str = "Motions in the phase plane") -> Figure:
    """Both arms' speeds over position under the boundary of the feasible region (Lee1991 Fig. 6)."""
    cell = plan.cell
    figure = new_figure(7.4, 4.6)
    axes = figure.add_subplot(title=title)
    boundaries: list[tuple[Floats, Floats]] = []
    fastest = max(float(motion.mu.max()) for motion in cell.fastest)
    for i, plane in enumerate(cell.planes):
        grid, limit = plane.rows.station, plane.speed_limit()
        same = any(b.shape == limit.shape and np.allclose(b, limit, rtol=1e-3) for _, b in boundaries)
        if not same:
            boundaries.append((grid, limit))
            name = "" if len(cell.planes) == 1 else f" of {cell.arms[i].name}"
            color, label = INK if i == 0 else arm_color(i), f"boundary of the feasible region{name}"
            axes.plot(grid, limit, color=color, linewidth=1.3, linestyle=(0, (5, 2)), zorder=3.0, label=label)
    finite = np.concatenate([limit[np.isfinite(limit)] for _, limit in boundaries])
    top = 1.08 * min(max(float(finite.min()) * 1.6, 1.25 * fastest), max(float(finite.max()), fastest))
    for i, arm in enumerate(cell.arms):
        lam, mu, wait = _moving(plan, i)
        how = "minimum time" if i == plan.order[0] else f"{plan.method}"
        waited = f", after waiting {wait:.3f} s" if wait > 0.0 else ""
        axes.plot(lam, mu, color=arm_color(i), linewidth=2.4, zorder=5.0, label=f"{arm.name}: {how}{waited}")
    if len(boundaries) == 1:
        grid, limit = boundaries[0]
        axes.fill_between(grid, np.minimum(limit, 2.0 * top), 2.0 * top, color="#F1F1F1", zorder=0.6)
        for line in axes.get_legend_handles_labels()[0][:1]:
            line.set_label("boundary of the feasible region")
    unit = cell.paths[0].unit
    axes.set(xlabel=f"position on the path λ [{unit}]", ylabel=f"speed on the path μ [{unit}/s]")
    axes.set(xlim=(0.0, 1.01 * max(plane.length for plane in cell.planes)), ylim=(0.0, top))
    figure.legend(loc="outside lower center", ncols=3)
    return figure


@styled
def running_time(plan: Schedule, title: str = "Running time: the area under 1/μ") -> Figure:
    """1/mu over position: the area under a curve is the time its arm is under way (Lee1991 Fig. 8)."""
    cell = plan.cell
    figure = new_figure(7.4, 4.4)
    axes = figure.add_subplot(title=title)
    slowest = 0.0
    for i, arm in enumerate(cell.arms):
        lam, mu, wait = _moving(plan, i)
        fine = np.linspace(lam[0], lam[-1], 1600)
        speed = np.sqrt(np.maximum(np.interp(fine, lam, mu**2), 1e-12))
        slowness = 1.0 / speed
        under_way = plan.trajectories[i].duration - wait
        waited = f" (after {wait:.3f} s at rest)" if wait > 0.0 else ""
        label = f"({'ab'[i] if i < 2 else i}) {arm.name}: area = running time = {under_way:.3f} s{waited}"
        axes.fill_between(fine, slowness, color=arm_color(i), alpha=0.13, linewidth=0.0, zorder=2.0 + i)
        axes.plot(fine, slowness, color=arm_color(i), linewidth=2.2, label=label, zorder=4.0 + i)
        middle = slowness[len(slowness) // 20 : -len(slowness) // 20]
        slowest = max(slowest, min(float(middle.max()), 6.0 * under_way / (lam[-1] - lam[0])))
    unit = cell.paths[0].unit
    axes.set(xlabel=f"position on the path λ [{unit}]", ylabel=f"slowness 1/μ [s/{unit}]")
    axes.set(xlim=(0.0, 1.01 * max(plane.length for plane in cell.planes)), ylim=(0.0, 1.15 * slowest))
    word = "1/μ grows without bound at either end,\nwhere the arms are at rest"
    note(axes, 0.5, 0.97, word, ha="center", va="top", color=MUTED)
    figure.legend(loc="outside lower center", ncols=2)
    return figure

"""Figs. 7-13 of Chung, Ryu, Park from our data, and three of ours; the print swaps the captions of 10 and 11."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from armtempo.arrays import Floats
from armtempo.commands.figures._style import ARM_COLORS, FAINT, FORBIDDEN, INK, MUTED, new_figure, note, styled
from armtempo.commands.papers.chung._run import (
    KA,
    KN,
    MM,
    NOISE,
    PERIOD,
    SCHEMES,
    SETTLED,
    SHIFTS,
    Chung,
    least_error,
    ordered_angles,
)

ENTRY = 0.2  # [s] shown of the way from the start to the path
COLORS = dict(zip(SHIFTS, ("#D55E00", "#24476B"), strict=True))
FEEDS = dict(zip(SHIFTS, ("without P_d'", "with P_d'"), strict=True))
METHODS = {"euler": "#D55E00", "heun": "#009E73", "rk4": "#24476B"}
DASHED, DOTTED = (0, (4, 2)), (0, (1, 1.4))


def chung_figures(found: Chung) -> dict[str, Figure]:
    """All figures by file name."""
    done = found.entry[SHIFTS[1]]
    axes = [
        (f"fig{7 + k}_{axis}_position", _position(found, k, f"Fig. {7 + k}  {axis}: desired and solution"))
        for k, axis in enumerate("xyz")
    ]
    return {
        **dict(axes),
        "fig10_approach_vector": _direction(found, 2, "Fig. 10  Approach vector a: desired and solution"),
        "fig11_normal_vector": _direction(found, 0, "Fig. 11  Normal vector n: desired and solution"),
        "fig12_joints": _joints(found, np.rad2deg(done.q), "angle [deg]", "Fig. 12  Joint angles", same_scale=True),
        "fig13_joint_speeds": _joints(found, done.qd, "speed [rad/s]", "Fig. 13  Joint speeds"),
        "errors_and_bounds": _errors_and_bounds(found),
        "noise": _noise(found),
        "singular_and_unreachable": _hard(found),
    }


def _entry_and_run(figure: Figure, rows: int, end: float) -> list[tuple[Axes, Axes]]:
    """Rows of two axes: the first instants at their own scale, and the whole run."""
    pairs = figure.subplots(rows, 2, sharex="col", width_ratios=(1.0, 2.4), squeeze=False)
    for entry, whole in pairs:
        entry.set_xlim(0.0, ENTRY)
        whole.set_xlim(0.0, end)
    pairs[-1, 0].set_xlabel("time [s]: from a start of ours")
    pairs[-1, 1].set_xlabel("time [s]: one period")
    return [(entry, whole) for entry, whole in pairs]


@styled
def _position(found: Chung, axis: int, title: str) -> Figure:
    figure = new_figure(7.6, 5.0)
    time, desired = found.target.time, found.target.position[::2, axis]
    above, below = _entry_and_run(figure, 2, time[-1])
    solved = {name: found.arm.tip_pose(done.q)[:, axis, 3] for name, done in found.entry.items()}
    for axes in above:
        axes.plot(time, desired, color=FAINT, linewidth=5.0, label="desired")
        for name, p in solved.items():
            axes.plot(time, p, color=COLORS[name], label=f"solution, {FEEDS[name]}")
    for axes in below:
        axes.axhline(0.0, color=FAINT, linewidth=1.2)
        for name, p in solved.items():
            axes.plot(time, MM * (desired - p), color=COLORS[name])
    late = time > SETTLED
    lag = MM * float(np.abs(desired - solved[SHIFTS[0]])[late].max())
    below[1].set_ylim(-1.6 * lag, 1.6 * lag)
    within = time < ENTRY
    seen = np.concatenate([desired[within], *(p[within] for p in solved.values())])
    room = 0.1 * (seen.max() - seen.min())
    above[0].set_ylim(seen.min() - room, seen.max() + room)
    above[0].set_ylabel(f"{'xyz'[axis]} [m]")
    below[0].set_ylabel("desired − solution [mm]")
    above[1].legend(loc="upper center")
    note(below[1], 0.02, 0.9, f"without P_d' it lags by up to {lag:.2f} mm")
    figure.suptitle(title, x=0.01, ha="left", fontsize=10.5, fontweight="bold")
    return figure


@styled
def _direction(found: Chung, column: int, title: str) -> Figure:
    figure = new_figure(7.2, 5.4)
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=(1.1, 1.0))
    time, done = found.target.time, found.entry[SHIFTS[1]]
    desired, solved = found.target.rotation[::2, :, column], found.arm.tip_pose(done.q)[:, :3, column]
    for k, axis in enumerate("xyz"):
        above.plot(time, desired[:, k], color=ARM_COLORS[k], linewidth=5.0, alpha=0.25)
        above.plot(time, solved[:, k], color=ARM_COLORS[k], label=f"{'n a'[column]}_{axis}")
    above.plot([], [], color=MUTED, linewidth=5.0, alpha=0.3, label="desired")
    above.set_xlim(0.0, 0.4)
    above.set_ylabel("component [1]")
    above.legend(loc="center right", ncols=4)
    above.set_title(title)
    size = np.linalg.norm(desired - solved, axis=1)
    chord = 2.0 * np.sin(0.5 * done.approach_error[0]) * np.exp(-KA * time)
    if column == 2:
        bound, name = chord, "the paper's bound (3.4)"
    else:
        around = np.abs(ordered_angles(found.arm, done, found.target)[0, 2]) * np.exp(-KN * time)
        bound, name = np.hypot(chord, around), "the paper's bound (3.9), by (3.4) and (3.5)"
    below.semilogy(time, size, color=ARM_COLORS[0], label="|desired − solution|")
    below.semilogy(time, bound, color=ARM_COLORS[1], linewidth=1.2, linestyle=DASHED, label=name)
    below.set_ylim(1e-4, 2.0)
    below.set_ylabel("error [1]")
    below.set_xlabel("time [s]; the desired vector never changes")
    below.legend(loc="upper right")
    over = float((size / bound)[time < 0.4].max())
    note(below, 0.02, 0.06, f"largest error / bound: {over:.3f}{': it is of first order only' if over > 1.0 else ''}")
    return figure


@styled
def _joints(found: Chung, values: Floats, label: str, title: str, *, same_scale: bool = False) -> Figure:
    figure = new_figure(7.6, 4.0)
    time = found.target.time
    ((entry, whole),) = _entry_and_run(figure, 1, time[-1])
    for k in range(values.shape[1]):
        for axes in (entry, whole):
            axes.plot(time, values[:, k], color=ARM_COLORS[k], label=f"θ{'₁₂₃₄₅₆'[k]}")
    late = values[time > 0.5]
    room = 0.06 * (late.max() - late.min())
    whole.set_ylim(late.min() - room, late.max() + room)
    if same_scale:
        entry.set_ylim(whole.get_ylim())
    entry.set_ylabel(label)
    whole.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=6)
    entry.set_title(title)
    return figure


@styled
def _errors_and_bounds(found: Chung) -> Figure:
    """The step of 10 ms; the tool swings, so that its orientation has something to follow."""
    figure = new_figure(8.4, 6.2)
    rows = figure.subplots(2, 2, sharex=True, sharey="row")
    for row, (what, unit, scale, span) in enumerate(
        (("position", "mm", MM, (1e-6, 50.0)), ("orientation", "rad", 1.0, (1e-10, 1.0)))
    ):
        for axes, fed in zip(rows[row], (False, True), strict=True):
            for (own, method, step), done in found.steady.items():
                if own != fed or step != 1e-2:
                    continue
                error, bound = getattr(done, f"{what}_error"), getattr(done.bounds, what)
                style = {"color": METHODS[method], "zorder": 3.0 + (method == "euler")}
                axes.semilogy(done.time[1:], scale * bound[1:], **style, linewidth=4.5, alpha=0.3)
                axes.semilogy(done.time[1:], scale * error[1:], **style, linewidth=1.2)
            axes.set_ylim(*span)
            axes.set_xlim(0.0, PERIOD)
            if not fed:
                note(axes, 0.5, 0.1, "the three integrators coincide", ha="center", color=MUTED)
        rows[row, 0].set_ylabel(f"{what} error [{unit}]")
    rows[0, 0].set_title("Feedback alone lags")
    rows[0, 1].set_title("Rates fed forward")
    for axes in rows[1]:
        axes.set_xlabel("time [s], in steps of 10 ms")
    for name, color in METHODS.items():
        rows[0, 1].plot([], [], color=color, label=name)
    rows[0, 1].plot([], [], color=MUTED, linewidth=4.5, alpha=0.4, label="bound, from the joints' steps and no pose")
    figure.legend(*rows[0, 1].get_legend_handles_labels(), loc="outside lower center", ncols=4)
    return figure


@styled
def _noise(found: Chung) -> Figure:
    figure = new_figure(7.6, 5.6)
    speed, error = figure.subplots(2, 1, sharex=True)
    colors = dict(zip(SCHEMES, ("#D55E00", "#56B4E9", "#24476B"), strict=True))
    time = found.target.time
    names = ("differences of the target, inverted", "fed back", "fed back, with the true rates")
    for k, (name, said) in enumerate(zip(SCHEMES, names, strict=True)):
        scheme = found.noisy[name]
        speed.plot(time, scheme.qd[:, 3], color=colors[name], linewidth=0.6 if k == 0 else 1.2, label=said)
        error.semilogy(time, MM * scheme.error, color=colors[name], linewidth=1.0, label=said)
    speed.set_ylabel("speed of joint 4 [rad/s]")
    speed.set_title(f"A target measured to {MM * NOISE:g} mm each 1 ms: what the solvers make of it")
    error.set_ylabel("position error [mm]")
    error.set_xlabel("time [s]")
    error.set_xlim(0.0, time[-1])
    error.set_ylim(1e-3, 20.0)
    figure.legend(*error.get_legend_handles_labels(), loc="outside lower center", ncols=3)
    return figure


@styled
def _hard(found: Chung) -> Figure:
    figure = new_figure(8.8, 5.8)
    axes = figure.subplots(2, 2, sharex="col")
    cap = found.arm.speed_max
    out, past = found.outside, found.singular
    titles = ("Target 0.28 m out of reach and back", "Wrist passes straight at 0.01 rad")
    columns = (
        (out, MM * out.plain_error[:, 0], MM * out.ours.position_error),
        (past, past.plain_error[:, 1], past.ours.orientation_error),
    )
    for (hard, plain, mine), title, (speed, error) in zip(columns, titles, axes.T, strict=True):
        time = hard.target.time
        for own, first, second in (
            (speed, np.abs(hard.plain_qd / cap).max(axis=1), np.abs(hard.ours.qd / cap).max(axis=1)),
            (error, plain, mine),
        ):
            own.semilogy(time, first, color=ARM_COLORS[1], linewidth=1.0, label="the paper's law, plain inverse")
            own.semilogy(time, second, color=ARM_COLORS[0], label="damped and capped")
            own.set_xlim(0.0, time[-1])
        speed.axhline(1.0, color=MUTED, linewidth=0.9, linestyle=DOTTED)
        speed.set_title(title)
        error.set_xlabel("time [s]")
    least = MM * least_error(out)
    beyond = out.target.time[least > 0.0]
    (speed, turning_speed), (error, turning_error) = axes
    for own in (speed, error):
        own.axvspan(beyond[0], beyond[-1], color=FORBIDDEN, alpha=0.5, zorder=0)
    nearest = {"color": INK, "linewidth": 1.0, "linestyle": DASHED, "label": "no posture is nearer", "zorder": 4.0}
    error.semilogy(out.target.time, np.where(least > 0.0, least, np.nan), **nearest)
    speed.set_ylim(1e-2, 1e7)
    turning_speed.set_ylim(5e-2, 1e2)
    error.set_ylim(1e-6, 1e5)
    turning_error.set_ylim(1e-10, 1.0)
    note(speed, float(beyond.mean()), 2e6, "out of reach", data=True, ha="center", color=MUTED)
    note(turning_speed, 0.02, 1.15, "the cap", data=True, color=MUTED)
    speed.set_ylabel("fastest joint / its cap [1]")
    error.set_ylabel("position error [mm]")
    turning_error.set_ylabel("orientation error [rad]")
    figure.legend(*error.get_legend_handles_labels(), loc="outside lower center", ncols=3)
    return figure

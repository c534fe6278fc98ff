"""The values of Lee, Chong, Suh, Choi, Lyou (1991), beside ours."""

from __future__ import annotations

from functools import partial
from typing import Any, NamedTuple

import numpy as np

from armtempo.commands.console import Output
from armtempo.commands.papers._reproduction import Quantity
from armtempo.planners import METHODS, CoordinationCell, Schedule, schedule

PERIODS_MS = (0.5, 1.0, 2.0, 4.0, 5.0)  # steps dT of velocity control


class Run(NamedTuple):
    """The paper's cell planned by every method and every step of velocity control."""

    cell: CoordinationCell
    plans: dict[str, Schedule]  # by method
    by_period: dict[float, Schedule]  # by vci, by step dT [ms]


def run(cell: CoordinationCell, output: Output) -> Run:
    """Plan the bundled ``lee1991``."""
    plans: dict[str, Schedule] = {}
    by_period: dict[float, Schedule] = {}
    with output.progress("Planning", len(METHODS) + len(PERIODS_MS)) as (progress, task):
        for method in METHODS:
            plans[method] = schedule(cell, method, order="file")
            progress.advance(task)
        for period in PERIODS_MS:
            by_period[period] = schedule(cell, "vci", period=1e-3 * period)
            progress.advance(task)
    return Run(cell, plans, by_period)


def compare(run: Run) -> list[Quantity]:
    """Every number of the paper, and what it leaves out, beside ours."""
    return [*_path_values(run.cell), *_arm_values(run.cell), *_times(run), *_choices(run.cell), *_more(run)]


def _path_values(cell: CoordinationCell) -> list[Quantity]:
    """Table 1, read off the joint paths through the arms' own kinematics."""
    printed = {
        "master": {"start": (0.40, 0.35), "end": (0.40, 0.05), "centre": (0.25, 0.20)},
        "slave": {"start": (0.45, 0.35), "end": (0.45, 0.05), "centre": (0.60, 0.20)},
    }
    row = partial(Quantity, "Table 1: paths")
    values = []
    for arm, path in zip(cell.arms, cell.paths, strict=True):
        points = arm.tip_pose(path.evaluate(np.linspace(0.0, path.length, 5))[0])[:, :2, 3]
        # Circle through the points: x^2 + y^2 = 2 x c_x + 2 y c_y + (r^2 - c^2)
        rows = np.column_stack([2.0 * points, np.ones(len(points))])
        solution = np.linalg.lstsq(rows, (points**2).sum(axis=1), rcond=None)[0]
        centre = solution[:2]
        ours = {"start": points[0], "end": points[-1], "centre": centre}
        for what, place in printed[arm.name].items():
            for k, axis in enumerate("xy"):
                values.append(row(f"{arm.name}'s {what}, {axis}", "m", place[k], float(ours[what][k])))
        radius = float(np.sqrt(solution[2] + centre @ centre))
        values.append(row(f"radius of the {arm.name}'s path", "m", 0.2121, radius, note="follows from its points"))
        values.append(row(f"length of the {arm.name}'s path", "m", None, path.length))
    return values


def _arm_values(cell: CoordinationCell) -> list[Quantity]:
    """The appendix, computed from the URDF's masses and lengths."""
    row = partial(Quantity, "Appendix: arm")
    arm = cell.arms[0]
    straight, folded = arm.mass_matrix(np.array([[0.0, 0.0], [0.0, np.pi]]))
    constant, cosine = 0.5 * (straight + folded), 0.5 * (straight - folded)
    bent = np.array([0.0, 0.5 * np.pi])

    def velocity_torque(*speeds: float) -> np.ndarray[Any, np.dtype[np.float64]]:
        still = arm.inverse_dynamics(bent, np.zeros(2), np.zeros(2), friction=False)
        return arm.inverse_dynamics(bent, np.array(speeds), np.zeros(2), friction=False) - still

    first, second, both = velocity_torque(1.0, 0.0), velocity_torque(0.0, 1.0), velocity_torque(1.0, 1.0)
    twice = "the print also has 0.3405"
    slip = "the print also has 0.0795"
    return [
        row("length of link 1", "m", 0.37, float(np.linalg.norm(arm.model.placement_p[1]))),
        row("length of link 2", "m", 0.23, float(np.linalg.norm(arm.model.tip_p))),
        row("torque limit of joint 1", "N m", 25.0, float(arm.torque_max[0]), 1),
        row("torque limit of joint 2", "N m", 7.0, float(arm.torque_max[1]), 1),
        row("U1: θ1'', constant", "kg m^2", 0.8608, float(constant[0, 0])),
        row("U1: θ1'', cos θ2", "kg m^2", 0.3404, float(cosine[0, 0]), note=twice),
        row("U1: θ2'', constant", "kg m^2", 0.07905, float(constant[0, 1]), 5, note=slip),
        row("U1: θ2'', cos θ2", "kg m^2", 0.1702, float(cosine[0, 1])),
        row("U1: θ1' θ2', sin θ2", "kg m^2", -0.3404, float((both - first - second)[0]), note=twice),
        row("U1: θ2'^2, sin θ2", "kg m^2", -0.1702, float(second[0])),
        row("U2: θ1'', constant", "kg m^2", 0.07905, float(constant[1, 0]), 5, note=slip),
        row("U2: θ1'', cos θ2", "kg m^2", 0.1702, float(cosine[1, 0])),
        row("U2: θ2'', constant", "kg m^2", 0.07905, float(constant[1, 1]), 5, note=slip),
        row("U2: θ1'^2, sin θ2", "kg m^2", 0.1702, float(first[1])),
        row("U2: θ1' θ2', sin θ2", "kg m^2", None, float((both - first - second)[1]), note="printed: a slip"),
    ]


def _times(run: Run) -> list[Quantity]:
    """What the paper's simulation is about."""
    row = partial(Quantity, "Section 3: times")
    cell, vci, sequential = run.cell, run.plans["vci"].makespan, run.plans["sequential"].makespan
    quickest = min(plan.makespan for plan in run.by_period.values())
    step = 1e3 * cell.control_period
    half, unknown = "half of the printed 0.59", "step not printed"
    return [
        *(
            row(f"minimum time of the {arm.name} alone", "s", 0.295, fastest.duration, note=half)
            for arm, fastest in zip(cell.arms, cell.fastest, strict=True)
        ),
        row("one arm after the other", "s", 0.59, sequential),
        *(
            row(f"slave's finish by VCI, step {period:g} ms", "s", 0.33, plan.makespan, note=unknown)
            for period, plan in run.by_period.items()
        ),
        row(
            f"time saved by VCI, step {step:g} ms", "%", 45.0, _saved(vci, sequential), 1,
            "0.33 s against 0.59 s are 44.1 %",
        ),
        row("time saved by VCI, best step above", "%", 45.0, _saved(quickest, sequential), 1),
    ]  # fmt: skip


def _saved(makespan: float, sequential: float) -> float:
    return 100.0 * (1.0 - makespan / sequential)


def _choices(cell: CoordinationCell) -> list[Quantity]:
    """What the paper does not print, and a cell needs."""
    row = partial(Quantity, "Not printed: chosen here")
    thickness = 2.0 * float(cell.arms[0].capsules.radius.max())
    return [
        *(
            row(f"{arm.name}'s base, {axis}", "m", None, float(arm.T_world_base[k, 3]), 3)
            for arm in cell.arms
            for k, axis in enumerate("xy")
        ),
        row("d_min between surfaces", "m", None, cell.d_min, 4),
        row("d_min between centre lines", "m", None, cell.d_min + thickness, 4, "links of 5 mm radius"),
    ]


def _more(run: Run) -> list[Quantity]:
    """What the paper could not know."""
    row = partial(Quantity, "Beyond the paper")
    cell, plans = run.cell, run.plans
    vci, rival = plans["vci"], "what the paper compares with"
    slow, eager = plans["constant-speed"].makespan, plans["constant-acceleration"].makespan
    saved = _saved(plans["optimal"].makespan, plans["sequential"].makespan)
    clearance, torque = vci.certificate.min_clearance, vci.certificate.torque_ratio_max
    step = 1e3 * cell.control_period
    return [
        row("certified lower bound", "s", None, cell.lower_bound),
        row("delayed start ('method 1')", "s", None, plans["delay"].makespan, note="optimal in this class"),
        row("optimal ('method 2')", "s", None, plans["optimal"].makespan),
        row("constant speed, delayed", "s", None, slow, note=rival),
        row("constant acceleration, delayed", "s", None, eager, note=rival),
        row("time saved by the optimum", "%", None, saved, 1),
        row(f"VCI's gap to the bound, step {step:g} ms", "%", None, vci.gap_percent, 2),
        row("smallest clearance by VCI", "m", None, clearance, 5, "FCL, every 0.2 ms"),
        row("largest torque by VCI", "x limit", None, torque, 5, "10 samples an interval"),
        row("collision regions in the chart", "1", None, float(cell.chart.regions), 0),
    ]

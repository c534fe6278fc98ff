"""The values and figures of Lee, Chong, Suh, Choi, Lyou (1991), beside ours."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from armtempo.commands.papers._reproduction import Quantity, Reproduction

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from armtempo.commands.console import Output
    from armtempo.planners import CoordinationCell, Schedule

PERIODS_MS = (0.5, 1.0, 2.0, 4.0, 5.0)  # steps dT of velocity control


def reproduce_lee1991(output: Output) -> Reproduction:
    """Plan the paper's cell by every method and every step of velocity control, and compare."""
    from armtempo.commands.console import open_cell
    from armtempo.planners import METHODS, schedule

    cell = open_cell("lee1991", output)
    plans: dict[str, Schedule] = {}
    by_period: dict[float, Schedule] = {}
    with output.progress("Planning", len(METHODS) + len(PERIODS_MS)) as (progress, task):
        for method in METHODS:
            plans[method] = schedule(cell, method)
            progress.advance(task)
        for period in PERIODS_MS:
            by_period[period] = schedule(cell, "vci", period=1e-3 * period)
            progress.advance(task)
    with output.progress("Comparing"):
        quantities = lee1991_quantities(cell, plans, by_period)
    with output.progress("Drawing"):
        figures = lee1991_figures(cell, plans)
    return Reproduction("Lee, Chong, Suh, Choi, Lyou (1991)", quantities, figures)


def _path_values(cell: CoordinationCell) -> list[Quantity]:
    """Table 1, read off the joint paths through the arms' own kinematics."""
    printed = {
        "master": {"start": (0.40, 0.35), "end": (0.40, 0.05), "centre": (0.25, 0.20)},
        "slave": {"start": (0.45, 0.35), "end": (0.45, 0.05), "centre": (0.60, 0.20)},
    }
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
                values.append(
                    Quantity("Table 1: paths", f"{arm.name}'s {what}, {axis}", "m", place[k], float(ours[what][k]))
                )
        radius = float(np.sqrt(solution[2] + centre @ centre))
        values.append(
            Quantity(
                "Table 1: paths",
                f"radius of the {arm.name}'s path",
                "m",
                0.2121,
                radius,
                note="follows from its points",
            )
        )
        values.append(Quantity("Table 1: paths", f"length of the {arm.name}'s path", "m", None, path.length))
    return values


def _arm_values(cell: CoordinationCell) -> list[Quantity]:
    """The appendix, computed from the URDF's masses and lengths."""
    section = "Appendix: arm"
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
        Quantity(section, "length of link 1", "m", 0.37, float(np.linalg.norm(arm.model.placement_p[1]))),
        Quantity(section, "length of link 2", "m", 0.23, float(np.linalg.norm(arm.model.tip_p))),
        Quantity(section, "torque limit of joint 1", "N m", 25.0, float(arm.torque_max[0]), 1),
        Quantity(section, "torque limit of joint 2", "N m", 7.0, float(arm.torque_max[1]), 1),
        Quantity(section, "U1: θ1'', constant", "kg m^2", 0.8608, float(constant[0, 0])),
        Quantity(section, "U1: θ1'', cos θ2", "kg m^2", 0.3404, float(cosine[0, 0]), note=twice),
        Quantity(section, "U1: θ2'', constant", "kg m^2", 0.07905, float(constant[0, 1]), 5, note=slip),
        Quantity(section, "U1: θ2'', cos θ2", "kg m^2", 0.1702, float(cosine[0, 1])),
        Quantity(section, "U1: θ1' θ2', sin θ2", "kg m^2", -0.3404, float((both - first - second)[0]), note=twice),
        Quantity(section, "U1: θ2'^2, sin θ2", "kg m^2", -0.1702, float(second[0])),
        Quantity(section, "U2: θ1'', constant", "kg m^2", 0.07905, float(constant[1, 0]), 5, note=slip),
        Quantity(section, "U2: θ1'', cos θ2", "kg m^2", 0.1702, float(cosine[1, 0])),
        Quantity(section, "U2: θ2'', constant", "kg m^2", 0.07905, float(constant[1, 1]), 5, note=slip),
        Quantity(section, "U2: θ1'^2, sin θ2", "kg m^2", 0.1702, float(first[1])),
        Quantity(
            section, "U2: θ1' θ2', sin θ2", "kg m^2", None, float((both - first - second)[1]), note="printed: a slip"
        ),
    ]


def lee1991_quantities(
    cell: CoordinationCell, plans: dict[str, Schedule], by_period: dict[float, Schedule]
) -> list[Quantity]:
    """Every number of the paper, and what it leaves out, beside ours.

    Args:
        cell: The bundled ``lee1991``.
        plans: Its schedules by method.
        by_period: Its ``vci`` schedules by step dT [ms].
    """
    times, choice, more = "Section 3: times", "Not printed: chosen here", "Beyond the paper"
    sequential = plans["sequential"].makespan
    vci = plans["vci"]
    values = _path_values(cell) + _arm_values(cell)
    values += [
        Quantity(
            times,
            f"minimum time of the {arm.name} alone",
            "s",
            0.295,
            fastest.duration,
            note="half of the printed 0.59",
        )
        for arm, fastest in zip(cell.arms, cell.fastest, strict=True)
    ]
    values.append(Quantity(times, "one arm after the other", "s", 0.59, sequential))
    values += [
        Quantity(times, f"slave's finish by VCI, step {period:g} ms", "s", 0.33, plan.makespan, note="step not printed")
        for period, plan in by_period.items()
    ]
    saved = 100.0 * (1.0 - vci.makespan / sequential)
    quickest = 100.0 * (1.0 - min(plan.makespan for plan in by_period.values()) / sequential)
    step = 1e3 * cell.control_period
    values += [
        Quantity(
            times, f"time saved by VCI, step {step:g} ms", "%", 45.0, saved, 1, "0.33 s against 0.59 s are 44.1 %"
        ),
        Quantity(times, "time saved by VCI, best step above", "%", 45.0, quickest, 1),
    ]
    for arm in cell.arms:
        values.append(Quantity(choice, f"{arm.name}'s base, x", "m", None, float(arm.T_world_base[0, 3]), 3))
        values.append(Quantity(choice, f"{arm.name}'s base, y", "m", None, float(arm.T_world_base[1, 3]), 3))
    radius = float(cell.arms[0].capsules.radius.max())
    values += [
        Quantity(choice, "d_min between surfaces", "m", None, cell.d_min, 4),
        Quantity(choice, "d_min between centre lines", "m", None, cell.d_min + 2.0 * radius, 4, "links of 5 mm radius"),
        Quantity(more, "certified lower bound", "s", None, cell.lower_bound),
        Quantity(more, "delayed start ('method 1')", "s", None, plans["delay"].makespan, note="optimal in this class"),
        Quantity(more, "optimal ('method 2')", "s", None, plans["optimal"].makespan),
        Quantity(
            more,
            "constant speed, delayed",
            "s",
            None,
            plans["constant-speed"].makespan,
            note="what the paper compares with",
        ),
        Quantity(
            more,
            "constant acceleration, delayed",
            "s",
            None,
            plans["constant-acceleration"].makespan,
            note="what the paper compares with",
        ),
        Quantity(
            more, "time saved by the optimum", "%", None, 100.0 * (1.0 - plans["optimal"].makespan / sequential), 1
        ),
        Quantity(more, f"VCI's gap to the bound, step {step:g} ms", "%", None, vci.gap_percent, 2),
        Quantity(more, "smallest clearance by VCI", "m", None, vci.certificate.min_clearance, 5, "FCL, every 0.2 ms"),
        Quantity(
            more,
            "largest torque by VCI",
            "x limit",
            None,
            vci.certificate.torque_ratio_max,
            5,
            "10 samples an interval",
        ),
        Quantity(more, "collision regions in the chart", "1", None, float(cell.chart.regions), 0),
    ]
    return values


def lee1991_figures(cell: CoordinationCell, plans: dict[str, Schedule]) -> dict[str, Figure]:
    """Figs. 1 to 8 of the paper from our data, then torque and clearance over time, by file name."""
    from armtempo.commands.figures import _phase as _phase_figures
    from armtempo.commands.figures import _space as _space_figures
    from armtempo.commands.figures import _time as _time_figures

    vci = plans["vci"]
    figures = {
        "fig1_collision_interval": _space_figures.collision_interval(
            cell, title="Fig. 1  Collision interval in the common workspace"
        ),
        "fig2_coordination_chart": _space_figures.coordination_chart(cell, title="Fig. 2  Coordination chart"),
    }
    cases: tuple[tuple[Literal[3, 4], str], ...] = ((3, "last step adjusted"), (4, "earlier step adjusted"))
    for case, name in cases:
        correction = _phase_figures.find_correction(cell, case)
        if correction is not None:
            figures[f"fig{case}_vci_{name.split()[0]}_step"] = _phase_figures.velocity_control(
                cell, correction, f"Fig. {case}  Modified trajectory of the slave: {name}"
            )
    figures |= {
        "fig5_workspace": _space_figures.workspace(cell, "Fig. 5  Two robots in a common workspace"),
        "fig6_phase_plane": _phase_figures.phase_plane(
            vci, "Fig. 6  Trajectories of the two robots in the phase plane"
        ),
        "fig7_relative_trajectory": _space_figures.relative_trajectories(
            cell, plans, "vci", "Fig. 7  Relative trajectory in the coordination chart"
        ),
        "fig8_running_time": _phase_figures.running_time(vci, "Fig. 8  Running time: the area under 1/μ"),
        "torque": _time_figures.torques(vci, title="Torques over time: vci"),
        "clearance": _time_figures.clearances(cell, plans, emphasised="vci"),
    }
    return figures

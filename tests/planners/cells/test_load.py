"""Loading a cell certifies it: every error says in one line what is wrong, where in the user's file, and what to do."""

from __future__ import annotations

import math
import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from armtempo.configs import data_path
from armtempo.errors import (
    ArmtempoError,
    CollisionError,
    ConfigError,
    InfeasibleError,
    InputError,
    PathError,
    UnknownNameError,
)
from armtempo.planners import METHODS, BlendedPath, Cell, CoordinationCell, build_cell, load_cell, schedule
from armtempo.planners.joint_paths import CartesianJointPath

Cells = Callable[..., Path]
Change = Callable[[dict[str, Any]], object]


def test_the_bundled_cell(lee1991: CoordinationCell) -> None:
    assert lee1991.name == "lee1991"
    assert [arm.name for arm in lee1991.arms] == ["master", "slave"]
    assert (lee1991.d_min, lee1991.physics_tick, lee1991.control_period) == (0.01, 0.001, 0.004)
    assert lee1991.planned_clearance == pytest.approx(0.0105)
    assert lee1991.ticks_per_period == 4
    assert lee1991.paths[0].length == pytest.approx(0.5 * math.pi * 0.15 * math.sqrt(2.0))
    for arm, path, start in zip(lee1991.arms, lee1991.paths, ((0.4, 0.35, 0.0), (0.45, 0.35, 0.0)), strict=True):
        np.testing.assert_allclose(arm.tip_pose(path.evaluate(0.0)[0])[:3, 3], start, atol=1e-12)
    q_master, q_slave = (path.evaluate(0.1)[0] for path in lee1991.paths)
    assert q_master[1] < 0.0 < q_slave[1]  # elbows outward
    np.testing.assert_allclose(q_slave, [math.pi - q_master[0], -q_master[1]], atol=1e-12)  # mirror images


def test_a_file_of_the_users_own_is_the_same_cell(write_cell: Cells, lee1991: CoordinationCell) -> None:
    own = load_cell(write_cell(lambda data: data.update(name="mine")))
    assert own.name == "mine"
    assert own.fastest[0].duration == lee1991.fastest[0].duration
    np.testing.assert_array_equal(own.chart.states, lee1991.chart.states)
    assert build_cell(own.config).paths[1].length == own.paths[1].length


@pytest.mark.parametrize("kind", [Cell, "blend", int])
def test_what_is_no_class_of_cells_is_refused(kind: Any) -> None:
    with pytest.raises(
        InputError, match=r"kind must be a class of cells, got .*give CoordinationCell, BlendCell, IKCell"
    ):
        load_cell("lee1991", kind)


def arm(data: dict[str, Any], i: int = 0) -> dict[str, Any]:
    chosen: dict[str, Any] = data["arms"][i]
    return chosen


def vertical(data: dict[str, Any], torque: list[float]) -> None:
    data["gravity_m_s2"] = [0, -9.81, 0]
    for i in (0, 1):
        arm(data, i)["limits"] = {"torque_nm": torque}


def obstacle(data: dict[str, Any], position: list[float], **body: Any) -> None:
    data["obstacles"] = [{"name": "post", **(body or {"sphere": {"radius_m": 0.02}}), "pose": {"position_m": position}}]


def line(data: dict[str, Any], start: list[float], *ends: list[float]) -> None:
    arm(data)["path"] = {"start_m": start, "segments": [{"line": {"to_m": end}} for end in ends]}


HEAD = r"cell\.yaml, arms\[0\]\.path: "
REFUSED: dict[str, tuple[Change, type[ArmtempoError], str]] = {
    "start too close": (
        lambda data: data.update(d_min_m=0.05),
        CollisionError,
        r"cell\.yaml: the arms collide where they start: master/link_\d and slave/link_\d "
        r"are 0\.04 m apart, 0\.0505 m are required.*lower d_min_m",
    ),
    "unreachable": (
        lambda data: line(data, [0.4, 0.35, 0], [0.6, 0.35, 0]),
        PathError,
        HEAD + r"path of arm 'master' is unreachable at station 0\.2 m: 0\.6946 m from its base, too far",
    ),
    "out of plane": (
        lambda data: line(data, [0.4, 0.35, 0], [0.4, 0.3, 0.1]),
        PathError,
        HEAD + "path of arm 'master' leaves the plane",
    ),
    "corner": (
        lambda data: line(data, [0.4, 0.35, 0], [0.4, 0.3, 0], [0.3, 0.3, 0]),
        PathError,
        HEAD + r"segments 0 and 1 meet in a corner of 90 degrees at 0\.05 m \(round it",
    ),
    "zero line": (
        lambda data: line(data, [0.4, 0.3, 0], [0.4, 0.3, 0]),
        PathError,
        HEAD + r"segments\[0\]: line from .* has no length",
    ),
    "radii": (
        lambda data: arm(data)["path"]["segments"][0]["arc"].update(center_m=[0.25, 0.21, 0]),
        PathError,
        HEAD + r"segments\[0\]: arc centre .* is 0\.205183 m from its start but 0\.219317 m from its end",
    ),
    "joint limit": (
        lambda data: arm(data)["limits"].update(position_rad=[None, [-0.5, 0.5]]),
        PathError,
        HEAD + r"path of arm 'master' breaks the limit of joint 'joint_2' at station .* outside \[-0\.5, 0\.5\]",
    ),
    "obstacle": (
        lambda data: obstacle(data, [0.46, 0.2, 0]),
        CollisionError,
        HEAD + r"path of arm 'master' comes too close to an obstacle at station 0\.1\d* m: "
        r".*(master/link_2.*post|post.*master/link_2) .*0\.01\d* m are required",
    ),
    "box on a link": (
        lambda data: obstacle(data, [0.05, 0.12, 0], box={"size_m": [0.05, 0.02, 0.1]}),
        CollisionError,
        HEAD + "path of arm 'master' comes too close to an obstacle at station",
    ),
    "too weak to hold": (
        lambda data: vertical(data, [1, 7]),
        InfeasibleError,
        HEAD + r"joint 'joint_1' of arm 'master' needs .* N m to hold still at station .*, its "
        r"limits are \[-1, 1\] N m \(raise limits\.torque_nm",
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", REFUSED)
def test_what_cannot_work_is_refused_where_it_stands(write_cell: Cells, case: str) -> None:
    change, kind, message = REFUSED[case]
    with pytest.raises(kind, match=message) as refusal:
        load_cell(write_cell(change))
    assert "\n" not in str(refusal.value)
    assert refusal.value.remedy


def test_refusals_carry_their_data(write_cell: Cells) -> None:
    with pytest.raises(CollisionError) as refusal:
        load_cell(write_cell(lambda data: obstacle(data, [0.46, 0.2, 0])))
    data = refusal.value.data
    assert data["arm"] == "master"
    assert 0.05 < data["station"] < 0.3
    assert "post" in " ".join(data["bodies"])
    assert data["clearance_m"] < data["required_m"]
    with pytest.raises(PathError) as unreachable:
        load_cell(write_cell(lambda data: line(data, [0.4, 0.35, 0], [0.6, 0.35, 0])))
    assert unreachable.value.data["station"] == pytest.approx(0.2)


def test_the_second_arm_is_named_too(write_cell: Cells) -> None:
    def change(data: dict[str, Any]) -> None:
        arm(data, 1)["path"]["start_m"] = [0.2, 0.0, 0]
        arm(data, 1)["path"]["segments"] = [{"line": {"to_m": [0.1, 0.0, 0]}}]

    with pytest.raises(PathError, match=r"arms\[1\]\.path: path of arm 'slave' is unreachable at station"):
        load_cell(write_cell(change))


def test_an_obstacle_beside_the_path_is_none(write_cell: Cells) -> None:
    cell = load_cell(write_cell(lambda data: obstacle(data, [0.425, -0.1, 0])))
    assert cell.obstacles[0].kind == "sphere"
    lam = np.linspace(0.0, cell.paths[0].length, 200)
    nearest = min(cell.clearance.obstacles(0, q).distance for q in cell.paths[0].evaluate(lam)[0])
    assert nearest >= cell.planned_clearance
    assert schedule(cell, "delay").makespan == pytest.approx(0.328, abs=0.002)


@pytest.mark.parametrize("room", [-2e-4, 2e-4])
def test_obstacles_are_kept_off_to_the_reserve(write_cell: Cells, lee1991: CoordinationCell, room: float) -> None:
    """A post beyond the end of the master's path, just inside and just outside of d_min and the reserve."""
    end = lee1991.paths[0].evaluate(lee1991.paths[0].length)[0]
    tip = lee1991.arms[0].tip_pose(end)[:3, 3]
    away = tip + np.array([0.0, -(0.005 + 0.02 + lee1991.planned_clearance + room), 0.0])
    file = write_cell(lambda data: obstacle(data, away.tolist()))
    if room > 0:
        assert load_cell(file).obstacles
    else:
        with pytest.raises(CollisionError, match=r"too close to an obstacle"):
            load_cell(file)


def test_an_arm_that_meets_itself_is_refused(write_cell: Cells, tmp_path: Path) -> None:
    """A base with a body: the tip folds back to it. Neighbours are never asked."""
    ball = '<collision><geometry><sphere radius="0.18"/></geometry></collision></link>'
    urdf = data_path("robots/planar_two_link.urdf").read_text().replace("</link>", ball, 1)
    (tmp_path / "ball.urdf").write_text(urdf)

    def change(data: dict[str, Any], reach: float) -> None:
        arm(data)["urdf"] = "ball.urdf"
        line(data, [0.4, 0.05, 0], [reach, 0.05, 0])

    assert load_cell(write_cell(lambda data: change(data, 0.3))).arms[0].shapes[0].link == -1
    with pytest.raises(
        CollisionError, match=HEAD + "path of arm 'master' comes too close to itself at station .*base_link"
    ):
        load_cell(write_cell(lambda data: change(data, 0.17)))


def test_enough_torque_to_hold_is_enough_to_plan(write_cell: Cells) -> None:
    cell = load_cell(write_cell(lambda data: vertical(data, [80, 20])))
    assert cell.fastest[0].certificate.excess < 1e-3
    plan = schedule(cell, "delay")
    assert plan.certificate.certified_free
    assert plan.gap_percent >= -0.1


def test_a_reserve_of_torque_costs_time(write_cell: Cells, lee1991: CoordinationCell) -> None:
    cell = load_cell(write_cell(lambda data: data.update(torque_reserve=0.19)))
    assert cell.fastest[0].duration == pytest.approx(lee1991.fastest[0].duration / 0.9, rel=1e-6)
    assert cell.dynamics[0].torque_max[0].tolist() == pytest.approx([20.25, 5.67])


def test_speed_limits_are_kept(write_cell: Cells) -> None:
    cell = load_cell(write_cell(lambda data: arm(data)["limits"].update(speed_rad_s=[3, 4])))
    assert cell.fastest[0].duration > cell.fastest[1].duration
    assert cell.fastest[0].certificate.speed_ratio_max < 1 + 1e-3


def test_one_arm_is_a_cell(write_cell: Cells) -> None:
    cell = load_cell(write_cell(lambda data: data.update(arms=data["arms"][:1])))
    assert 0.999 * cell.fastest[0].duration < cell.lower_bound <= cell.fastest[0].duration
    assert schedule(cell, "vci").makespan == cell.fastest[0].duration


def test_lines_and_arcs_joined(write_cell: Cells) -> None:
    def change(data: dict[str, Any]) -> None:
        arm(data)["path"] = {
            "start_m": [0.1, 0.35, 0],
            "segments": [
                {"line": {"to_m": [0.3, 0.35, 0]}},
                {"arc": {"to_m": [0.4, 0.25, 0], "center_m": [0.3, 0.25, 0]}},
                {"line": {"to_m": [0.4, 0.05, 0]}},
            ],
        }

    cell = load_cell(write_cell(change))
    assert len(cell.paths[0].breakpoints) == 4
    assert cell.fastest[0].certificate.excess < 1e-3
    for method in METHODS:
        plan = schedule(cell, method)
        assert plan.certificate.certified_free
        assert plan.certificate.torque_ratio_max < 1 + 1e-3
        assert plan.gap_percent >= -0.1


def test_unknown_cells_and_typos_are_named(write_cell: Cells) -> None:
    with pytest.raises(UnknownNameError, match=r"lee1990.*did you mean 'lee1991'"):
        load_cell("lee1990")
    with pytest.raises(ConfigError, match=r"cell\.yaml.*d_min"):
        load_cell(write_cell(lambda data: data.update(d_min=data.pop("d_min_m"))))


def test_a_path_near_a_folded_arm_is_planned_on_a_finer_grid(write_cell: Cells) -> None:
    """The dynamics change so fast there that on the file's grid full speed in ticks exceeds a limit by half."""

    def fold(data: dict[str, Any]) -> None:
        data["arms"] = data["arms"][:1]
        line(data, [0.1401, 0, 0], [0.4, 0.2, 0])

    cell = load_cell(write_cell(fold))
    assert len(cell.planes[0].rows.station) > cell.config.stations + 50
    stepped = cell.planes[0].motion(np.ones(1000), np.full(1000, cell.physics_tick))
    assert stepped.certificate.excess <= 1e-3
    assert cell.lower_bound <= stepped.duration <= 1.01 * cell.lower_bound


def test_the_bound_does_not_hang_on_the_cells_own_grid(write_cell: Cells) -> None:
    coarse = load_cell(write_cell(lambda data: data.update(stations=50)))
    fine = load_cell("lee1991")
    for method in METHODS:
        assert coarse.lower_bound <= schedule(fine, method).makespan
        assert schedule(coarse, method).certificate.torque_ratio_max <= 1 + 1e-3


def test_an_arm_needs_its_elbow_or_its_start(write_cell: Cells) -> None:
    with pytest.raises(
        ConfigError, match=r"path.start_rad: arm 'master' reaches .* none is chosen \(give path.start_rad"
    ):
        load_cell(write_cell(lambda data: data["arms"][0].pop("elbow")))


def test_the_elbow_of_another_arm(write_cell: Cells) -> None:
    def swap(data: dict[str, Any]) -> None:
        arm(data).update(urdf="pybullet_data/franka_panda/panda.urdf", limits={})
        del arm(data)["tip_link"]

    with pytest.raises(PathError, match=r"arms\[0\].path: arm 'master' is no SCARA"):
        load_cell(write_cell(swap))


def test_any_arm_follows_lines_with_blended_corners(write_cell: Cells) -> None:
    """A Panda beside the paper's slave: from its start posture along two lines, the corner rounded."""

    def swap(data: dict[str, Any]) -> None:
        master = arm(data)
        del master["elbow"], master["tip_link"], master["limits"]
        master.update(urdf="pybullet_data/franka_panda/panda.urdf", base={"position_m": [-2.0, 0.0, 0.0]})
        master["path"] = {
            "start_m": [-1.446, 0.0, 0.3522],
            "start_rad": [0.0, 0.0, 0.0, -2.0, 0.0, 2.0, 0.785],
            "segments": [{"line": {"to_m": [-1.45, 0.1, 0.35]}}, {"line": {"to_m": [-1.45, 0.1, 0.25]}}],
            "blend": {"curve": "quintic", "remaining_distance_m": 0.03},
        }
        data.update(stations=200, chart_tolerance_m=0.01)

    cell = load_cell(write_cell(swap))
    path = cell.paths[0]
    assert isinstance(path, CartesianJointPath)
    assert isinstance(path.cartesian, BlendedPath)
    lam = np.linspace(0.0, path.length, 50)
    np.testing.assert_allclose(
        cell.arms[0].tip_pose(path.evaluate(lam)[0])[:, :3, 3], path.cartesian.position(lam), atol=1e-12
    )
    assert cell.fastest[0].certificate.excess <= 1e-3
    assert cell.priority_class == "free"


def test_a_cell_travels_to_other_processes(lee1991: CoordinationCell) -> None:
    copy: CoordinationCell = pickle.loads(pickle.dumps(lee1991))
    assert copy.config == lee1991.config
    assert copy.config.source == lee1991.config.source
    np.testing.assert_array_equal(copy.fastest[1].mu, lee1991.fastest[1].mu)


def test_jerk_limits_of_a_cell_reach_the_arm(write_cell: Cells) -> None:
    def limit(data: dict[str, Any], jerk: list[object]) -> None:
        arm(data)["limits"]["jerk_rad_s3"] = jerk

    made = load_cell(write_cell(lambda data: limit(data, [500, None])))
    assert [one.jerk_max.tolist() for one in made.arms] == [[500.0, np.inf], [np.inf, np.inf]]
    for jerk, words in (([500, 0], r"jerk_rad_s3\[1\]"), ([500], "2, one per joint")):
        with pytest.raises(ArmtempoError, match=words):
            load_cell(write_cell(lambda data, jerk=jerk: limit(data, jerk)))

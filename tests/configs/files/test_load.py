from __future__ import annotations

import copy
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import yaml
from pydantic import ValidationError

from armtempo.configs import (
    ArcConfig,
    ArmConfig,
    BlendCellConfig,
    CellConfig,
    IKCellConfig,
    LineConfig,
    bundled_cells,
    change_blend,
    data_path,
    load_cell_config,
    parse_cell_config,
    resolve_file,
    robot_config,
)
from armtempo.errors import ArmtempoError, ConfigError, UnknownNameError

Edit = Callable[[dict[str, Any]], None]


def cell() -> dict[str, Any]:
    """A small valid cell with everything that is optional."""
    return {
        "kind": "coordination",
        "name": "mine",
        "d_min_m": 0.02,
        "arms": [
            {
                "name": "left",
                "urdf": "left.urdf",
                "tool": {
                    "mass_kg": 0.5,
                    "com_m": [0, 0, 0.1],
                    "inertia_kgm2": [0.01, 0.01, 0.005, 0, 0, 0],
                    "frame": {"position_m": [0, 0, 0.2]},
                    "hull_m": [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]],
                },
                "limits": {"torque_nm": [25, None], "position_rad": [[-1, 1], None]},
                "path": {
                    "start_m": [0.4, 0.3, 0],
                    "segments": [
                        {"line": {"to_m": [0.4, 0.2, 0]}},
                        {"arc": {"to_m": [0.3, 0.1, 0], "center_m": [0.3, 0.2, 0]}},
                    ],
                },
            },
            {
                "name": "right",
                "urdf": "right.urdf",
                "path": {"start_m": [1, 0, 0], "segments": [{"line": {"to_m": [1, 1, 0]}}]},
            },
        ],
        "obstacles": [
            {"name": "post", "cylinder": {"radius_m": 0.1, "length_m": 1}, "pose": {"position_m": [2, 0, 0]}}
        ],
    }


def write(folder: Path, text: str) -> Path:
    path = folder / "mine.yaml"
    path.write_text(text, encoding="utf-8")
    return path


def test_bundled_lee1991_is_the_cell_of_the_paper() -> None:
    config = load_cell_config("lee1991")
    master, slave = config.arms
    assert (master.name, slave.name) == ("master", "slave")
    assert master.base.position_m == (0.0, 0.0, 0.0)
    assert slave.base.position_m == (0.85, 0.0, 0.0)
    assert master.base.rpy_rad == slave.base.rpy_rad == (0.0, 0.0, 0.0)
    assert (master.elbow, slave.elbow) == ("negative", "positive")
    assert master.limits.torque_nm == slave.limits.torque_nm == (25.0, 7.0)
    assert master.path.start_m == (0.40, 0.35, 0.0)
    assert master.path.segments[0].geometry == ArcConfig(to_m=(0.40, 0.05, 0.0), center_m=(0.25, 0.20, 0.0))
    assert slave.path.start_m == (0.45, 0.35, 0.0)
    assert slave.path.segments[0].geometry == ArcConfig(to_m=(0.45, 0.05, 0.0), center_m=(0.60, 0.20, 0.0))
    assert (config.d_min_m, config.physics_tick_s, config.control_period_s) == (0.01, 0.001, 0.004)
    assert config.ticks_per_period == 4


@pytest.mark.parametrize("name", bundled_cells())
def test_every_bundled_cell_loads_under_its_own_name(name: str) -> None:
    config = load_cell_config(name)
    assert config.name == name
    assert config.description
    assert config.source == data_path(f"cells/{name}.yaml").resolve()


def test_own_file_loads_with_its_optional_parts(tmp_path: Path) -> None:
    path = write(tmp_path, yaml.safe_dump(cell()))
    config = load_cell_config(path)
    assert load_cell_config(str(path)) == config
    assert config.source == path
    left, right = config.arms
    assert left.limits.torque_nm == (25.0, None)
    assert left.limits.position_rad == ((-1.0, 1.0), None)
    assert left.tool is not None
    assert left.tool.hull_m is not None
    assert len(left.tool.hull_m) == 4
    assert isinstance(left.path.segments[0].geometry, LineConfig)
    assert right.tool is None
    assert right.elbow is None
    assert config.obstacles[0].kind == "cylinder"
    assert config.gravity_m_s2 == (0.0, 0.0, -9.81)


def test_a_bundled_name_wins_over_a_folder_of_that_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "lee1991").mkdir()
    monkeypatch.chdir(tmp_path)
    assert load_cell_config("lee1991").name == "lee1991"


def test_a_config_cannot_be_changed() -> None:
    config = load_cell_config("lee1991")
    with pytest.raises(ValidationError, match="frozen"):
        setattr(config, "d_min_m", 0.05)  # noqa: B010 - the checkers know, too
    assert config.model_copy(update={"d_min_m": 0.05}).source == config.source


def test_every_key_is_documented() -> None:
    def undocumented(model: Any, prefix: str) -> list[str]:
        return [f"{prefix}{name}" for name, field in model.model_fields.items() if not field.description]

    alternatives = {"line", "arc", "box", "sphere", "cylinder", "capsule", "mesh"}  # documented by their own class
    models = [
        CellConfig,
        *(
            vars(__import__("armtempo.configs", fromlist=["x"]))[n]
            for n in ("ArmConfig", "ToolConfig", "IKCellConfig", "HarmonicConfig", "FeedbackLawConfig")
        ),
    ]
    for model in models:
        assert not set(undocumented(model, "")) - alternatives


def arm(change: dict[str, Any], index: int = 0) -> Edit:
    return lambda data: data["arms"][index].update(change)


def top(change: dict[str, Any]) -> Edit:
    return lambda data: data.update(change)


def drop(key: str) -> Edit:
    def edit(data: dict[str, Any]) -> None:
        del data[key]

    return edit


def segment(value: Any) -> Edit:
    return lambda data: data["arms"][1]["path"].update(segments=[value])


NAN = float("nan")
BAD: dict[str, tuple[Edit, str, str]] = {
    # name: (edit of a good cell, dotted key, rest of the message as it must begin)
    "misspelt key": (
        arm({"lmits": {}}),
        "arms[0].lmits",
        "unknown key (did you mean 'limits'? known: name, urdf, base",
    ),
    "misspelt required key": (
        segment({"arc": {"to": [0, 0, 0], "center_m": [0, 0, 0]}}),
        "arms[1].path.segments[0].arc.to",
        "unknown key (did you mean 'to_m'? known: to_m, center_m, via_m, turn, normal)",
    ),
    "unlike any key": (top({"zzz": 1}), "zzz", "unknown key (known: kind, name, description, physics_tick_s"),
    "missing": (drop("d_min_m"), "d_min_m", "missing (add it: Smallest distance allowed between the surfaces"),
    "missing kind": (drop("kind"), "kind", "missing (add it: What the cell is for)"),
    "text for a number": (top({"d_min_m": "0.01"}), "d_min_m", "must be a number, got '0.01' (Smallest distance"),
    "bool for a number": (top({"d_min_m": True}), "d_min_m", "must be a number, got True ("),
    "number for text": (top({"name": 5}), "name", "must be a valid string, got 5 (Name of the cell)"),
    "bad name": (
        arm({"name": "Left arm"}),
        "arms[0].name",
        "must match '^[a-z][a-z0-9_]*$', got 'Left arm'",
    ),
    "nan": (top({"d_min_m": NAN}), "d_min_m", "must be a finite number, got nan (Smallest distance"),
    "infinite": (
        arm({"path": {"start_m": [0, float("inf"), 0], "segments": [{"line": {"to_m": [0, 0, 0]}}]}}),
        "arms[0].path.start_m[1]",
        "must be a finite number, got inf (First point [m], world frame)",
    ),
    "negative d_min": (top({"d_min_m": -0.01}), "d_min_m", "must be greater than or equal to 0, got -0.01 ("),
    "zero tick": (
        top({"physics_tick_s": 0}),
        "physics_tick_s",
        "must be greater than or equal to 0.00001, got 0 (Step of the simulation",
    ),
    "no reserve": (top({"torque_reserve": "Auto"}), "torque_reserve", "must be a number or auto, got 'Auto' ("),
    "true reserve": (top({"torque_reserve": True}), "torque_reserve", "must be a number or auto, got True ("),
    "reserve below 0": (
        top({"torque_reserve": -0.1}),
        "torque_reserve",
        "must be greater than or equal to 0, got -0.1 (",
    ),
    "all torque reserved": (top({"torque_reserve": 1}), "torque_reserve", "must be less than or equal to 0.9, got 1 ("),
    "period": (
        top({"control_period_s": 0.0045}),
        "control_period_s",
        "must be a whole multiple of physics_tick_s = 0.001, got 4.5 ticks; nearest: 0.004 (Time between two decisions",
    ),
    "period below a tick": (
        top({"control_period_s": 0.0004}),
        "control_period_s",
        "must be a whole multiple of physics_tick_s = 0.001, got 0.4 ticks; nearest: 0.001 (",
    ),
    "part of a station": (top({"stations": 10.5}), "stations", "must be a valid integer, got 10.5 ("),
    "no arms": (top({"arms": []}), "arms", "must have at least 1 item, got [] ("),
    "same name": (arm({"name": "left"}, 1), "arms", "each needs a name of its own; used twice: left ("),
    "no segments": (
        arm({"path": {"start_m": [0, 0, 0], "segments": []}}),
        "arms[0].path.segments",
        "must have at least 1 item, got [] (Pieces in order",
    ),
    "two kinds of segment": (
        segment({"line": {"to_m": [0, 0, 0]}, "arc": {"to_m": [0, 0, 0], "center_m": [0, 0, 0]}}),
        "arms[1].path.segments[0]",
        "a segment needs exactly one of line, arc; got line, arc (",
    ),
    "empty segment": (segment({}), "arms[1].path.segments[0]", "a segment needs exactly one of line, arc; got none ("),
    "short point": (
        segment({"line": {"to_m": [0, 0]}}),
        "arms[1].path.segments[0].line.to_m",
        "has too few items, got [0, 0] (End [m], world frame)",
    ),
    "bad turn": (
        segment({"arc": {"to_m": [0, 0, 0], "center_m": [0, 0, 0], "turn": "left"}}),
        "arms[1].path.segments[0].arc.turn",
        "must be 'ccw' or 'cw', got 'left' (Sense seen against",
    ),
    "bad elbow": (arm({"elbow": "up"}), "arms[0].elbow", "must be 'negative' or 'positive', got 'up' ("),
    "limits": (
        arm({"limits": {"position_rad": [[1, -1], None]}}),
        "arms[0].limits.position_rad",
        "each range must be [lowest, highest], the lowest first (Lowest and highest position [rad]",
    ),
    "inertia": (
        arm({"tool": {"inertia_kgm2": [1, 1, 3, 0, 0, 0]}}),
        "arms[0].tool.inertia_kgm2",
        "ixx, iyy, izz must be >= 0, and none larger than the sum of the other two (ixx, iyy, izz,",
    ),
    "flat hull": (
        arm({"tool": {"hull_m": [[0, 0, 0]] * 5}}),
        "arms[0].tool.hull_m",
        "a hull needs at least 4 different points",
    ),
    "obstacle without shape": (
        top({"obstacles": [{"name": "post"}]}),
        "obstacles[0]",
        "an obstacle needs exactly one of box, sphere, cylinder, capsule, mesh; got none (",
    ),
    "unknown shape": (
        top({"obstacles": [{"name": "p", "boxx": {}}]}),
        "obstacles[0].boxx",
        "unknown key (did you mean 'box'?",
    ),
    "mapping for a list": (
        top({"arms": {"name": "x"}}),
        "arms",
        "must be a list, got {'name': 'x'} (The arms in",
    ),
    "long point": (
        top({"gravity_m_s2": [0, 0, 0, 0]}),
        "gravity_m_s2",
        "must have at most 3 items, got [0, 0, 0, 0] (",
    ),
    "number for a mapping": (top({"arms": [5]}), "arms[0]", "must be a mapping of keys to values, got 5 ("),
    "left empty": (top({"obstacles": None}), "obstacles", "must be a list, got null (Bodies that stand still)"),
    "unknown kind": (
        top({"kind": "dance"}),
        "kind",
        "must be 'coordination', 'blend', 'ik' or 'task', got 'dance' (use kind:",
    ),
    "kind is no text": (top({"kind": ["ik"]}), "kind", "must be 'coordination', 'blend', 'ik' or 'task', got ['ik'] ("),
    "a source of its own": (top({"source": "x"}), "source", "unknown key ("),
}


@pytest.mark.parametrize("name", BAD)
def test_errors_name_file_key_value_and_remedy(name: str, tmp_path: Path) -> None:
    edit, key, rest = BAD[name]
    data = cell()
    edit(data)
    path = write(tmp_path, yaml.safe_dump(data, sort_keys=False))
    with pytest.raises(ConfigError) as caught:
        load_cell_config(path)
    message = str(caught.value)
    assert message.startswith(f"{path}: {key}: {rest}"), message
    assert "\n" not in message
    assert caught.value.remedy
    assert caught.value.data["file"] == path
    assert caught.value.data["key"] == key
    assert "value" in caught.value.data


def test_period_is_compared_with_a_tolerance() -> None:
    data = cell()
    data.update(physics_tick_s=1 / 240, control_period_s=0.05)
    assert parse_cell_config(data, Path("x.yaml")).ticks_per_period == 12


def test_error_keeps_the_offending_value() -> None:
    data = cell()
    data["control_period_s"] = 0.0045
    with pytest.raises(ConfigError) as caught:
        parse_cell_config(data, Path("x.yaml"))
    assert caught.value.data["value"] == 0.0045


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("kind: coordination\narms: [1, 2\nname: x\n", "line 3, column 5: "),
        ("kind: coordination\n\tname: x\n", "line 2, column 1: found character '\\t' that cannot start any token"),
        (
            "kind: coordination\nname: a\nname: b\n",
            "line 3, column 1: the key 'name' is given twice (mend the YAML there",
        ),
        ("arms:\n  - name: a\n    urdf: b\n    name: c\n", "line 4, column 5: the key 'name' is given twice"),
        ("", "is empty (start from a bundled cell"),
        ("- 1\n- 2\n", "is no mapping of keys to values but [1, 2] (start from a bundled cell"),
        (
            "name: !!python/object/apply:os.getcwd []\n",
            "line 1, column 7: the tag 'tag:yaml.org,2002:python/object/apply:os.getcwd' is none of",
        ),
        ("name: !!timestamp 2020-13-45\n", "line 1, column 7: the tag"),
        ("name: \x00\n", "not YAML: unacceptable character"),
    ],
)
def test_yaml_errors_name_the_line(text: str, message: str, tmp_path: Path) -> None:
    path = write(tmp_path, text)
    with pytest.raises(ConfigError) as caught:
        load_cell_config(path)
    assert str(caught.value).startswith(f"{path}: {message}")
    assert "\n" not in str(caught.value)


def test_short_exponents_are_numbers(tmp_path: Path) -> None:
    text = yaml.safe_dump(cell()).replace("d_min_m: 0.02", "d_min_m: 2e-2")
    assert load_cell_config(write(tmp_path, text)).d_min_m == 0.02


def test_anchors_and_merge_keys_work(tmp_path: Path) -> None:
    text = """
kind: coordination
name: twins
d_min_m: 0.01
arms:
  - &arm {name: a, urdf: a.urdf, path: {start_m: [0, 0, 0], segments: [line: {to_m: [1, 0, 0]}]}}
  - {<<: *arm, name: b}
"""
    assert [arm.name for arm in load_cell_config(write(tmp_path, text)).arms] == ["a", "b"]


def test_unknown_cell_names_the_closest_and_all() -> None:
    with pytest.raises(UnknownNameError) as caught:
        load_cell_config("lee1919")
    message = str(caught.value)
    assert message.startswith("unknown cell 'lee1919' (did you mean 'lee1991'? known: ")
    assert message.endswith("; or give the path of a YAML file)")
    assert caught.value.data["known"] == list(bundled_cells())


@pytest.mark.parametrize("name", ["nowhere.yaml", "some/where", Path("nowhere")])
def test_missing_file(name: str | Path) -> None:
    with pytest.raises(ConfigError, match=r"no such file \(give a YAML file, or a bundled cell: .*lee1991"):
        load_cell_config(name)


def test_a_folder_is_no_cell(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="is a folder"):
        load_cell_config(tmp_path)


def test_text_must_be_utf8(tmp_path: Path) -> None:
    path = tmp_path / "mine.yaml"
    path.write_bytes(b"name: \xff\xfe")
    with pytest.raises(ConfigError, match=r"not UTF-8 text \(save it as UTF-8\)"):
        load_cell_config(path)


def test_files_are_looked_for_beside_the_cell_first(tmp_path: Path) -> None:
    config = load_cell_config(write(tmp_path, yaml.safe_dump(cell())))
    own = tmp_path / "meshes" / "planar_two_link.urdf"
    own.parent.mkdir()
    own.touch()
    assert resolve_file(config, "meshes/planar_two_link.urdf") == own
    assert resolve_file(config, str(own)) == own
    (tmp_path / "planar_two_link.urdf").touch()
    assert resolve_file(config, "planar_two_link.urdf") == tmp_path / "planar_two_link.urdf"


def test_bundled_robots_are_found_from_any_cell(tmp_path: Path) -> None:
    config = load_cell_config(write(tmp_path, yaml.safe_dump(cell())))
    assert resolve_file(config, "planar_two_link.urdf") == data_path("robots/planar_two_link.urdf").resolve()


def test_missing_file_of_a_cell_says_where_it_looked(tmp_path: Path) -> None:
    config = load_cell_config(write(tmp_path, yaml.safe_dump(cell())))
    with pytest.raises(ConfigError) as caught:
        resolve_file(config, "planar_two_lnk.urdf")
    message = str(caught.value)
    assert message.startswith(f"{config.source}: no file 'planar_two_lnk.urdf': looked for {tmp_path}")
    assert "did you mean 'planar_two_link.urdf'?" in message


def test_unknown_data_file() -> None:
    with pytest.raises(UnknownNameError, match=r"unknown data file 'cells/lee.yaml'"):
        data_path("cells/lee.yaml")


def test_all_errors_share_one_root() -> None:
    assert issubclass(ConfigError, ArmtempoError)
    assert issubclass(UnknownNameError, ArmtempoError)


def test_names_of_cells_may_have_hyphens(tmp_path: Path) -> None:
    data = cell() | {"name": "my-cell"}
    assert load_cell_config(write(tmp_path, yaml.safe_dump(data))).name == "my-cell"


@pytest.mark.parametrize(
    ("path", "key", "words"),
    [
        ({}, "arms[0].path", "a path needs exactly one of start_m, waypoints_rad, waypoints_file; got none"),
        (
            {"waypoints_rad": [[0, 1], [1, 0]], "waypoints_file": "a.csv"},
            "arms[0].path",
            "a path needs exactly one of start_m, waypoints_rad, waypoints_file; got waypoints_rad, waypoints_file",
        ),
        ({"start_m": [0, 0, 0]}, "arms[0].path.segments", "missing"),
        (
            {"waypoints_rad": [[0, 1], [1, 0]], "segments": [{"line": {"to_m": [0, 0, 0]}}]},
            "arms[0].path.segments",
            "belong to start_m, not to waypoints_rad",
        ),
        (
            {"waypoints_rad": [[0, 1], [1, 0]], "start_rad": [0, 1]},
            "arms[0].path.start_rad",
            "belongs to start_m, not to waypoints_rad",
        ),
        ({"waypoints_rad": [[0, 1]]}, "arms[0].path.waypoints_rad", "must have at least 2 items"),
        ({"waypoints_rad": [[0, "1"], [1, 0]]}, "arms[0].path.waypoints_rad[0][1]", "must be a number"),
    ],
)
def test_paths_are_of_exactly_one_kind(path: dict[str, Any], key: str, words: str, tmp_path: Path) -> None:
    data = cell()
    data["arms"][0]["path"] = path
    with pytest.raises(ConfigError) as caught:
        parse_cell_config(data, tmp_path / "mine.yaml")
    assert str(caught.value).startswith(f"{tmp_path / 'mine.yaml'}: {key}: {words}"), str(caught.value)


def test_chart_sizes_are_cells_or_metres() -> None:
    data, source = cell(), Path("mine.yaml")
    assert parse_cell_config(data, source).chart_tolerance(2.0) == 0.0004
    assert parse_cell_config(data | {"chart_tolerance_m": 0.001}, source).chart_tolerance(2.0) == 0.001
    assert parse_cell_config(data | {"chart_cells": 256}, source).chart_tolerance(2.0) == pytest.approx(2.0 / 256)
    joints = copy.deepcopy(data)
    joints["arms"][0]["path"] = {"waypoints_rad": [[0, 0], [1, 1]]}
    assert parse_cell_config(joints, source).chart_tolerance(2.0) == pytest.approx(2.0 / 1024)
    for wrong, words in (
        (data | {"chart_cells": 100}, "chart_cells: must be a power of two, got 100"),
        (data | {"chart_cells": 256, "chart_tolerance_m": 0.001}, "chart_cells: give it or chart_tolerance_m"),
        (joints | {"chart_tolerance_m": 0.001}, "chart_tolerance_m: paths through joint waypoints"),
        (data | {"chart_cells": 8}, "chart_cells: must be greater than or equal to 16"),
    ):
        with pytest.raises(ConfigError, match=re.escape(words)):
            parse_cell_config(wrong, source)


def test_data_sheets_fill_what_an_arm_leaves_open() -> None:
    panda = "pybullet_data/franka_panda/panda.urdf"
    sheet = robot_config(panda)
    assert sheet is not None
    assert list(sheet.limits.torque_nm or ()) == [87, 87, 87, 87, 12, 12, 12]
    assert robot_config("planar_two_link.urdf") is None
    limits = {"torque_nm": [None, 50, None, None, None, None, 6]}
    friction = {"coulomb_nm": [0] * 7}
    path = {"waypoints_rad": [[0] * 7, [1] * 7]}
    arm = ArmConfig.model_validate(
        {"name": "a", "urdf": panda, "limits": limits, "friction": friction, "path": path}
    ).over(sheet)
    assert list(arm.limits.torque_nm or ()) == [87, 50, 87, 87, 12, 12, 6]
    assert list(arm.limits.acceleration_rad_s2 or ()) == [15, 7.5, 10, 12.5, 15, 20, 20]
    assert list(arm.limits.jerk_rad_s3 or ()) == [7500, 3750, 5000, 6250, 7500, 10000, 10000]
    assert list(arm.friction.coulomb_nm or ()) == [0] * 7
    assert arm.friction.viscous_nm_s_rad == sheet.friction.viscous_nm_s_rad
    assert arm.tip_link == "panda_grasptarget"
    assert arm.over(None) is arm


def test_robots_of_pybullet_are_found_by_name(tmp_path: Path) -> None:
    config = load_cell_config(write(tmp_path, yaml.safe_dump(cell())))
    for name in ("franka_panda/panda.urdf", "kuka_iiwa/model.urdf", "xarm/xarm6_robot.urdf"):
        file = resolve_file(config, f"pybullet_data/{name}")
        assert file.is_file()
        assert file.as_posix().endswith(name)
        assert robot_config(f"pybullet_data/{name}") is not None
    with pytest.raises(ConfigError, match=r"did you mean 'pybullet_data/franka_panda/panda.urdf'"):
        resolve_file(config, "pybullet_data/franka_panda/pana.urdf")


def blend_cell() -> dict[str, Any]:
    path = {"start_m": [0.7, 0, 0.05], "segments": [{"line": {"to_m": [0.3, 0, 0.05]}}]}
    return {
        "kind": "blend",
        "name": "mine",
        "arm": {"name": "a", "urdf": "scara_800.urdf", "elbow": "positive", "path": path},
        "blend": {"remaining_distance_m": 0.1},
        "line_speed": {"speed_m_s": 1, "acceleration_m_s2": 5, "jerk_m_s3": 200},
    }


def test_bundled_lee2006_is_the_run_of_the_paper() -> None:
    config = load_cell_config("lee2006", BlendCellConfig)
    assert isinstance(load_cell_config("lee2006"), BlendCellConfig)  # whatever the file says
    assert [segment.geometry.to_m for segment in config.arm.path.segments] == [
        (0.3, 0.0, 0.05),
        (0.3, 0.65, 0.0),
        (-0.372, 0.65, 0.05),
    ]
    assert (config.blend.curve, config.blend.shape_factor, config.blend.remaining_distance_m) == ("cubic", 3.0, 0.15)
    speed = config.line_speed
    assert (speed.speed_m_s, speed.acceleration_m_s2, speed.jerk_m_s3) == (1.0, 5.0, 200.0)
    assert speed.acceleration_reading == "mean"
    assert (config.physics_tick_s, config.ticks_per_period) == (0.002, 10)


@pytest.mark.parametrize(
    ("edit", "key", "words"),
    [
        (top({"blend": {}}), "blend", "a blend needs remaining_distance_m or tolerance_m, or both; got none"),
        (
            top({"blend": {"remaining_distance_m": 0.1, "tolerance_m": [0.01, 0.01, 0.01, 0.01]}}),
            "blend",
            "tolerance_m has 4 values, and 1 segments have 0 joints",
        ),
        (top({"blend": {"tolerance_m": -1}}), "blend.tolerance_m", "must be greater than 0, got -1"),
        (
            top({"blend": {"tolerance_m": [0, -1]}}),
            "blend.tolerance_m[1]",
            "must be greater than or equal to 0, got -1",
        ),
        (top({"blend": {"tolerance_m": "wide"}}), "blend.tolerance_m", "must be a number"),
        (top({"blend": {"radius_m": 0.1}}), "blend.radius_m", "unknown key (known: curve, shape_factor, remaining"),
        (top({"blend": {"remaining_distance_m": 0.1, "curve": "nurbs"}}), "blend.curve", "must be 'cubic', 'quintic'"),
        (
            top({"blend": {"remaining_distance_m": 0.1, "curve": "quintic", "shape_factor": 2}}),
            "blend.shape_factor",
            "belongs to curve 'cubic', not to 'quintic'; drop it",
        ),
        (
            top({"blend": {"remaining_distance_m": 0.1, "shape_factor": 4.5}}),
            "blend.shape_factor",
            "must be less than or equal to 4, got 4.5",
        ),
        (
            top({"blend": {"remaining_distance_m": 0.1, "curve": "least-time"}}),
            "blend.tolerance_m",
            "missing; curve 'least-time' needs it",
        ),
        (drop("kind"), "kind", "missing, and blend belongs to cells of kind blend (add kind: blend)"),
        (top({"d_min_m": 0.01}), "d_min_m", "unknown key (known: kind, name, description, physics_tick_s"),
        (drop("line_speed"), "line_speed", "missing (add it: Limits of the tip's motion)"),
        (
            top({"line_speed": {"speed_m_s": 0, "acceleration_m_s2": 5, "jerk_m_s3": 200}}),
            "line_speed.speed_m_s",
            "must be greater than 0, got 0 (Line speed [m/s])",
        ),
        (
            top({"control_period_s": 0.0205}),
            "control_period_s",
            "must be a whole multiple of physics_tick_s = 0.001, got 20.5 ticks",
        ),
        (
            lambda data: data["arm"].update(path={"waypoints_rad": [[0, 0, 0, 0], [1, 1, 0, 0]]}),
            "arm",
            "its path must be given by start_m and segments",
        ),
        (lambda data: data["arm"].pop("elbow"), "arm", "its elbow is missing: positive or negative"),
        (
            lambda data: data["arm"]["path"].update(start_rad=[0, 1, 0, 0]),
            "arm.elbow",
            "give it or path.start_rad, not both",
        ),
        (
            lambda data: data["arm"]["path"].update(blend={"tolerance_m": 0.01}),
            "arm",
            "its path has a blend of its own",
        ),
        (
            lambda data: data["arm"]["path"].update(blend={"tolerance_m": 0.01, "curve": "least-time"}),
            "arm.path.blend",
            "curve 'least-time' needs a line speed",
        ),
    ],
)
def test_blend_cells_are_checked_like_all_others(edit: Edit, key: str, words: str, tmp_path: Path) -> None:
    data = blend_cell()
    edit(data)
    source = tmp_path / "mine.yaml"
    with pytest.raises(ConfigError) as caught:
        parse_cell_config(data, source)
    assert str(caught.value).startswith(f"{source}: {key}: {words}"), str(caught.value)
    assert caught.value.remedy


def test_arcs_go_about_a_centre_or_through_a_point() -> None:
    ArcConfig(to_m=(1, 1, 0), via_m=(0, 1, 0))
    for wrong, words in (
        ({}, "center_m: give it or via_m, one of them"),
        ({"via_m": (0, 1, 0), "center_m": (0, 0, 0)}, "center_m: give it or via_m, not both"),
        ({"via_m": (0, 1, 0), "turn": "cw"}, "turn: belongs to center_m"),
    ):
        with pytest.raises(ValidationError, match=words):
            ArcConfig.model_validate({"to_m": (1, 1, 0), **wrong})


def test_a_kind_that_is_asked_for_is_the_kind_that_comes(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"kind: this is a coordination cell, and a blend cell is needed here"):
        load_cell_config("lee1991", BlendCellConfig)
    with pytest.raises(ConfigError, match=r"kind: this is a blend cell, and a coordination cell is needed here"):
        load_cell_config("lee2006", CellConfig)


def test_a_blend_takes_distance_and_tolerance_for_all_corners_or_each(tmp_path: Path) -> None:
    data = blend_cell()
    data["arm"]["path"]["segments"] += [{"line": {"to_m": [0.3, 0.3, 0.05]}}, {"line": {"to_m": [0.2, 0.4, 0.05]}}]
    data["blend"] = {"remaining_distance_m": [0.1, 0.05], "tolerance_m": 0.01}
    blend = parse_cell_config(data, tmp_path / "mine.yaml", BlendCellConfig).blend
    assert (blend.remaining_distance_m, blend.tolerance_m) == ((0.1, 0.05), 0.01)


def test_corners_can_be_changed() -> None:
    config = load_cell_config("lee2006", BlendCellConfig)
    changed = change_blend(config, curve="quintic", tolerance_m=0.02, shape_factor=None)
    assert (changed.blend.curve, changed.blend.tolerance_m, changed.blend.remaining_distance_m) == (
        "quintic",
        0.02,
        None,
    )
    assert changed.source == config.source
    with pytest.raises(ConfigError, match=r"lee2006.yaml: blend.shape_factor: must be greater than 0, got -1"):
        change_blend(config, shape_factor=-1)
    tight = change_blend(config, shape_factor=2.0)
    assert tight.blend.shape_factor == 2.0
    assert change_blend(tight, curve="quintic").blend.shape_factor == 3.0  # the cubic's goes with the cubic
    assert change_blend(tight, curve="cubic").blend.shape_factor == 2.0
    with pytest.raises(ConfigError, match=r"blend.shape_factor: belongs to curve 'cubic', not to 'quintic'"):
        change_blend(tight, curve="quintic", shape_factor=2.0)


HARMONIC = {"center_m": [0.4, 0, 0.3], "amplitude_m": [0, 0.1, 0], "rate_rad_s": 1, "duration_s": 1000}


def test_the_longest_target_loads_and_errors_keep_its_value(tmp_path: Path) -> None:
    data = ik_cell() | {"target": {"harmonic": HARMONIC}}
    parse_cell_config(data, tmp_path / "mine.yaml", IKCellConfig)
    data["target"] = {"harmonic": HARMONIC | {"duration_s": 1e6}}
    with pytest.raises(ConfigError) as caught:
        parse_cell_config(data, tmp_path / "mine.yaml")
    assert caught.value.data["value"] == 1e6
    assert "How long it is followed" in caught.value.remedy


def ik_cell() -> dict[str, Any]:
    poses = [{"time_s": t, "position_m": [0.4, 0.1 * t, 0.3]} for t in (0, 1, 2)]
    return {
        "kind": "ik",
        "name": "mine",
        "arm": {"name": "a", "urdf": "puma560.urdf", "start_rad": [0, 0, 0, 0, 0.5, 0]},
        "target": {"poses": poses},
    }


@pytest.mark.parametrize(
    ("edit", "key", "words"),
    [
        (drop("kind"), "kind", "missing, and target belongs to cells of kind ik (add kind: ik)"),
        (drop("target"), "target", "missing (add it: What its tip is to follow)"),
        (top({"target": {}}), "target", "a target needs exactly one of harmonic, poses; got none"),
        (top({"law": {"damping": 1.0}}), "law.damping", "must be less than 1, got 1.0 (Singular value of the"),
        (top({"law": {"error": "euler"}}), "law.error", "must be 'axes' or 'quaternion', got 'euler'"),
        (top({"blend": {}}), "blend", "unknown key (known: kind, name, description, physics_tick_s"),
        (lambda data: data["arm"].pop("start_rad"), "arm.start_rad", "missing (add it: Joint positions at the start"),
        (lambda data: data["arm"].update(path={}), "arm.path", "unknown key (known: name, urdf, base, tip_link"),
        (
            lambda data: data["target"]["poses"][2].update(time_s=1),
            "target.poses",
            "time_s must begin at 0 and rise, got 0, 1, 1",
        ),
        (
            lambda data: data["target"]["poses"].__delitem__(slice(1, None)),
            "target.poses",
            "must have at least 2 items",
        ),
        (top({"control_period_s": 0.0015}), "control_period_s", "must be a whole multiple of physics_tick_s = 0.001"),
        (top({"law": {"feed_forward": "yes"}}), "law.feed_forward", "must be a valid boolean, got 'yes' (Whether the"),
        (
            lambda data: data["target"]["poses"][2].update(time_s=1e6),
            "target.poses[2].time_s",
            "1e+06 s are 1e+09 ticks of physics_tick_s = 0.001, and at most 1000000 can be sampled; give at most 1000",
        ),
        (
            top({"target": {"harmonic": HARMONIC | {"duration_s": 1000.1}}}),
            "target.harmonic.duration_s",
            "1000.1 s are 1e+06 ticks",
        ),
        (top({"control_period_s": 2000}), "control_period_s", "2000 s are 2e+06 ticks"),
    ],
)
def test_ik_cells_are_checked_like_all_others(edit: Edit, key: str, words: str, tmp_path: Path) -> None:
    data = ik_cell()
    parse_cell_config(data, tmp_path / "mine.yaml", IKCellConfig)
    edit(data)
    source = tmp_path / "mine.yaml"
    with pytest.raises(ConfigError) as caught:
        parse_cell_config(data, source)
    assert str(caught.value).startswith(f"{source}: {key}: {words}"), str(caught.value)

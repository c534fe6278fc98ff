"""Tasks written in Python say what files say: the same checks, there and back through YAML."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
import yaml

from armtempo.configs import TaskCellConfig, data_path, load_cell_config, parse_cell_config
from armtempo.errors import ConfigError, InputError
from armtempo.planners import Task, TaskCell

PLACES = yaml.safe_load(data_path("cells/scara-pair.yaml").read_text())["places"]
ZONE = {"name": "fixture", "box": {"size_m": [0.2, 0.2, 0.3]}, "pose": {"position_m": [0.0, 0.35, 0.15]}}


def task(name: str, side: float, **waits: Any) -> Task:
    settings = {
        "base": {"position_m": [0.4 * side, 0.0, 0.0], "rpy_rad": [0.0, 0.0, 1.5708]},
        "posture_rad": [-1.6 * side, 2.28 * side, -0.03, -0.68 * side],
        "blend": {"tolerance_m": 0.02},
    }
    s = "l" if side < 0 else "r"
    return (
        Task(name, "scara_800.urdf", start=f"above_{s}", settings=settings)
        .line(f"feeder_{s}", speed=0.2, stop=True)
        .event("picked", 0.15)
        .line(f"above_{s}")
        .line("centre_up", **waits)
        .line("centre", speed=0.2, stop=True)
        .event("placed", 0.1)
        .line("centre_up")
        .line(f"above_{s}", stop=True)
    )


def pair() -> TaskCell:
    return TaskCell(
        [task("left", -1.0), task("right", 1.0, after=("left", "placed"))],
        name="scara-pair", d_min=0.02, places=PLACES,
        settings={"zones": [ZONE], "physics_tick_s": 0.001, "control_period_s": 0.004},
    )  # fmt: skip


def test_the_bundled_cell_in_python() -> None:
    theirs = load_cell_config("scara-pair", TaskCellConfig)
    assert pair().config.model_dump(exclude={"description"}) == theirs.model_dump(exclude={"description"})


def test_there_and_back_through_yaml() -> None:
    both = Task("a", "scara_800.urdf", start={"joints_rad": [0.0, 1.0, 0.1, 0.0]}).move([0.3, 0.3, 0.1], name="over")
    both = both.repeat(2, Task("", "", start="").line(by=[0.1, 0.0, 0.0], blend=0.01).dwell(0.5))
    both = both.arc([0.3, 0.4, 0.1], center=[0.3, 0.35, 0.1], turn="cw", speed=0.1)
    both = both.event("give", 0.4, together=("b", "take"), after=[("b", "take", "arrived")])
    other = Task("b", "scara_800.urdf", start="home").event("take", 0.4)
    for cell in (pair(), TaskCell([both, other], d_min=0.01, places={"home": {"joints_rad": [0.0, 1.0, 0.1, 0.0]}})):
        again = parse_cell_config(yaml.safe_load(cell.to_yaml()), Path(f"{cell.name}.yaml"), TaskCellConfig)
        assert again == cell.config
    assert both.steps[-1]["event"]["with"] == {"arm": "b", "event": "take"}


def test_a_task_is_not_changed_by_what_comes_after() -> None:
    begun = Task("a", "scara_800.urdf", start="home").dwell(1.0)
    assert len(begun.line("there").steps) == 2
    assert len(begun.steps) == 1


def test_what_a_file_could_not_say_is_refused_alike() -> None:
    with pytest.raises(ConfigError, match=r"scara-pair.yaml: .*there is no place 'nowhere'"):
        TaskCell([task("left", -1.0).line("nowhere")], name="scara-pair", d_min=0.02, places=PLACES).build()
    with pytest.raises(InputError, match="blended or a stop"):
        task("left", -1.0).line("centre", stop=True, blend=0.1)
    with pytest.raises(InputError, match=r"'left' is nothing to wait for \(give \(arm, event\)"):
        task("left", -1.0).move("centre", after=["left"])  # type: ignore[list-item]

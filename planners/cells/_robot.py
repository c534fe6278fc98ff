"""One arm by itself: a robot's name or file, or an arm of a cell."""

from __future__ import annotations

import re
from pathlib import Path

from armtempo.configs import CellFileConfig, MountedArmConfig, load_cell_config
from armtempo.errors import ConfigError, InputError, UnknownNameError, brief
from armtempo.planners.cells._arm_from_config import arm_from
from armtempo.robots import Arm

__all__ = ["load_robot"]


def load_robot(name_or_path: str | Path, *, tip_link: str | None = None) -> Arm:
    """An arm with the limits of its data sheet, where a bundled one knows it, else of its URDF.

    Args:
        name_or_path: A URDF (or xacro) file, a bundled robot's name, ``pybullet_data/...``, or ``CELL:ARM`` for an arm
            of a cell, on its base and with its tool.
        tip_link: Link that carries the tool, where the URDF leaves a choice; not for arms of cells, which say it.

    Raises:
        InputError: No such robot; the message lists the bundled ones.
        UnknownNameError: No such cell, or no such arm in it.
        RobotError: The file cannot be used; the message names file, element and remedy.
    """
    name = str(name_or_path)
    cell, colon, arm = name.rpartition(":")
    if colon and cell and not Path(name).is_file():
        return _of_cell(cell, arm, tip_link)
    robot = MountedArmConfig(name=_short(name), urdf=name, tip_link=tip_link)
    here = CellFileConfig.model_validate({"kind": "robot", "name": "robot"}, context={"source": Path.cwd() / "robot"})
    try:
        return arm_from(here, robot)
    except ConfigError as error:
        raise InputError(f"no robot {brief(name)}", remedy=error.remedy) from error


def _short(name: str) -> str:
    """A file's name as arms are called."""
    return "arm_" + re.sub("[^a-z0-9]", "_", Path(name).stem.lower())[:20]


def _of_cell(cell: str, name: str, tip_link: str | None) -> Arm:
    if tip_link is not None:
        raise InputError(f"tip_link {brief(tip_link)} for an arm of a cell", remedy="leave it out: the cell says it")
    config = load_cell_config(cell)
    arms = {arm.name: arm for arm in config.arms}
    if name not in arms:
        raise UnknownNameError(f"arm of cell {cell!r}", name, arms)
    return arm_from(config, arms[name])

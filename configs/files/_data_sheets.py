"""The robot files that cells name, and the data sheets that come with armtempo."""

from __future__ import annotations

from functools import cache
from pathlib import Path

from pydantic import TypeAdapter

from armtempo.configs.files._find import DATA, data_path
from armtempo.configs.files._yaml import parse_yaml
from armtempo.configs.schema import CellFileConfig, RobotConfig
from armtempo.errors import ConfigError, InputError, brief, closest
from armtempo.reading import user_path, why_unreadable

PYBULLET_PREFIX = "pybullet_data/"


def resolve_file(config: CellFileConfig, name: str) -> Path:
    """Find a file that a cell names: next to the cell file first, else among the bundled robots or PyBullet's data.

    Args:
        config: The cell.
        name: An absolute path, a path from the cell file's folder, a bundled robot's file name, or
            ``pybullet_data/`` and a path in the data that comes with PyBullet.

    Raises:
        ConfigError: It is in none of these places, or in the home of somebody unknown.
    """
    try:
        beside = config.source.parent / user_path(name)
    except InputError as error:
        message = f"{config.source}: {error.message}"
        raise ConfigError(message, remedy=error.remedy, file=config.source, key="", value=name) from error
    places = [beside, DATA / "robots" / name]
    if name.startswith(PYBULLET_PREFIX):
        import pybullet_data

        places.append(Path(pybullet_data.getDataPath()) / name.removeprefix(PYBULLET_PREFIX))
    for path in places:
        if why_unreadable(path) is None:
            return path.resolve()
    robots = sorted({path.name for path in (DATA / "robots").glob("*.urdf")} | set(_datasheets()))
    raise ConfigError(
        f"{config.source}: no file {brief(name)}: looked for {beside}",
        remedy=f"{closest(name, robots)}give a file or a bundled robot: {', '.join(robots)}",
        file=config.source,
        key="",
        value=name,
    )


def robot_config(urdf: str) -> RobotConfig | None:
    """What the bundled data sheets say of a robot, None if nothing.

    Args:
        urdf: The name that a cell gives as ``urdf``, such as ``"pybullet_data/franka_panda/panda.urdf"``.
    """
    return _datasheets().get(urdf)


@cache
def _datasheets() -> dict[str, RobotConfig]:
    path = data_path("robots/datasheets.yaml")
    data = parse_yaml(path.read_text(encoding="utf-8"), path)
    return TypeAdapter(dict[str, RobotConfig]).validate_python(data)

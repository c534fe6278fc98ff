"""Cells of every kind by one table: from a file, from a configuration, or built already."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeVar, overload

from armtempo.configs import BlendCellConfig, CellFileConfig, IKCellConfig, SharedSpaceConfig, load_cell_config
from armtempo.errors import InputError, brief
from armtempo.planners.cells._blend_cell import BlendCell
from armtempo.planners.cells._cell import CellBase
from armtempo.planners.cells._coordination_cell import CoordinationCell
from armtempo.planners.cells._ik_cell import IKCell

C = TypeVar("C", bound=CellBase[Any])

CELLS: Mapping[str, type[CellBase[Any]]] = {"coordination": CoordinationCell, "blend": BlendCell, "ik": IKCell}
"""Every kind of cell; files of kind ``task`` become cells of kind ``coordination``."""


@overload
def load_cell(name_or_path: str | Path) -> CoordinationCell: ...
@overload
def load_cell(name_or_path: str | Path, kind: type[C]) -> C: ...
@overload
def load_cell(name_or_path: str | Path, kind: None) -> CoordinationCell | BlendCell | IKCell: ...
def load_cell(name_or_path: str | Path, kind: type[CellBase[Any]] | None = None) -> CellBase[Any]:
    """Load a bundled cell by name, or a user's own YAML file, and certify it.

    Args:
        name_or_path: A bundled cell's name or a file.
        kind: ``CoordinationCell``, ``BlendCell`` or ``IKCell``: refuse files of another kind. None: whatever the file
            says (left out, type checkers take it for a ``CoordinationCell``).

    Raises:
        InputError: ``kind`` is none of these.
        UnknownNameError: No such bundled cell or file.
        ConfigError: The file cannot be used, or is of another kind; the message names file, key, value and remedy.
        PathError: A path is out of reach, breaks a limit or has a corner; the message names the station.
        InfeasibleError: Torque limits are too small; the message names the station and the joint.
        CollisionError: A path hits an obstacle or its own arm, or the arms start or end too close.
    """
    if kind is None:
        return build_cell(load_cell_config(name_or_path))
    given: object = kind  # whatever the annotation says
    if not (isinstance(given, type) and issubclass(given, CellBase)):
        known = ", ".join(one.__name__ for one in CELLS.values())
        raise InputError(f"kind must be a class of cells, got {brief(given)}", remedy=f"give {known}, or leave it out")
    return kind.from_config(load_cell_config(name_or_path, kind.config_type))


@overload
def build_cell(config: SharedSpaceConfig) -> CoordinationCell: ...
@overload
def build_cell(config: BlendCellConfig) -> BlendCell: ...
@overload
def build_cell(config: IKCellConfig) -> IKCell: ...
def build_cell(config: CellFileConfig) -> CellBase[Any]:
    """Build and certify a cell (of an IK cell postures only, not what is between); raises as ``load_cell``."""
    return CELLS[config.built_as].from_config(config)


def as_cell(cell: C | str | Path, kind: type[C]) -> C:
    """A built cell of that kind, or the bundled name or the file to build it from: the one door of environments.

    Raises:
        InputError: It is a cell of another kind, or no cell; and as ``load_cell``.
    """
    if isinstance(cell, kind):
        return cell
    if isinstance(cell, CellBase):
        raise _wrong_kind(cell, kind)
    return load_cell(cell, kind)


def _wrong_kind(cell: CellBase[Any], kind: type[CellBase[Any]]) -> InputError:
    """What is said of a built cell where one of another kind is needed."""
    asked = next((name for name, known in CELLS.items() if known is kind), kind.__name__)
    return InputError(
        f"{cell.name!r} is {_a(cell.config.kind)} cell, and {_a(asked)} cell is needed here",
        remedy=f"give a cell of kind {asked}; armtempo cells lists those that come with it",
    )


def _a(kind: str) -> str:
    return f"an {kind}" if kind == "ik" else f"a {kind}"

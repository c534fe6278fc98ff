"""Cells of kind task written in Python: the same steps, names and checks as in a file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, final

import numpy as np
import yaml

from armtempo.configs import TaskCellConfig, parse_cell_config
from armtempo.errors import InputError, brief
from armtempo.planners.cells._coordination_cell import CoordinationCell
from armtempo.planners.cells._load import build_cell

Place = str | Sequence[float] | Mapping[str, Any]
"""A name of the cell's places, a position [m], or what a file says of a place (``{"joints_rad": [...]}``)."""
Sync = tuple[str, str] | tuple[str, str, str]
"""Arm and event (or named step) of another arm; and what counts: ``arrived``, ``begun`` or ``done``."""


def _place(given: Place) -> Any:
    """A place as a file has it."""
    if isinstance(given, str | Mapping):
        return given
    return {"position_m": _numbers(given)}


def _numbers(given: object) -> Any:
    try:
        return np.asarray(given, dtype=np.float64).tolist()
    except (TypeError, ValueError):
        return given  # for the file's checks to refuse


def _sync(given: object) -> dict[str, Any]:
    if not isinstance(given, tuple) or not 2 <= len(given) <= 3:
        raise InputError(
            f"{brief(given)} is nothing to wait for",
            remedy="give (arm, event), or (arm, event, 'arrived' or 'begun' or 'done')",
        )
    return dict(zip(("arm", "event", "when"), given, strict=False))


def _syncs(given: Sync | Sequence[Sync] | None) -> list[dict[str, Any]] | None:
    if given is None:
        return None
    many = [given] if isinstance(given, tuple) and given and isinstance(given[0], str) else list(given)
    return [_sync(one) for one in many]


def _without_none(**said: Any) -> dict[str, Any]:
    return {key: value for key, value in said.items() if value is not None}


@final
@dataclass(frozen=True)
class Task:
    """What an arm is to do, step by step; every method returns a new one with one more step.

    ``Task("left", "scara_800.urdf", start="above").line("feeder", stop=True).event("picked", 0.15).line("above")``

    Attributes:
        name: Of the arm.
        urdf: Its robot, as in a file.
        start: Where it begins.
        settings: What else a file may say of an arm, by its keys (``base``, ``posture_rad``, ``limits``, ``blend``).
        steps: As in a file.
    """

    name: str
    urdf: str
    start: Place = field(kw_only=True)
    settings: Mapping[str, Any] = field(default_factory=dict, kw_only=True)
    steps: tuple[Mapping[str, Any], ...] = field(default=(), kw_only=True)

    def _then(self, kind: str, said: object) -> Task:
        return replace(self, steps=(*self.steps, {kind: said}))

    def move(self, to: Place, *, name: str | None = None, after: Sync | Sequence[Sync] | None = None) -> Task:
        """A straight line in joint space, at full speed."""
        return self._then("move", _without_none(to=_place(to), name=name, after=_syncs(after)))

    def line(
        self,
        to: Place | None = None,
        *,
        by: Sequence[float] | None = None,
        speed: float | None = None,
        blend: float | None = None,
        stop: bool = False,
        name: str | None = None,
        after: Sync | Sequence[Sync] | None = None,
    ) -> Task:
        """A straight line of the tip.

        Args:
            to: Where to; or ``by``.
            by: How far from where the tip is [m].
            speed: Largest speed of the tip on it [m/s].
            blend: The most that the path leaves the corner behind it by [m]; default: the arm's own.
            stop: The arm stops there instead.
            name: What others call it in ``after``.
            after: What other arms must have done before; see ``Sync``.
        """
        if stop and blend is not None:
            raise InputError("a corner is blended or a stop", remedy="give blend or stop, not both")
        corner = "stop" if stop else None if blend is None else {"tolerance_m": blend}
        said = _without_none(
            to=None if to is None else _place(to), by_m=None if by is None else _numbers(by), tool_speed_m_s=speed,
            blend=corner, name=name, after=_syncs(after),
        )  # fmt: skip
        return self._then("line", said)

    def arc(
        self,
        to: Place,
        *,
        center: Sequence[float] | None = None,
        via: Sequence[float] | None = None,
        turn: str | None = None,
        **line: Any,
    ) -> Task:
        """A circular arc of the tip, about a centre [m] or through a point [m]; ``line``: as of ``line``."""
        task = self.line(to, **line)
        ((_, said),) = task.steps[-1].items()
        points = {"center_m": center, "via_m": via}
        about = {key: _numbers(point) for key, point in points.items() if point is not None}
        return self._then("arc", {**said, **about, **_without_none(turn=turn)})

    def dwell(self, seconds: float) -> Task:
        """The arm stands for so long [s], no more and no less."""
        return self._then("dwell_s", seconds)

    def event(
        self,
        name: str,
        seconds: float,
        *,
        together: Sync | None = None,
        after: Sync | Sequence[Sync] | None = None,
    ) -> Task:
        """The arm stands for so long [s] while something happens; ``together`` with an event of another arm."""
        return self._then(
            "event",
            _without_none(
                name=name, duration_s=seconds, after=_syncs(after),
                **({} if together is None else {"with": _sync(together)}),
            ),
        )  # fmt: skip

    def repeat(self, times: int, steps: Task) -> Task:
        """The steps of another task, again and again."""
        return self._then("repeat", {"times": times, "steps": list(steps.steps)})

    @property
    def said(self) -> dict[str, Any]:
        """What a file says of the arm."""
        own = {"name": self.name, "urdf": self.urdf, "start": _place(self.start)}
        return {**own, **self.settings, "task": list(self.steps)}


@final
@dataclass(frozen=True)
class TaskCell:
    """Arms and their tasks in one place: a cell file of kind ``task``, in Python.

    Attributes:
        tasks: One per arm, in priority order.
        name: Of the cell.
        d_min: Smallest distance allowed between two arms, or an arm and an obstacle [m].
        places: By name.
        settings: What else a file may say, by its keys (``zones``, ``obstacles``, ``physics_tick_s``).
    """

    tasks: Sequence[Task]
    name: str = field(default="task", kw_only=True)
    d_min: float = field(kw_only=True)
    places: Mapping[str, Place] = field(default_factory=dict, kw_only=True)
    settings: Mapping[str, Any] = field(default_factory=dict, kw_only=True)

    @property
    def config(self) -> TaskCellConfig:
        """As read from a file.

        Raises:
            ConfigError: A file could not say so; the message names key, value and remedy.
        """
        return parse_cell_config(self._said, Path(f"{self.name}.yaml"), TaskCellConfig)

    @property
    def _said(self) -> dict[str, Any]:
        return {
            "kind": "task",
            "name": self.name,
            "d_min_m": self.d_min,
            "places": {name: _place(place) for name, place in self.places.items()},
            **self.settings,
            "arms": [task.said for task in self.tasks],
        }

    def build(self) -> CoordinationCell:
        """The cell; raises as ``load_cell``."""
        return build_cell(self.config)

    def to_yaml(self) -> str:
        """The same as the text of a cell file."""
        said = self.config.model_dump(mode="json", by_alias=True, exclude_unset=True)
        return yaml.safe_dump(said, sort_keys=False, allow_unicode=True)

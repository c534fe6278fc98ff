"""Cells of kind task: what arms are to do, step by step, and in which order among them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Annotated, Literal, Self

from pydantic import (
    Field,
    field_validator,
    model_validator,
)

from armtempo.configs.schema._arm import MountedArmConfig
from armtempo.configs.schema._base import (
    FileModel,
    Name,
    Point,
    Positive,
    Real,
    exactly_one,
)
from armtempo.configs.schema._coordination import SharedSpaceConfig
from armtempo.configs.schema._obstacles import ObstacleConfig
from armtempo.errors import closest

STEPS_MAX = 2000  # of an arm, repeats unrolled

PlaceName = Annotated[str, Field(pattern=r"^[a-z][a-z0-9_]*$", max_length=100)]


class PlaceConfig(FileModel):
    """Where a tip, or an arm, is to be: joint positions, or a pose of the tip."""

    joints_rad: tuple[Real, ...] | None = None
    """Joint positions [rad] (prismatic joints: [m]), one per joint from the base on."""
    position_m: Point | None = None
    """The tip's position [m], world frame."""
    rpy_rad: Point | None = None
    """The tool's roll, pitch, yaw [rad] in the world, as in URDF; null: as it is turned before."""

    @model_validator(mode="after")
    def _one_way(self) -> Self:
        exactly_one(self, "a place", ("joints_rad", "position_m"))
        if self.rpy_rad is not None and self.position_m is None:
            raise ValueError("rpy_rad: belongs to position_m")
        return self


class CornerConfig(FileModel):
    """How the corner behind a line or an arc is rounded."""

    tolerance_m: Positive | None = None
    """The most that the path leaves the corner by [m]; less where the lines are too short for it."""
    remaining_distance_m: Positive | None = None
    """Length that it takes off each of the two [m]; with a tolerance, the most that it takes."""
    curve: Literal["cubic", "quintic", "low-peak", "septic"] = "quintic"
    """Family of the curve."""

    @model_validator(mode="after")
    def _some_size(self) -> Self:
        if self.tolerance_m is None and self.remaining_distance_m is None:
            raise ValueError("a blend needs tolerance_m or remaining_distance_m, or both; got none")
        return self


Corner = CornerConfig | Literal["stop"]


class SyncConfig(FileModel):
    """Something that another arm does."""

    arm: Name
    """Which arm."""
    event: PlaceName
    """Name of its event or step."""
    when: Literal["arrived", "begun", "done"] = "done"
    """What counts: that it has arrived where that step begins, has begun it, or has done it."""


class _SyncedConfig(FileModel):
    after: tuple[SyncConfig, ...] = ()
    """It does not begin before all of these; one may stand without brackets."""

    @field_validator("after", mode="before")
    @classmethod
    def _one_or_more(cls, value: object) -> object:
        return (value,) if isinstance(value, dict | SyncConfig) else value


class _StepConfig(_SyncedConfig):
    name: PlaceName | None = None
    """What others call it in ``after``."""


class MoveConfig(_StepConfig):
    """A straight line in joint space, at full speed."""

    to: PlaceName | PlaceConfig
    """Where to: a name of ``places``, or a place. A pose is reached on the branch that the arm is on."""


class TaskLineConfig(_StepConfig):
    """A straight line of the tip; the tool stays turned as it is."""

    to: PlaceName | PlaceConfig | None = None
    """Where to: a name of ``places``, or a place with ``position_m``."""
    by_m: Point | None = None
    """Instead: how far from where the tip is [m], world axes."""
    tool_speed_m_s: Positive | None = None
    """Largest speed of the tip on it, and on the blends at its ends [m/s]."""
    blend: Corner | None = None
    """The corner behind it; null: the arm's own. Lines that do not go on as a line or an arc end in a stop."""

    @model_validator(mode="after")
    def _one_end(self) -> Self:
        exactly_one(self, "a line or an arc", ("to", "by_m"))
        return self


class TaskArcConfig(TaskLineConfig):
    """A circular arc of the tip: about a centre, or through a point on the way."""

    center_m: Point | None = None
    """Centre [m], world frame; as far from the start as from the end."""
    via_m: Point | None = None
    """Instead: a point [m] on the arc between its ends, world frame."""
    turn: Literal["ccw", "cw"] | None = None
    """Sense about the world's z axis; null: the shorter arc (a half circle needs a sense)."""

    @model_validator(mode="after")
    def _one_way(self) -> Self:
        exactly_one(self, "an arc", ("center_m", "via_m"))
        if self.via_m is not None and self.turn is not None:
            raise ValueError("turn: belongs to center_m; an arc through via_m turns as it must")
        return self


class EventConfig(_SyncedConfig):
    """The arm stands while something happens: a gripper closes, a part is handed over."""

    name: PlaceName
    """What it is called, unique among the arm's steps."""
    duration_s: Positive
    """How long it takes [s], no more and no less."""
    together: SyncConfig | None = Field(None, alias="with")
    """An event of another arm: while either is inside its event, the other one stands in its own."""


class StepConfig(FileModel):
    """One step of a task."""

    move: MoveConfig | None = None
    line: TaskLineConfig | None = None
    arc: TaskArcConfig | None = None
    dwell_s: Positive | None = None
    """The arm stands for so long [s], no more and no less."""
    event: EventConfig | None = None
    repeat: RepeatConfig | None = None

    @model_validator(mode="after")
    def _one_kind(self) -> Self:
        exactly_one(self, "a step")
        return self

    @property
    def kind(self) -> str:
        """Which of them it is."""
        return exactly_one(self, "a step")

    @property
    def said(self) -> MoveConfig | TaskLineConfig | TaskArcConfig | EventConfig | None:
        """What is said of it; of a dwell or a repeat nothing."""
        return self.move or self.arc or self.line or self.event


class RepeatConfig(FileModel):
    """The same steps again and again."""

    times: Annotated[int, Field(ge=1, le=STEPS_MAX, strict=True)]
    """How often, in all."""
    steps: Annotated[tuple[StepConfig, ...], Field(min_length=1)]
    """What is repeated."""


StepConfig.model_rebuild()


class TaskArmConfig(MountedArmConfig):
    """One arm, where it stands and what it is to do."""

    start: PlaceName | PlaceConfig
    """Where it begins: a name of ``places``, or a place; of a pose ``posture_rad`` says how it gets there."""
    posture_rad: tuple[Real, ...] | None = None
    """Joint positions [rad] near those at ``start``: they choose the branch."""
    blend: Corner = "stop"
    """Corners between lines and arcs that say nothing else."""
    task: Annotated[tuple[StepConfig, ...], Field(min_length=1)]
    """What it does, step by step."""

    @property
    def steps(self) -> tuple[tuple[str, StepConfig], ...]:
        """Repeats unrolled: each step and its place in the file, ``task[3]``."""
        return tuple(_unrolled("task", self.task))

    @model_validator(mode="after")
    def _names_are_clear(self) -> Self:
        count = sum(_count(step) for step in self.task)
        if count > STEPS_MAX:
            raise ValueError(f"task: has {count} steps, repeats unrolled; at most {STEPS_MAX}")
        return self


def _count(step: StepConfig) -> int:
    return 1 if step.repeat is None else step.repeat.times * sum(_count(own) for own in step.repeat.steps)


def _unrolled(place: str, steps: tuple[StepConfig, ...]) -> Iterator[tuple[str, StepConfig]]:
    for k, step in enumerate(steps):
        if step.repeat is None:
            yield f"{place}[{k}]", step
        else:
            for _ in range(step.repeat.times):
                yield from _unrolled(f"{place}[{k}].repeat.steps", step.repeat.steps)


class TaskCellConfig(SharedSpaceConfig):
    """Arms that share a space, what each is to do, and who waits for whom."""

    kind: Literal["task"]
    """What the cell is for."""
    places: dict[PlaceName, PlaceConfig] = Field(default_factory=dict)
    """Places by name."""
    arms: Annotated[tuple[TaskArmConfig, ...], Field(min_length=1)]
    """The arms in priority order: the first is the master."""
    zones: tuple[ObstacleConfig, ...] = ()
    """Volumes that hold one arm at a time; nothing stands there."""

    @property
    def built_as(self) -> str:
        """Tasks become paths with stops, and rules between them."""
        return "coordination"

    @model_validator(mode="after")
    def _names_are_known(self) -> Self:
        zones = [zone.name for zone in self.zones]
        if len(set(zones)) < len(zones):
            raise ValueError(f"zones: each needs a name of its own, got {', '.join(zones)}")
        for i, arm in enumerate(self.arms):
            self._check_place(f"arms[{i}].start", arm.start)
            for place, step in arm.steps:
                said = step.said
                if said is None:
                    continue
                self._check_place(f"arms[{i}].{place}.{step.kind}.to", getattr(said, "to", None))
                for sync in (
                    *said.after,
                    *([said.together] if isinstance(said, EventConfig) and said.together else []),
                ):
                    self._check_sync(f"arms[{i}].{place}.{step.kind}", arm.name, sync)
        return self

    def _check_place(self, where: str, to: str | PlaceConfig | None) -> None:
        if isinstance(to, str) and to not in self.places:
            raise ValueError(f"{_key(where)}: there is no place {to!r}; {_known(to, sorted(self.places))}")

    def _check_sync(self, where: str, own: str, sync: SyncConfig) -> None:
        named = {
            arm.name: [step.said.name for _, step in arm.steps if step.said and step.said.name] for arm in self.arms
        }
        if sync.arm == own or sync.arm not in named:
            others = [name for name in named if name != own]
            raise ValueError(f"{_key(where)}: there is no other arm {sync.arm!r}; {_known(sync.arm, others)}")
        count = named[sync.arm].count(sync.event)
        if count == 0:
            known = _known(sync.event, list(dict.fromkeys(named[sync.arm])))
            raise ValueError(f"{_key(where)}: arm {sync.arm!r} has no event or step {sync.event!r}; {known}")
        if count > 1:
            raise ValueError(
                f"{_key(where)}: arm {sync.arm!r} does {sync.event!r} {count} times; "
                "name the one that is meant differently"
            )


def _key(where: str) -> str:
    """A place in the file, as checks over several keys name it."""
    return where.replace("[", ".").replace("]", "")


def _known(name: str, names: Sequence[str]) -> str:
    return f"{closest(name, names)}known: {', '.join(names) or 'none'}"

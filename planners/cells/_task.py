"""From what arms are to do, step by step, to their paths with stops, and to rules between them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation, Slerp

from armtempo.arrays import Bools, Floats
from armtempo.configs import (
    CornerConfig,
    EventConfig,
    MoveConfig,
    PlaceConfig,
    StepConfig,
    SyncConfig,
    TaskArcConfig,
    TaskArmConfig,
    TaskCellConfig,
    TaskLineConfig,
)
from armtempo.errors import InputError, PathError
from armtempo.planners.blends import BlendedPath
from armtempo.planners.cells._arm_from_config import located, obstacle_from
from armtempo.planners.charts import Exclusion, after, inside_zone, zone_exclusions
from armtempo.planners.coordination import check_rules
from armtempo.planners.geometry import Arc, CartesianPath, Line, PoseTarget
from armtempo.planners.ik import NewtonIK
from armtempo.planners.joint_paths import AbstractJointPath, Dwell, JointPath, SequencePath, Wait
from armtempo.planners.topp import SpeedCap
from armtempo.robots import Arm

POSE_SAMPLES = 100  # between two poses, for the branch that the arm is on
TURN_MAX = 1e-6  # [rad] by which a place on a line may be turned away from where the tool is
WORDS = {"arrived": "has come to", "begun": "has begun", "done": "has done"}


@dataclass(frozen=True, kw_only=True, slots=True)
class TaskEvent:
    """Where on its arm's path an event happens.

    Attributes:
        arm: Its name.
        name: Of the event.
        begins, ends: Places between which the arm stands [lambda].
    """

    arm: str
    name: str
    begins: float
    ends: float


@dataclass(frozen=True, kw_only=True)
class Ways:
    """The arms' paths, how fast their tips may go along them [m/s], and rules between them."""

    key: str
    """Of an arm in the file, for messages."""
    paths: tuple[AbstractJointPath, ...]
    tool_speeds: tuple[SpeedCap | None, ...]
    exclusions: tuple[Exclusion, ...] = ()
    events: tuple[TaskEvent, ...] = ()


@dataclass(frozen=True, slots=True)
class _Mark:
    """Where a step is in its arm's sequence: items from ``first`` to ``last``; a wait may come before it."""

    words: str
    first: int
    last: int
    waits: bool


@dataclass
class _Sequence:
    """What an arm does, as it is put together."""

    arm: Arm
    tick: float
    q: Floats
    items: list[AbstractJointPath | Dwell] = field(default_factory=list)
    speeds: list[SpeedCap | None] = field(default_factory=list)
    marks: dict[int, _Mark] = field(default_factory=dict)
    segments: list[Line | Arc] = field(default_factory=list)  # of a chain that is not finished
    corners: list[CornerConfig] = field(default_factory=list)
    limits: list[float] = field(default_factory=list)  # [m/s] of its segments

    @property
    def tip(self) -> Floats:
        """[m] where the tip is."""
        return self.segments[-1].end if self.segments else self.arm.tip_pose(self.q)[:3, 3]

    def add(self, item: AbstractJointPath | Dwell, speed: SpeedCap | None = None) -> None:
        """One more piece, which the arm begins at rest."""
        self.items.append(item)
        self.speeds.append(speed)
        if isinstance(item, AbstractJointPath):
            self.q = item.evaluate(item.length)[0]

    def wait(self) -> None:
        """A place to wait at, for a tick at least; two in a row are one."""
        if not (self.items and isinstance(self.items[-1], Wait)):
            self.add(Wait(self.tick))

    def finish_chain(self) -> None:
        """Lines and arcs so far become a path; the arm stops at its end."""
        if not self.segments:
            return
        limits = np.array(self.limits)
        cartesian: CartesianPath | BlendedPath
        if len(self.segments) == 1:
            cartesian = CartesianPath(self.segments)
            speed: SpeedCap | None = float(limits[0]) if np.isfinite(limits[0]) else None
        else:
            cartesian = _blended(self.segments, self.corners)
            caps, inner = limits[cartesian.segments_of_pieces].min(axis=1), cartesian.breakpoints[1:-1]
            speed = (lambda lam: caps[np.searchsorted(inner, lam, side="right")]) if np.isfinite(caps).any() else None
        self.segments, self.corners, self.limits = [], [], []
        self.add(JointPath.along(cartesian, self.arm, start=self.q), speed)


def _blended(segments: Sequence[Line | Arc], corners: Sequence[CornerConfig]) -> BlendedPath:
    """A chain whose corners are rounded as its steps say."""
    curves = {corner.curve for corner in corners}
    if len(curves) > 1:
        raise PathError(
            f"corners of one chain are of different curves: {', '.join(sorted(curves))}",
            remedy="use one curve, or stop between them (blend: stop)",
        )
    distance, tolerance = (
        None if all(value is None for value in values) else [np.inf if value is None else value for value in values]
        for values in zip(*((corner.remaining_distance_m, corner.tolerance_m) for corner in corners), strict=True)
    )
    if distance is not None:  # no corner takes more than its segments have
        longest = max(segment.length for segment in segments)
        distance = [min(value, longest) for value in distance]
    if tolerance is not None:
        tolerance = [min(value, 1e3) for value in tolerance]
    return BlendedPath(segments, distance, tolerance=tolerance, curve=corners[0].curve)


def tasks_from(config: TaskCellConfig, arms: Sequence[Arm]) -> Ways:
    """Paths with stops for all arms, and the rules between them.

    Raises:
        InputError, PathError: A step cannot be done; the message names it.
        InfeasibleError: Arms wait for each other in a circle; the message has its rules.
    """
    needed = _needed(config)
    done = []
    for i, (arm, given) in enumerate(zip(arms, config.arms, strict=True)):
        done.append(_sequence_of(config, f"{config.source}, arms[{i}]", arm, given, needed.get(given.name, set())))
    paths = []
    for i, own in enumerate(done):
        with located(f"{config.source}, arms[{i}].task"):
            paths.append(JointPath.sequence(own.items))
    rules = _rules(config, done, paths)
    with located(str(config.source)):
        check_rules([path.length for path in paths], rules)
    return Ways(
        key="task",
        paths=tuple(paths),
        tool_speeds=tuple(
            _tool_speed(path, own.speeds, given.limits.tool_speed_m_s)
            for path, own, given in zip(paths, done, config.arms, strict=True)
        ),
        exclusions=(*rules, *_zones(config, arms, paths)),
        events=tuple(_events(config, done, paths)),
    )


def _events(config: TaskCellConfig, done: Sequence[_Sequence], paths: Sequence[SequencePath]) -> Iterator[TaskEvent]:
    """Arm by arm, in their order."""
    for arm, own, path in zip(config.arms, done, paths, strict=True):
        for k, (_, step) in enumerate(arm.steps):
            if isinstance(step.said, EventConfig):
                _, begins, ends, _ = _borders(path, own.marks[k])
                yield TaskEvent(arm=arm.name, name=step.said.name, begins=begins, ends=ends)


def _syncs(step: StepConfig) -> tuple[SyncConfig, ...]:
    said = step.said
    if said is None:
        return ()
    together = (said.together,) if isinstance(said, EventConfig) and said.together else ()
    return (*said.after, *together)


def _needed(config: TaskCellConfig) -> dict[str, set[str]]:
    """By arm, the names of its steps that others wait for."""
    found: dict[str, set[str]] = {}
    for arm in config.arms:
        for _, step in arm.steps:
            for sync in _syncs(step):
                found.setdefault(sync.arm, set()).add(sync.event)
    return found


def _sequence_of(config: TaskCellConfig, source: str, arm: Arm, given: TaskArmConfig, needed: set[str]) -> _Sequence:
    """All that an arm does."""
    with located(f"{source}.start"):
        start = _posture(config, arm, given.start, np.array(given.posture_rad or np.zeros(arm.dof)), given.posture_rad)
    own = _Sequence(arm, config.physics_tick_s, start)
    steps = given.steps
    for k, (place, step) in enumerate(steps):
        following = steps[k + 1][1] if k + 1 < len(steps) else None
        with located(f"{source}.{place}"):
            _add_step(config, own, given, k, (place, step, following), needed)
    return own


def _add_step(
    config: TaskCellConfig, own: _Sequence, given: TaskArmConfig, k: int,
    at: tuple[str, StepConfig, StepConfig | None], needed: set[str],
) -> None:  # fmt: skip
    """Put one step to an arm's sequence."""
    place, step, following = at
    said = step.said
    synchronised = bool(_syncs(step)) or (said is not None and said.name in needed)
    if synchronised or isinstance(said, EventConfig):
        own.finish_chain()
        own.wait()
    waits = bool(own.items) and isinstance(own.items[-1], Wait)
    if not isinstance(said, TaskLineConfig):
        own.finish_chain()
    first = len(own.items)
    if isinstance(said, TaskLineConfig):
        _add_segment(config, own, given, said)
        corner = given.blend if said.blend is None else said.blend
        goes_on = following is not None and following.kind in ("line", "arc") and not _syncs(following)
        if synchronised or not goes_on or corner == "stop":
            _check_blend(said, synchronised or not goes_on)
            own.finish_chain()
        else:
            assert isinstance(corner, CornerConfig)
            own.corners.append(corner)
    elif isinstance(said, MoveConfig):
        target = _posture(config, own.arm, said.to, own.q, own.q)
        own.add(JointPath.through([own.q, target], arm=own.arm))
    else:
        own.add(Dwell(said.duration_s if isinstance(said, EventConfig) else step.dwell_s or 0.0))
    if synchronised or isinstance(said, EventConfig):
        own.marks[k] = _Mark(_words(place, step), first, len(own.items) - 1, waits)
        own.wait()


def _check_blend(said: TaskLineConfig, stops: bool) -> None:
    if stops and isinstance(said.blend, CornerConfig):
        raise PathError(
            "a corner is blended where the arm has to stop: no line or arc goes on from there at once",
            remedy="leave blend out, or let a line follow that waits for nobody",
        )


def _words(place: str, step: StepConfig) -> str:
    said = step.said
    name = None if said is None else said.name
    to = getattr(said, "to", None)
    return f"{place} ({step.kind}{f' {name!r}' if name else f' to {to}' if isinstance(to, str) else ''})"


def _place(config: TaskCellConfig, given: str | PlaceConfig) -> PlaceConfig:
    return config.places[given] if isinstance(given, str) else given


def _add_segment(config: TaskCellConfig, own: _Sequence, given: TaskArmConfig, said: TaskLineConfig) -> None:
    """One more line or arc of the chain."""
    start = own.tip
    end = start + np.array(said.by_m) if said.by_m is not None else _end_of_line(config, own, said.to)
    if isinstance(said, TaskArcConfig):
        if said.via_m is not None:
            segment: Line | Arc = Arc.through(start, np.array(said.via_m), end)
        else:
            normal = None if said.turn is None else np.array([0.0, 0.0, 1.0 if said.turn == "ccw" else -1.0])
            assert said.center_m is not None
            segment = Arc(start, end, np.array(said.center_m), normal)
    else:
        segment = Line(start, end)
    own.segments.append(segment)
    own.limits.append(min(said.tool_speed_m_s or np.inf, given.limits.tool_speed_m_s or np.inf))


def _end_of_line(config: TaskCellConfig, own: _Sequence, to: str | PlaceConfig | None) -> Floats:
    assert to is not None
    place, name = _place(config, to), f" {to!r}" if isinstance(to, str) else ""
    if place.position_m is None:
        raise InputError(
            f"place{name} has joint positions, and a line ends where the tip is to be",
            remedy="use move, or give the place as position_m",
        )
    if place.rpy_rad is not None:
        R = own.arm.tip_pose(own.q)[:3, :3]
        turn = (Rotation.from_euler("xyz", place.rpy_rad) * Rotation.from_matrix(R).inv()).magnitude()
        if turn > TURN_MAX:
            raise PathError(
                f"place{name} is turned by {turn:.4g} rad away from the tool, and on lines and arcs the tool stays "
                "as it is",
                remedy="use move, or leave rpy_rad out",
            )
    return np.array(place.position_m)


def _posture(config: TaskCellConfig, arm: Arm, to: str | PlaceConfig, near: Floats, given: ArrayLike | None) -> Floats:
    """(n,) the arm at a place; of a pose the posture that it comes to from ``near`` without leaving its branch."""
    place, name = _place(config, to), f" {to!r}" if isinstance(to, str) else ""
    if place.joints_rad is not None:
        if len(place.joints_rad) != arm.dof:
            raise InputError(
                f"place{name} has {len(place.joints_rad)} joint positions, arm {arm.name!r} has {arm.dof} joints",
                remedy=f"give one per joint: {', '.join(arm.joint_names)}",
            )
        return np.array(place.joints_rad)
    if given is None or len(near) != arm.dof:
        raise InputError(
            f"place{name} is reached in several postures, and none is chosen",
            remedy=f"give posture_rad: {arm.dof} joint positions near those at the start",
        )
    assert place.position_m is not None
    T = arm.tip_pose(near)
    wanted = T[:3, :3] if place.rpy_rad is None else Rotation.from_euler("xyz", place.rpy_rad).as_matrix()
    turn = Rotation.from_matrix(np.stack([T[:3, :3], wanted]))
    share = np.linspace(0.0, 1.0, POSE_SAMPLES)
    position = T[:3, 3] + share[:, None] * (np.array(place.position_m) - T[:3, 3])
    target = PoseTarget.through(position, Slerp([0.0, 1.0], turn)(share).as_matrix(), 1.0)
    run = NewtonIK(arm, iterations=None).track(target, near)
    q = np.array(run.q[-1])
    there = arm.tip_pose(q)
    off = float(np.linalg.norm(there[:3, 3] - np.array(place.position_m)))
    aside = float((Rotation.from_matrix(there[:3, :3]) * Rotation.from_matrix(wanted).inv()).magnitude())
    if off > 1e-9 or (place.rpy_rad is not None and aside > TURN_MAX):
        raise PathError(
            f"arm {arm.name!r} does not get to place{name} on the branch that it is on: it comes no nearer than "
            f"{off:.3g} m and {aside:.3g} rad",
            remedy="move the place, give it as joints_rad, or start on another branch (posture_rad)",
            arm=arm.name,
        )
    beyond = np.flatnonzero((q < arm.position_min) | (q > arm.position_max))
    if len(beyond):
        joint = int(beyond[0])
        raise PathError(
            f"arm {arm.name!r} at place{name}: joint {arm.joint_names[joint]!r} would be at {q[joint]:.4g}, its range "
            f"is [{arm.position_min[joint]:.4g}, {arm.position_max[joint]:.4g}]",
            remedy="move the place, give it as joints_rad, or start on another branch (posture_rad)",
            arm=arm.name,
            joint=joint,
        )
    return q


def _tool_speed(path: SequencePath, speeds: Sequence[SpeedCap | None], of_arm: float | None) -> SpeedCap | None:
    """How fast the tip may go along a sequence [m/s], from what each piece says."""
    if not any(speed is not None for speed in speeds):
        return of_arm

    def limit(lam: Floats) -> Floats:
        step, out = path.step_at(lam), np.full(len(lam), np.inf if of_arm is None else of_arm)
        for k, speed in enumerate(speeds):
            at = step == k
            if speed is not None and at.any():
                own = path.own(k, lam[at])
                out[at] = np.minimum(out[at], speed(own) if callable(speed) else speed)
        return out

    return limit


def _rules(config: TaskCellConfig, done: Sequence[_Sequence], paths: Sequence[SequencePath]) -> list[Exclusion]:
    """Who waits for whom."""
    number = {arm.name: i for i, arm in enumerate(config.arms)}
    found: dict[tuple[int, float, int, float], Exclusion] = {}

    def put(second: int, beyond: float, first: int, reached: float, rule: str) -> None:
        made = after(second, beyond, first, reached, paths[second].length, rule)
        found.setdefault((second, beyond, first, reached), made)

    for i, arm in enumerate(config.arms):
        for k, (_, step) in enumerate(arm.steps):
            said = step.said
            for sync in () if said is None else said.after:
                j, mark = number[sync.arm], done[i].marks[k]
                until = f"until {sync.arm!r} {WORDS[sync.when]} {sync.event!r}"
                rule = f"{arm.name!r} waits before {mark.words} {until}"
                put(i, _borders(paths[i], mark)[1], j, _reached(config, done, paths, j, sync), rule)
            if isinstance(said, EventConfig) and said.together:
                j, sync = number[said.together.arm], said.together
                own, other = _borders(paths[i], done[i].marks[k]), _borders(paths[j], _mark(config, done, j, sync))
                rule = f"{arm.name!r} does {said.name!r} together with {sync.event!r} of {sync.arm!r}"
                for one, two, first, second in ((own, other, i, j), (other, own, j, i)):
                    put(second, two[1], first, one[0], rule)
                    put(second, two[3], first, one[2], rule)
    return list(found.values())


def _mark(config: TaskCellConfig, done: Sequence[_Sequence], j: int, sync: SyncConfig) -> _Mark:
    steps = config.arms[j].steps
    return done[j].marks[next(k for k, (_, step) in enumerate(steps) if step.said and step.said.name == sync.event)]


def _borders(path: SequencePath, mark: _Mark) -> tuple[float, float, float, float]:
    """Where the wait before a step begins, the step itself, the wait behind it, and where that ends [lambda]."""
    border = path.border
    begin = mark.first - 1 if mark.waits else mark.first
    return float(border[begin]), float(border[mark.first]), float(border[mark.last + 1]), float(border[mark.last + 2])


def _reached(
    config: TaskCellConfig, done: Sequence[_Sequence], paths: Sequence[SequencePath], j: int, sync: SyncConfig
) -> float:
    borders = _borders(paths[j], _mark(config, done, j, sync))
    return borders[("arrived", "begun", "done").index(sync.when)]


def _zones(config: TaskCellConfig, arms: Sequence[Arm], paths: Sequence[SequencePath]) -> list[Exclusion]:
    found = []
    names, lengths = tuple(arm.name for arm in arms), tuple(path.length for path in paths)
    for zone in config.zones:
        body = obstacle_from(config, zone)
        met: dict[int, tuple[Bools, Bools]] = {
            i: inside_zone(arm, path, body, path.cells) for i, (arm, path) in enumerate(zip(arms, paths, strict=True))
        }
        found += zone_exclusions(zone.name, met, names, lengths)
    return found

"""What a cell file may say.

One model per mapping of the file, attribute names equal to the keys. Keys carry their unit (``_m``, ``_rad``, ``_s``,
``_nm`` = N m). Every number must be finite, unknown keys are refused, and a loaded model cannot be changed.
"""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any, Literal, Self, TypeVar

from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    PrivateAttr,
    StrictBool,
    StringConstraints,
    field_validator,
    model_validator,
)
from pydantic_core import PydanticCustomError


def _only_numbers(value: Any) -> Any:
    """Refuse what pydantic would turn into a number: ``"1.0"`` and ``true`` in a YAML file are slips."""
    if isinstance(value, bool | str):
        raise PydanticCustomError("float_type", "must be a number")
    return value


Real = Annotated[float, BeforeValidator(_only_numbers), Field(allow_inf_nan=False)]
Positive = Annotated[Real, Field(gt=0)]
NonNegative = Annotated[Real, Field(ge=0)]
Point = tuple[Real, Real, Real]
Name = Annotated[str, StringConstraints(pattern=r"^[a-z][a-z0-9_]*$")]
CellTitle = Annotated[str, StringConstraints(pattern=r"^[a-z][a-z0-9_-]*$")]
ZERO: Point = (0.0, 0.0, 0.0)
MOST_TICKS = 1_000_000  # of a target, which is sampled as a whole: 0.3 GB


class _Model(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", use_attribute_docstrings=True)


class PoseConfig(_Model):
    """A position and an orientation in the parent frame."""

    position_m: Point = ZERO
    """Origin [m]."""
    rpy_rad: Point = ZERO
    """Roll, pitch, yaw [rad] about fixed x, y, z, as in URDF: R = Rz(yaw) Ry(pitch) Rx(roll)."""


class ToolConfig(_Model):
    """A rigid body bolted to the tip link. All of it is given in the tip link's frame."""

    mass_kg: NonNegative = 0.0
    """Mass [kg]."""
    com_m: Point = ZERO
    """Centre of mass [m]."""
    inertia_kgm2: tuple[Real, Real, Real, Real, Real, Real] = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    """ixx, iyy, izz, ixy, ixz, iyz about the centre of mass [kg m^2]."""
    frame: PoseConfig = PoseConfig()
    """The tool's working point, which follows the path."""
    hull_m: tuple[Point, ...] | None = None
    """Corner points [m] of the convex body for collision checks; null: the tool cannot collide."""

    @field_validator("hull_m")
    @classmethod
    def _hull_is_a_body(cls, hull: tuple[Point, ...] | None) -> tuple[Point, ...] | None:
        if hull is not None and len(set(hull)) < 4:
            raise ValueError("a hull needs at least 4 different points")
        return hull

    @model_validator(mode="after")
    def _inertia_is_physical(self) -> Self:
        ixx, iyy, izz = self.inertia_kgm2[:3]
        if min(ixx, iyy, izz) < 0 or 2 * max(ixx, iyy, izz) > (ixx + iyy + izz) * (1 + 1e-9):
            raise ValueError("inertia_kgm2: ixx, iyy, izz must be >= 0, and none larger than the sum of the other two")
        if any(self.inertia_kgm2) and self.mass_kg == 0.0:
            raise ValueError("inertia_kgm2: a tool without mass_kg cannot have one")
        return self


class LimitsConfig(_Model):
    """Limits instead of the URDF's, one value per joint from the base on. A null keeps the URDF's."""

    torque_nm: tuple[Positive | None, ...] | None = None
    """Largest torque, either way [N m] (prismatic joints: force [N])."""
    speed_rad_s: tuple[Positive | None, ...] | None = None
    """Largest speed, either way [rad/s] (prismatic joints: [m/s])."""
    acceleration_rad_s2: tuple[Positive | None, ...] | None = None
    """Largest acceleration, either way [rad/s^2] (prismatic joints: [m/s^2]); null: no limit, a URDF has none."""
    position_rad: tuple[tuple[Real, Real] | None, ...] | None = None
    """Lowest and highest position [rad] (prismatic joints: [m])."""

    @field_validator("position_rad")
    @classmethod
    def _low_before_high(
        cls, ranges: tuple[tuple[float, float] | None, ...] | None
    ) -> tuple[tuple[float, float] | None, ...] | None:
        for low_high in ranges or ():
            if low_high is not None and not low_high[0] < low_high[1]:
                raise ValueError("each range must be [lowest, highest], the lowest first")
        return ranges


class FrictionConfig(_Model):
    """Friction instead of the URDF's, one value per joint from the base on. A null keeps the URDF's."""

    viscous_nm_s_rad: tuple[NonNegative | None, ...] | None = None
    """Torque per speed [N m s/rad] (prismatic joints: [N s/m])."""
    coulomb_nm: tuple[NonNegative | None, ...] | None = None
    """Torque against the motion whatever its speed [N m] (prismatic joints: force [N])."""


class LineConfig(_Model):
    """A straight line from where the path stands."""

    to_m: Point
    """End [m], world frame."""


class ArcConfig(_Model):
    """A circular arc from where the path stands: about a centre, or through a point on the way.

    About a centre it is the shorter one, unless ``turn`` says which.
    """

    to_m: Point
    """End [m], world frame."""
    center_m: Point | None = None
    """Centre [m], world frame; as far from the start as from the end."""
    via_m: Point | None = None
    """Instead: a point [m] on the arc between its ends, world frame."""
    turn: Literal["ccw", "cw"] | None = None
    """Sense seen against ``normal``; null: the shorter arc (a half circle needs a sense)."""
    normal: Point = (0.0, 0.0, 1.0)
    """Axis that ``turn`` refers to, any length; used only with ``turn``."""

    @field_validator("normal")
    @classmethod
    def _normal_has_a_direction(cls, normal: Point) -> Point:
        if not any(normal):
            raise ValueError("must not be the zero vector")
        return normal

    @model_validator(mode="after")
    def _one_way(self) -> Self:
        if (self.center_m is None) == (self.via_m is None):
            raise ValueError(f"center_m: give it or via_m, {'one of them' if self.via_m is None else 'not both'}")
        if self.via_m is not None and self.turn is not None:
            raise ValueError("turn: belongs to center_m; an arc through via_m turns as it must")
        return self


def _exactly_one(model: BaseModel, what: str, among: tuple[str, ...] = ()) -> str:
    """Name of the one field of ``model`` that is set, of these, or of those that default to None."""
    choices = among or [name for name, field in type(model).model_fields.items() if field.default is None]
    given = [name for name in choices if getattr(model, name) is not None]
    if len(given) != 1:
        raise ValueError(f"{what} needs exactly one of {', '.join(choices)}; got {', '.join(given) or 'none'}")
    return given[0]


class SegmentConfig(_Model):
    """One piece of a path: a line or an arc."""

    line: LineConfig | None = None
    arc: ArcConfig | None = None

    @model_validator(mode="after")
    def _one_kind(self) -> Self:
        _exactly_one(self, "a segment")
        return self

    @property
    def geometry(self) -> LineConfig | ArcConfig:
        """The piece itself."""
        geometry = self.line or self.arc
        assert geometry is not None  # by _one_kind
        return geometry


class BlendConfig(_Model):
    """How corners are rounded: all of them alike."""

    curve: Literal["cubic", "quintic", "low-peak", "septic", "least-time"] = "cubic"
    """Family of the curve: the paper's ``cubic``; the others have no jump of curvature at any corner."""
    shape_factor: Annotated[Positive, Field(le=4)] = 3.0
    """End tangents of the cubic in remaining distances, at most 4; at 3 the curvature does not jump between lines."""
    remaining_distance_m: Positive | None = None
    """Length that a blend takes off each of its two segments [m]."""
    tolerance_m: Positive | None = None
    """Instead: how far the curve passes from the corner [m]."""

    @model_validator(mode="after")
    def _one_size(self) -> Self:
        _exactly_one(self, "a blend")
        return self

    @model_validator(mode="after")
    def _fits_the_curve(self) -> Self:
        if self.curve != "cubic" and self.shape_factor != 3.0:
            raise ValueError(f"shape_factor: belongs to curve 'cubic', not to {self.curve!r}; drop it")
        if self.curve == "least-time" and self.tolerance_m is None:
            raise ValueError("tolerance_m: missing; curve 'least-time' needs it instead of remaining_distance_m")
        return self


class PathConfig(_Model):
    """Where an arm goes: lines and arcs of its working point, or waypoints of its joints."""

    start_m: Point | None = None
    """First point [m], world frame."""
    waypoints_rad: Annotated[tuple[tuple[Real, ...], ...], Field(min_length=2)] | None = None
    """Joint positions [rad] (prismatic joints: [m]), one row per waypoint, one value per joint from the base on."""
    waypoints_file: str | None = None
    """CSV or JSON file of waypoints, a path from the cell file; columns may be named after the joints."""
    segments: Annotated[tuple[SegmentConfig, ...], Field(min_length=1)] = ()
    """Pieces in order; each begins where the one before ended."""
    start_rad: Annotated[tuple[Real, ...], Field(min_length=2)] | None = None
    """Joint positions [rad] (prismatic joints: [m]) at ``start_m``, of any arm, instead of an elbow: how it gets there.

    They may be rounded: the arm is moved onto ``start_m``, no joint by more than 0.25.
    The tool keeps the orientation that it has there, as far as the arm has the joints for it.
    """
    blend: BlendConfig | None = None
    """How corners of the segments are rounded; null: there are none. Cells of kind blend have it beside the arm."""

    @model_validator(mode="after")
    def _one_kind(self) -> Self:
        kind = _exactly_one(self, "a path", ("start_m", "waypoints_rad", "waypoints_file"))
        if kind == "start_m" and not self.segments:
            raise ValueError("segments: missing; a path that starts at start_m goes on in lines and arcs")
        if kind != "start_m" and self.segments:
            raise ValueError(f"segments: belong to start_m, not to {kind}")
        for key in ("start_rad", "blend"):
            if kind != "start_m" and getattr(self, key) is not None:
                raise ValueError(f"{key}: belongs to start_m, not to {kind}")
        if self.blend is not None and self.blend.curve == "least-time":
            raise ValueError("blend: curve 'least-time' needs a line speed; use it in a cell of kind blend")
        return self


Entries = TypeVar("Entries", LimitsConfig, FrictionConfig)


def _over(cell: Entries, sheet: Entries) -> Entries:
    """``cell``'s values, where it is null joint by joint the data sheet's."""
    merged: dict[str, Any] = {}
    for key in type(cell).model_fields:
        own, other = getattr(cell, key), getattr(sheet, key)
        if own is not None and other is not None and len(own) == len(other):
            own = tuple(o if c is None else c for c, o in zip(own, other, strict=True))
        merged[key] = other if own is None else own
    return type(cell)(**merged)


class RobotConfig(_Model):
    """What a robot's data sheet says beyond its URDF; cells may replace any of it."""

    source: str
    """Where the numbers are from."""
    tip_link: str | None = None
    """Link that carries the tool, where the URDF branches."""
    limits: LimitsConfig = LimitsConfig()
    """Limits instead of the URDF's."""
    friction: FrictionConfig = FrictionConfig()
    """Friction instead of the URDF's."""
    ignored_pairs: tuple[tuple[str, str], ...] = ()
    """Pairs of links that are not looked at for self-collision."""
    unphysical_inertia: Literal["refuse", "point-mass"] = "refuse"
    """Links with moments of inertia that no body can have: an error, or taken for a point mass as PyBullet does."""


class MountedArmConfig(_Model):
    """One arm and where it stands."""

    name: Name
    """Short name, unique in the cell; tables and errors use it."""
    urdf: str
    """URDF file: a path from the cell file, a bundled robot's name, or ``pybullet_data/...`` for one of PyBullet's."""
    base: PoseConfig = PoseConfig()
    """Pose of the URDF's root link in the world."""
    tip_link: str | None = None
    """Link that carries the tool; null: the last link of the chain."""
    tool: ToolConfig | None = None
    """Body on the tip link; null: the bare tip link follows the path."""
    limits: LimitsConfig = LimitsConfig()
    """Limits instead of the URDF's."""
    friction: FrictionConfig = FrictionConfig()
    """Friction instead of the URDF's."""
    ignored_pairs: tuple[tuple[str, str], ...] = ()
    """Pairs of links that are not looked at for self-collision: those that touch by design."""

    def over(self, sheet: RobotConfig | None) -> Self:
        """This arm, and what it leaves open from its robot's data sheet."""
        if sheet is None:
            return self
        return self.model_copy(
            update={
                "tip_link": self.tip_link or sheet.tip_link,
                "limits": _over(self.limits, sheet.limits),
                "friction": _over(self.friction, sheet.friction),
                "ignored_pairs": (*sheet.ignored_pairs, *self.ignored_pairs),
            }
        )


class ArmConfig(MountedArmConfig):
    """One arm, where it stands and the path it is given."""

    elbow: Literal["negative", "positive"] | None = None
    """Sign of a two-link arm's elbow angle (its second joint); null where there is no such choice."""
    path: PathConfig
    """The given path."""

    @model_validator(mode="after")
    def _one_posture(self) -> Self:
        if self.elbow is not None and self.path.start_rad is not None:
            raise ValueError("elbow: give it or path.start_rad, not both")
        return self


class BoxConfig(_Model):
    """A box around its origin."""

    size_m: tuple[Positive, Positive, Positive]
    """Full lengths along x, y, z [m]."""


class SphereConfig(_Model):
    """A sphere around its origin."""

    radius_m: Positive
    """Radius [m]."""


class CylinderConfig(_Model):
    """A cylinder along z around its origin."""

    radius_m: Positive
    """Radius [m]."""
    length_m: Positive
    """Length along z [m]."""


class CapsuleConfig(_Model):
    """A capsule along z around its origin."""

    radius_m: Positive
    """Radius [m]."""
    length_m: Positive
    """Length of its cylindrical part along z [m]; the two round ends come on top."""


class MeshConfig(_Model):
    """A mesh file, taken as its convex hull."""

    file: str
    """Mesh file (.stl, .obj, ...), a path from the cell file; its unit is the metre."""


class ObstacleConfig(_Model):
    """A body that stands still: exactly one shape, and where it stands."""

    name: Name
    """Short name, unique in the cell."""
    box: BoxConfig | None = None
    sphere: SphereConfig | None = None
    cylinder: CylinderConfig | None = None
    capsule: CapsuleConfig | None = None
    mesh: MeshConfig | None = None
    pose: PoseConfig = PoseConfig()
    """Pose in the world."""

    @model_validator(mode="after")
    def _one_shape(self) -> Self:
        _exactly_one(self, "an obstacle")
        return self

    @property
    def kind(self) -> str:
        """Which shape: ``box``, ``sphere``, ``cylinder``, ``capsule`` or ``mesh``."""
        return _exactly_one(self, "an obstacle")


_Named = TypeVar("_Named", ArmConfig, ObstacleConfig)


class _CellFile(_Model):
    """What the files of all kinds of cells say."""

    kind: str
    """What the cell is for."""
    name: CellTitle
    """Name of the cell."""
    description: str = ""
    """What the cell shows, for `armtempo cells`."""

    _source: Path = PrivateAttr(default=Path("cell.yaml"))

    def model_post_init(self, context: Any, /) -> None:
        """Take the file from the validation context; it is no key that a file could set."""
        if context and "source" in context:
            self._source = context["source"]

    @property
    def source(self) -> Path:
        """The file this came from; file names in the cell are relative to its folder."""
        return self._source


def _check_period(control_period: float, physics_tick: float) -> None:
    ticks = control_period / physics_tick
    if round(ticks) < 1 or abs(ticks - round(ticks)) > 1e-9 * round(ticks):
        raise ValueError(
            f"control_period_s: must be a whole multiple of physics_tick_s = {physics_tick:g}, "
            f"got {ticks:.6g} ticks; nearest: {max(1, round(ticks)) * physics_tick:g}"
        )


class CellConfig(_CellFile):
    """Arms that share a space, each on its own given path, and how closely they may pass."""

    kind: Literal["coordination"]
    """What the cell is for."""
    d_min_m: NonNegative
    """Smallest distance allowed between the surfaces of two arms, or of an arm and an obstacle [m].

    Boxes, cylinders and hulls that overlap are 0 apart however deep they are in each other: at ``d_min_m`` 0 they break
    no rule, and charts cannot call a cell of theirs blocked, only undecided. Give such arms more than 0.
    """
    clearance_reserve_m: NonNegative = 0.0005
    """Planned on top of ``d_min_m``, for what the execution will deviate [m]."""
    torque_reserve: Annotated[Real, Field(ge=0, le=0.9)] = 0.0
    """Share of each torque limit that plans leave to the controller, 0 to 0.9."""
    physics_tick_s: Annotated[Real, Field(ge=1e-5, le=0.02)] = 0.001
    """Step of the simulation [s]; clearance is watched at every tick, so it may not be long."""
    control_period_s: Positive = 0.004
    """Time between two decisions [s], a whole multiple of ``physics_tick_s``."""
    stations: Annotated[int, Field(ge=50, le=16000, strict=True)] = 1000
    """Intervals of the phase-plane grid along each path; doubled until sampled torques exceed no limit by 0.1 %."""
    chart_tolerance_m: Annotated[Real, Field(ge=1e-6)] = 0.0004
    """Side of the smallest cell of a coordination chart [m]; a chart has at most 4096 cells along each side."""
    chart_cells: Annotated[int, Field(ge=16, le=4096, strict=True)] | None = None
    """Instead: cells along each side, a power of two; null: 1024 where a path goes through joint waypoints."""
    arms: Annotated[tuple[ArmConfig, ...], Field(min_length=1)]
    """The arms in priority order: the first is the master."""
    obstacles: tuple[ObstacleConfig, ...] = ()
    """Bodies that stand still."""
    gravity_m_s2: Point = (0.0, 0.0, -9.81)
    """Acceleration of free fall [m/s^2], world frame."""

    def chart_tolerance(self, longest: float) -> float:
        """Side of the smallest cell of a chart [lambda], the longer of its two paths being ``longest``."""
        cells = self.chart_cells
        if cells is None and any(arm.path.start_m is None for arm in self.arms):
            cells = 1024
        if cells is not None:
            return longest / cells * (1.0 + 1e-9)  # so that rounding does not double the cells
        return self.chart_tolerance_m

    @property
    def ticks_per_period(self) -> int:
        """Simulation steps between two decisions."""
        return round(self.control_period_s / self.physics_tick_s)

    @field_validator("arms", "obstacles")
    @classmethod
    def _names_differ(cls, bodies: tuple[_Named, ...]) -> tuple[_Named, ...]:
        names = [body.name for body in bodies]
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise ValueError(f"each needs a name of its own; used twice: {', '.join(twice)}")
        return bodies

    @model_validator(mode="after")
    def _one_chart_size(self) -> Self:
        if self.chart_cells is not None and self.chart_cells & (self.chart_cells - 1):
            raise ValueError(f"chart_cells: must be a power of two, got {self.chart_cells}")
        if "chart_tolerance_m" in self.model_fields_set:
            if self.chart_cells is not None:
                raise ValueError("chart_cells: give it or chart_tolerance_m, not both")
            if any(arm.path.start_m is None for arm in self.arms):
                raise ValueError(
                    "chart_tolerance_m: paths through joint waypoints are not measured in metres; give chart_cells"
                )
        return self

    @model_validator(mode="after")
    def _period_is_whole_ticks(self) -> Self:
        _check_period(self.control_period_s, self.physics_tick_s)
        return self


class LineSpeedConfig(_Model):
    """How fast the tip may go along its path."""

    speed_m_s: Positive
    """Line speed [m/s]."""
    acceleration_m_s2: Positive
    """Largest acceleration along the path [m/s^2], as ``acceleration_reading`` reads it."""
    acceleration_reading: Literal["peak", "mean"] = "peak"
    """``peak``: the largest; ``mean``: that of the ramp from rest to line speed."""
    jerk_m_s3: Positive
    """Largest jerk [m/s^3]."""
    normal_acceleration_m_s2: Positive | None = None
    """Largest acceleration across the path [m/s^2], for profiles that look at it; null: as along the path."""


class OneArmCellConfig(_CellFile):
    """What the files of cells with one arm say."""

    physics_tick_s: Annotated[Real, Field(ge=1e-5, le=0.02)] = 0.001
    """Step of the simulation and of the reference [s]."""
    control_period_s: Positive = 0.02
    """Time between two decisions [s], a whole multiple of ``physics_tick_s``."""
    gravity_m_s2: Point = (0.0, 0.0, -9.81)
    """Acceleration of free fall [m/s^2], world frame."""

    @property
    def ticks_per_period(self) -> int:
        """Simulation steps between two decisions."""
        return round(self.control_period_s / self.physics_tick_s)

    @model_validator(mode="after")
    def _period_is_whole_ticks(self) -> Self:
        _check_period(self.control_period_s, self.physics_tick_s)
        return self


class BlendCellConfig(OneArmCellConfig):
    """One arm whose tip follows lines and arcs, blended at the corners, at a constant line speed."""

    kind: Literal["blend"]
    """What the cell is for."""
    arm: ArmConfig
    """The arm and its path: lines and arcs that may meet in corners."""
    blend: BlendConfig
    """How the corners are rounded."""
    line_speed: LineSpeedConfig
    """Limits of the tip's motion."""
    contour_error_max_m: Positive = 0.005
    """Distance of the tip from the path at which an episode ends [m]."""

    @property
    def arms(self) -> tuple[ArmConfig]:
        """The arm, as cells of several have theirs."""
        return (self.arm,)

    @model_validator(mode="after")
    def _path_of_segments(self) -> Self:
        if self.arm.path.start_m is None:
            raise ValueError("arm: its path must be given by start_m and segments; waypoints have no corners to blend")
        return self

    @model_validator(mode="after")
    def _has_a_posture(self) -> Self:
        if self.arm.elbow is None and self.arm.path.start_rad is None:
            raise ValueError(
                "arm: its elbow is missing: positive or negative, of a two-link arm or a SCARA; "
                "or give path.start_rad: joint positions at start_m"
            )
        if self.arm.path.blend is not None:
            raise ValueError("arm: its path has a blend of its own; give it beside the arm only")
        return self


class StartedArmConfig(MountedArmConfig):
    """One arm, where it stands and the posture it starts from."""

    start_rad: Annotated[tuple[Real, ...], Field(min_length=1)]
    """Joint positions at the start [rad] (prismatic joints: [m]), one per joint from the base on."""


class HarmonicConfig(_Model):
    """A pose that swings along a line, center_m + amplitude_m cos(rate_rad_s t), and does not turn."""

    center_m: Point
    """Middle of the line [m], world frame."""
    amplitude_m: Point
    """From there to the place at time 0 [m]."""
    rate_rad_s: Positive
    """Angular frequency [rad/s]."""
    rpy_rad: Point = ZERO
    """Orientation of the tip [rad]: roll, pitch, yaw about fixed x, y, z, as in URDF."""
    duration_s: Positive
    """How long it is followed [s]."""


class TimedPoseConfig(PoseConfig):
    """A pose of the tip in the world, and when it is to be there."""

    time_s: NonNegative
    """Instant [s]; the first pose's is 0."""


class TargetConfig(_Model):
    """Where the tip is to be, over time."""

    harmonic: HarmonicConfig | None = None
    """A pose that swings along a line."""
    poses: Annotated[tuple[TimedPoseConfig, ...], Field(min_length=2)] | None = None
    """Poses with times: from each to the next straight and about one axis, at rest in all of them."""

    @model_validator(mode="after")
    def _one_kind(self) -> Self:
        _exactly_one(self, "a target")
        return self

    @field_validator("poses")
    @classmethod
    def _times_rise(cls, poses: tuple[TimedPoseConfig, ...] | None) -> tuple[TimedPoseConfig, ...] | None:
        times = [pose.time_s for pose in poses or ()]
        if times and (times[0] != 0.0 or any(b <= a for a, b in pairwise(times))):
            raise ValueError(f"time_s must begin at 0 and rise, got {', '.join(f'{t:g}' for t in times)}")
        return poses


class FeedbackLawConfig(_Model):
    """Inverse kinematics by feedback: its gains, which error it looks at, and when it is damped."""

    position_gain_1_s: Positive = 50.9
    """Gain of the position error [1/s]."""
    approach_gain_1_s: Positive = 20.0
    """Gain of the approach axis' error [1/s]; with quaternion errors that of all axes."""
    normal_gain_1_s: Positive = 25.5
    """Gain of the normal axis' error [1/s]."""
    error: Literal["axes", "quaternion"] = "axes"
    """Error of orientation: approach and normal axes, or the shortest way."""
    feed_forward: StrictBool = True
    """Whether the target's velocity is fed forward."""
    task: Literal["auto", "pose", "position"] = "auto"
    """What is controlled; auto: of the pose, what the arm can."""
    damping: Annotated[Positive, Field(lt=1)] = 0.02
    """Singular value of the Jacobian, lengths in units of the arm's, below which it is damped."""


class IKCellConfig(OneArmCellConfig):
    """One arm whose tip follows a pose over time."""

    kind: Literal["ik"]
    """What the cell is for."""
    arm: StartedArmConfig
    """The arm and where it starts."""
    target: TargetConfig
    """What its tip is to follow."""
    law: FeedbackLawConfig = FeedbackLawConfig()
    """Feedback that follows it, for the baselines and for actions that set its gains."""
    control_period_s: Positive = 0.01
    """Time between two decisions [s], a whole multiple of ``physics_tick_s``."""
    error_scale_m: Positive = 0.01
    """Position error [m] that costs half of the most; observations are scaled by it, too."""
    error_scale_rad: Positive = 0.05
    """Orientation error [rad], likewise."""

    @property
    def arms(self) -> tuple[StartedArmConfig]:
        """The arm, as cells of several have theirs."""
        return (self.arm,)

    @model_validator(mode="after")
    def _target_can_be_sampled(self) -> Self:
        poses, harmonic = self.target.poses, self.target.harmonic
        if harmonic is not None:
            key, duration = "target.harmonic.duration_s", harmonic.duration_s
        else:
            assert poses is not None  # by the target's own check
            key, duration = f"target.poses.{len(poses) - 1}.time_s", poses[-1].time_s
        if self.control_period_s > duration:  # a target lasts whole periods
            key, duration = "control_period_s", self.control_period_s
        if duration > MOST_TICKS * self.physics_tick_s * (1.0 + 1e-9):
            raise ValueError(
                f"{key}: {duration:g} s are {duration / self.physics_tick_s:.3g} ticks of physics_tick_s = "
                f"{self.physics_tick_s:g}, and at most {MOST_TICKS} can be sampled; give at most "
                f"{MOST_TICKS * self.physics_tick_s:g} s"
            )
        return self


AnyCellConfig = CellConfig | BlendCellConfig | IKCellConfig

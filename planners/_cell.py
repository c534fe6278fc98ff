"""A cell: arms on their given paths, built from its configuration and certified while it is built."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import final

import numpy as np
from numpy.typing import NDArray

from armtempo.configs import (
    ArcConfig,
    ArmConfig,
    CellConfig,
    LineConfig,
    ObstacleConfig,
    PoseConfig,
    SegmentConfig,
    load_cell_config,
    resolve_file,
)
from armtempo.errors import ArmtempoError, CollisionError, ConfigError
from armtempo.planners._cartesian_path import Arc, CartesianPath, Line
from armtempo.planners._coordination_chart import CoordinationChart, swept_displacements
from armtempo.planners._joint_path import JointPath
from armtempo.planners._makespan_bound import makespan_bound
from armtempo.planners._path_dynamics import PathDynamics
from armtempo.planners._phase_plane import PhasePlane
from armtempo.planners._phase_trajectory import PhaseTrajectory
from armtempo.planners._two_link_path import TwoLinkPath
from armtempo.robots import Arm, Clearance, Shape, Tool, static_shape

Array = NDArray[np.float64]

TORQUE_TOLERANCE = 1e-3
FINEST_GRID = 16_000  # intervals
BOUND_REFINEMENT = 8
FINEST_STATION = 2**-10  # share of a path's length to which obstacles and self-collision are certified


@dataclass(frozen=True, kw_only=True)
@final
class Cell:
    """Arms on given paths in one place. Make one with ``load_cell`` or ``build_cell``.

    Attributes:
        name: The cell's name.
        config: What it was built from.
        arms: The arms in priority order; the first is the master.
        paths: One joint path per arm.
        obstacles: Static bodies.
        dynamics: One per arm, the torque reserve taken off the limits.
        planes: One phase plane per arm.
        clearance: FCL distances between arms and to obstacles.
    """

    name: str
    config: CellConfig
    arms: tuple[Arm, ...]
    paths: tuple[JointPath, ...]
    obstacles: tuple[Shape, ...]
    dynamics: tuple[PathDynamics, ...]
    planes: tuple[PhasePlane, ...]
    clearance: Clearance

    def __deepcopy__(self, memo: dict[int, object]) -> Cell:
        return self  # nothing in it changes; gymnasium.make copies the arguments of environments

    @property
    def d_min(self) -> float:
        """Smallest allowed distance between two arms, and to obstacles [m]."""
        return self.config.d_min_m

    @property
    def planned_clearance(self) -> float:
        """``d_min`` plus the reserve that plans keep [m]."""
        return self.config.d_min_m + self.config.clearance_reserve_m

    @property
    def physics_tick(self) -> float:
        """Step of the simulation [s]."""
        return self.config.physics_tick_s

    @property
    def control_period(self) -> float:
        """Time between two decisions [s]."""
        return self.config.control_period_s

    @property
    def ticks_per_period(self) -> int:
        """Simulation steps between two decisions."""
        return self.config.ticks_per_period

    @cached_property
    def fastest(self) -> tuple[PhaseTrajectory, ...]:
        """The minimum-time motion of every arm."""
        return tuple(plane.fastest() for plane in self.planes)

    @property
    def sequential_makespan(self) -> float:
        """Minimum times of all arms, one after the other [s]."""
        return sum(motion.duration for motion in self.fastest)

    def _chart(self, d_min: float) -> CoordinationChart:
        return CoordinationChart.build(
            self.arms[0], self.paths[0], self.arms[1], self.paths[1], d_min, self.config.chart_tolerance_m
        )

    @cached_property
    def chart(self) -> CoordinationChart:
        """Coordination chart of the first two arms for planning: at ``d_min`` plus the reserve."""
        return self._chart(self.planned_clearance)

    @cached_property
    def bound_chart(self) -> CoordinationChart:
        """Coordination chart of the first two arms for bounds: at ``d_min``."""
        return self._chart(self.d_min)

    @cached_property
    def lower_bound(self) -> float:
        """Certified lower bound on the makespan of any timing within the planned torque limits [s]; or infinite.

        It rests on minimum times from a grid finer than the plans', which are themselves above the true ones by some
        1e-5 of them.
        """
        fastest = [
            PhasePlane(_dynamics(arm, path, self.config, BOUND_REFINEMENT * self.config.stations)).fastest()
            for arm, path in zip(self.arms, self.paths, strict=True)
        ]
        if len(fastest) == 1:
            return fastest[0].duration
        return makespan_bound(fastest[0], fastest[1], self.bound_chart)

    def check_ends(self) -> None:
        """Check that the arms are clear of each other where all start and where all end.

        Raises:
            CollisionError: They are not; the message names the links and their distance.
        """
        for where, end in (("start", 0.0), ("end", 1.0)):
            q = [path.evaluate(end * path.length)[0] for path in self.paths]
            nearest = self.clearance.arms(q)
            if nearest.distance < self.planned_clearance:
                raise CollisionError(
                    f"the arms collide where they {where}: {nearest.body_a} and {nearest.body_b} are "
                    f"{nearest.distance:.4g} m apart, {self.planned_clearance:.4g} m are required "
                    f"(d_min_m {self.d_min:.4g} and clearance_reserve_m {self.config.clearance_reserve_m:.4g})",
                    remedy=f"lower d_min_m, or move a path's {where}",
                    bodies=(nearest.body_a, nearest.body_b),
                    clearance_m=nearest.distance,
                    required_m=self.planned_clearance,
                )

    def check_path(self, i: int) -> None:
        """Certify path i, between samples too, against obstacles and the arm's own links.

        Raises:
            CollisionError: It comes too close; the message names the station and the bodies.
        """
        arm, path = self.arms[i], self.paths[i]
        # of two own links both move; plans keep off obstacles by the reserve too
        checks = [(self.clearance.self_collision, 0.0, 2.0, "itself")]
        if self.obstacles:
            checks.append((self.clearance.obstacles, self.planned_clearance, 1.0, "an obstacle"))
        smallest = round(1.0 / FINEST_STATION)
        sweeps = swept_displacements(arm, path, smallest)
        stack = [(1, 0)]
        while stack:
            cells, k = stack.pop()
            station = path.length * (k + 0.5) / cells
            q = path.evaluate(station)[0]
            sweep = sweeps[cells][k]
            for ask, required, movers, what in checks:
                nearest = ask(i, q)
                if nearest.distance - movers * sweep >= required:
                    continue
                if nearest.distance < required or cells >= smallest:
                    raise CollisionError(
                        f"path of arm {arm.name!r} comes too close to {what} at station {station:.4g} m: "
                        f"{nearest.body_a} and {nearest.body_b} are {nearest.distance:.4g} m apart, "
                        f"{required:.4g} m are required",
                        remedy="move the path or the obstacle, or lower d_min_m",
                        arm=arm.name,
                        station=station,
                        bodies=(nearest.body_a, nearest.body_b),
                        clearance_m=nearest.distance,
                        required_m=required,
                    )
                stack += [(2 * cells, 2 * k), (2 * cells, 2 * k + 1)]
                break


def load_cell(name_or_path: str | Path) -> Cell:
    """Load a bundled cell by name, or a user's own YAML file, and certify it.

    Raises:
        UnknownNameError: No such bundled cell or file.
        ConfigError: The file cannot be used; the message names file, key, value and remedy.
        PathError: A path is out of reach, breaks a limit or has a corner; the message names the station.
        InfeasibleError: Torque limits are too small; the message names the station and the joint.
        CollisionError: A path hits an obstacle or its own arm, or the arms start or end too close.
    """
    return build_cell(load_cell_config(name_or_path))


def build_cell(config: CellConfig) -> Cell:
    """Build and certify a cell; raises as ``load_cell``."""
    source = str(config.source)
    arms, paths, dynamics, planes = [], [], [], []
    for i, arm_config in enumerate(config.arms):
        place = f"{source}, arms[{i}]"
        try:
            arm = _build_arm(config, arm_config)
            place += ".path"
            path = _build_path(arm, arm_config)
            plane = _build_plane(arm, path, config)
        except ConfigError:
            raise
        except ArmtempoError as error:
            raise error.at(place) from error
        arms.append(arm)
        paths.append(path)
        dynamics.append(plane.dynamics)
        planes.append(plane)
    obstacles = tuple(_build_obstacle(config, obstacle) for obstacle in config.obstacles)
    cell = Cell(
        name=config.name,
        config=config,
        arms=tuple(arms),
        paths=tuple(paths),
        obstacles=obstacles,
        dynamics=tuple(dynamics),
        planes=tuple(planes),
        clearance=Clearance(arms, obstacles),
    )
    for i in range(len(arms)):
        try:
            cell.check_path(i)
        except CollisionError as error:
            raise error.at(f"{source}, arms[{i}].path") from error
    if len(arms) > 1:
        try:
            cell.check_ends()
        except CollisionError as error:
            raise error.at(source) from error
    return cell


def _transform(pose: PoseConfig) -> Array:
    """``T`` (4, 4) of a pose: roll, pitch, yaw about fixed axes, as in URDF."""
    (cr, cp, cy), (sr, sp, sy) = np.cos(pose.rpy_rad), np.sin(pose.rpy_rad)
    T = np.eye(4)
    T[:3, :3] = [
        [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
        [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
        [-sp, cp * sr, cp * cr],
    ]
    T[:3, 3] = pose.position_m
    return T


def _build_arm(config: CellConfig, arm: ArmConfig) -> Arm:
    tool = None
    if arm.tool is not None:
        # The file gives the body in the tip link's frame; a Tool holds it in its own.
        T = _transform(arm.tool.frame)
        ixx, iyy, izz, ixy, ixz, iyz = arm.tool.inertia_kgm2
        inertia = np.array([[ixx, ixy, ixz], [ixy, iyy, iyz], [ixz, iyz, izz]])
        R, p = T[:3, :3], T[:3, 3]
        tool = Tool(
            T_link_tool=T,
            mass=arm.tool.mass_kg,
            com=R.T @ (np.array(arm.tool.com_m) - p),
            inertia=R.T @ inertia @ R,
            hull=None if arm.tool.hull_m is None else (np.array(arm.tool.hull_m) - p) @ R,
        )
    return Arm.from_urdf(
        resolve_file(config, arm.urdf),
        name=arm.name,
        T_world_base=_transform(arm.base),
        gravity=config.gravity_m_s2,
        tip_link=arm.tip_link,
        tool=tool,
        torque_max=arm.limits.torque_nm,
        speed_max=arm.limits.speed_rad_s,
        position_limits=arm.limits.position_rad,
    )


def _build_segment(start: Array, config: SegmentConfig) -> Line | Arc:
    geometry = config.geometry
    if isinstance(geometry, LineConfig):
        return Line(start, np.array(geometry.to_m))
    assert isinstance(geometry, ArcConfig)
    normal = None if geometry.turn is None else np.array(geometry.normal) * (1.0 if geometry.turn == "ccw" else -1.0)
    return Arc(start, np.array(geometry.to_m), np.array(geometry.center_m), normal)


def _build_path(arm: Arm, config: ArmConfig) -> JointPath:
    segments: list[Line | Arc] = []
    start = np.array(config.path.start_m)
    for k, segment in enumerate(config.path.segments):
        try:
            segments.append(_build_segment(start, segment))
        except ArmtempoError as error:
            raise error.at(f"segments[{k}]") from error
        start = segments[-1].end
    return TwoLinkPath(arm, CartesianPath(segments), config.elbow or "positive")


def _dynamics(arm: Arm, path: JointPath, config: CellConfig, intervals: int) -> PathDynamics:
    return PathDynamics.from_path(arm, path, intervals=intervals, torque_reserve=config.torque_reserve)


def _build_plane(arm: Arm, path: JointPath, config: CellConfig) -> PhasePlane:
    """The phase plane on a grid fine enough that dense sampling finds no torque above its limit by more than 0.1 %."""
    intervals = config.stations
    while True:
        plane = PhasePlane(_dynamics(arm, path, config, intervals))
        if plane.fastest().certificate.torque_excess <= TORQUE_TOLERANCE or intervals >= FINEST_GRID:
            return plane
        intervals *= 2


def _build_obstacle(config: CellConfig, obstacle: ObstacleConfig) -> Shape:
    size: tuple[float, ...] = ()
    file = None
    if obstacle.box is not None:
        size = obstacle.box.size_m
    elif obstacle.sphere is not None:
        size = (obstacle.sphere.radius_m,)
    elif obstacle.mesh is not None:
        file = resolve_file(config, obstacle.mesh.file)
    else:
        rod = obstacle.cylinder or obstacle.capsule
        assert rod is not None
        size = (rod.radius_m, rod.length_m)
    return static_shape(obstacle.kind, size, T_world=_transform(obstacle.pose), name=obstacle.name, file=file)

"""From a cell file to a cell: arms, paths, phase planes and obstacles, certified while they are built."""

from __future__ import annotations

from pathlib import Path
from typing import Any, overload

import numpy as np

from armtempo.arrays import Floats
from armtempo.configs import (
    AnyCellConfig,
    ArcConfig,
    ArmConfig,
    BlendCellConfig,
    CellConfig,
    IKCellConfig,
    LineConfig,
    MountedArmConfig,
    ObstacleConfig,
    SegmentConfig,
    load_cell_config,
    resolve_file,
    robot_config,
)
from armtempo.errors import ArmtempoError, CollisionError, ConfigError, InfeasibleError
from armtempo.planners.blends._blended_path import BlendedPath
from armtempo.planners.cells._blend_cell import BlendCell
from armtempo.planners.cells._coordination_cell import Cell
from armtempo.planners.cells._ik_cell import IKCell
from armtempo.planners.charts._path_certificate import check_path
from armtempo.planners.geometry._cartesian_path import Arc, CartesianPath, Line
from armtempo.planners.geometry._pose_matrix import pose_matrix
from armtempo.planners.joint_paths._joint_path import JointPath
from armtempo.planners.topp._path_dynamics import PathDynamics
from armtempo.planners.topp._phase_plane import refined_plane
from armtempo.robots import Arm, Clearance, Shape, Tool, static_shape

_CONFIGS: dict[type, Any] = {Cell: CellConfig, BlendCell: BlendCellConfig, IKCell: IKCellConfig}


@overload
def load_cell(name_or_path: str | Path, kind: type[Cell] | None = None) -> Cell: ...
@overload
def load_cell(name_or_path: str | Path, kind: type[BlendCell]) -> BlendCell: ...
@overload
def load_cell(name_or_path: str | Path, kind: type[IKCell]) -> IKCell: ...
def load_cell(
    name_or_path: str | Path, kind: type[Cell] | type[BlendCell] | type[IKCell] | None = None
) -> Cell | BlendCell | IKCell:
    """Load a bundled cell by name, or a user's own YAML file, and certify it.

    Args:
        name_or_path: A bundled cell's name or a file.
        kind: ``Cell`` (kind: coordination), ``BlendCell`` (kind: blend) or ``IKCell`` (kind: ik): refuse files of
            another kind. None: whatever the file says (type checkers take it for a ``Cell``).

    Raises:
        UnknownNameError: No such bundled cell or file.
        ConfigError: The file cannot be used, or is of another kind; the message names file, key, value and remedy.
        PathError: A path is out of reach, breaks a limit or has a corner; the message names the station.
        InfeasibleError: Torque limits are too small; the message names the station and the joint.
        CollisionError: A path hits an obstacle or its own arm, or the arms start or end too close.
    """
    config: AnyCellConfig
    if kind is None:
        config = load_cell_config(name_or_path)
    else:
        config = load_cell_config(name_or_path, _CONFIGS[kind])
    return build_cell(config)


@overload
def build_cell(config: CellConfig) -> Cell: ...
@overload
def build_cell(config: BlendCellConfig) -> BlendCell: ...
@overload
def build_cell(config: IKCellConfig) -> IKCell: ...
def build_cell(config: AnyCellConfig) -> Cell | BlendCell | IKCell:
    """Build and certify a cell (of an IK cell postures only, not what is between); raises as ``load_cell``."""
    if isinstance(config, IKCellConfig):
        return _build_ik_cell(config)
    return _build_blend_cell(config) if isinstance(config, BlendCellConfig) else _build_coordination_cell(config)


def _build_ik_cell(config: IKCellConfig) -> IKCell:
    try:
        cell = IKCell.of(config, _build_arm(config, config.arm))
        cell.check()
    except ConfigError:
        raise
    except ArmtempoError as error:
        raise error.at(f"{config.source}, arm") from error
    return cell


def _build_blend_cell(config: BlendCellConfig) -> BlendCell:
    place = f"{config.source}, arm"
    try:
        arm = _build_arm(config, config.arm)
        place += ".path"
        cell = BlendCell.of(config, arm, _build_segments(config.arm))
        check_path(Clearance([arm], ()), 0, arm, cell.path)
        _check_holding(arm, cell)
    except ConfigError:
        raise
    except ArmtempoError as error:
        raise error.at(place) from error
    return cell


def _check_holding(arm: Arm, cell: BlendCell) -> None:
    """Raise InfeasibleError where the drives cannot hold the arm at rest on its path."""
    station = cell.path.station
    q = cell.path.evaluate(station)[0]
    rest = np.zeros_like(q)
    share = np.abs(arm.inverse_dynamics(q, rest, rest)) / arm.torque_max
    k, joint = np.unravel_index(int(share.argmax()), share.shape)
    if share[k, joint] > 1.0:
        unit = "N" if arm.model.prismatic[joint] else "N m"
        limit = float(arm.torque_max[joint])
        raise InfeasibleError(
            f"arm {arm.name!r} cannot hold still at station {station[k]:.4g} m: joint {arm.joint_names[joint]!r} needs "
            f"{share[k, joint] * limit:.4g} {unit}, its limit is {limit:.4g} {unit}",
            remedy="raise that limit, or move the path or the base",
            station=float(station[k]),
            joint=int(joint),
        )


def _build_coordination_cell(config: CellConfig) -> Cell:
    source = str(config.source)
    arms, paths, planes = [], [], []
    for i, arm_config in enumerate(config.arms):
        place = f"{source}, arms[{i}]"
        try:
            arm = _build_arm(config, arm_config)
            place += ".path"
            path = _build_path(arm, config, arm_config)
            dynamics = PathDynamics.from_path(
                arm, path, intervals=config.stations, torque_reserve=config.torque_reserve
            )
            plane = refined_plane(dynamics, tick=config.physics_tick_s)
        except ConfigError:
            raise
        except ArmtempoError as error:
            raise error.at(place) from error
        arms.append(arm)
        paths.append(path)
        planes.append(plane)
    obstacles = tuple(_build_obstacle(config, obstacle) for obstacle in config.obstacles)
    cell = Cell(
        name=config.name,
        config=config,
        arms=tuple(arms),
        paths=tuple(paths),
        obstacles=obstacles,
        dynamics=tuple(plane.dynamics for plane in planes),
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


def _build_arm(config: AnyCellConfig, arm: MountedArmConfig) -> Arm:
    sheet = robot_config(arm.urdf)
    arm = arm.over(sheet)
    tool = None
    if arm.tool is not None:
        # The file gives the body in the tip link's frame; a Tool holds it in its own.
        T = pose_matrix(arm.tool.frame)
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
        T_world_base=pose_matrix(arm.base),
        gravity=config.gravity_m_s2,
        tip_link=arm.tip_link,
        tool=tool,
        torque_max=arm.limits.torque_nm,
        speed_max=arm.limits.speed_rad_s,
        position_limits=arm.limits.position_rad,
        acceleration_max=arm.limits.acceleration_rad_s2,
        damping=arm.friction.viscous_nm_s_rad,
        coulomb=arm.friction.coulomb_nm,
        unphysical_inertia="refuse" if sheet is None else sheet.unphysical_inertia,
        ignored_pairs=arm.ignored_pairs,
    )


def _build_segment(start: Floats, config: SegmentConfig) -> Line | Arc:
    geometry = config.geometry
    if isinstance(geometry, LineConfig):
        return Line(start, np.array(geometry.to_m))
    assert isinstance(geometry, ArcConfig)
    if geometry.via_m is not None:
        return Arc.through(start, np.array(geometry.via_m), np.array(geometry.to_m))
    assert geometry.center_m is not None  # by the schema
    normal = None if geometry.turn is None else np.array(geometry.normal) * (1.0 if geometry.turn == "ccw" else -1.0)
    return Arc(start, np.array(geometry.to_m), np.array(geometry.center_m), normal)


def _build_path(arm: Arm, cell: CellConfig, config: ArmConfig) -> JointPath:
    given = config.path
    if given.waypoints_rad is not None:
        return JointPath.through(given.waypoints_rad, arm=arm)
    if given.waypoints_file is not None:
        return JointPath.from_file(resolve_file(cell, given.waypoints_file), arm=arm)
    if config.elbow is None and given.start_rad is None:
        raise ConfigError(
            f"{cell.source}: path.start_rad: arm {arm.name!r} reaches the points of its path in several postures, and "
            "none is chosen",
            remedy="give path.start_rad: joint positions at start_m; or elbow, of a two-link arm or a SCARA",
            file=str(cell.source),
            key="path.start_rad",
            value=None,
        )
    segments = _build_segments(config)
    cartesian: CartesianPath | BlendedPath
    if given.blend is None:
        cartesian = CartesianPath(segments)
    else:
        blend = given.blend
        cartesian = BlendedPath(
            segments,
            blend.remaining_distance_m,
            shape_factor=blend.shape_factor,
            tolerance=blend.tolerance_m,
            curve=blend.curve,
        )
    return JointPath.along(cartesian, arm, elbow=config.elbow, start=given.start_rad)


def _build_segments(config: ArmConfig) -> list[Line | Arc]:
    segments: list[Line | Arc] = []
    start = np.array(config.path.start_m)
    for k, segment in enumerate(config.path.segments):
        try:
            segments.append(_build_segment(start, segment))
        except ArmtempoError as error:
            raise error.at(f"segments[{k}]") from error
        start = segments[-1].end
    return segments


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
    return static_shape(obstacle.kind, size, T_world=pose_matrix(obstacle.pose), name=obstacle.name, file=file)

"""From what a cell file says of an arm: the arm, its segments, its joint path, the bodies round it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

from armtempo.arrays import Floats
from armtempo.configs import (
    ArcConfig,
    ArmConfig,
    CellConfig,
    CellFileConfig,
    LineConfig,
    MountedArmConfig,
    ObstacleConfig,
    SegmentConfig,
    resolve_file,
    robot_config,
)
from armtempo.errors import ArmtempoError, ConfigError
from armtempo.planners.blends import BlendedPath
from armtempo.planners.geometry import Arc, CartesianPath, Line, pose_matrix
from armtempo.planners.joint_paths import AbstractJointPath, JointPath
from armtempo.planners.topp import SpeedCap
from armtempo.robots import Arm, Shape, Tool, static_shape


@contextmanager
def located(place: str) -> Iterator[None]:
    """Errors from inside say ``place`` in the cell's file; those of the file itself say it already."""
    try:
        yield
    except ConfigError:
        raise
    except ArmtempoError as error:
        raise error.at(place) from error


def arm_from(config: CellFileConfig, arm: MountedArmConfig) -> Arm:
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
        jerk_max=arm.limits.jerk_rad_s3,
        damping=arm.friction.viscous_nm_s_rad,
        coulomb=arm.friction.coulomb_nm,
        substitute_mass=arm.substitute_mass_kg,
        unphysical_inertia="refuse" if sheet is None else sheet.unphysical_inertia,
        ignored_pairs=arm.ignored_pairs,
        locked=arm.locked,
        srdf=None if arm.srdf is None else resolve_file(config, arm.srdf),
        group=arm.group,
        joint_limits=None if arm.joint_limits is None else resolve_file(config, arm.joint_limits),
    )


def _segment_from(start: Floats, config: SegmentConfig) -> Line | Arc:
    geometry = config.geometry
    if isinstance(geometry, LineConfig):
        return Line(start, np.array(geometry.to_m))
    assert isinstance(geometry, ArcConfig)
    if geometry.via_m is not None:
        return Arc.through(start, np.array(geometry.via_m), np.array(geometry.to_m))
    assert geometry.center_m is not None  # by the schema
    normal = None if geometry.turn is None else np.array(geometry.normal) * (1.0 if geometry.turn == "ccw" else -1.0)
    return Arc(start, np.array(geometry.to_m), np.array(geometry.center_m), normal)


def path_from(arm: Arm, cell: CellConfig, config: ArmConfig) -> tuple[AbstractJointPath, SpeedCap | None]:
    """The arm's path, and how fast its tip may go along it [m/s]."""
    given, limit = config.path, config.limits.tool_speed_m_s
    if given.waypoints_rad is not None:
        return JointPath.through(given.waypoints_rad, arm=arm), limit
    if given.waypoints_file is not None:
        return JointPath.from_file(resolve_file(cell, given.waypoints_file), arm=arm), limit
    if config.elbow is None and given.start_rad is None:
        raise ConfigError(
            f"{cell.source}: path.start_rad: arm {arm.name!r} reaches the points of its path in several postures, and "
            "none is chosen",
            remedy="give path.start_rad: joint positions at start_m; or elbow, of a two-link arm or a SCARA",
            file=str(cell.source),
            key="path.start_rad",
            value=None,
        )
    segments = segments_from(config)
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
    joints = JointPath.along(cartesian, arm, elbow=config.elbow, start=given.start_rad)
    return joints, _tool_speed(cartesian, config)


def _tool_speed(path: CartesianPath | BlendedPath, config: ArmConfig) -> SpeedCap | None:
    """How fast the tip may go along a path of segments with limits of their own; blends have both neighbours'."""
    limit, own = config.limits.tool_speed_m_s, [segment.tool_speed_m_s for segment in config.path.segments]
    if not any(own):
        return limit
    caps = np.array([min(one or np.inf, limit or np.inf) for one in own])
    if isinstance(path, BlendedPath):
        caps = caps[path.segments_of_pieces].min(axis=1)
    inner = path.breakpoints[1:-1]
    return lambda lam: caps[np.searchsorted(inner, lam, side="right")]


def segments_from(config: ArmConfig) -> list[Line | Arc]:
    segments: list[Line | Arc] = []
    start = np.array(config.path.start_m)
    for k, segment in enumerate(config.path.segments):
        with located(f"segments[{k}]"):
            segments.append(_segment_from(start, segment))
        start = segments[-1].end
    return segments


def obstacle_from(config: CellFileConfig, obstacle: ObstacleConfig) -> Shape:
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

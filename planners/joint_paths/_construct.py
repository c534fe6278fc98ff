"""Joint paths made from what a user has: waypoints, a file of them, a Cartesian path."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Literal

from numpy.typing import ArrayLike

from armtempo.errors import InputError
from armtempo.planners.blends import BlendedPath
from armtempo.planners.geometry import Arc, CartesianPath, Line, read_waypoints
from armtempo.planners.joint_paths._cartesian_joint_path import CartesianJointPath
from armtempo.planners.joint_paths._fitted_path import FittedPath
from armtempo.planners.joint_paths._joint_path import AbstractJointPath
from armtempo.planners.joint_paths._planar_pair import Elbow
from armtempo.planners.joint_paths._pose_path import PosePath, TipSegments
from armtempo.planners.joint_paths._scara_path import ScaraPath
from armtempo.planners.joint_paths._sequence_path import Dwell, SequencePath
from armtempo.planners.joint_paths._two_link_path import TwoLinkPath
from armtempo.planners.joint_paths._waypoint_path import WaypointPath
from armtempo.robots import Arm


class JointPath(AbstractJointPath):
    """A path of an arm in joint space; ``through``, ``from_file``, ``fit``, ``along`` and ``sequence`` make one.

    A path of your own is a subclass with ``length``, ``dof``, ``breakpoints``, ``evaluate`` and ``speed_bound``.
    """

    @staticmethod
    def through(
        waypoints: ArrayLike,
        *,
        arm: Arm | None = None,
        ends: Literal["natural", "not-a-knot"] = "natural",
        spacing: Literal["chord", "centripetal"] = "chord",
    ) -> WaypointPath:
        """A smooth path through joint positions (K, n) [rad or m]: C2 cubics over the chord length in joint space.

        Args:
            waypoints: In order; the first and the last are the path's ends.
            arm: Whose path it is: its number of joints, and its position limits all along the spline, are checked.
            ends: ``natural`` (no curvature at the ends) or ``not-a-knot``.
            spacing: How lambda grows between waypoints: ``chord`` or ``centripetal`` (gentler in sharp corners).

        Raises:
            InputError: Wrong shape, NaN, or fewer than 2 waypoints.
            PathError: A repeated waypoint, or a position beyond the arm's limits; ``data`` says where and which joint.
        """
        return WaypointPath(waypoints, arm=arm, ends=ends, spacing=spacing)

    @staticmethod
    def from_file(
        file: str | Path,
        *,
        arm: Arm | None = None,
        ends: Literal["natural", "not-a-knot"] = "natural",
        spacing: Literal["chord", "centripetal"] = "chord",
    ) -> WaypointPath:
        """``through`` the waypoints of a CSV or JSON file.

        CSV: one waypoint per line; a first line of names is optional. JSON: ``[[...], ...]`` or
        ``{"joints": [...], "waypoints_rad": [[...], ...]}``. Where joints are named and ``arm`` is given, columns are
        matched by name, in any order, and others are left out.

        Raises:
            InputError: The file cannot be read; the message names file and line. And as ``through``.
            PathError: As ``through``.
        """
        waypoints = read_waypoints(Path(file), None if arm is None else arm.joint_names)
        return JointPath.through(waypoints, arm=arm, ends=ends, spacing=spacing)

    @staticmethod
    def fit(points: ArrayLike, tolerance: float, *, arm: Arm | None = None) -> FittedPath:
        """A smooth path near thousands of recorded joint positions (N, n) [rad or m]: few quintics that join C4.

        It starts at the first point and ends at the last; between, it leaves the chords of the points by at most
        ``tolerance`` (the length of the difference in joint space), certified between the points, too. Give more than
        the noise: what is noise beyond the tolerance is followed.

        Raises:
            InputError: Wrong shape, NaN, fewer than 2 points, a tolerance that is not positive.
            PathError: All points are the same; a position beyond the arm's limits; ``data`` says where and which joint.
        """
        return FittedPath(points, tolerance, arm=arm)

    @staticmethod
    def along(
        cartesian: TipSegments | PosePath,
        arm: Arm,
        *,
        elbow: Elbow | None = None,
        start: ArrayLike | None = None,
    ) -> TwoLinkPath | ScaraPath | CartesianJointPath:
        """The joints of an arm whose tip follows a Cartesian path; give ``elbow`` or ``start``, whichever fits the arm.

        Args:
            cartesian: A line, an arc, a chain of them, or a path with blended corners; with ``start`` any ``PosePath``.
            arm: Any serial arm.
            elbow: ``positive`` or ``negative``, of two-link arms and SCARAs: their closed form.
            start: (n,) joint positions at the path's start [rad or m], of any arm: see ``CartesianJointPath``.

        Raises:
            InputError: Both of the two, or none; no path; a wrong shape.
            UnknownNameError: No such elbow.
            PathError: The arm cannot follow: out of its reach, near a singularity, beyond a joint's limit; the message
                names the station.
        """
        if (elbow is None) == (start is None):
            raise InputError(
                f"a path of arm {arm.name!r} needs its elbow or its start posture, one of the two",
                remedy="give elbow (two-link arms and SCARAs), or start: joint positions at the start of the path",
            )
        if elbow is None:
            assert start is not None
            return CartesianJointPath(arm, cartesian, start)
        if isinstance(cartesian, Line | Arc):
            cartesian = CartesianPath([cartesian])
        if not isinstance(cartesian, CartesianPath | BlendedPath):
            raise InputError(
                f"closed forms are for lines, arcs and blended paths, not for a {type(cartesian).__name__}",
                remedy="give start instead of elbow",
            )
        return TwoLinkPath(arm, cartesian, elbow) if arm.dof == 2 else ScaraPath(arm, cartesian, elbow)

    @staticmethod
    def sequence(steps: Sequence[AbstractJointPath | Dwell | float]) -> SequencePath:
        """Moves and dwells one after the other: ``JointPath.sequence([there, 0.15, back])`` stands for 0.15 s between.

        The arm comes to rest wherever two steps meet, so the path may have a corner there. Lambda is the share of the
        path, from 0 to 1.

        Args:
            steps: Joint paths, each beginning where the one before it ends, and between them (or at an end) dwells: a
                number [s] or ``Dwell``, which last exactly so long, or ``Wait``, which may be stretched.

        Raises:
            InputError: There is no move, or something else among the steps, or a dwell is not > 0.
            PathError: A move does not begin where the one before it ends; the message names the step.
        """
        return SequencePath(steps)

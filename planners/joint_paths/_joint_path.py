r"""Joint paths ``q = f(lambda)`` (Lee1991 eq. 2): what the phase plane and the charts need of a path.

``lambda`` runs over ``[0, length]``: the travelled length [m] of Cartesian paths, the length of the chords in joint
space [rad] of paths through waypoints. The derivatives
``f' = dq/dlambda`` and ``f'' = d2q/dlambda2`` are exact, not differences (Lee1991 eqs. 3-4):

    qd = f' mu,    qdd = f'' mu^2 + f' mu_dot,    mu = dlambda/dt
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from pathlib import Path
from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from armtempo.arrays import Floats
from armtempo.errors import InputError
from armtempo.robots import Arm, njit

if TYPE_CHECKING:  # they are joint paths themselves
    from armtempo.planners.joint_paths._cartesian_joint_path import CartesianJointPath
    from armtempo.planners.joint_paths._planar_pair import Elbow
    from armtempo.planners.joint_paths._pose_path import PosePath, TipSegments
    from armtempo.planners.joint_paths._scara_path import ScaraPath
    from armtempo.planners.joint_paths._two_link_path import TwoLinkPath


class PathTable(NamedTuple):
    """A joint path sampled for inner loops: quintic Hermite pieces through exact values and derivatives.

    ``station`` (K+1,) rising, may repeat where ``f''`` jumps; ``q``, ``dq``, ``ddq`` (K+1, n), the values *after* the
    station; ``ddq_before`` (K+1, n), those before it. With K = 2048 the pieces reproduce smooth paths to 1e-12 rad.
    """

    station: Floats
    q: Floats
    dq: Floats
    ddq: Floats
    ddq_before: Floats


class JointPath(ABC):
    """A path of an arm in joint space.

    Attributes:
        length: ``lambda_max``.
        dof: Number of joints n.
        breakpoints: Rising stations, first 0 and last ``length``, between which the path is smooth.
        unit: Of ``lambda``: ``m`` or ``rad``.
    """

    unit: str = "m"
    length: float
    dof: int
    breakpoints: Floats

    @abstractmethod
    def evaluate(self, lam: ArrayLike, *, before: bool = False) -> tuple[Floats, Floats, Floats]:
        """``f``, ``f'``, ``f''`` at ``lam``, each (..., n); ``before``: a breakpoint belongs to the piece before it."""

    @abstractmethod
    def speed_bound(self, low: ArrayLike, high: ArrayLike) -> Floats:
        """Upper bounds of ``|f'|`` over intervals [low, high], (..., n), not from samples: charts certify with them."""

    @staticmethod
    def through(
        waypoints: ArrayLike,
        *,
        arm: Arm | None = None,
        ends: Literal["natural", "not-a-knot"] = "natural",
        spacing: Literal["chord", "centripetal"] = "chord",
    ) -> JointPath:
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
        from armtempo.planners.joint_paths._waypoint_path import WaypointPath

        return WaypointPath(waypoints, arm=arm, ends=ends, spacing=spacing)

    @staticmethod
    def from_file(
        file: str | Path,
        *,
        arm: Arm | None = None,
        ends: Literal["natural", "not-a-knot"] = "natural",
        spacing: Literal["chord", "centripetal"] = "chord",
    ) -> JointPath:
        """``through`` the waypoints of a CSV or JSON file.

        CSV: one waypoint per line; a first line of names is optional. JSON: ``[[...], ...]`` or
        ``{"joints": [...], "waypoints_rad": [[...], ...]}``. Where joints are named and ``arm`` is given, columns are
        matched by name, in any order, and others are left out.

        Raises:
            InputError: The file cannot be read; the message names file and line. And as ``through``.
            PathError: As ``through``.
        """
        from armtempo.planners.geometry._waypoint_file import read_waypoints

        waypoints = read_waypoints(Path(file), None if arm is None else arm.joint_names)
        return JointPath.through(waypoints, arm=arm, ends=ends, spacing=spacing)

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
            from armtempo.planners.joint_paths._cartesian_joint_path import CartesianJointPath

            assert start is not None
            return CartesianJointPath(arm, cartesian, start)
        from armtempo.planners.blends._blended_path import BlendedPath
        from armtempo.planners.geometry._cartesian_path import Arc, CartesianPath, Line
        from armtempo.planners.joint_paths._scara_path import ScaraPath
        from armtempo.planners.joint_paths._two_link_path import TwoLinkPath

        if isinstance(cartesian, Line | Arc):
            cartesian = CartesianPath([cartesian])
        if not isinstance(cartesian, CartesianPath | BlendedPath):
            raise InputError(
                f"closed forms are for lines, arcs and blended paths, not for a {type(cartesian).__name__}",
                remedy="give start instead of elbow",
            )
        return TwoLinkPath(arm, cartesian, elbow) if arm.dof == 2 else ScaraPath(arm, cartesian, elbow)

    def table(self, pieces: int = 2048) -> PathTable:
        """Samples for numba kernels; breakpoints are stations."""
        station = np.union1d(np.linspace(0.0, self.length, pieces + 1), self.breakpoints)
        q, dq, ddq = self.evaluate(station)
        return PathTable(station, q, dq, ddq, self.evaluate(station, before=True)[2])


@njit
def path_point(table: PathTable, lam: float, q: Floats) -> None:
    """Write ``f(lam)`` to ``q`` (n,)."""
    station = table.station
    last = station.shape[0] - 2
    low = min(max(int(lam / station[last + 1] * (last + 1)), 0), last)
    while low > 0 and lam < station[low]:
        low -= 1
    while low < last and lam >= station[low + 1]:
        low += 1
    h = station[low + 1] - station[low]
    w = min(max((lam - station[low]) / h, 0.0), 1.0)
    w3 = w * w * w
    to_end = w3 * (10.0 - 15.0 * w + 6.0 * w * w)
    d_start = w - w3 * (6.0 - 8.0 * w + 3.0 * w * w)
    d_end = w3 * (-4.0 + 7.0 * w - 3.0 * w * w)
    c_start = 0.5 * w * w - w3 * (1.5 - 1.5 * w + 0.5 * w * w)
    c_end = w3 * (0.5 - w + 0.5 * w * w)
    for j in range(q.shape[0]):
        q[j] = (
            table.q[low, j]
            + to_end * (table.q[low + 1, j] - table.q[low, j])
            + h * (d_start * table.dq[low, j] + d_end * table.dq[low + 1, j])
            + h * h * (c_start * table.ddq[low, j] + c_end * table.ddq_before[low + 1, j])
        )

"""The closed-form joint path of a two-link arm along a Cartesian path; the algebra is that of ``_planar_pair``."""

from __future__ import annotations

from typing import final

import numpy as np
from numpy.typing import ArrayLike

from armtempo.arrays import Floats
from armtempo.errors import PathError
from armtempo.planners.joint_paths._joint_path import AbstractJointPath
from armtempo.planners.joint_paths._planar_pair import Elbow, PlanarPair, TipPath, check_position_limits
from armtempo.robots import Arm


@final
class TwoLinkPath(AbstractJointPath):
    """The joint path of a planar two-joint arm whose tip follows a Cartesian path.

    Args:
        arm: Two revolute joints with parallel axes.
        cartesian: Where the tip goes, in world coordinates [m]: in the plane in which the tip moves.
        elbow: The sign of the elbow's angle, about its own axis, away from the stretched arm.

    Attributes:
        station: (K,) samples between which no joint turns far [m].
        pair: The algebra of the two links.

    Raises:
        PathError: The arm is no two-link arm; the path leaves its plane or its reach, passes near a singularity, or
            breaks a joint's position limit. The message names the station.
    """

    def __init__(self, arm: Arm, cartesian: TipPath, elbow: Elbow) -> None:
        if arm.dof != 2 or bool(np.any(arm.model.prismatic)):
            raise PathError(
                f"arm {arm.name!r} has {arm.dof} joints: lines and arcs are followed by two-link arms only",
                remedy="use an arm with two revolute joints",
            )
        self.arm = arm
        self.cartesian = cartesian
        self.elbow = elbow
        self.length = cartesian.length
        self.dof = 2
        self.breakpoints = cartesian.breakpoints
        self.pair = PlanarPair(arm, cartesian, elbow)
        self._check_plane()
        self.pair.settle()
        self.station = self.pair.station
        check_position_limits(arm, self, self.pair.station)

    def _check_plane(self) -> None:
        pair = self.pair
        off = np.abs(self.cartesian.evaluate(pair.station)[0] @ pair.axis - pair.height)
        if off.max() > 1e-6:
            k = int(off.argmax())
            name, station = self.arm.name, float(pair.station[k])
            raise PathError(
                f"path of arm {name!r} leaves the plane in which its tip moves by {off[k]:.4g} m at {station:.4g} m",
                remedy=f"keep its points at height {pair.height:.6g} m along the joint axes",
                arm=name,
                station=station,
            )

    def evaluate(self, lam: ArrayLike, *, before: bool = False) -> tuple[Floats, Floats, Floats]:
        """Joint angles [rad] and their first and second derivatives by length [rad/m, rad/m^2], each (..., 2)."""
        lam = np.clip(np.asarray(lam, dtype=np.float64), 0.0, self.length)
        return self.pair.evaluate(lam, before=before)

    def inverse(self, position: Floats, lam: ArrayLike) -> Floats:
        """Joint angles (..., 2) [rad] with the tip at ``position`` (..., 3) [m], which is near station ``lam``."""
        return self.pair.inverse(position, lam)

    def speed_bound(self, low: ArrayLike, high: ArrayLike) -> Floats:
        """Upper bounds of ``|f'|`` over the intervals [low, high], (..., 2) [rad/m]."""
        return self.pair.speed_bound(low, high)

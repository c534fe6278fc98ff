r"""The closed-form joint path of a SCARA along a Cartesian path.

Shoulder and elbow as ``_planar_pair`` has them; the slide follows the height, the wrist keeps (or turns) the tool:

    q_z = p . axis - height        q_w = yaw(s) - q_1 - q_2

each with its two derivatives by length, up to the signs of the axes.
"""

from __future__ import annotations

from typing import final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armtempo.errors import PathError
from armtempo.planners._joint_path import JointPath
from armtempo.planners._planar_pair import Elbow, PlanarPair, TipPath, check_position_limits, whole_turns
from armtempo.robots import Arm

Array = NDArray[np.float64]


@final
class ScaraPath(JointPath):
    """The joint path of a SCARA whose tip follows a Cartesian path.

    The tool keeps the orientation in which it starts, with the wrist at zero there.

    Args:
        arm: Four joints with parallel axes: two that turn, then a slide and a wrist in either order. Its tip lies on
            the axis of the wrist.
        cartesian: Where the tip goes, in world coordinates [m].
        elbow: The sign of the elbow's angle, about its own axis, away from the stretched arm.

    Raises:
        PathError: The arm is no SCARA; the path leaves its reach, passes near a singularity, or breaks a joint's
            position limit. The message names the station.
    """

    def __init__(self, arm: Arm, cartesian: TipPath, elbow: Elbow) -> None:
        self.arm = arm
        self.cartesian = cartesian
        self.elbow = elbow
        self.length = cartesian.length
        self.dof = 4
        self.breakpoints = cartesian.breakpoints
        self._measure()
        self._pair = PlanarPair(arm, cartesian, elbow)
        self._pair.settle()
        self._yaw = 0.0
        start = self.evaluate(0.0)[0]
        self._yaw = -float(start[self._wrist])
        q = self.evaluate(self._pair.station)[0]
        self._yaw += whole_turns(arm, self._wrist, q[:, self._wrist])
        check_position_limits(arm, self._pair.station, self.evaluate(self._pair.station)[0])

    def _measure(self) -> None:
        """Find slide and wrist and the senses of all axes at ``q = 0``."""
        arm = self.arm
        slides = np.flatnonzero(arm.model.prismatic)
        if arm.dof != 4 or len(slides) != 1 or slides[0] < 2:
            kinds = ", ".join("slide" if p else "turn" for p in arm.model.prismatic)
            raise PathError(
                f"arm {arm.name!r} is no SCARA: its joints are {kinds}",
                remedy="use an arm with two joints that turn, then a slide and a wrist",
                arm=arm.name,
            )
        self._slide, self._wrist = int(slides[0]), 5 - int(slides[0])
        zero = np.zeros(4)
        poses = arm.link_poses(zero)
        axes = np.einsum("jab,jb->ja", poses[:, :3, :3], arm.model.axis)
        sense = axes @ axes[0]
        if np.abs(np.abs(sense) - 1.0).max() > 1e-9:
            joint = arm.joint_names[int(np.abs(sense).argmin())]
            raise PathError(
                f"arm {arm.name!r} is no SCARA: the axis of joint {joint!r} is not parallel to the first",
                remedy="use an arm whose four axes are parallel",
                arm=arm.name,
            )
        self._sense = np.sign(sense)
        offset = arm.tip_pose(zero)[:3, 3] - poses[self._wrist, :3, 3]
        off = float(np.linalg.norm(offset - axes[0] * (axes[0] @ offset)))
        if off > 1e-9:
            raise PathError(
                f"the tip of arm {arm.name!r} is {off:.4g} m off the axis of its wrist",
                remedy="give a tool whose working point lies on that axis",
                arm=arm.name,
            )

    def evaluate(self, lam: ArrayLike, *, before: bool = False) -> tuple[Array, Array, Array]:
        """Joint positions [rad, m] and their first and second derivatives by length [m], each (..., 4)."""
        lam = np.clip(np.asarray(lam, dtype=np.float64), 0.0, self.length)
        planar = self._pair.evaluate(lam, before=before)
        spatial = self.cartesian.evaluate(lam, before=before)
        out = []
        for order, (pair, point) in enumerate(zip(planar, spatial, strict=True)):
            column = np.empty((*lam.shape, 4))
            column[..., :2] = pair
            height = point @ self._pair.axis - (self._pair.height if order == 0 else 0.0)
            column[..., self._slide] = self._sense[self._slide] * height
            turned = pair @ self._sense[:2]
            column[..., self._wrist] = -self._sense[self._wrist] * turned + (self._yaw if order == 0 else 0.0)
            out.append(column)
        return out[0], out[1], out[2]

    def speed_bound(self, low: ArrayLike, high: ArrayLike) -> Array:
        """Upper bounds of ``|f'|`` over the intervals [low, high], (..., 4) [rad/m, 1].

        The slide is never faster than the tip, the wrist never faster than both joints that it makes up for.
        """
        pair = self._pair.speed_bound(low, high)
        bound = np.empty((*pair.shape[:-1], 4))
        bound[..., :2] = pair
        bound[..., self._slide] = 1.0
        bound[..., self._wrist] = pair.sum(axis=-1)
        return bound

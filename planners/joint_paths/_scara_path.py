r"""The closed-form joint path of a SCARA along a Cartesian path.

Shoulder and elbow as ``_planar_pair`` has them; the slide follows the height, the wrist keeps (or turns) the tool:

    q_z = p . axis - height        q_w = yaw(s) - q_1 - q_2

each with its two derivatives by length, up to the signs of the axes.
"""

from __future__ import annotations

from typing import final

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from armtempo.arrays import Floats
from armtempo.errors import PathError
from armtempo.planners.blends import BlendedPath
from armtempo.planners.joint_paths._joint_path import AbstractJointPath
from armtempo.planners.joint_paths._planar_pair import Elbow, PlanarPair, TipPath, check_position_limits, whole_turns
from armtempo.robots import Arm


@final
class ScaraPath(AbstractJointPath):
    """The joint path of a SCARA whose tip follows a Cartesian path.

    The wrist is at zero at the start (or whole turns from it, where its range asks for that), and the tool keeps that
    orientation. Along a ``BlendedPath`` with two orientations it turns by their difference, in proportion to length.

    Args:
        arm: Four joints with parallel axes: two that turn, then a slide and a wrist in either order. Its tip lies on
            the axis of the wrist.
        cartesian: Where the tip goes, in world coordinates [m].
        elbow: The sign of the elbow's angle, about its own axis, away from the stretched arm.

    Attributes:
        station: (K,) samples between which no joint turns far [m].
        pair: The algebra of shoulder and elbow.

    Raises:
        PathError: The arm is no SCARA; the path leaves its reach, passes near a singularity, turns the tool about
            another axis than the wrist's, or breaks a joint's position limit. The message names the station.
    """

    def __init__(self, arm: Arm, cartesian: TipPath, elbow: Elbow) -> None:
        self.arm = arm
        self.cartesian = cartesian
        self.elbow = elbow
        self.length = cartesian.length
        self.dof = 4
        self.breakpoints = cartesian.breakpoints
        self._measure()
        self.pair = PlanarPair(arm, cartesian, elbow)
        self.pair.settle()
        self.station = self.pair.station
        self._yaw, self._yaw_rate = 0.0, self._turning()
        wrist = self.evaluate(self.pair.station)[0][:, self._wrist]
        turns = whole_turns(arm, self._wrist, wrist - wrist[0])
        self._yaw = float(self._sense[self._wrist]) * (turns - float(wrist[0]))
        check_position_limits(arm, self, self.pair.station)

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

    def _turning(self) -> float:
        """How fast the tool turns about the first axis along the path [rad/m]."""
        if not isinstance(self.cartesian, BlendedPath):
            return 0.0
        first, last = Rotation.from_quat(self.cartesian.orientation(np.array([0.0, self.length])))
        turn = (last * first.inv()).as_rotvec()
        angle = float(turn @ self.pair.axis)
        if float(np.linalg.norm(turn - angle * self.pair.axis)) > 1e-9:
            raise PathError(
                f"path of arm {self.arm.name!r} turns the tool about {np.round(turn, 6).tolist()}, and its wrist turns "
                f"it about {np.round(self.pair.axis, 6).tolist()} only",
                remedy="give orientations that differ by a turn about that axis",
                arm=self.arm.name,
            )
        return angle / self.length

    def inverse(self, position: Floats, lam: ArrayLike) -> Floats:
        """Joint positions (..., 4) [rad, m] with the tip at ``position`` (..., 3) [m], near station ``lam``."""
        pair = self.pair.inverse(position, lam)
        return self._joints(
            pair, position @ self.pair.axis - self.pair.height, self._yaw + self._yaw_rate * np.asarray(lam)
        )

    def _joints(self, pair: Floats, height: Floats, yaw: ArrayLike) -> Floats:
        """All four joints from the first two, the height and the yaw of the tool; or the rates of all."""
        q = np.empty((*pair.shape[:-1], 4))
        q[..., :2] = pair
        q[..., self._slide] = self._sense[self._slide] * height
        q[..., self._wrist] = self._sense[self._wrist] * (yaw - pair @ self._sense[:2])
        return q

    def evaluate(self, lam: ArrayLike, *, before: bool = False) -> tuple[Floats, Floats, Floats]:
        """Joint positions [rad, m] and their first and second derivatives by length [m], each (..., 4)."""
        lam = np.clip(np.asarray(lam, dtype=np.float64), 0.0, self.length)
        q, dq, ddq = self.pair.evaluate(lam, before=before)
        p, dp, ddp = (point @ self.pair.axis for point in self.cartesian.evaluate(lam, before=before))
        return (
            self._joints(q, p - self.pair.height, self._yaw + self._yaw_rate * lam),
            self._joints(dq, dp, self._yaw_rate),
            self._joints(ddq, ddp, 0.0),
        )

    def speed_bound(self, low: ArrayLike, high: ArrayLike) -> Floats:
        """Upper bounds of ``|f'|`` over the intervals [low, high], (..., 4) [rad/m, 1].

        The slide is never faster than the tip, the wrist than the tool and both joints that it makes up for.
        """
        pair = self.pair.speed_bound(low, high)
        bound = np.empty((*pair.shape[:-1], 4))
        bound[..., :2] = pair
        bound[..., self._slide] = 1.0
        bound[..., self._wrist] = pair.sum(axis=-1) + abs(self._yaw_rate)
        return bound

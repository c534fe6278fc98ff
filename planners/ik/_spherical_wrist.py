"""Closed-form inverse kinematics of arms like the PUMA 560: shoulder and elbow parallel, the wrist's axes in one point.

The wrist centre fixes the first three joints (its distance along the shoulder's axis the waist, its distance from the
shoulder the elbow), the orientation that is left the last three: D. Pieper, "The kinematics of manipulators under
computer control", 1968; for the PUMA, R. Paul, H. Zhang, IJRR 5(2), 1986. The geometry is read from the arm.
"""

from __future__ import annotations

from typing import final

import numpy as np
from numpy.typing import ArrayLike

from armtempo.arrays import Floats, Ints
from armtempo.errors import InputError, RobotError
from armtempo.planners.geometry import floats
from armtempo.robots import Arm

__all__ = ["SphericalWristIK"]

GEOMETRY_TOLERANCE = 1e-9  # axes that miss each other, or right angles, by less are exact [m, rad]


@final
class SphericalWristIK:
    """All joint positions of a PUMA-like arm for a pose of its tip: 8 branches, in closed form.

    Branch ``4 a + 2 b + c``: a, b, c are 0 or 1 for the waist, the elbow and the wrist, each of which has two answers
    (see ``branch``). Angles are in (-pi, pi]; joint limits are not looked at here (``within_limits``).

    Args:
        arm: Six turning joints. Axis 3 is parallel to axis 2 and not to axis 1; axes 4, 5, 6 meet in one point,
            each at a right angle to the next. Tool and base are whatever the arm has.

    Raises:
        RobotError: The arm has another geometry; the message says where.
    """

    def __init__(self, arm: Arm) -> None:
        self.arm = arm
        if arm.dof != 6 or arm.model.prismatic.any():
            raise _other(arm, f"it has {arm.dof} joints, {int(arm.model.prismatic.sum())} of which slide")
        zero = np.zeros(6)
        poses, tip = arm.link_poses(zero), arm.tip_pose(zero)
        z = np.einsum("jab,jb->ja", poses[:, :3, :3], arm.model.axis)
        p = poses[:, :3, 3]
        if np.linalg.norm(np.cross(z[1], z[2])) > GEOMETRY_TOLERANCE:
            raise _other(arm, "the axes of its second and third joint are not parallel")
        if np.linalg.norm(np.cross(z[0], z[1])) < 1e-3:
            raise _other(arm, "the axes of its first and second joint are parallel")
        if max(abs(z[3] @ z[4]), abs(z[4] @ z[5])) > GEOMETRY_TOLERANCE:
            raise _other(arm, "the axes of its wrist are not at right angles")
        # Where axes 4 and 5 meet; axis 6 has to pass through it.
        along = np.linalg.lstsq(np.stack([z[3], -z[4]], axis=1), p[4] - p[3], rcond=None)[0]
        wrist = p[3] + along[0] * z[3]
        off = [np.linalg.norm(np.cross(wrist - p[j], z[j])) for j in (4, 5)]
        if max(off) > GEOMETRY_TOLERANCE:
            raise _other(arm, f"the axes of its wrist miss each other by {max(off):.3g} m")
        self._z, self._p, self._wrist = z, p, wrist
        self._tip = tip
        self.wrist_in_tip: Floats = tip[:3, :3].T @ (wrist - tip[:3, 3])
        """(3,) [m] the wrist's centre in the frame of the tip."""
        self.wrist_in_tip.setflags(write=False)
        self._upper, self._fore = p[2] - p[1], wrist - p[2]
        self._plane = [v - z[1] * (z[1] @ v) for v in (self._upper, self._fore)]
        self._lengths = [float(np.linalg.norm(v)) for v in self._plane]
        if min(self._lengths) < GEOMETRY_TOLERANCE:
            raise _other(arm, "its upper arm or its forearm has no length")
        self._elbow_zero = _angle(z[1], self._plane[0], self._plane[1])
        self._bend_zero = float(_angle(z[4], z[3], z[5]))

    def solve(self, T_world_tip: ArrayLike) -> Floats:
        """Joint positions (..., 8, 6) [rad] for poses (..., 4, 4) of the tip; NaN in branches that do not reach.

        FK of every answer is the pose to 1e-12 (1 + its distance from the origin). Where the wrist is straight (axes 4
        and 6 in line) joint 4 is free: it is put to zero.

        Raises:
            InputError: Wrong shape, or not finite.
        """
        T = floats(T_world_tip, "poses")
        if T.shape[-2:] != (4, 4) or not np.isfinite(T).all():
            raise InputError(f"poses of shape {T.shape} or not finite", remedy="give (..., 4, 4) finite numbers")
        lead = T.shape[:-2]
        T = T.reshape(-1, 4, 4)
        out = np.empty((len(T), 2, 2, 2, 6))
        target = T[:, :3, 3] + T[:, :3, :3] @ self.wrist_in_tip
        R = T[:, :3, :3] @ self._tip[:3, :3].T  # from zero to the target
        z = self._z
        rounding = 1e-14 * (1.0 + np.linalg.norm(target, axis=1))  # [m] out of reach by less is not
        with np.errstate(invalid="ignore"):
            for a, waist in enumerate(self._waist(target, rounding)):
                forward = _turn(z[0], -waist)
                point = np.einsum("kij,kj->ki", forward, target - self._p[0]) + self._p[0] - self._p[1]
                for b, (shoulder, elbow) in enumerate(self._two_links(point, rounding)):
                    left = _turn(z[1], -(shoulder + elbow)) @ forward @ R
                    for c, wrist in enumerate(self._bends(left)):
                        out[:, a, b, c, 0], out[:, a, b, c, 1], out[:, a, b, c, 2] = waist, shoulder, elbow
                        out[:, a, b, c, 3:] = wrist
            out = np.pi - np.mod(np.pi - out, 2 * np.pi)
        out[~np.isfinite(out).all(axis=-1)] = np.nan
        return out.reshape(*lead, 8, 6)

    def branch(self, q: ArrayLike) -> Ints:
        """The branch (...,) of ``solve`` that joint positions (..., 6) [rad] are on.

        Bits 4, 2, 1: set where the wrist centre lies behind the waist (seen along the upper arm), the elbow's and the
        wrist's angle, counted from the straight arm and the straight wrist, is negative.
        """
        q = np.asarray(q, dtype=np.float64)
        planar = np.einsum("...ij,j->...i", _turn(self._z[1], q[..., 1]), self._upper)
        planar = planar + np.einsum("...ij,j->...i", _turn(self._z[1], q[..., 1] + q[..., 2]), self._fore)
        behind = (planar + self._p[1] - self._p[0]) @ np.cross(self._z[1], self._z[0]) < 0.0
        elbow = np.sin(q[..., 2] + self._elbow_zero) < 0.0
        bend = np.sin(q[..., 4] + self._bend_zero) < 0.0
        return np.asarray(4 * behind + 2 * elbow + 1 * bend, dtype=np.int64)

    def within_limits(self, q: ArrayLike) -> Floats:
        """The same joint positions (..., 6), each turned by whole turns into its range; NaN rows where none is."""
        q = np.array(q, dtype=np.float64)
        low, high = self.arm.position_min, self.arm.position_max
        finite = np.isfinite(low) & np.isfinite(high)
        middle = 0.5 * (np.where(finite, low, 0.0) + np.where(finite, high, 0.0))
        q = q - 2 * np.pi * np.round((q - middle) / (2 * np.pi))
        q[~((q >= low) & (q <= high)).all(axis=-1)] = np.nan
        return q

    def _waist(self, target: Floats, rounding: Floats) -> tuple[Floats, Floats]:
        """Both angles at which the wrist centre is as far along the shoulder's axis as the links put it."""
        z, side = self._z[0], self._z[1]
        x = side - z * (z @ side)
        r = target - self._p[0]
        # cos q (x . r) + sin q ((z x x) . r) = what is left of the distance
        u, v = r @ x, r @ np.cross(z, x)
        distance = side @ (self._wrist - self._p[0]) - (r @ z) * (z @ side)
        away, least = np.hypot(u, v), np.abs(distance)
        left = np.where(away >= least - rounding, np.maximum(away - least, 0.0), np.nan)
        root = np.sqrt(left * (away + least))
        towards = np.arctan2(v, u)
        # In front is where the point lies along side x z, a quarter turn before the axis.
        return towards + np.arctan2(root, distance), towards - np.arctan2(root, distance)

    def _two_links(self, point: Floats, rounding: Floats) -> list[tuple[Floats, Floats]]:
        """Shoulder and elbow angles (elbow positive, negative) for points from the shoulder."""
        axis, (upper, fore), (a, b) = self._z[1], self._plane, self._lengths
        flat = point - np.outer(point @ axis, axis)
        away = np.linalg.norm(flat, axis=1)
        cosine = np.clip((away * away - a * a - b * b) / (2 * a * b), -1.0, 1.0)
        cosine[(away > a + b + rounding) | (away < abs(a - b) - rounding)] = np.nan
        answers = []
        for sign in (1.0, -1.0):
            elbow = sign * np.arccos(cosine) - self._elbow_zero
            reached = upper + np.einsum("kij,j->ki", _turn(axis, elbow), fore)
            answers.append((_angle(axis, reached, flat), elbow))
        return answers

    def _bends(self, left: Floats) -> list[Floats]:
        """The wrist's angles (k, 3) (bend positive, negative) for the turns (k, 3, 3) that are left to it."""
        z4, z5, z6 = self._z[3:]
        tip = left @ z6
        across = np.cross(z4, tip)
        bend = np.arctan2(np.linalg.norm(across, axis=1), tip @ z4)
        answers = []
        for sign in (1.0, -1.0):
            q5 = sign * bend - self._bend_zero
            turned = np.einsum("kij,j->ki", _turn(z5, q5), z6)
            q4 = np.where(np.sin(bend) > 1e-13, _angle(z4, turned, tip), 0.0)
            rest = _turn(z5, -q5) @ _turn(z4, -q4) @ left
            q6 = _angle(z6, np.broadcast_to(z5, tip.shape), rest @ z5)
            answers.append(np.stack([q4, q5, q6], axis=1))
        return answers


def _other(arm: Arm, why: str) -> RobotError:
    return RobotError(
        f"arm {arm.name!r} has no closed form here: {why}",
        remedy="use FeedbackIK, or an arm with parallel shoulder and elbow and a spherical wrist",
        element=arm.name,
    )


def _turn(axis: Floats, angle: ArrayLike) -> Floats:
    """Rotations (..., 3, 3) about a unit axis."""
    angle = np.asarray(angle, dtype=np.float64)[..., None, None]
    cross = np.array([[0.0, -axis[2], axis[1]], [axis[2], 0.0, -axis[0]], [-axis[1], axis[0], 0.0]])
    square = np.outer(axis, axis)
    return np.asarray(np.cos(angle) * (np.eye(3) - square) + np.sin(angle) * cross + square)


def _angle(axis: Floats, start: Floats, end: Floats) -> Floats:
    """The turn about a unit axis that takes the directions ``start`` (..., 3) to ``end``, seen along it."""
    a, b = (v - (v @ axis)[..., None] * axis for v in (start, end))
    return np.asarray(np.arctan2(np.cross(a, b) @ axis, (a * b).sum(axis=-1)))

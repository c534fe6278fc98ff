"""How far the points of an arm get along its path: what certifies whole intervals from one place in each.

A point of a convex body moves no farther than the farthest-moving corner of anything convex that holds it. So for the
capsules that enclose the shapes the two ends of the axis are followed, for hulls eight corners of a box. Samples of
the path are closed by bounds of the joint speeds in between (research/coordination.md 2.1, (c)).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from armtempo.arrays import Floats, Ints, all_finite
from armtempo.errors import PathError
from armtempo.planners.joint_paths import AbstractJointPath
from armtempo.robots import Arm, njit

SAMPLES_PER_INTERVAL = 16  # of the path, per smallest interval


@dataclass(frozen=True, kw_only=True, eq=False)
class ArmSweep:
    """An arm at samples of its path, and its displacement over every one of 1, 2, 4, ... ``finest`` intervals.

    Attributes:
        arm: The arm.
        finest: Number of smallest intervals, a power of two.
        q: (samples + 1, n) joint positions; the centre of every interval is a sample.
        speed: (samples, n) bounds of |f'| from sample to sample.
        step: From sample to sample, in the unit of lambda.
    """

    arm: Arm
    finest: int
    q: Floats
    speed: Floats
    step: float

    @classmethod
    def of(cls, arm: Arm, path: AbstractJointPath, finest: int, part: tuple[float, float] | None = None) -> ArmSweep:
        """Sample the path, or the part of it between two places [lambda].

        Raises:
            PathError: The path, its speed bounds or the arm on it are not finite: they would certify anything.
        """
        path.check_stations()
        begin, end = (0.0, path.length) if part is None else part
        station = np.linspace(begin, end, SAMPLES_PER_INTERVAL * finest + 1)
        q = path.sampled(station, arm.dof)[0]
        speed = path.speed_bound(station[:-1], station[1:])
        if np.shape(speed) != (len(station) - 1, arm.dof) or not all_finite(speed) or (speed < 0.0).any():
            raise PathError(
                f"the speed bounds of a {type(path).__name__} are not (..., {arm.dof}) finite numbers >= 0",
                remedy="give upper bounds of |f'| over intervals, one per joint",
            )
        return cls(arm=arm, finest=finest, q=q, speed=speed, step=(end - begin) / (SAMPLES_PER_INTERVAL * finest))

    @cached_property
    def poses(self) -> Floats:
        """(samples + 1, n, 4, 4) of the links in the world."""
        poses = self.arm.link_poses(self.q)
        if not all_finite(poses):
            raise PathError(f"arm {self.arm.name!r} has no finite place on its path", remedy="its model must be finite")
        return poses

    @cached_property
    def base(self) -> Floats:
        """(4, 4) of the base, writable like ``poses``, so that kernels may take the one for the other."""
        return np.array(self.arm.T_world_base)

    @cached_property
    def axes(self) -> Floats:
        """(2 finest + 1, shapes, 2, 3) world ends of the enclosing capsules' axes at every centre and border."""
        capsules = self.arm.capsules
        out = np.empty((2 * self.finest + 1, len(capsules.link), 2, 3))
        world_axes(self.poses, self.base, capsules.link, np.stack([capsules.p0, capsules.p1], axis=1), out)
        return out

    def _levels(self, points: list[Floats]) -> dict[int, Floats]:
        """{intervals: (intervals, shapes)} the farthest that any of a shape's points gets from its place in the centre.

        Smallest intervals look at all samples; larger ones at the centres of eight parts, and add what those know.
        """
        link = self.arm.capsules.link
        first = np.cumsum([0, *(len(own) for own in points)])
        corners = np.concatenate([np.zeros((0, 3)), *points])
        cells = self.finest
        levels = {cells: np.empty((cells, len(points)))}
        _from_samples(self.poses, link, corners, first, self._slack(points), levels[cells])
        while cells > 1:
            cells //= 2
            parts = min(8 * cells, self.finest)
            levels[cells] = np.empty((cells, len(points)))
            _from_parts(self.poses, link, corners, first, levels[parts], levels[cells])
        return levels

    def _slack(self, points: list[Floats]) -> Floats:
        """(samples, shapes): how far a point may be from where the nearest sample has it."""
        reach = np.array([np.linalg.norm(own, axis=1).max() for own in points])
        q_max = np.abs(self.q).max(axis=0) + 0.5 * self.step * self.speed.max(axis=0)
        slack = 0.5 * self.step * (self.speed @ self.arm.levers(reach, q_max))
        if not all_finite(slack):
            raise PathError(
                f"how far the bodies of arm {self.arm.name!r} move is not finite", remedy="its model must be finite"
            )
        return slack

    @cached_property
    def capsule_moves(self) -> dict[int, Floats]:
        """{intervals: (intervals, shapes)} displacement of the enclosing capsules [m]."""
        return self._levels([np.stack(shape.capsule[:2]) for shape in self.arm.shapes])

    @cached_property
    def shape_moves(self) -> dict[int, Floats]:
        """{intervals: (intervals, shapes)} displacement of the shapes themselves [m]."""
        if self.arm.capsules.exact.all():
            return self.capsule_moves
        return self._levels([shape.points for shape in self.arm.shapes])


def swept_displacements(arm: Arm, path: AbstractJointPath, finest: int) -> dict[int, Floats]:
    """How far, at most, any point of an arm gets from its place at the centre of each of 1, 2, 4, ... intervals."""
    moves = ArmSweep.of(arm, path, finest).shape_moves
    return {cells: own.max(axis=1, initial=0.0) for cells, own in moves.items()}


@njit
def world_axes(poses: Floats, base: Floats, link: Ints, local: Floats, out: Floats) -> None:
    """World ends of the capsules' axes at len(out) of the poses, equally spaced from the first to the last."""
    per = (poses.shape[0] - 1) // (out.shape[0] - 1)
    for m in range(out.shape[0]):
        for k in range(link.shape[0]):
            T = base if link[k] < 0 else poses[m * per, link[k]]
            for end in range(2):
                x, y, z = local[k, end, 0], local[k, end, 1], local[k, end, 2]
                for r in range(3):
                    out[m, k, end, r] = T[r, 0] * x + T[r, 1] * y + T[r, 2] * z + T[r, 3]


@njit
def _farthest(T: Floats, U: Floats, corners: Floats, start: int, stop: int) -> float:
    """How far the farthest-moving of some points gets from pose T to pose U."""
    d00, d01, d02, d03 = U[0, 0] - T[0, 0], U[0, 1] - T[0, 1], U[0, 2] - T[0, 2], U[0, 3] - T[0, 3]
    d10, d11, d12, d13 = U[1, 0] - T[1, 0], U[1, 1] - T[1, 1], U[1, 2] - T[1, 2], U[1, 3] - T[1, 3]
    d20, d21, d22, d23 = U[2, 0] - T[2, 0], U[2, 1] - T[2, 1], U[2, 2] - T[2, 2], U[2, 3] - T[2, 3]
    far2 = 0.0
    for p in range(start, stop):
        x, y, z = corners[p, 0], corners[p, 1], corners[p, 2]
        mx, my, mz = (
            d00 * x + d01 * y + d02 * z + d03,
            d10 * x + d11 * y + d12 * z + d13,
            d20 * x + d21 * y + d22 * z + d23,
        )
        far2 = max(far2, mx * mx + my * my + mz * mz)
    return float(np.sqrt(far2))


@njit
def _from_samples(poses: Floats, link: Ints, corners: Floats, first: Ints, slack: Floats, out: Floats) -> None:
    cells = out.shape[0]
    per = (poses.shape[0] - 1) // cells
    for c in range(cells):
        centre = c * per + per // 2
        for k in range(link.shape[0]):
            far, loose = 0.0, 0.0
            if link[k] >= 0:
                for m in range(c * per, (c + 1) * per + 1):
                    moved = _farthest(poses[centre, link[k]], poses[m, link[k]], corners, first[k], first[k + 1])
                    far = max(far, moved)
                for m in range(c * per, (c + 1) * per):
                    loose = max(loose, slack[m, k])
            out[c, k] = far + loose


@njit
def _from_parts(poses: Floats, link: Ints, corners: Floats, first: Ints, parts: Floats, out: Floats) -> None:
    cells = out.shape[0]
    many = parts.shape[0] // cells
    per = (poses.shape[0] - 1) // parts.shape[0]
    for c in range(cells):
        centre = c * many * per + many * per // 2
        for k in range(link.shape[0]):
            far = 0.0
            if link[k] >= 0:
                for m in range(c * many, (c + 1) * many):
                    there = m * per + per // 2
                    moved = _farthest(poses[centre, link[k]], poses[there, link[k]], corners, first[k], first[k + 1])
                    far = max(far, moved + parts[m, k])
            out[c, k] = far

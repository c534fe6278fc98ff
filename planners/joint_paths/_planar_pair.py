r"""Two links that turn about parallel axes, in closed form: what two-link arms and SCARAs have in common.

With link lengths ``l1``, ``l2`` and the tip at distance ``r`` from the first axis (law of cosines):

    cos(theta2) = (r^2 - l1^2 - l2^2) / (2 l1 l2)        theta2 > 0 or < 0: the elbow branch
    theta1 = atan2(y, x) - atan2(l2 sin(theta2), l1 + l2 cos(theta2))
    theta'  = J^-1 p'          theta'' = J^-1 (p'' - J' theta')

with ``p`` the tip in the plane of motion and ``J`` its Jacobian. The axes may stand anywhere in space.
"""

from __future__ import annotations

from typing import Literal, Protocol, final, get_args

import numpy as np
from numpy.typing import ArrayLike

from armtempo.arrays import Bools, Floats
from armtempo.errors import PathError, UnknownNameError
from armtempo.planners.joint_paths._joint_path import AbstractJointPath
from armtempo.robots import Arm

Elbow = Literal["positive", "negative"]
ELBOWS: tuple[Elbow, ...] = get_args(Elbow)

SINGULAR_SINE = (
    0.01  # |sin theta2| below which joint speeds exceed 100 x what the same tip speed needs at a right angle
)
PATH_SAMPLES = 2049  # of a path, and
PER_PIECE = 17  # of each of its pieces
LIMIT_HALVINGS = 6  # of an interval in which a limit may be broken, before its middle is believed


class TipPath(Protocol):
    """Where a tip goes, by arc length: a ``CartesianPath`` or a ``BlendedPath``."""

    @property
    def length(self) -> float:
        """Arc length [m]."""
        ...

    @property
    def breakpoints(self) -> Floats:
        """Rising stations between which the path is smooth [m]."""
        ...

    def evaluate(self, s: ArrayLike, *, before: bool = False) -> tuple[Floats, Floats, Floats]:
        """Position, tangent and curvature vector at arc length ``s``: each (..., 3), [m], [1], [1/m]."""
        ...


@final
class PlanarPair:
    """The first two joints of an arm along the path of its tip.

    Args:
        arm: Its first two joints turn about parallel axes; whatever follows moves the tip along these axes only.
        path: Where the tip goes, in world coordinates [m].
        elbow: The sign of the elbow's angle, about its own axis, away from the stretched arm.

    Attributes:
        axis: (3,) the direction of the first axis in the world.
        side: 1, or -1 if the second axis points the other way.
        height: Of the tip along ``axis`` at q = 0 [m].
        station: (K,) [m] samples of the path, between which no joint turns by more than a radian.

    Raises:
        UnknownNameError: No such elbow.
        PathError: The axes are not parallel; the path leaves the reach or passes near a singularity.
    """

    def __init__(self, arm: Arm, path: TipPath, elbow: Elbow) -> None:
        if not isinstance(elbow, str) or elbow not in ELBOWS:
            raise UnknownNameError("elbow", elbow, ELBOWS)
        self.arm, self.path = arm, path
        self._measure()
        self._bend = self.side * (1.0 if elbow == "positive" else -1.0)
        self.station = _samples(path)
        self._turns, self._turn2 = np.zeros(len(self.station)), 0.0

    def settle(self) -> None:
        """Check the reach all along, and choose the turns that fit the joints' position limits best."""
        self._check_reach()
        self._sample_turns()
        q = self.evaluate(self.station)[0]
        self._turns = np.unwrap(q[:, 0])
        self._turns += whole_turns(self.arm, 0, self._turns)
        self._turn2 = whole_turns(self.arm, 1, q[:, 1])

    def _measure(self) -> None:
        """Read the link lengths, the plane and the zero angles off the arm at ``q = 0``."""
        arm = self.arm
        zero = np.zeros(arm.dof)
        first, second = arm.link_poses(zero)[:2]
        tip = arm.tip_pose(zero)[:3, 3]
        axis = first[:3, :3] @ arm.model.axis[0]
        side = float(axis @ (second[:3, :3] @ arm.model.axis[1]))
        if abs(abs(side) - 1.0) > 1e-9:
            raise PathError(
                f"the two joint axes of arm {arm.name!r} are not parallel", remedy="use a planar two-link arm"
            )
        upper, lower = second[:3, 3] - first[:3, 3], tip - second[:3, 3]
        upper, lower = upper - axis * (axis @ upper), lower - axis * (axis @ lower)
        self._l1, self._l2 = float(np.linalg.norm(upper)), float(np.linalg.norm(lower))
        if min(self._l1, self._l2) < 1e-6:
            raise PathError(f"a link of arm {arm.name!r} has no length in the plane of motion")
        x_axis = upper / self._l1
        self._plane = np.stack([x_axis, np.cross(axis, x_axis)])
        self._origin = first[:3, 3]
        self.axis, self.height = axis, float(axis @ tip)
        self.side = float(np.sign(side))
        self._zero2 = float(np.arctan2(lower @ self._plane[1], lower @ self._plane[0]))

    def _radius(self, position: Floats) -> tuple[Floats, Floats]:
        in_plane = (position - self._origin) @ self._plane.T
        return in_plane, np.hypot(in_plane[..., 0], in_plane[..., 1])

    def polar(self, position: Floats) -> Floats:
        """Distance from the first axis [m], angle about it [rad] and height along it [m] of points, (..., 3)."""
        in_plane, radius = self._radius(position)
        height: Floats = position @ self.axis
        return np.stack([radius, np.arctan2(in_plane[..., 1], in_plane[..., 0]), height], axis=-1)

    def point(self, polar: Floats) -> Floats:
        """The points (..., 3) [m] of which ``polar`` tells."""
        radius, angle, height = polar[..., 0, None], polar[..., 1, None], polar[..., 2, None]
        foot = self._origin - (self._origin @ self.axis) * self.axis
        in_plane: Floats = radius * (np.cos(angle) * self._plane[0] + np.sin(angle) * self._plane[1])
        points: Floats = foot + in_plane + height * self.axis
        return points

    def _check_reach(self) -> None:
        """Check the distance from the first axis all along; it changes by no more than the length travelled."""
        bend = 2.0 * self._l1 * self._l2 * np.sqrt(1.0 - SINGULAR_SINE**2)
        near, far = np.sqrt(self._l1**2 + self._l2**2 + bend * np.array([-1.0, 1.0]))
        self._refuse(self.station, self._radius(self.path.evaluate(self.station)[0])[1])
        low, high = self.station[:-1], self.station[1:]
        for _ in range(LIMIT_HALVINGS):
            middle, half = 0.5 * (low + high), 0.5 * (high - low)
            radius = self._radius(self.path.evaluate(middle)[0])[1]
            self._refuse(middle, radius)
            low, high = _halves(low, high, (radius + half > far) | (radius - half < near))
            if not len(low):
                break

    def _refuse(self, station: Floats, radius: Floats) -> None:
        """Raise where a distance from the first axis is out of reach or too near its limits."""
        name, l1, l2 = self.arm.name, self._l1, self._l2
        for k, wrong in ((int(radius.argmax()), "far"), (int(radius.argmin()), "near")):
            if not abs(l1 - l2) <= radius[k] <= l1 + l2:
                raise PathError(
                    f"path of arm {name!r} is unreachable at station {station[k]:.4g} m: "
                    f"{radius[k]:.4g} m from its base, too {wrong} for links of {l1:.4g} m and {l2:.4g} m",
                    remedy="move the path or the base",
                    arm=name,
                    station=float(station[k]),
                )
            cosine = (radius[k] ** 2 - l1**2 - l2**2) / (2.0 * l1 * l2)
            if 1.0 - cosine**2 < SINGULAR_SINE**2:
                raise PathError(
                    f"path of arm {name!r} is singular at station {station[k]:.4g} m: the arm is "
                    f"{'stretched' if wrong == 'far' else 'folded'} there",
                    remedy="keep the path away from the limits of its reach",
                    arm=name,
                    station=float(station[k]),
                )

    def _sample_turns(self) -> None:
        """Sample so densely that whole turns cannot be mistaken."""
        while True:
            low, high = self.station[:-1], self.station[1:]
            wide = (self.speed_bound(low, high).max(axis=-1) * (high - low) > 1.0) & (high - low > 1e-9)
            if not wide.any():
                break
            self.station = np.sort(np.concatenate([self.station, 0.5 * (low + high)[wide]]))
        self._turns = np.zeros(len(self.station))

    def inverse(self, position: Floats, lam: ArrayLike) -> Floats:
        """Both joint angles (..., 2) [rad] with the tip above ``position`` (..., 3), which is near station ``lam``."""
        in_plane, r = self._radius(position)
        l1, l2 = self._l1, self._l2
        cos2 = np.clip((r**2 - l1**2 - l2**2) / (2.0 * l1 * l2), -1.0, 1.0)
        sin2 = self._bend * np.sqrt(1.0 - cos2**2)
        theta1 = np.arctan2(in_plane[..., 1], in_plane[..., 0]) - np.arctan2(l2 * sin2, l1 + l2 * cos2)
        near = np.interp(np.asarray(lam, dtype=np.float64), self.station, self._turns)
        theta1 += 2.0 * np.pi * np.round((near - theta1) / (2.0 * np.pi))
        q2 = self.side * (np.arctan2(sin2, cos2) - self._zero2) + self._turn2  # theta2 keeps its sign: no jump
        return np.stack([theta1, q2], axis=-1)

    def evaluate(self, lam: ArrayLike, *, before: bool = False) -> tuple[Floats, Floats, Floats]:
        """Both joint angles [rad] and their first and second derivatives by length [rad/m, rad/m^2], each (..., 2)."""
        lam = np.asarray(lam, dtype=np.float64)
        position, tangent, curvature = self.path.evaluate(lam, before=before)
        q = self.inverse(position, lam)
        l1, l2 = self._l1, self._l2
        theta1, theta2 = q[..., 0], self.side * (q[..., 1] - self._turn2) + self._zero2
        sin2 = np.sin(theta2)
        x1, y1 = l1 * np.cos(theta1), l1 * np.sin(theta1)
        x2, y2 = l2 * np.cos(theta1 + theta2), l2 * np.sin(theta1 + theta2)

        def joint_rates(x: Floats, y: Floats) -> tuple[Floats, Floats]:
            """Solve ``J rates = (x, y)``; the determinant is l1 l2 sin(theta2)."""
            both = (x2 * x + y2 * y) / (l1 * l2 * sin2)
            return both, -((x1 + x2) * x + (y1 + y2) * y) / (l1 * l2 * sin2)

        p, pp = tangent @ self._plane.T, curvature @ self._plane.T
        d1, d2 = joint_rates(p[..., 0], p[..., 1])
        w = d1 + d2
        dd1, dd2 = joint_rates(pp[..., 0] + x1 * d1**2 + x2 * w**2, pp[..., 1] + y1 * d1**2 + y2 * w**2)
        return (
            q,
            np.stack([d1, self.side * d2], axis=-1),
            np.stack([dd1, self.side * dd2], axis=-1),
        )

    def speed_bound(self, low: ArrayLike, high: ArrayLike) -> Floats:
        """Upper bounds of ``|f'|`` over the intervals [low, high], (..., 2) [rad/m].

        The tip moves one metre per metre of path, so its distance from the axis stays within half an interval of that
        at the centre; the bounds are those of the closed form over that range of distances.
        """
        low, high = np.asarray(low, dtype=np.float64), np.asarray(high, dtype=np.float64)
        l1, l2, half = self._l1, self._l2, 0.5 * (high - low)
        r = self._radius(self.path.evaluate(0.5 * (low + high))[0])[1]
        near, far = np.maximum(r - half, 1e-12), r + half

        def sine(radius: Floats) -> Floats:
            cosine = np.clip((radius**2 - l1**2 - l2**2) / (2.0 * l1 * l2), -1.0, 1.0)
            return np.sqrt(1.0 - cosine**2)

        def numerator(radius: Floats) -> Floats:
            return np.abs(radius**2 - l1**2 + l2**2)

        with np.errstate(divide="ignore"):
            lever = l1 * l2 * np.minimum(sine(near), sine(far))  # the sine is concave in r^2: smallest at an end
            bound2 = far / lever
            bound1 = np.hypot(1.0 / near, np.maximum(numerator(near), numerator(far)) / (2.0 * near * lever))
        return np.stack([bound1, bound2], axis=-1)


def whole_turns(arm: Arm, joint: int, q: Floats) -> float:
    """The number of turns [rad] by which a joint best fits its position limits."""
    low, high = arm.position_min[joint], arm.position_max[joint]
    middle = 0.5 * (q.min() + q.max())
    wanted = 0.5 * (low + high) if np.isfinite(low) and np.isfinite(high) else np.clip(0.0, low, high)
    return float(2.0 * np.pi * np.round((wanted - middle) / (2.0 * np.pi)))


def _samples(path: TipPath) -> Floats:
    """Rising stations: even ones, and some of every piece."""
    ends = path.breakpoints
    pieces = ends[:-1, None] + np.linspace(0.0, 1.0, PER_PIECE) * np.diff(ends)[:, None]
    return np.unique(
        np.clip(np.concatenate([np.linspace(0.0, path.length, PATH_SAMPLES), pieces.ravel()]), 0.0, path.length)
    )


def _halves(low: Floats, high: Floats, chosen: Bools) -> tuple[Floats, Floats]:
    """Both halves of the chosen intervals."""
    low, high = low[chosen], high[chosen]
    middle = 0.5 * (low + high)
    return np.concatenate([low, middle]), np.concatenate([middle, high])


def check_position_limits(arm: Arm, path: AbstractJointPath, station: Floats) -> None:
    """Check the joints along a path: at stations (K,) [m] and, where its speed bounds leave a doubt, between them.

    Raises:
        PathError: A joint leaves its range; the message names it and the station.
    """
    _refuse_positions(arm, station, path.evaluate(station)[0])
    low, high = station[:-1], station[1:]
    for _ in range(LIMIT_HALVINGS):
        middle, half = 0.5 * (low + high), 0.5 * (high - low)
        q, reach = path.evaluate(middle)[0], half[:, None] * path.speed_bound(low, high)
        _refuse_positions(arm, middle, q)
        doubtful = (q + reach > arm.position_max) | (q - reach < arm.position_min)
        low, high = _halves(low, high, np.asarray(doubtful.any(axis=1)))
        if not len(low):
            break


def _refuse_positions(arm: Arm, station: Floats, q: Floats) -> None:
    """Raise where joint positions (K, n) are out of range."""
    excess = np.maximum(q - arm.position_max, arm.position_min - q)
    k, joint = np.unravel_index(int(excess.argmax()), excess.shape)
    if excess[k, joint] > 0.0:
        unit = "m" if arm.model.prismatic[joint] else "rad"
        raise PathError(
            f"path of arm {arm.name!r} breaks the limit of joint {arm.joint_names[joint]!r} at station "
            f"{station[k]:.4g} m: {q[k, joint]:.4g} {unit} is outside [{arm.position_min[joint]:.4g}, "
            f"{arm.position_max[joint]:.4g}]",
            remedy="move the path, start in another posture (the other elbow), or widen limits.position_rad",
            arm=arm.name,
            station=float(station[k]),
            joint=int(joint),
        )

"""Joint positions for one pose of the tip: all of them where there is a closed form, else from many starts.

From a start the pose is sought by damped least squares (Levenberg and Marquardt): steps that help are damped less and
less, so that the last ones are Newton's; joints stay within their limits.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from armtempo.arrays import Bools, Floats
from armtempo.errors import InputError, PathError, RobotError, brief
from armtempo.planners.geometry import floats
from armtempo.planners.ik._spherical_wrist import SphericalWristIK
from armtempo.robots import Arm

__all__ = ["find_postures"]

STARTS = 256
STEPS_MAX = 200
FIRST_DAMPING, DAMPING_SHARE = 1e-2, 0.3  # of the squared Jacobian; it falls by this share where a step helps
EXACT = 1e-10  # [m, rad] what is left of a pose that is reached
APART = 1e-3  # [rad, m] of some joint between two postures: nearer ones are one
WIDEST = np.pi  # [rad, m] either side of zero, where a joint has no limits


def find_postures(
    arm: Arm, position: ArrayLike, rotation: ArrayLike | None = None, *, count: int = 8, seed: int = 0
) -> Floats:
    """Different joint positions that put the tip there, within the limits, those first that are farthest from them.

    Args:
        arm: Any serial arm.
        position: (3,) of the tip in the world [m].
        rotation: (3, 3) of the tip in the world; None: any.
        count: So many at most. Six turning joints with a spherical wrist have eight in closed form; of infinitely many
            (an arm that can move without moving its tip) these are as different as can be. Whole turns make no other.
        seed: Of the random starts.

    Returns:
        (K, n) [rad, m]; forward kinematics of each is the pose to 1e-9.

    Raises:
        InputError: A pose, ``count`` or ``seed`` that cannot be used.
        PathError: None was found; the message says by how much the nearest misses.
    """
    p, R = _checked(position, rotation)
    for name, value, least in (("count", count, 1), ("seed", seed, 0)):
        if not isinstance(value, int | np.integer) or value < least:
            raise InputError(f"{name} {brief(value)}", remedy=f"give a whole number, {least} or more")
    found = _closed(arm, p, R)
    if found is None:
        q, miss = _sought(arm, p, R, _starts(arm, int(seed)))
        found = _unwound(arm, q[miss < EXACT])
        if not len(found):
            raise _missed(arm, p, R, q[miss.argmin()])
    elif not len(found):
        raise PathError(
            f"arm {arm.name!r} has no posture for this pose within its limits",
            remedy="move the pose nearer to the arm, or turn it",
        )
    return _apart(arm, found, int(count))


def _checked(position: ArrayLike, rotation: ArrayLike | None) -> tuple[Floats, Floats | None]:
    p = floats(position, "position")
    R = None if rotation is None else floats(rotation, "rotation")
    if p.shape != (3,) or not np.isfinite(p).all():
        raise InputError(f"position of shape {p.shape} or not finite", remedy="give (3,) in the world [m]")
    if R is not None and not (
        R.shape == (3, 3) and np.allclose(R @ R.T, np.eye(3), atol=1e-6) and np.linalg.det(R) > 0
    ):
        raise InputError(f"rotation of shape {R.shape} is none", remedy="give a rotation matrix (3, 3)")
    return p, R


def _closed(arm: Arm, p: Floats, R: Floats | None) -> Floats | None:
    """All postures in closed form; None: this arm has none, or the pose is not whole."""
    if R is None:
        return None
    try:
        solver = SphericalWristIK(arm)
    except RobotError:
        return None
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = R, p
    q = solver.within_limits(solver.solve(T))
    return np.asarray(q[np.isfinite(q).all(axis=1)])


def _range(arm: Arm) -> tuple[Floats, Floats]:
    """(n,) lowest and highest joint positions that are looked at."""
    low, high = arm.position_min, arm.position_max
    return np.where(np.isfinite(low), low, -WIDEST), np.where(np.isfinite(high), high, WIDEST)


def _starts(arm: Arm, seed: int) -> Floats:
    low, high = _range(arm)
    return low + (high - low) * np.random.default_rng(seed).uniform(0.0, 1.0, (STARTS, arm.dof))


def _error(arm: Arm, q: Floats, p: Floats, R: Floats | None) -> Floats:
    """(K, 3 or 6) what is left of the pose: way [m] and turning [rad], in the world."""
    T = arm.tip_pose(q)
    way = p - T[:, :3, 3]
    if R is None:
        return np.asarray(way)
    turning = Rotation.from_matrix(R @ T[:, :3, :3].transpose(0, 2, 1)).as_rotvec()
    return np.concatenate([way, turning], axis=1)


def _sought(arm: Arm, p: Floats, R: Floats | None, q: Floats) -> tuple[Floats, Floats]:
    """Where starts (K, n) lead, and (K,) what is left of the pose there."""
    low, high = _range(arm)
    error = _error(arm, q, p, R)
    damping = np.full(len(q), FIRST_DAMPING)
    going: Bools = np.ones(len(q), dtype=np.bool_)
    for _ in range(STEPS_MAX):
        k = np.flatnonzero(going)
        J = arm.jacobian(q[k])[:, : error.shape[1]]
        square = J @ J.transpose(0, 2, 1)
        scale = np.trace(square, axis1=1, axis2=2) + 1e-12
        square += (damping[k] * scale)[:, None, None] * np.eye(error.shape[1])
        step = np.einsum("kij,ki->kj", J, np.linalg.solve(square, error[k][:, :, None])[:, :, 0])
        tried = np.clip(q[k] + step, low, high)
        left = _error(arm, tried, p, R)
        helps = np.linalg.norm(left, axis=1) < np.linalg.norm(error[k], axis=1)
        q[k[helps]], error[k[helps]] = tried[helps], left[helps]
        damping[k] = np.where(helps, np.maximum(DAMPING_SHARE * damping[k], 1e-15), damping[k] / DAMPING_SHARE**2)
        going[k] = (np.abs(error[k]).max(axis=1) >= 1e-3 * EXACT) & (damping[k] < 1e6)
        if not going.any():
            break
    return q, np.abs(error).max(axis=1)


def _missed(arm: Arm, p: Floats, R: Floats | None, q: Floats) -> PathError:
    error = _error(arm, q[None], p, R)[0]
    turned = "" if R is None else f" and {np.degrees(np.linalg.norm(error[3:])):.3g} degrees"
    return PathError(
        f"arm {arm.name!r} was found in no posture for this pose: the nearest misses it by "
        f"{1e3 * np.linalg.norm(error[:3]):.3g} mm{turned}",
        remedy="move the pose nearer to the arm, or leave its rotation out",
        nearest=q,
    )


def _unwound(arm: Arm, q: Floats) -> Floats:
    """The same postures (K, n), turning joints as near to the middle of their ranges as whole turns bring them."""
    low, high = _range(arm)
    turns = np.where(arm.model.prismatic, 0.0, np.round((q - 0.5 * (low + high)) / (2.0 * np.pi)))
    return np.asarray(q - 2.0 * np.pi * turns)


def _apart(arm: Arm, q: Floats, count: int) -> Floats:
    """Of postures (K, n) so many that are apart, of too many the most different; those in mid-range first."""
    low, high = _range(arm)
    margin = (np.minimum(q - low, high - q) / np.maximum(high - low, 1e-12)).min(axis=1)
    kept = [int(margin.argmax())]
    nearest = np.abs(q - q[kept[0]]).max(axis=1)
    while len(kept) < count and nearest.max() >= APART:
        kept.append(int(nearest.argmax()))
        nearest = np.minimum(nearest, np.abs(q - q[kept[-1]]).max(axis=1))
    return np.asarray(q[sorted(kept, key=lambda k: -margin[k])])

"""Random targets for any arm, drawn by seed: easy ones, some through singularities, some that leave the workspace."""

from __future__ import annotations

from typing import Literal, NamedTuple, get_args

import numpy as np

from armtempo.arrays import Floats
from armtempo.errors import PathError, UnknownNameError
from armtempo.planners.cells._ik_cell import IKCell
from armtempo.planners.geometry import JointMotion, smooth_step
from armtempo.planners.ik import ranges_near_zero
from armtempo.robots import Clearance

TargetFamilyName = Literal["given", "smooth", "near-singular", "partly-unreachable"]
TARGET_FAMILIES: tuple[TargetFamilyName, ...] = get_args(TargetFamilyName)

MOST_DRAWS = 1000
MOTION_SAMPLES = 61  # of a motion; one of them is the middle posture
LARGEST_TURN = 0.8  # [rad] a joint goes at most from posture to posture; sliding joints a share of their range
LARGEST_SLIDE_SHARE = 0.3
WIDEST_RANGE = np.pi  # joints that turn farther are drawn in this range about zero, or from the limit nearest to it
SHORTEST_DURATION = 2.0  # [s]
LOAD_SHARE_MAX = 0.8  # largest share of a torque limit, and of an acceleration limit
SPEED_SHARE_MAX = 0.5  # largest share of a joint's speed
CLEAR_OF_SINGULAR = (
    3.0  # dampings (and at least WELL_SHARE of what the arm has in the middle) that smooth motions keep away
)
CLEAR_OF_SINGULAR_SHARE = 0.25
NEAR_SINGULAR = 0.25  # dampings below which a posture is near-singular
REACH_EXCEEDED_BY = (0.05, 0.2)  # of the arm's length that a target goes out of reach
TRIP_SPEED = 0.5  # arm's lengths per second that the way out takes at most


class _Demand(NamedTuple):
    speed: float
    torque: float
    acceleration: float


def draw_target(cell: IKCell, family: str, random: np.random.Generator) -> IKCell:
    """The cell with a start and a target drawn at random.

    Motions are made by the arm's own joints, from rest to rest along a spline through random postures, at most at half
    of every joint's speed and 80 % of torque and acceleration limits, and free of self-collision where it is looked
    at. The tip's pose along them is the target; the arm starts on it.

    Args:
        cell: The arm; its own target is ``given``.
        family: ``smooth``: at least three times the law's damping away from every singular posture. ``near-singular``:
            on the way through a posture that is singular, to a quarter of the damping. ``partly-unreachable``: as
            ``smooth``, but for part of the time the target is 5 to 20 % of the arm's length out of reach, and comes
            back.
        random: Draws all of it.

    Raises:
        UnknownNameError: No such family.
        PathError: None of 1000 draws will do; nothing is known to be out of reach of the arm (no joint turns, or
            slides before the first that does have no limits).
    """
    if not isinstance(family, str) or family not in TARGET_FAMILIES:
        raise UnknownNameError("family of targets", family, TARGET_FAMILIES)
    if family == "given":
        return cell
    if family == "partly-unreachable" and not np.isfinite(_slides(cell)):
        raise PathError(
            f"nothing is known to be out of reach of arm {cell.arm.name!r}: no joint turns, or one slides without end",
            remedy="take another family, or give the sliding joints limits",
            arm=cell.arm.name,
        )
    clearance = Clearance([cell.arm], ())
    well = _well_conditioned(cell)
    for _ in range(MOST_DRAWS):
        postures = _postures(cell, random)
        if family == "near-singular":
            postures[1] = _towards_singular(cell, postures[1], random)
        motion = _timed(cell, postures)
        if motion is None:
            continue
        q = motion.joints(np.linspace(0.0, motion.duration, MOTION_SAMPLES))[0]
        values = cell.singular_value(q)
        if family == "near-singular":
            fits = values.min() < NEAR_SINGULAR * cell.config.law.damping and min(values[0], values[-1]) >= well
        else:
            fits = bool(values.min() >= well)
        if not fits or _touches(clearance, q):
            continue
        if family == "partly-unreachable":
            return _excursion(cell, motion, random)
        return cell.variant(motion, motion.duration, postures[0])
    raise PathError(
        f"none of {MOST_DRAWS} targets drawn as {family!r} suits arm {cell.arm.name!r}",
        remedy="take another family, or give the arm wider limits",
        arm=cell.arm.name,
    )


def _ranges(cell: IKCell) -> tuple[Floats, Floats, Floats]:
    """Lowest, highest, and how far from posture to posture (n,)."""
    arm = cell.arm
    sliding = arm.model.prismatic
    bounded = np.isfinite(arm.position_min) & np.isfinite(arm.position_max)
    low, high = ranges_near_zero(arm, np.where(sliding & bounded, np.inf, WIDEST_RANGE))
    reserve = 0.05 * (high - low)
    return low + reserve, high - reserve, np.where(sliding, LARGEST_SLIDE_SHARE * (high - low), LARGEST_TURN)


def _postures(cell: IKCell, random: np.random.Generator) -> Floats:
    """(3, n)."""
    low, high, step = _ranges(cell)
    rows = [random.uniform(low, high)]
    for _ in range(2):
        rows.append(np.clip(rows[-1] + step * random.uniform(-1.0, 1.0, len(step)), low, high))
    return np.array(rows)


def _well_conditioned(cell: IKCell) -> float:
    """Smallest singular value that counts as far from singular."""
    low, high, _ = _ranges(cell)
    typical = np.median(cell.singular_value(np.random.default_rng(0).uniform(low, high, (200, len(low)))))
    return max(CLEAR_OF_SINGULAR * cell.config.law.damping, CLEAR_OF_SINGULAR_SHARE * float(typical))


def _towards_singular(cell: IKCell, q: Floats, random: np.random.Generator) -> Floats:
    """A posture near ``q`` that is singular, or nearly: joint by joint to the smallest singular value, a few rounds."""
    low, high, step = _ranges(cell)
    at = q.copy()
    width = step.copy()
    for _ in range(6):
        for j in random.permutation(len(q)):
            tries = np.repeat(at[None], 41, axis=0)
            tries[:, j] = np.clip(at[j] + width[j] * np.linspace(-1.0, 1.0, 41), low[j], high[j])
            at = tries[int(cell.singular_value(tries).argmin())]
        width *= 0.3
    return at


def _timed(cell: IKCell, postures: Floats) -> JointMotion | None:
    """Through the postures as slowly as limits need it; None where no time is enough."""
    low, high, _ = _ranges(cell)
    motion = JointMotion(cell.arm, postures, SHORTEST_DURATION)
    q = motion.joints(np.linspace(0.0, SHORTEST_DURATION, MOTION_SAMPLES))[0]
    if (q < low - 1e-9).any() or (q > high + 1e-9).any():
        return None
    for _ in range(8):
        demand = _demand(cell, motion)
        slower = max(
            demand.speed / SPEED_SHARE_MAX,
            np.sqrt(demand.acceleration / LOAD_SHARE_MAX),
            1.0 if demand.torque <= LOAD_SHARE_MAX else 1.3,
        )
        if slower <= 1.0:
            return motion
        motion = JointMotion(cell.arm, postures, 1.01 * slower * motion.duration)
    return None


def _demand(cell: IKCell, motion: JointMotion) -> _Demand:
    """Largest shares of the limits."""
    arm, t = cell.arm, np.linspace(0.0, motion.duration, 8 * MOTION_SAMPLES)
    q, qd = motion.joints(t)
    qdd = np.gradient(qd, t, axis=0)
    torque = np.abs(arm.inverse_dynamics(q, qd, qdd)) / arm.torque_max
    speed = np.abs(qd) / arm.speed_max
    return _Demand(float(speed.max()), float(torque.max()), float((np.abs(qdd) / arm.acceleration_max).max()))


def _touches(clearance: Clearance, q: Floats) -> bool:
    return clearance.self_pairs(0) > 0 and any(clearance.self_collision(0, row).distance <= 0.0 for row in q)


def _slides(cell: IKCell) -> float:
    """How far the joints before the first that turns can move it [m]; inf without one."""
    arm = cell.arm
    if arm.model.prismatic.all():
        return np.inf
    first = int(np.argmin(arm.model.prismatic))
    return float((arm.position_max - arm.position_min)[:first].sum())


def _excursion(cell: IKCell, motion: JointMotion, random: np.random.Generator) -> IKCell:
    """The motion, pulled away from the base for a while in its middle, to where the arm cannot be: out and back."""
    arm, length = cell.arm, cell.solver.length
    first = int(np.argmin(arm.model.prismatic))  # that turns
    middle = motion(np.array([0.5 * motion.duration]))[0][0]
    base = arm.link_poses(motion.postures[0])[first, :3, 3]
    out = middle - base
    off = float(np.linalg.norm(out))
    rise = (_slides(cell) + length * (1.0 + random.uniform(*REACH_EXCEEDED_BY)) - off) / off * out
    # Slow enough for the trip: the motion itself gets longer with it.
    trip = 15.0 / 8.0 * float(np.linalg.norm(rise)) / (TRIP_SPEED * length)
    duration = max(motion.duration, 4.0 * trip)
    slowed = JointMotion(arm, motion.postures, duration)

    def pulled(t: Floats) -> tuple[Floats, Floats, Floats, Floats]:
        p, R, v, w = slowed(t)
        up, up_rate = smooth_step((t / duration - 0.2) / 0.25)
        down, down_rate = smooth_step((t / duration - 0.55) / 0.25)
        share, rate = (up - down)[:, None], ((up_rate - down_rate) / (0.25 * duration))[:, None]
        return p + share * rise, R, v + rate * rise, w

    return cell.variant(pulled, duration, motion.postures[0])

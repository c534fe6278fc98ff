"""The fastest motion along a path, with or without jerk limits."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from armtempo.arrays import Floats
from armtempo.errors import InputError
from armtempo.planners.geometry import floats
from armtempo.planners.topp._jerk_limited import jerk_limited
from armtempo.planners.topp._path_dynamics import PathDynamics
from armtempo.planners.topp._phase_plane import refined_plane
from armtempo.planners.topp._trajectory import PhaseTrajectory

JerkLimits = bool | Sequence[float | None] | Floats


def minimum_time(
    dynamics: PathDynamics, mu_start: float = 0.0, mu_end: float = 0.0, *, jerk: JerkLimits = False
) -> PhaseTrajectory:
    """The fastest motion along a path inside its torque, speed and acceleration limits (Lee1991 eqs. 14-16).

    Where dense sampling finds a limit exceeded by more than 0.1 % between stations, the grid is refined there: the
    motion's own ``dynamics`` has the grid in the end. ``PhasePlane(dynamics).fastest()`` is the bare solve.

    With jerk limits the motion starts and ends at rest and without acceleration, and stops where ``f''`` jumps (a line
    that meets an arc): no other motion keeps a jerk limit there. It is a local optimum of a problem that is not convex;
    on straight lines it takes the least time to 0.1 %.

    Args:
        dynamics: Limits along the path.
        mu_start: Path speed at the start.
        mu_end: Path speed at the end.
        jerk: True: the arm's own jerk limits are kept, too; or limits (n,) in their place [rad/s^3 or m/s^3], inf or
            None for joints without.

    Raises:
        InfeasibleError: No motion keeps the limits; the message names the station, the joint and the reason.
        InputError: Jerk limits are not (n,) positive numbers, or the arm has none, or the motion is to start or end at
            a speed.
    """
    if jerk is False:
        return refined_plane(dynamics, mu_end, mu_start=mu_start).fastest(mu_start)
    if mu_start != 0.0 or mu_end != 0.0:
        raise InputError(
            f"a motion with limited jerk starts and ends at rest, not at mu = {mu_start:.4g} and {mu_end:.4g}",
            remedy="leave mu_start and mu_end at 0",
        )
    return jerk_limited(dynamics, jerk_limits(dynamics, jerk))


def jerk_limits(dynamics: PathDynamics, jerk: JerkLimits) -> Floats:
    """The limits (n,) that ``minimum_time`` is asked to keep."""
    arm = dynamics.arm
    if arm is None:
        raise InputError("bare arrays have no joints whose jerk is limited", remedy="use PathDynamics.from_path")
    if jerk is True:
        limits = arm.jerk_max
        if not np.isfinite(limits).any():
            raise InputError(
                f"arm {arm.name!r} has no jerk limits",
                remedy="give jerk_max to its Arm, limits.jerk_rad_s3 in its cell, or limits here",
            )
        return limits
    given: Any = jerk
    if isinstance(jerk, (list, tuple)):
        given = [np.inf if one is None else one for one in jerk]
    limits = floats(given, "jerk", np.inf)
    if limits.shape != (arm.dof,) or not (limits > 0.0).all():
        raise InputError(
            f"jerk limits {limits.tolist()!r:.60} of arm {arm.name!r} are not {arm.dof} positive numbers",
            remedy=f"give one per joint: {', '.join(arm.joint_names)}",
        )
    return limits

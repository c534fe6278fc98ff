"""How much torque a plan has to leave unused, so that arms that are not as planned still keep up with it."""

from __future__ import annotations

import numpy as np

from armtempo.arrays import Floats
from armtempo.planners.cells._coordination_cell import CONTROL_SHARE, CoordinationCell
from armtempo.planners.topp import PathDynamics, PhasePlane
from armtempo.robots import Arm

OVERSHOOT = 0.31
"""Of what feedback adds at a limit: critically damped it overshoots a change by ``exp(-2)``, by 0.153 a tick late, and
where a torque jumps from one limit to the other the change is twice what is added."""


RATES = np.linspace(1.0, 0.05, 381)


def needed_torque_reserve(cell: CoordinationCell, model_error: float = 0.0, friction_error: float = 0.0) -> float:
    """The ``torque_reserve`` with which no arm needs more than its limits; infinite: none will do.

    A plan uses at most ``L = (1 - reserve) limit`` for bodies and friction together. Bodies heavier by a share ``e``,
    with friction larger by ``f``, need ``(1 + e) L + |f - e| F`` for the same motion, ``F`` being the largest friction
    torque on the path as planned. What is beyond the plan comes from feedback, which overshoots by ``OVERSHOOT`` where
    a torque jumps; ``CONTROL_SHARE`` of the limit is for ticks. (The bound is that of an inertia which does not change
    while feedback settles. With bodies half as heavy again, mixed-priority needs 1 % more.)

    Args:
        cell: The arms on their paths.
        model_error: By what share the bodies are heavier than planned.
        friction_error: By what share damping and dry friction are larger.
    """
    reserve = 0.0
    for arm, dynamics, friction in _planned(cell):
        limit = arm.torque_max
        rougher = (1.0 + OVERSHOOT) * abs(friction_error - model_error)
        of_plan = (1.0 - CONTROL_SHARE) - rougher * friction.max(axis=0) / limit
        least = float(np.min(of_plan) / (1.0 + model_error + OVERSHOOT * abs(model_error)))
        if least < 0.1 or not _stands(arm, dynamics, model_error, friction_error):
            return float("inf")
        reserve = max(reserve, 1.0 - least)
    return reserve


def rate_that_holds(cell: CoordinationCell, model_error: float = 0.0, friction_error: float = 0.0) -> float:
    """The largest rate up to 1 at which any motion within the plan's limits can run with these errors; 0: none.

    At a rate ``k`` torques of inertia are ``k^2`` of the planned ones, those of viscous friction ``k``; what holds the
    arm, and dry friction, stay. They are asked at rest and at the highest speeds, with all that the plan may use.
    """
    return min(
        _rate(arm, plane, model_error, friction_error) for arm, plane in zip(cell.arms, cell.planes, strict=True)
    )


def _rate(arm: Arm, plane: PhasePlane, model_error: float, friction_error: float) -> float:
    dynamics, n = plane.dynamics, arm.dof
    held, most = _gravity(arm, dynamics), (1.0 - CONTROL_SHARE) * arm.torque_max
    dry = dynamics.S[:, :n] - held
    fastest = np.sqrt(np.maximum(plane.edges.high, 0.0))[:, None]
    for rate in RATES:
        worst = np.zeros_like(held)
        for viscous in (np.zeros_like(held), dynamics.R[:, :n] * fastest):
            for used in (dynamics.torque_min[:, :n], dynamics.torque_max[:, :n]):
                body = rate * rate * (used - dynamics.S[:, :n] - viscous) + held
                rubbing = rate * viscous + dry
                extra = model_error * body + friction_error * rubbing
                jumping = np.abs(extra - model_error * held)  # what holds the arm does not jump
                worst = np.maximum(worst, np.abs(body + rubbing + extra) + OVERSHOOT * jumping)
        if (worst <= most).all():
            return float(rate)
    return 0.0


def _planned(cell: CoordinationCell) -> list[tuple[Arm, PathDynamics, Floats]]:
    """Per arm itself, its rows, and (N, n) the friction torques at the highest speeds."""
    found = []
    for arm, plane in zip(cell.arms, cell.planes, strict=True):
        dynamics = plane.dynamics
        fastest = np.sqrt(np.maximum(plane.edges.high, 0.0))[:, None]
        dry = dynamics.S[:, : arm.dof] - _gravity(arm, dynamics)
        found.append((arm, dynamics, np.abs(dry) + np.abs(dynamics.R[:, : arm.dof]) * fastest))
    return found


def _gravity(arm: Arm, dynamics: PathDynamics) -> Floats:
    """(N, n) torques that hold the arm at the stations."""
    assert dynamics.path is not None
    q = dynamics.path.evaluate(dynamics.grid)[0]
    return arm.inverse_dynamics(q, np.zeros_like(q), np.zeros_like(q), friction=False)


def _stands(arm: Arm, dynamics: PathDynamics, model_error: float, friction_error: float) -> bool:
    """Whether torques at rest are within the limits, dry friction against the motion."""
    held = _gravity(arm, dynamics)
    dry = dynamics.S[:, : arm.dof] - held
    at_rest = (1.0 + model_error) * held + (1.0 + friction_error) * dry
    return bool((np.abs(at_rest) <= (1.0 - CONTROL_SHARE) * arm.torque_max).all())

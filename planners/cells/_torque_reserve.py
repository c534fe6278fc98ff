"""How much torque a plan has to leave unused, so that arms that are not as planned still keep up with it."""

from __future__ import annotations

import numpy as np

from armtempo.arrays import Floats
from armtempo.planners.cells._coordination_cell import CONTROL_SHARE, CoordinationCell
from armtempo.planners.topp import PathDynamics
from armtempo.robots import Arm

OVERSHOOT = 0.15
"""Of what feedback adds: critically damped, ``exp(-2)`` without ticks; 0.153 at the most with those of the cells."""


def needed_torque_reserve(cell: CoordinationCell, model_error: float = 0.0, friction_error: float = 0.0) -> float:
    """The ``torque_reserve`` with which no arm needs more than its limits; infinite: none will do.

    A plan uses at most ``L = (1 - reserve) limit`` for bodies and friction together. Bodies heavier by a share ``e``,
    with friction larger by ``f``, need ``(1 + e) L + |f - e| F`` for the same motion, ``F`` being the largest friction
    torque on the path as planned. What is beyond the plan comes from feedback, which overshoots by ``OVERSHOOT`` where
    a torque jumps; ``CONTROL_SHARE`` of the limit is for ticks.

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


def can_go_slowly(cell: CoordinationCell, model_error: float = 0.0, friction_error: float = 0.0) -> bool:
    """Whether every arm can go along its path as slowly as it likes: torques at rest, with these errors, suffice.

    Then any motion along the path is possible, if only slowly enough.
    """
    return all(_stands(arm, dynamics, model_error, friction_error) for arm, dynamics, _ in _planned(cell))


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

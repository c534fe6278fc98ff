"""Inverse kinematics: the feedback law (Chung) with error bounds, Newton, closed forms."""

from __future__ import annotations

from armtempo.planners.ik._classical import ClosedFormIK, NewtonIK, ResolvedRateIK
from armtempo.planners.ik._feedback import (
    INTEGRATORS,
    FeedbackIK,
    IKBounds,
    IKGains,
    IKRun,
    Integrator,
    ranges_near_zero,
)
from armtempo.planners.ik._postures import find_postures
from armtempo.planners.ik._spherical_wrist import SphericalWristIK

__all__ = [
    "ClosedFormIK",
    "FeedbackIK",
    "IKBounds",
    "IKGains",
    "IKRun",
    "INTEGRATORS",
    "Integrator",
    "NewtonIK",
    "ResolvedRateIK",
    "SphericalWristIK",
    "find_postures",
    "ranges_near_zero",
]

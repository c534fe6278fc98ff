"""Motions for the controllers of real robots: one time base for all arms, and what controllers make of them."""

from __future__ import annotations

from armtempo.planners.exports._export import ENDINGS, FORMS, Form, export_motion
from armtempo.planners.exports._interpolation import Interpolation, interpolate, interpolation
from armtempo.planners.exports._robot_motion import MotionEvent, RobotMotion, check_rest, time_base

__all__ = [
    "ENDINGS",
    "FORMS",
    "Form",
    "Interpolation",
    "MotionEvent",
    "RobotMotion",
    "check_rest",
    "export_motion",
    "interpolate",
    "interpolation",
    "time_base",
]

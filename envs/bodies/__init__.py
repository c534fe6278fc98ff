"""Arms in PyBullet: scene, renderer, joint controller."""

from __future__ import annotations

from armtempo.envs.bodies._bullet import pybullet
from armtempo.envs.bodies._controller import (
    CONTROLLER_GAIN,
    PHYSICS,
    SETTLED_DISTANCE,
    SETTLED_SPEED,
    SETTLED_TIME,
    Physics,
    TrackedArm,
    is_number,
)
from armtempo.envs.bodies._joint_control import joint_torques, tip_of
from armtempo.envs.bodies._renderer import Renderer, check_render_mode, render_modes
from armtempo.envs.bodies._scene import Scene

__all__ = [
    "CONTROLLER_GAIN",
    "PHYSICS",
    "Physics",
    "Renderer",
    "SETTLED_DISTANCE",
    "SETTLED_SPEED",
    "SETTLED_TIME",
    "Scene",
    "TrackedArm",
    "check_render_mode",
    "is_number",
    "joint_torques",
    "pybullet",
    "render_modes",
    "tip_of",
]

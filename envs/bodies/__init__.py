"""Arms in a physics engine: scene, renderer, joint controller."""

from __future__ import annotations

from armtempo.envs.bodies._bullet import pybullet
from armtempo.envs.bodies._bullet_scene import display_available
from armtempo.envs.bodies._controller import CONTROLLER_GAIN, PHYSICS, Controller, Physics, engine_name, make_scene
from armtempo.envs.bodies._engine_audit import OTHER_ENGINE, engine_difference
from armtempo.envs.bodies._joint_control import clip_torques, joint_demand, joint_torques, tip_of
from armtempo.envs.bodies._renderer import Renderer, check_render_mode, outline, render_modes
from armtempo.envs.bodies._scene import Scene
from armtempo.envs.bodies._settling import SETTLED_DISTANCE, Settling
from armtempo.envs.bodies._trace import End, Recorder, Simulation, Trace

__all__ = [
    "CONTROLLER_GAIN",
    "Controller",
    "End",
    "OTHER_ENGINE",
    "PHYSICS",
    "Physics",
    "Recorder",
    "Renderer",
    "SETTLED_DISTANCE",
    "Scene",
    "Settling",
    "Simulation",
    "Trace",
    "check_render_mode",
    "clip_torques",
    "display_available",
    "engine_difference",
    "engine_name",
    "joint_demand",
    "joint_torques",
    "make_scene",
    "outline",
    "pybullet",
    "render_modes",
    "tip_of",
]

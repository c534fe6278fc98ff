"""Environments: arms on given paths in PyBullet, clearance by FCL, through Gymnasium and PettingZoo."""

from __future__ import annotations

from armtempo.envs import coordination_v0
from armtempo.envs.blend._env import BlendTrackingEnv
from armtempo.envs.blend._observation import BLEND_ENTRIES
from armtempo.envs.blend._simulation import MAPPINGS, BlendSimulation, BlendTrace, MappingName
from armtempo.envs.bodies._renderer import Renderer
from armtempo.envs.common._entries import ENTRIES, OTHER, OTHERS, OWN, Entry, observation_table, share
from armtempo.envs.coordination._batch import REWARDS, BatchSimulation
from armtempo.envs.coordination._multi_agent_env import CoordinationEnv
from armtempo.envs.coordination._shield_wrappers import ShieldParallelWrapper, ShieldWrapper
from armtempo.envs.coordination._vector_envs import CoordinationVectorEnv, YieldingVectorEnv
from armtempo.envs.coordination._yielding_env import YieldingEnv
from armtempo.envs.coordination.shield._shield import EpisodeShield, Shield
from armtempo.envs.coordination.shield._trial import REQUESTS, ShieldTrial, shield_trial
from armtempo.envs.coordination.world._disturbance import DISTURBANCES, Disturbance
from armtempo.envs.coordination.world._disturbed_motion import disturbed_motion
from armtempo.envs.coordination.world._simulation import MODES, PHYSICS, EpisodeTrace, Physics, Simulation
from armtempo.envs.ik._env import FeedbackIKEnv
from armtempo.envs.ik._observation import ik_entries
from armtempo.envs.ik._simulation import ACTION_MODES, ActionMode, IKSimulation, IKTrace
from armtempo.envs.ik._vector_env import FeedbackIKVectorEnv

__all__ = [
    "BLEND_ENTRIES",
    "DISTURBANCES",
    "ENTRIES",
    "MAPPINGS",
    "MODES",
    "OTHER",
    "OTHERS",
    "OWN",
    "PHYSICS",
    "REQUESTS",
    "REWARDS",
    "BatchSimulation",
    "BlendSimulation",
    "BlendTrace",
    "BlendTrackingEnv",
    "CoordinationEnv",
    "CoordinationVectorEnv",
    "Disturbance",
    "Entry",
    "EpisodeShield",
    "EpisodeTrace",
    "MappingName",
    "Physics",
    "Renderer",
    "Shield",
    "ShieldParallelWrapper",
    "ShieldTrial",
    "ShieldWrapper",
    "Simulation",
    "YieldingEnv",
    "YieldingVectorEnv",
    "coordination_v0",
    "disturbed_motion",
    "observation_table",
    "share",
    "shield_trial",
    "ACTION_MODES",
    "ActionMode",
    "FeedbackIKEnv",
    "FeedbackIKVectorEnv",
    "IKSimulation",
    "IKTrace",
    "ik_entries",
]

for _env in (CoordinationEnv, YieldingEnv):
    _env.__doc__ = (_env.__doc__ or "").replace("{table}", observation_table())
BlendTrackingEnv.__doc__ = (BlendTrackingEnv.__doc__ or "").replace("{table}", observation_table(BLEND_ENTRIES))
FeedbackIKEnv.__doc__ = (FeedbackIKEnv.__doc__ or "").replace("{table}", observation_table(ik_entries(6)))

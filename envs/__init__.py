"""Environments: arms on given paths in PyBullet, clearance by FCL, through Gymnasium and PettingZoo."""

from __future__ import annotations

from armtempo.envs import coordination_v0
from armtempo.envs._batch import REWARDS, BatchSimulation
from armtempo.envs._blend_observation import BLEND_ENTRIES
from armtempo.envs._blend_simulation import MAPPINGS, BlendSimulation, BlendTrace, MappingName
from armtempo.envs._blend_tracking import BlendTrackingEnv
from armtempo.envs._coordination import CoordinationEnv
from armtempo.envs._disturbance import DISTURBANCES, Disturbance
from armtempo.envs._disturbed_motion import disturbed_motion
from armtempo.envs._feedback_ik import FeedbackIKEnv
from armtempo.envs._ik_observation import ik_entries
from armtempo.envs._ik_simulation import ACTION_MODES, ActionMode, IKSimulation, IKTrace
from armtempo.envs._ik_vector import FeedbackIKVectorEnv
from armtempo.envs._observation import ENTRIES, OTHER, OTHERS, OWN, Entry, observation_table, share
from armtempo.envs._renderer import Renderer
from armtempo.envs._shield import EpisodeShield, Shield
from armtempo.envs._shield_trial import REQUESTS, ShieldTrial, shield_trial
from armtempo.envs._shield_wrappers import ShieldParallelWrapper, ShieldWrapper
from armtempo.envs._simulation import MODES, PHYSICS, EpisodeTrace, Physics, Simulation
from armtempo.envs._vector import CoordinationVectorEnv, YieldingVectorEnv
from armtempo.envs._yielding import YieldingEnv

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

"""Environments: arms on given paths in PyBullet, clearance by FCL, through Gymnasium and PettingZoo."""

from __future__ import annotations

from armtempo.envs import coordination_v0
from armtempo.envs.blend import (
    BLEND_ENTRIES,
    MAPPINGS,
    BlendOptions,
    BlendSimulation,
    BlendTrace,
    BlendTrackingEnv,
    MappingName,
)
from armtempo.envs.bodies import PHYSICS, Physics, Renderer
from armtempo.envs.common import Entry, observation_table, share
from armtempo.envs.coordination import (
    REWARDS,
    BatchSimulation,
    CoordinationEnv,
    CoordinationOptions,
    CoordinationVectorEnv,
    ShieldParallelWrapper,
    ShieldWrapper,
    YieldingEnv,
    YieldingVectorEnv,
)
from armtempo.envs.coordination.shield import REQUESTS, EpisodeShield, Shield, ShieldTrial, shield_trial
from armtempo.envs.coordination.world import (
    COORDINATION_ENTRIES,
    DISTURBANCES,
    MODES,
    OTHER,
    OTHERS,
    OWN,
    CoordinationSimulation,
    CoordinationTrace,
    Disturbance,
    disturbed_motion,
)
from armtempo.envs.ik import (
    ACTION_MODES,
    ActionMode,
    FeedbackIKEnv,
    FeedbackIKVectorEnv,
    IKOptions,
    IKSimulation,
    IKTrace,
    ik_entries,
)

__all__ = [
    "BlendOptions",
    "CoordinationOptions",
    "IKOptions",
    "BLEND_ENTRIES",
    "DISTURBANCES",
    "COORDINATION_ENTRIES",
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
    "CoordinationTrace",
    "MappingName",
    "Physics",
    "Renderer",
    "Shield",
    "ShieldParallelWrapper",
    "ShieldTrial",
    "ShieldWrapper",
    "CoordinationSimulation",
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

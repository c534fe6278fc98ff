"""One arm on a blended path; the agent overrides the feed rate."""

from __future__ import annotations

from armtempo.envs.blend._env import BlendTrackingEnv
from armtempo.envs.blend._observation import BLEND_ENTRIES
from armtempo.envs.blend._options import MAPPINGS, BlendKeywords, BlendOptions, MappingName
from armtempo.envs.blend._simulation import BlendSimulation, BlendTrace
from armtempo.envs.blend._vector_env import BlendTrackingVectorEnv

__all__ = [
    "BlendKeywords",
    "BlendOptions",
    "BLEND_ENTRIES",
    "BlendSimulation",
    "BlendTrace",
    "BlendTrackingEnv",
    "BlendTrackingVectorEnv",
    "MAPPINGS",
    "MappingName",
]

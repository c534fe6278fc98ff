"""One arm follows a pose; the agent sets joint speeds, or the gains of the feedback law."""

from __future__ import annotations

from armtempo.envs.ik._env import FeedbackIKEnv
from armtempo.envs.ik._observation import ik_entries
from armtempo.envs.ik._options import ACTION_MODES, ActionMode, IKKeywords, IKOptions
from armtempo.envs.ik._simulation import IKSimulation, IKTrace
from armtempo.envs.ik._vector_env import FeedbackIKVectorEnv

__all__ = [
    "IKKeywords",
    "IKOptions",
    "ACTION_MODES",
    "ActionMode",
    "FeedbackIKEnv",
    "FeedbackIKVectorEnv",
    "IKSimulation",
    "IKTrace",
    "ik_entries",
]

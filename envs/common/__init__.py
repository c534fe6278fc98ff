"""What environments of every kind share: entries, actions, rewards, random numbers, life cycle."""

from __future__ import annotations

from armtempo.envs.common._actions import TIME_LIMIT, check_late, read_action, read_actions, read_command
from armtempo.envs.common._drawn_cells import DrawnCells, Slots, families_of
from armtempo.envs.common._entries import Entry, action_space, observation_space, observation_table, share
from armtempo.envs.common._lifecycle import Lifecycle
from armtempo.envs.common._options import (
    check_bodies,
    check_flags,
    check_names,
    check_time_limit,
    is_number,
    options_of,
    read_seed,
)
from armtempo.envs.common._random import (
    BEGIN,
    FAMILY,
    LATE,
    LENGTH,
    MASTER_LATE,
    NOISE,
    PHASE,
    SPEED,
    STOPS,
    key_from,
    normal,
    uniform,
)
from armtempo.envs.common._rewards import (
    collision_reward,
    deviation_reward,
    leaving_reward,
    progress_reward,
    time_reward,
)
from armtempo.envs.common._saved import SavedEnv, SavedEnvs
from armtempo.envs.common._single_agent import SingleAgentEnv
from armtempo.envs.common._vector_env import Batch, VectorBase, as_commands, ideal_options, spread
from armtempo.envs.common._vector_parts import (
    Chunks,
    Generators,
    Seeds,
    count_of,
    sums_of,
    with_masks,
)

__all__ = [
    "Batch",
    "Chunks",
    "DrawnCells",
    "Generators",
    "SavedEnv",
    "SavedEnvs",
    "Seeds",
    "Slots",
    "VectorBase",
    "as_commands",
    "families_of",
    "ideal_options",
    "sums_of",
    "with_masks",
    "BEGIN",
    "Entry",
    "FAMILY",
    "LATE",
    "LENGTH",
    "Lifecycle",
    "MASTER_LATE",
    "NOISE",
    "PHASE",
    "SPEED",
    "STOPS",
    "SingleAgentEnv",
    "TIME_LIMIT",
    "action_space",
    "check_late",
    "check_names",
    "check_bodies",
    "check_flags",
    "is_number",
    "options_of",
    "check_time_limit",
    "collision_reward",
    "count_of",
    "deviation_reward",
    "key_from",
    "leaving_reward",
    "normal",
    "observation_space",
    "observation_table",
    "progress_reward",
    "read_action",
    "read_actions",
    "read_command",
    "read_seed",
    "share",
    "spread",
    "time_reward",
    "uniform",
]

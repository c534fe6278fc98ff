"""The world of several arms: compiled episodes, disturbances, the simulation."""

from __future__ import annotations

from armtempo.envs.coordination.world._disturbance import (
    ATTEMPTS,
    DISTURBANCES,
    Disturbance,
    Draws,
    Range,
    as_noise,
    as_range,
    describe,
    draw,
    draw_all,
    draws_of,
    stops_of,
    uncertain_arms,
)
from armtempo.envs.coordination.world._disturbed_motion import disturbed_motion
from armtempo.envs.coordination.world._entries import COORDINATION_ENTRIES, OTHER, OTHERS, OWN, SIZE
from armtempo.envs.coordination.world._kernels import observe, run_periods, scratch_for
from armtempo.envs.coordination.world._simulation import MODES, CoordinationSimulation, CoordinationTrace
from armtempo.envs.coordination.world._world import (
    Episodes,
    World,
    clearance_of,
    episodes_of,
    ideal_world,
    length_of,
    steps_of,
)

__all__ = [
    "ATTEMPTS",
    "DISTURBANCES",
    "Disturbance",
    "Draws",
    "COORDINATION_ENTRIES",
    "CoordinationTrace",
    "Episodes",
    "MODES",
    "OTHER",
    "OTHERS",
    "OWN",
    "Range",
    "SIZE",
    "CoordinationSimulation",
    "World",
    "as_noise",
    "as_range",
    "clearance_of",
    "describe",
    "disturbed_motion",
    "draw",
    "draw_all",
    "draws_of",
    "episodes_of",
    "ideal_world",
    "length_of",
    "observe",
    "run_periods",
    "scratch_for",
    "steps_of",
    "stops_of",
    "uncertain_arms",
]

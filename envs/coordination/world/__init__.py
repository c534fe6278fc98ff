"""The world of several arms: compiled episodes, disturbances, the simulation."""

from __future__ import annotations

from armtempo.envs.coordination.world._disturbance import (
    DISTURBANCES,
    START_ATTEMPTS,
    Disturbance,
    Draws,
    Range,
    as_noise,
    as_range,
    describe,
    draw,
    draw_all,
    make_draws,
    stops_max,
    uncertain_arms,
)
from armtempo.envs.coordination.world._disturbed_motion import disturbed_motion
from armtempo.envs.coordination.world._entries import COORDINATION_ENTRIES, OTHER, OTHERS, OWN, SIZE
from armtempo.envs.coordination.world._keeping_up import check_torque_left, with_auto_reserve
from armtempo.envs.coordination.world._kernels import observe, run_periods, scratch_for
from armtempo.envs.coordination.world._options import (
    ACTION_FORMS,
    MODES,
    OBSERVATION_FORMS,
    ORDER_RULES,
    ActionForm,
    CoordinationKeywords,
    CoordinationOptions,
    ObservationForm,
    OrderRule,
)
from armtempo.envs.coordination.world._simulation import CoordinationSimulation, CoordinationTrace
from armtempo.envs.coordination.world._world import (
    Episodes,
    World,
    check_places,
    clearance_of,
    ideal_world,
    length_of,
    make_episodes,
    steps_of,
)

__all__ = [
    "check_places",
    "check_torque_left",
    "START_ATTEMPTS",
    "DISTURBANCES",
    "Disturbance",
    "Draws",
    "COORDINATION_ENTRIES",
    "CoordinationKeywords",
    "CoordinationOptions",
    "CoordinationTrace",
    "Episodes",
    "ACTION_FORMS",
    "ActionForm",
    "MODES",
    "OBSERVATION_FORMS",
    "ORDER_RULES",
    "ObservationForm",
    "OrderRule",
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
    "make_draws",
    "make_episodes",
    "ideal_world",
    "length_of",
    "observe",
    "run_periods",
    "scratch_for",
    "steps_of",
    "stops_max",
    "uncertain_arms",
    "with_auto_reserve",
]

"""When arms move: bounds, delays, intervals, velocity control, precedence, on charts and planes alone."""

from __future__ import annotations

from armtempo.planners.coordination._arm_orders import arm_orders
from armtempo.planners.coordination._best_responses import prioritised, respond
from armtempo.planners.coordination._chart_refinement import pairs_to_refine
from armtempo.planners.coordination._guard import BrakingGuard
from armtempo.planners.coordination._interval_search import ALL_STAGES, IntervalSearch
from armtempo.planners.coordination._joint_bound import JointBound, joint_bound
from armtempo.planners.coordination._joint_optimum import GAP, optimal
from armtempo.planners.coordination._joint_refinement import Refinement, refine
from armtempo.planners.coordination._makespan_bound import (
    MakespanBound,
    PairBound,
    PriorityClass,
    pair_bound,
)
from armtempo.planners.coordination._order_delays import order_delays
from armtempo.planners.coordination._order_search import OrderSearch, order_tables
from armtempo.planners.coordination._passing_orders import Orders, PassingOrders, PassingRegion
from armtempo.planners.coordination._precedence import Precedence
from armtempo.planners.coordination._rules import check_rules
from armtempo.planners.coordination._start_delays import delayed, offset, one_by_one
from armtempo.planners.coordination._time_windows import pair_is_free
from armtempo.planners.coordination._timing_problem import Motions, TimingProblem, makespan
from armtempo.planners.coordination._vci import VciPlan, VelocityControl, plan_vci

__all__ = [
    "ALL_STAGES",
    "GAP",
    "BrakingGuard",
    "IntervalSearch",
    "JointBound",
    "MakespanBound",
    "Motions",
    "OrderSearch",
    "Orders",
    "PairBound",
    "PassingOrders",
    "PassingRegion",
    "Precedence",
    "PriorityClass",
    "Refinement",
    "TimingProblem",
    "VciPlan",
    "VelocityControl",
    "arm_orders",
    "check_rules",
    "delayed",
    "joint_bound",
    "makespan",
    "offset",
    "one_by_one",
    "optimal",
    "order_delays",
    "order_tables",
    "pair_bound",
    "pair_is_free",
    "pairs_to_refine",
    "plan_vci",
    "prioritised",
    "refine",
    "respond",
]

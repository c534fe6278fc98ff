"""Baselines for blend cells: a profile, a mapping and corners, and who overrides the feed rate.

``line-speed``         the paper's profile (limits along the path only) and mapping (Lee2006 eqs. 13, 15), at full rate
``limit-aware``        the profile that also keeps normal acceleration and the jerk vector, exact mapping, at full rate
``limit-aware-smooth`` the same on corners without a jump of curvature, where it need not stop: quintic blends
``constant``           the line-speed profile at the highest constant rate that keeps all those limits and the arm's
``random``             uniform actions on the line-speed profile
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import final

import numpy as np

from armtempo.agents.policies import Policy, RandomPolicy, to_action
from armtempo.arrays import Floats32
from armtempo.envs import BlendTrackingEnv, MappingName
from armtempo.errors import UnknownNameError
from armtempo.planners import BlendCell
from armtempo.planners.cells import ProfileName, motion_demand

PROFILE_SAMPLES = 16001  # of a profile, for what it asks of the arm
RATE_MARGIN = 1e-6


@final
class ConstantRate:
    """The same override all the way; None: the highest that keeps all limits, of each episode's own path."""

    def __init__(self, rate: float | None = 1.0) -> None:
        self.rate = rate
        self._found: tuple[BlendCell, float] | None = None

    def reset(self, seed: int | None = None) -> None:
        """Nothing to forget."""

    def act(self, observation: Floats32, env: BlendTrackingEnv) -> Floats32:
        """That override."""
        return to_action(self.rate_of(env.simulation.cell))

    def rate_of(self, cell: BlendCell) -> float:
        """That override in a cell."""
        if self.rate is not None:
            return self.rate
        if self._found is None or self._found[0] is not cell:
            self._found = cell, highest_rate(cell)
        return self._found[1]


@dataclass(frozen=True, kw_only=True)
class BlendBaseline:
    """What an episode of a baseline needs: the environment's settings and a policy.

    Attributes:
        profile: Of the environment.
        mapping: Likewise.
        curve: Blends that take the place of the cell's; None: the cell's.
        make: Makes the policy; None: it is a learned one.
    """

    profile: ProfileName
    mapping: MappingName
    curve: str | None
    make: Callable[[], Policy[Floats32, Floats32]] | None


_BASELINES = {
    "line-speed": BlendBaseline(profile="line-speed", mapping="paper", curve=None, make=ConstantRate),
    "limit-aware": BlendBaseline(profile="limit-aware", mapping="exact", curve=None, make=ConstantRate),
    "limit-aware-smooth": BlendBaseline(profile="limit-aware", mapping="exact", curve="quintic", make=ConstantRate),
    "constant": BlendBaseline(
        profile="line-speed", mapping="exact", curve=None, make=lambda: ConstantRate(None)
    ),
    "random": BlendBaseline(profile="line-speed", mapping="exact", curve=None, make=RandomPolicy),
}  # fmt: skip
BLEND_POLICIES = tuple(_BASELINES)


def blend_baseline(name: str) -> BlendBaseline:
    """A baseline by name.

    Raises:
        UnknownNameError: No such policy.
    """
    if name not in _BASELINES:
        raise UnknownNameError("policy", name, BLEND_POLICIES)
    return _BASELINES[name]


def highest_rate(cell: BlendCell) -> float:
    """The highest constant override of the line-speed profile that keeps all limits of the tip and of the arm.

    At the rate f speeds shrink by f, accelerations by f^2, jerks by f^3; torques keep what gravity and friction ask.
    Where even standing asks for too much torque the rate is 0.
    """
    profile = cell.line_speed
    s, v, a, j = profile.at(np.linspace(0.0, profile.duration, PROFILE_SAMPLES))

    def ratio(f: float) -> float:
        return motion_demand(cell, s, f * v, f * f * a, f**3 * j).ratio_max

    if ratio(1.0) <= 1.0:
        return 1.0
    low, high = 0.0, 1.0
    while high - low > RATE_MARGIN:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if ratio(middle) <= 1.0 else (low, middle)
    return low


def planning_time(cell: BlendCell, baseline: BlendBaseline) -> float:
    """Seconds to blend the given path afresh, to find the joints along it and to plan a baseline's profile."""
    began = time.perf_counter()
    cell.variant(curve=baseline.curve).profile(baseline.profile)
    return time.perf_counter() - began

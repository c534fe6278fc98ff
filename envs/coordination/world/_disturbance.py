"""What may go wrong with an arm, drawn anew for every episode: it is late, slow, or stops and goes.

A disturbance works below the agents: whoever commands the arm, it obeys later, less, or not at all for a while.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, fields
from typing import Any, NamedTuple

import numpy as np

from armtempo.arrays import Bools, Floats
from armtempo.envs.common import BEGIN, FAMILY, LATE, LENGTH, MASTER_LATE, PHASE, SPEED, STOPS, is_number, uniform
from armtempo.envs.coordination.world._world import Episodes, World, clearance_of, steps_of
from armtempo.errors import InputError, brief
from armtempo.planners import CoordinationCell
from armtempo.planners.charts import tabulated_clearance
from armtempo.planners.topp import kernels as phase_kernels
from armtempo.robots import njit

Range = tuple[float, float]

MOST_STOPS = 16
START_ATTEMPTS = 32  # at starting places; then all arms start at the start of their paths


@dataclass(frozen=True, kw_only=True, slots=True)
class Disturbance:
    """Ranges (lowest, highest) from which every episode draws, uniformly.

    Attributes:
        late_s: How long the arm stands before it obeys [s].
        speed: The share of ``mu*`` that it takes for the largest speed, above 0, at most 1. In speed mode it so obeys
            that share of its commands; in acceleration mode the highest ``mu_dot`` is the one that leads to that speed.
        stops: How many stops (whole numbers): each begins at an instant drawn from the arm's minimum time. While one
            lasts the arm brakes and stands. It is asked at the beginning of every control period.
        stop_s: How long a stop lasts [s].
        arms: Which arms, each with draws of its own; by their numbers in the cell.

    Raises:
        InputError: A range is empty or outside these limits.
    """

    late_s: Range = (0.0, 0.0)
    speed: Range = (1.0, 1.0)
    stops: tuple[int, int] = (0, 0)
    stop_s: Range = (0.0, 0.0)
    arms: tuple[int, ...] = (0,)

    def __post_init__(self) -> None:
        highest = {"late_s": math.inf, "speed": 1.0, "stops": MOST_STOPS, "stop_s": math.inf}
        for name, most in highest.items():
            value = getattr(self, name)
            numbers = isinstance(value, tuple | list) and len(value) == 2 and all(is_number(end) for end in value)
            low, high = value if numbers else (math.nan, math.nan)
            if not (0.0 <= low <= high <= most and math.isfinite(high)):
                raise InputError(
                    f"disturbance {name} must be (lowest, highest) between 0 and {most:g}, got {brief(value)}",
                    remedy="give two finite numbers, the lower one first",
                )
        if self.speed[0] <= 0.0:
            raise InputError(
                f"disturbance speed is {brief(self.speed)}", remedy="give a share above 0: the arm must arrive"
            )
        if any(int(end) != end for end in self.stops):
            raise InputError(f"disturbance stops is {brief(self.stops)}", remedy="give whole numbers")
        whole = isinstance(self.arms, tuple | list) and all(is_number(arm) and int(arm) == arm for arm in self.arms)
        if not whole or not self.arms or min(self.arms) < 0:
            raise InputError(f"disturbance arms is {brief(self.arms)}", remedy="give numbers of arms, 0 is the first")


_FAMILIES = {  # times are shares of the arm's minimum time
    "late": Disturbance(late_s=(0.0, 0.5)),
    "slow": Disturbance(speed=(0.4, 1.0)),
    "stop-and-go": Disturbance(stops=(1, 3), stop_s=(0.1, 0.5)),
}
_ALL = "all-"
_OF_ONE_ARM = (*_FAMILIES, "any")
DISTURBANCES = (*_OF_ONE_ARM, *(_ALL + name for name in _OF_ONE_ARM))
"""Named families for the first arm, in shares of its minimum time T: ``late`` by up to 0.5 T; ``slow``, taking 0.4 to
1 of ``mu*`` for the largest speed; ``stop-and-go``, 1 to 3 stops of 0.1 to 0.5 T; ``any`` draws one of them for every
episode. ``all-late`` and so on: for all arms, each with draws of its own."""


def disturbs_first_alone(disturbance: str | Disturbance | None) -> bool:
    """Whether no arm but the first is disturbed."""
    if isinstance(disturbance, Disturbance):
        return set(disturbance.arms) == {0}
    return disturbance is None or not disturbance.startswith(_ALL)


class Draws(NamedTuple):
    """What episodes of a cell are drawn from, for compiled loops."""

    families: Floats  # (F, 9) lowest and highest of late_s, speed, stops, stop_s; 1: times in units of the minimum time
    arms: Bools  # (A,) disturbed ones
    fastest: Floats  # (A,) minimum times [s]
    master_late: Floats  # (2,) range [s] of what the first arm is late in any case
    phase: Floats  # (2,) range of the share of the path where an arm starts
    apart: float  # smallest clearance of arms that start inside their paths [m]


def as_range(value: float | Range, name: str, highest: float) -> Range:
    """A number or (lowest, highest) as a range.

    Raises:
        InputError: It is neither, or not between 0 and ``highest``.
    """
    ends = value if isinstance(value, tuple | list) else (value, value)
    numbers = len(ends) == 2 and all(is_number(end) for end in ends)
    low, high = (float(ends[0]), float(ends[1])) if numbers else (math.nan, math.nan)
    if not (0.0 <= low <= high <= highest and math.isfinite(high)):
        limits = "" if highest == math.inf else f", at most {highest:g}"
        raise InputError(
            f"{name} must be a number or a range, 0 or more{limits}, got {brief(value)}", remedy="give 0 or more"
        )
    return low, high


def as_noise(value: float) -> float:
    """``observation_noise`` as a number, 0 or more.

    Raises:
        InputError: It is not.
    """
    if not (is_number(value) and value >= 0.0):
        raise InputError(
            f"observation_noise must be a finite number, 0 or more, got {brief(value)}", remedy="give 0 or more"
        )
    return float(value)


def make_draws(
    cell: CoordinationCell,
    disturbance: str | Disturbance | None = None,
    start_phase: float | Range = 0.0,
    master_late_s: float | Range = 0.0,
) -> Draws:
    """What episodes of a cell are drawn from, by the options of that name.

    Raises:
        InputError: The cell has no such arm.
    """
    if isinstance(disturbance, str):
        name = disturbance.removeprefix(_ALL)
        chosen, relative = list(_FAMILIES.values()) if name == "any" else [_FAMILIES[name]], 1.0
        disturbed: Iterable[int] = (0,) if name == disturbance else range(len(cell.arms))
    else:
        chosen, relative = [disturbance or Disturbance()], 0.0
        disturbed = () if disturbance is None else disturbance.arms
    arms = np.zeros(len(cell.arms), dtype=np.bool_)
    for arm in disturbed:
        if arm >= len(cell.arms):
            raise InputError(
                f"the disturbance is for arm {arm}, cell {brief(cell.name)} has {len(cell.arms)} arms",
                remedy="give numbers of arms, 0 is the first",
            )
        arms[arm] = True
    ranges = [[float(end) for field in fields(one)[:4] for end in getattr(one, field.name)] for one in chosen]
    return Draws(
        families=np.array([[*row, relative] for row in ranges]),
        arms=arms,
        fastest=np.array([motion.duration for motion in cell.fastest]),
        master_late=np.array(as_range(master_late_s, "master_late_s", math.inf)),
        phase=np.array(as_range(start_phase, "start_phase", 0.999)),
        apart=cell.planned_clearance,
    )


def stops_max(draws: Draws) -> int:
    """The most stops that an arm can get."""
    return int(draws.families[:, 5].max()) if draws.arms.any() else 0


def describe(episodes: Episodes, e: int, lengths: Floats) -> dict[str, Any]:
    """What was drawn for an episode that has just begun, for its info."""
    return {
        "late_s": episodes.late[e].tolist(),
        "speed": episodes.speed[e].tolist(),
        "stops_s": [[stop.tolist() for stop in arm if stop[1] > stop[0]] for arm in episodes.stops[e]],
        "start_phase": (episodes.lam[e] / lengths).tolist(),
    }


def uncertain_arms(episodes: Episodes) -> Bools:
    """(E, A) arms that may do less than they are told."""
    return np.asarray((episodes.late > 0.0) | (episodes.speed < 1.0) | (episodes.stops[..., 1] > 0.0).any(axis=2))


@njit
def _between(low: float, high: float, share: float) -> float:
    return low + (high - low) * share


@njit
def _may_start(world: World, draws: Draws, lam: Floats) -> bool:
    """Whether all can hold still where they are, and are clear of each other."""
    for i in range(lam.shape[0]):
        steps = steps_of(world, i)
        k = phase_kernels.interval_at(steps, lam[i])
        low, low_next = steps[k, phase_kernels.EDGE_LOW], steps[k, phase_kernels.EDGE_LOW_NEXT]
        if max(low, low_next, steps[k + 1, phase_kernels.EDGE_LOW]) > 0.0:
            return False
    for p in range(world.clearance.shape[0]):
        i, j = world.clearance[p, 0], world.clearance[p, 1]
        if not tabulated_clearance(clearance_of(world, p), lam[i], lam[j]) >= draws.apart:
            return False
    return True


@njit
def draw(world: World, draws: Draws, episodes: Episodes, e: int, late: float, first: int) -> int:
    """Begin an episode, its key and number given; ``late`` [s]: of the first arm, drawn if negative.

    ``first``: at which attempt to begin with starting places; returns the one that was taken, START_ATTEMPTS for the
    starts of the paths.
    """
    key, number = episodes.key[e], episodes.number[e]
    arms = episodes.lam.shape[1]
    episodes.lam[e], episodes.mu[e], episodes.arrival[e] = 0.0, 0.0, np.nan
    episodes.ticks[e], episodes.steps[e], episodes.violated[e], episodes.smallest[e] = 0, 0, False, np.inf
    episodes.late[e], episodes.speed[e], episodes.stops[e] = 0.0, 1.0, 0.0
    family = draws.families[int(uniform(key, number, 0, FAMILY, 0) * draws.families.shape[0])]
    for i in range(arms):
        if draws.arms[i]:
            unit = draws.fastest[i] if family[8] > 0.0 else 1.0
            episodes.late[e, i] = unit * _between(family[0], family[1], uniform(key, number, 0, LATE, i))
            episodes.speed[e, i] = _between(family[2], family[3], uniform(key, number, 0, SPEED, i))
            count = int(_between(family[4], family[5] + 1.0, uniform(key, number, 0, STOPS, i)))
            for s in range(min(count, episodes.stops.shape[2])):
                begin = draws.fastest[i] * uniform(key, number, s, BEGIN, i)
                length = unit * _between(family[6], family[7], uniform(key, number, s, LENGTH, i))
                episodes.stops[e, i, s, 0], episodes.stops[e, i, s, 1] = begin, begin + length
    if late < 0.0:
        late = _between(draws.master_late[0], draws.master_late[1], uniform(key, number, 0, MASTER_LATE, 0))
    episodes.late[e, 0] += late
    taken = START_ATTEMPTS
    if draws.phase[1] > 0.0:
        for attempt in range(first, START_ATTEMPTS):
            for i in range(arms):
                share = _between(draws.phase[0], draws.phase[1], uniform(key, number, attempt, PHASE, i))
                steps = steps_of(world, i)
                episodes.lam[e, i] = share * steps[steps.shape[0] - 1, phase_kernels.STATION]
            if _may_start(world, draws, episodes.lam[e]):
                taken = attempt
                break
            episodes.lam[e] = 0.0
    for p in range(world.clearance.shape[0]):
        i, j = world.clearance[p, 0], world.clearance[p, 1]
        found = tabulated_clearance(clearance_of(world, p), episodes.lam[e, i], episodes.lam[e, j])
        episodes.smallest[e] = min(episodes.smallest[e], found)
    episodes.rewarded[e], episodes.charged[e] = episodes.lam[e], 0.0
    return taken


@njit
def draw_all(world: World, draws: Draws, episodes: Episodes, active: Bools, late: float) -> None:
    """``draw`` for all active episodes."""
    for e in range(active.shape[0]):
        if active[e]:
            draw(world, draws, episodes, e, late, 0)

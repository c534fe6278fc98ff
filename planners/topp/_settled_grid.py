"""Is a grid fine enough: the minimum time from rest to rest, and what it is on every other station."""

from __future__ import annotations

import math

import numpy as np

from armtempo.planners.topp._controllable_sets import SET_INTERVALS_MAX, controllable_sets
from armtempo.planners.topp._greedy import greedy_profile
from armtempo.planners.topp._rows import Rows

__all__ = ["SETTLED_SHARE", "change_by_halving", "is_settled", "rest_to_rest_time"]

SETTLED_SHARE = 1e-3  # of the minimum time: what halving a grid may have changed


def rest_to_rest_time(rows: Rows) -> float:
    """The minimum time [s] from rest, or the slowest start there is, to rest; nan: there is none."""
    count = len(rows.station)
    sets, counts, x = np.zeros((count, SET_INTERVALS_MAX, 2)), np.zeros(count, dtype=np.int64), np.empty(count)
    if controllable_sets(rows, 0.0, False, np.empty(0), sets, counts) >= 0:
        return math.nan
    if greedy_profile(rows, sets, counts, sets[0, 0, 0], False, x) >= 0:
        return math.nan
    mu, way = np.sqrt(x), np.diff(rows.station)
    with np.errstate(divide="ignore", invalid="ignore"):
        return float(np.where(way > 0.0, 2.0 * way / (mu[1:] + mu[:-1]), 0.0).sum())


def change_by_halving(rows: Rows) -> float:
    """By what share of the minimum time every other station would do worse; nan: there is no such time."""
    time, coarser = rest_to_rest_time(rows), rest_to_rest_time(_thinned(rows))
    return abs(coarser - time) / time if time > 0.0 else math.nan


def is_settled(rows: Rows) -> bool:
    """Would every other station do, to 0.1 % of the minimum time? Also if there is no such time to tell."""
    return not change_by_halving(rows) > SETTLED_SHARE


def _thinned(rows: Rows) -> Rows:
    """Every other station, and all that are there twice."""
    twice = np.flatnonzero(np.diff(rows.station) == 0.0)
    kept = np.ones(len(rows.station), dtype=np.bool_)
    for first, last in zip(np.append(0, twice + 1), np.append(twice, len(kept) - 1), strict=True):
        kept[first + 1 : last : 2] = False
    return Rows(*(column[kept] for column in rows))

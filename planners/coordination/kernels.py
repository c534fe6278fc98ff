"""Compiled functions that other rooms call. Not public: they change without notice."""

from __future__ import annotations

from armtempo.planners.coordination._guard import stays_behind
from armtempo.planners.coordination._order_kernels import (
    LEADING,
    NODES,
    WAITING,
    OrderTables,
    arrivals,
    fill_lags,
    fill_times,
    price,
    search,
    settle,
    time_to_go,
)

__all__ = [
    "LEADING",
    "NODES",
    "WAITING",
    "OrderTables",
    "arrivals",
    "fill_lags",
    "fill_times",
    "price",
    "search",
    "settle",
    "stays_behind",
    "time_to_go",
]

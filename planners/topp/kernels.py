"""Compiled loops that other rooms call, and the columns of ``Edges.steps``. Not public: they change without notice."""

from __future__ import annotations

from armtempo.planners.topp._advance import advance, bounds_in, edge_speed, interval_at, upper_edge
from armtempo.planners.topp._rows import (
    COLUMNS_PER_ROW,
    EDGE_HIGH,
    EDGE_LOW,
    EDGE_LOW_NEXT,
    STATION,
    STEP_HEADER_COLUMNS,
    Edges,
    Rows,
)

__all__ = [
    "COLUMNS_PER_ROW",
    "EDGE_HIGH",
    "EDGE_LOW",
    "EDGE_LOW_NEXT",
    "STATION",
    "STEP_HEADER_COLUMNS",
    "Edges",
    "Rows",
    "advance",
    "bounds_in",
    "edge_speed",
    "interval_at",
    "upper_edge",
]

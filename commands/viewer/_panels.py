"""What the charts of a page show; ``page.js`` draws them. Lines name the columns of a run that they are of."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

from armtempo.arrays import Floats
from armtempo.commands.viewer._packing import packed

__all__ = ["Across", "Band", "Curve", "Line", "Mark", "Panel", "panel_json"]


@dataclass(frozen=True, kw_only=True)
class Line:
    """A line, in the colour of an arm, of a joint, or else of its policy.

    Attributes:
        column: Of the run; index: in its row.
        label: In the legend; empty: not there.
        arm, joint: Whose colour it has.
        scale: From the column's unit to the panel's.
        steps: A value holds from the row before on, as torques do.
    """

    column: str
    index: int = 0
    label: str = ""
    arm: int | None = None
    joint: int | None = None
    scale: float = 1.0
    dashed: bool = False
    steps: bool = False


@dataclass(frozen=True, kw_only=True)
class Band:
    """Heights that are shaded, from ``low`` to ``high`` (None: to the top); ``bad``: values there are told in red."""

    low: float
    high: float | None
    label: str = ""
    bad: bool = True


@dataclass(frozen=True, kw_only=True)
class Mark:
    """A limit across the panel."""

    at: float
    label: str = ""


@dataclass(frozen=True, kw_only=True)
class Curve:
    """Points (K, 2) that do not move; above a ``limit`` nothing is allowed."""

    points: Floats
    label: str
    limit: bool = False


@dataclass(frozen=True, kw_only=True)
class Across:
    """The axis to the right of a panel that is not over time."""

    column: str
    index: int
    label: str
    low: float
    high: float


@dataclass(frozen=True, kw_only=True)
class Panel:
    """A chart.

    Attributes:
        title: Above it.
        label: Of the axis upwards; unit: of the value told beside the title, with so many ``digits``.
        lines: What is drawn.
        low, high: Of the axis upwards; None: as the lines need it.
        across: What is to the right; None: time.
        regions: (K, 4) rectangles x0, x1, y0, y1 that are forbidden.
        curves: Below the lines.
        bands, marks: Below the lines, over the whole width.
        others: Whether policies that are not on show are drawn, too, pale.
        capped: Those do not stretch the axis.
        largest: The largest of all lines' values is told, not the first's.
        equal: One scale for both axes.
        log: The axis upwards is logarithmic, from ``floor`` on.
    """

    title: str
    label: str
    lines: tuple[Line, ...]
    unit: str = ""
    digits: int = 3
    low: float | None = None
    high: float | None = None
    across: Across | None = None
    regions: Floats | None = None
    curves: tuple[Curve, ...] = ()
    bands: tuple[Band, ...] = ()
    marks: tuple[Mark, ...] = ()
    others: bool = False
    capped: bool = False
    largest: bool = False
    equal: bool = False
    log: bool = False
    floor: float = 1e-12


def panel_json(panel: Panel) -> dict[str, Any]:
    """A panel as the page reads it."""
    told = {name: value for name, value in vars(panel).items() if name not in ("across", "regions", "curves")}
    return {
        **{name: [asdict(one) for one in value] if isinstance(value, tuple) else value for name, value in told.items()},
        "type": "time" if panel.across is None else "plane",
        "x": None if panel.across is None else asdict(panel.across),
        "regions": None if panel.regions is None else packed(panel.regions),
        "curves": [curve_json(curve) for curve in panel.curves],
    }


def curve_json(curve: Curve) -> dict[str, Any]:
    """A curve as the page reads it."""
    return {"points": packed(curve.points), "label": curve.label, "limit": curve.limit}

"""The look of all figures: one colour per policy and per arm (Okabe-Ito, safe for the colour-blind), PNG at 150 dpi."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from pathlib import Path
from typing import Any, ParamSpec, TypeVar

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke
from matplotlib.transforms import Bbox

from armtempo.files import whole_file

DPI = 150
HAIR = 0.02  # [inches] what sticks out by less is not seen
MARGIN = 0.06  # [inches] around what sticks out
INK, MUTED, FAINT = "#222222", "#6B6B6B", "#D9D9D9"
FORBIDDEN = "#E9D3D3"  # collision region, too small a clearance
FORBIDDEN_EDGE = "#B26B6B"  # undecided cells, d_min

POLICY_COLORS = {
    "vci": "#D55E00",
    "delay": "#0072B2",
    "optimal": "#009E73",
    "sequential": "#7A7A7A",
    "constant-speed": "#CC79A7",
    "constant-acceleration": "#E69F00",
    "phase-plane": "#56B4E9",
    "offset": "#8C6D31",
    "interval": "#7A4B9E",
    "random": "#3B3B3B",
    "line-speed": "#0072B2",
    "limit-aware": "#D55E00",
    "limit-aware-smooth": "#009E73",
    "constant": "#CC79A7",
    "feedback": "#0072B2",
    "feedback-ff": "#D55E00",
    "feedback-damped": "#009E73",
    "newton": "#CC79A7",
    "law": "#56B4E9",
    "law-scheduled": "#E69F00",
}
ARM_COLORS = ("#24476B", "#D55E00", "#009E73", "#CC79A7", "#56B4E9", "#E69F00")
HALO = (withStroke(linewidth=2.5, foreground="white"),)

STYLE: Any = {  # rcParams; their type is a literal of all names
    "font.size": 9.5,
    "axes.titlesize": 10.5,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.labelcolor": INK,
    "axes.edgecolor": MUTED,
    "axes.linewidth": 0.8,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "#ECECEC",
    "grid.linewidth": 0.7,
    "axes.axisbelow": True,
    "xtick.color": MUTED,
    "ytick.color": MUTED,
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "text.color": INK,
    "legend.frameon": False,
    "legend.handlelength": 1.6,
    "lines.linewidth": 1.6,
    "lines.solid_capstyle": "round",
    "savefig.dpi": DPI,
}

Arguments = ParamSpec("Arguments")
Result = TypeVar("Result")


def styled(draw: Callable[Arguments, Result]) -> Callable[Arguments, Result]:
    """Draw under this module's style without touching the user's."""

    @wraps(draw)
    def draw_in_style(*args: Arguments.args, **kwargs: Arguments.kwargs) -> Result:
        with mpl.rc_context(STYLE):
            return draw(*args, **kwargs)

    return draw_in_style


def new_figure(width: float, height: float) -> Figure:
    """An empty figure of so many inches, without pyplot and its global state."""
    figure = Figure(figsize=(width, height), dpi=DPI, layout="constrained", facecolor="white")
    FigureCanvasAgg(figure)
    return figure


@styled
def write_png(figure: Figure, path: Path) -> None:
    """Write a figure as PNG, whole or not at all: a little larger where something would stick out of it."""
    figure.draw_without_rendering()
    seen: Any = figure.get_tightbbox()
    whole = figure.bbox_inches if seen is None else Bbox.union([figure.bbox_inches, seen])
    sticks_out = bool(np.abs(np.subtract(whole.extents, figure.bbox_inches.extents)).max() > HAIR)
    with whole_file(path) as temporary:
        figure.savefig(temporary, format="png", dpi=DPI, bbox_inches=whole.padded(MARGIN) if sticks_out else None)


def policy_color(name: str) -> str:
    """The colour of a policy or method; black for one that is not ours."""
    return POLICY_COLORS.get(name, INK)


def policy_line(name: str, emphasised: str) -> dict[str, Any]:
    """Line style of a policy: the emphasised one stands out, ``optimal`` is dashed as it often lies on ``delay``."""
    strong = name == emphasised
    return {
        "color": policy_color(name),
        "linewidth": 2.6 if strong else 1.4,
        "linestyle": {"optimal": (0, (4, 2)), "random": (0, (1, 1.4))}.get(name, "-"),
        "zorder": 5.0 if strong else 4.0 if name == "optimal" else 3.0,
    }


def arm_color(i: int) -> str:
    """The colour of arm ``i``."""
    return ARM_COLORS[i % len(ARM_COLORS)]


def note(axes: Axes, x: float, y: float, text: str, *, data: bool = False, **options: Any) -> None:
    """A word in the picture, with a white halo; in axes coordinates, or in the data's."""
    transform = axes.transData if data else axes.transAxes
    settings: dict[str, Any] = {"fontsize": 9.0, "path_effects": HALO, "zorder": 10.0, "transform": transform}
    axes.text(x, y, text, **settings | options)

"""Pages that show episodes: one HTML file with arms in space and charts under one clock.

>>> import armtempo
>>> from armtempo.agents import evaluate
>>> from armtempo.commands.viewer import write_view
>>> write_view(evaluate(armtempo.load_cell("lee1991"), ["delay", "vci"]), "lee1991.html")  # doctest: +SKIP
"""

from __future__ import annotations

from armtempo.commands.viewer._kind_view import KindView, Told
from armtempo.commands.viewer._page import VIEWS, page_data, usual_policy, view_page, write_view
from armtempo.commands.viewer._panels import Across, Band, Curve, Line, Mark, Panel
from armtempo.commands.viewer._server import LivePage, serve

__all__ = [
    "Across",
    "Band",
    "Curve",
    "KindView",
    "Line",
    "LivePage",
    "Mark",
    "Panel",
    "Told",
    "VIEWS",
    "page_data",
    "serve",
    "usual_policy",
    "view_page",
    "write_view",
]

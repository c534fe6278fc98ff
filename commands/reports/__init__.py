"""What is told of an evaluation, by kind of cell."""

from __future__ import annotations

from typing import Any

from armtempo.commands.reports._blend import BLEND_REPORT
from armtempo.commands.reports._coordination import COORDINATION_REPORT
from armtempo.commands.reports._ik import IK_REPORT, gain_warning, gain_x_period
from armtempo.commands.reports._report import Report, labelled, title_of

__all__ = ["REPORTS", "Report", "gain_warning", "gain_x_period", "labelled", "title_of"]

REPORTS: dict[str, Report[Any]] = {"coordination": COORDINATION_REPORT, "blend": BLEND_REPORT, "ik": IK_REPORT}
"""By the ``kind`` of a cell's file."""

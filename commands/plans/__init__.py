"""Plans of a cell by several methods, by kind: computed, told, exported and drawn by one way for all."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from armtempo.commands.plans._blend import BlendPlans
from armtempo.commands.plans._coordination import CoordinationPlans
from armtempo.commands.plans._export import export_form, export_plans
from armtempo.commands.plans._ik import IKPlans
from armtempo.commands.plans._plans import CellPlans

__all__ = ["PLANS", "CellPlans", "export_form", "export_plans"]

PLANS: Mapping[str, type[CellPlans[Any, Any]]] = {"coordination": CoordinationPlans, "blend": BlendPlans, "ik": IKPlans}
"""By kind of cell."""

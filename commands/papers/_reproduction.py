"""A paper beside ours: its values and figures."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    from matplotlib.figure import Figure


class Quantity(NamedTuple):
    """One value of a paper beside ours."""

    section: str
    quantity: str
    unit: str
    paper: float | None
    ours: float
    digits: int = 4
    note: str = ""
    significant: bool = False  # digits count from the first that is not zero

    def to_dict(self) -> dict[str, Any]:
        """As JSON holds it; the note only where there is one."""
        entry: dict[str, Any] = {"quantity": self.quantity, "unit": self.unit, "paper": self.paper, "ours": self.ours}
        return {**entry, "note": self.note} if self.note else entry


class Reproduction(NamedTuple):
    """A paper: its authors and year, every value beside ours, its figures by file name."""

    source: str
    quantities: Sequence[Quantity]
    figures: Mapping[str, Figure]
    reference: str = "paper"  # head of the column beside ours
    caption: str = "– : the paper prints no number"

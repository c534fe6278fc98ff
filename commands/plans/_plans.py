"""What plans of a cell are, whatever its kind."""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, ClassVar, Generic, Literal, TypeVar

from armtempo.commands.console import Output
from armtempo.errors import InfeasibleError, InputError, PathError, UnknownNameError
from armtempo.planners.cells import CellBase
from armtempo.planners.exports import RobotMotion
from armtempo.planners.topp import JointTrajectory

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from rich.table import Table

CellT = TypeVar("CellT", bound=CellBase[Any])
PlanT = TypeVar("PlanT")
Orders = Literal["best", "file", "all"]


class CellPlans(ABC, Generic[CellT, PlanT]):
    """The plans of a cell by several methods; a kind says what its plans are, and how they are told and drawn.

    Args:
        cell: The cell.
        methods: Names out of ``METHODS``; none: all.
        output: For progress bars.
        control_period: Step of velocity control [s], in the kinds that have it; None: the cell's.
        orders: Of the arms, in the kinds of several: the best, that of the file, or all, each a plan of its own.
        smooth: Whether motions keep jerk limits, in the kinds that have such.

    Attributes:
        plans: By method.
        refusals: Why the other methods have none.
        seconds: Taken by each method.

    Raises:
        UnknownNameError: No such method.
        InputError: A control period where there is no velocity control, or smooth where there is no such choice.
        InfeasibleError: No method has a plan (that of the last one asked); or PathError, likewise.
    """

    METHODS: ClassVar[tuple[str, ...]]
    SHOWN: ClassVar[str | None] = None
    """The method that figures show in detail; None: they show all alike."""
    HAS_CONTROL_PERIOD: ClassVar[bool] = False
    """Whether a method of velocity control is among them."""
    HAS_SMOOTH: ClassVar[bool] = False
    """Whether plans can be asked to keep jerk limits."""

    def __init__(
        self,
        cell: CellT,
        methods: Sequence[str],
        output: Output,
        *,
        control_period: float | None = None,
        orders: Orders = "best",
        smooth: bool = False,
    ) -> None:
        self.cell, self.control_period, self.orders, self.smooth = cell, control_period, orders, smooth
        if smooth and not self.HAS_SMOOTH:
            raise InputError(
                f"--smooth is for cells of several arms, and {cell.name} is of kind {cell.config.kind}",
                remedy="leave it out",
            )
        if control_period is not None and not self.HAS_CONTROL_PERIOD:
            raise InputError(
                f"--control-period is for cells of several arms, and {cell.name} is of kind {cell.config.kind}",
                remedy="leave it out",
            )
        for name in methods:
            if name not in self.METHODS:
                raise UnknownNameError("method", name, self.METHODS)
        self.plans: dict[str, PlanT] = {}
        self.refusals: dict[str, str] = {}
        self.seconds: dict[str, float] = {}
        self._plan(self.named(tuple(dict.fromkeys(methods)) or self.METHODS), output)

    def _plan(self, methods: Sequence[str], output: Output) -> None:
        with output.progress("Planning", len(methods)) as (progress, task):
            self.prepare(lambda words: progress.update(task, description=words))
            for k, method in enumerate(methods):
                progress.update(task, description=f"Planning {method}", completed=k)
                began = time.perf_counter()
                try:
                    self.plans[method] = self.plan(method)
                except (InfeasibleError, PathError) as refusal:
                    self.refusals[method] = str(refusal)
                    if len(self.refusals) == len(methods):
                        raise
                self.seconds[method] = time.perf_counter() - began

    def named(self, methods: Sequence[str]) -> Sequence[str]:
        """Names of the plans by these methods."""
        return methods

    def prepare(self, tell: Callable[[str], object]) -> None:
        """Work out what all methods need, so that none of them is charged for it; ``tell`` what is going on."""

    @abstractmethod
    def plan(self, method: str) -> PlanT:
        """One plan, by its name (see ``named``).

        Raises:
            InfeasibleError: There is none; or PathError.
        """

    @abstractmethod
    def facts(self) -> dict[str, Any]:
        """What is so of the cell, whatever the method; units in the keys."""

    @abstractmethod
    def entries(self) -> dict[str, dict[str, Any]]:
        """The figures of every plan, by method; units in the keys."""

    @abstractmethod
    def tables(self, entries: Mapping[str, Mapping[str, Any]]) -> list[Table]:
        """The same for a reader."""

    @abstractmethod
    def motions(self, period: float | None) -> Iterator[tuple[str, JointTrajectory]]:
        """The motion of every arm by every method, with a name for its file.

        Args:
            period: Time between the rows [s]; None: what suits the kind.

        Raises:
            InputError: The motion cannot be sampled so.
        """

    def robot_motion(self, name: str, rate_hz: float) -> RobotMotion:
        """What all arms do by a method, on one time base, for the controllers of robots.

        Raises:
            InputError: The kind has no motions of joints, or this one cannot be sampled so.
        """
        kind = self.cell.config.kind
        raise InputError(f"cells of kind {kind} have no motions of joints", remedy="export plans of another kind")

    @abstractmethod
    def figures(self, method: str) -> dict[str, Figure]:
        """Figures by file name, ``method`` in detail where the kind shows one so (``SHOWN``)."""

"""What a kind of cell brings to the evaluation of policies: who acts in it, and what is measured."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields
from typing import Any, Protocol, TypeVar

from armtempo.errors import InputError, UnknownNameError
from armtempo.planners.cells import CellBase

CellT = TypeVar("CellT", bound=CellBase[Any])
CellT_contra = TypeVar("CellT_contra", bound=CellBase[Any], contravariant=True)
OptionsT = TypeVar("OptionsT")
RunT = TypeVar("RunT")
RunT_co = TypeVar("RunT_co", covariant=True)
ResultT = TypeVar("ResultT")


class Runner(Protocol[RunT_co]):
    """A policy in an environment of its own."""

    @property
    def env(self) -> Any:
        """Where it acts: Gymnasium or PettingZoo."""

    @property
    def policy(self) -> Any:
        """Who acts."""

    def run(self, seed: int, on_step: Callable[[], None] | None = None) -> RunT_co:
        """One episode to its end; ``on_step`` is called when it begins, and after every decision."""

    def close(self) -> None:
        """Close the environment."""


class Kind(Protocol[CellT_contra, OptionsT, RunT, ResultT]):
    """One kind of cell, as evaluations see it; ``KINDS`` lists them by the ``kind`` of a cell's file.

    Attributes:
        name: Of the kind.
        options_type: The record of what can be asked of episodes.
        result_type: The dataclass of ``figure`` fields that is measured.
        settled: Options that every policy brings itself.
        always_told: Options that JSON tells even where nobody asked for them.
        may_refuse: Whether its policies may have no plan in a cell.
        policies: The baselines' names.
    """

    name: str
    options_type: type[OptionsT]
    result_type: type[ResultT]
    settled: tuple[str, ...] = ()
    always_told: tuple[str, ...] = ()
    may_refuse: bool = False
    policies: tuple[str, ...]

    def open(
        self,
        cell: CellT_contra,
        policy: str,
        options: OptionsT,
        *,
        before: Runner[RunT] | None = None,
    ) -> Runner[RunT]:
        """An environment that records, and who acts in it.

        Args:
            cell: Where.
            policy: A baseline or a learned agent.
            options: Of the episodes.
            before: A runner of the same cell and options whose work is done: its environment may be taken over.

        Raises:
            InfeasibleError: It has no plan in this cell.
            InputError: A learned agent that is for something else, or whose file is damaged.
        """
        ...

    def usual_policies(self, options: OptionsT) -> Sequence[str]:
        """The baselines that are run where none is named."""
        return self.policies

    def measure(self, cell: CellT_contra, runs: Sequence[RunT], seed: int) -> ResultT:
        """The figures of a policy over its episodes; ``seed`` is that of the bootstrap."""
        ...

    def head(self, cell: CellT_contra) -> Mapping[str, object]:
        """What holds for every policy: limits and bounds, units in the keys."""
        ...

    def compare(
        self, cell: CellT_contra, options: OptionsT, results: Mapping[str, ResultT], *, episodes: int, seed: int
    ) -> tuple[Mapping[str, ResultT], Mapping[str, object]]:
        """The results with what is known of each only beside the others, and more facts for the head."""
        return results, {}


def option_names(kind: Kind[Any, Any, Any, Any]) -> list[str]:
    """What can be asked of an evaluation in a cell of this kind."""
    return [one.name for one in fields(kind.options_type) if one.name not in kind.settled]


def keywords_of(options: Any) -> dict[str, Any]:
    """A record of options as keywords of environments."""
    return {one.name: getattr(options, one.name) for one in fields(options)}


def options_for(kind: Kind[Any, OptionsT, Any, Any], options: OptionsT | None, keywords: Mapping[str, Any]) -> OptionsT:
    """The options that a record, or the defaults, and keywords mean.

    Raises:
        UnknownNameError: A keyword that cells of this kind do not have, or that policies bring themselves.
        InputError: A value that an episode cannot have, or the record of another kind.
    """
    if options is not None and not isinstance(options, kind.options_type):
        raise InputError(
            f"options are {type(options).__name__}, and the cell is of kind {kind.name}",
            remedy=f"give {kind.options_type.__name__}, or keywords",
        )
    known = option_names(kind)
    given = {} if options is None else asked_options(options)
    for name in (*keywords, *given):
        if name not in known:
            raise UnknownNameError(f"option of evaluations in {kind.name} cells", name, known)
    return kind.options_type(**(given | dict(keywords)))


def asked_options(options: Any) -> dict[str, Any]:
    """The options of a record that are not as they stand without being asked for."""
    usual = type(options)()
    return {name: value for name, value in keywords_of(options).items() if value != getattr(usual, name)}

"""What is told of an evaluation beside its table; each kind of cell has its own."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from armtempo.commands.console import policy_labels

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from armtempo.agents import Evaluation

EvaluationT = TypeVar("EvaluationT")


def nobody(evaluation: object) -> Collection[str]:
    """No policy."""
    return ()


@dataclass(frozen=True, kw_only=True)
class Report(Generic[EvaluationT]):
    """What is told of an evaluation beside its table.

    Attributes:
        title_suffix: What was asked of the episodes, for the title.
        caption: Below the table: limits and bounds, and what heads mean.
        summary_sentence: What the table says.
        figures: Pictures by file name.
        best: Policies whose rows stand out.
    """

    title_suffix: Callable[[EvaluationT], str]
    caption: Callable[[EvaluationT], str]
    summary_sentence: Callable[[EvaluationT], str]
    figures: Callable[[EvaluationT], dict[str, Figure]]
    best: Callable[[EvaluationT], Collection[str]] = nobody


def labelled(evaluation: Evaluation[Any, Any, Any]) -> Evaluation[Any, Any, Any]:
    """The same with short names for learned agents: for tables and pictures; files keep the whole ones."""
    labels = policy_labels([*evaluation.results, *(evaluation.refused or ())])
    return replace(
        evaluation,
        results={labels[name]: result for name, result in evaluation.results.items()},
        refused=evaluation.refused and {labels[name]: why for name, why in evaluation.refused.items()},
        facts={
            name: labels.get(value, value) if isinstance(value, str) else value
            for name, value in evaluation.facts.items()
        },
    )


def title_of(evaluation: Evaluation[Any, Any, Any], suffix: str) -> str:
    """The title of an evaluation's table: where, how, and what was asked."""
    cell = evaluation.cell
    return (
        f"{cell.name} in simulation ({evaluation.facts['physics']}, tick {1e3 * cell.physics_tick:g} ms, "
        f"decision every {1e3 * cell.control_period:g} ms{suffix})"
    )


def one_arm_suffix(evaluation: Evaluation[Any, Any, Any], what: str) -> str:
    """For a title: random ``what``, heavier bodies."""
    options = evaluation.options
    said = "" if options.family == "given" else f"; {evaluation.episodes} random {what} ({options.family})"
    return said + heavier(options.model_error)


def reasons(found: Mapping[str, Sequence[str]]) -> str:
    """For a sentence: who, by what stood in their way."""
    return "; ".join(f"{', '.join(names)} {why}" for why, names in found.items())


def heavier(model_error: float) -> str:
    """For a title: by how much the simulated bodies are heavier than plans and controllers believe."""
    return f"; bodies {100.0 * model_error:+g} % in mass" if model_error else ""

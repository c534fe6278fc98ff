"""What evaluations of every kind share: the loop, what a kind brings to it, figures of results, intervals."""

from __future__ import annotations

from armtempo.agents.evaluation._bootstrap import Interval, mean_interval, ratio_interval
from armtempo.agents.evaluation._evaluate import (
    Continuation,
    Evaluation,
    OnEpisode,
    audited,
    check_audit,
    evaluate_kind,
    play,
    run_episode,
    run_episodes,
)
from armtempo.agents.evaluation._figures import Figure, Form, figure, figures_of, numbers_of
from armtempo.agents.evaluation._kind import Kind, Runner, asked_options, keywords_of, option_names, options_for
from armtempo.agents.evaluation._training_task import CurveEvaluator, Row, TrainingTask, beside

__all__ = [
    "CurveEvaluator",
    "Row",
    "TrainingTask",
    "beside",
    "Continuation",
    "Evaluation",
    "Figure",
    "Form",
    "Interval",
    "Kind",
    "OnEpisode",
    "Runner",
    "asked_options",
    "audited",
    "check_audit",
    "evaluate_kind",
    "figure",
    "figures_of",
    "keywords_of",
    "mean_interval",
    "numbers_of",
    "option_names",
    "options_for",
    "play",
    "ratio_interval",
    "run_episode",
    "run_episodes",
]

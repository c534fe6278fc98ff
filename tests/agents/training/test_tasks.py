"""Kinds of trainings: what their files say is what episodes can be asked for, by the same names."""

from __future__ import annotations

from dataclasses import fields
from typing import Any, get_args

import pytest

from armtempo.agents.training._tasks import TASKS, training_task
from armtempo.configs import BlendTraining, CoordinationTraining, IKTraining, TrainConfig
from armtempo.envs import BlendOptions, CoordinationOptions, IKOptions

OPTIONS: dict[type, type[Any]] = {
    CoordinationTraining: CoordinationOptions,
    BlendTraining: BlendOptions,
    IKTraining: IKOptions,
}
OF_TRAININGS = {  # where agents learn, and how: no options of an episode
    "cells", "benchmark", "cell", "learners", "custom_disturbance", "undisturbed_share", "undisturbed_until", "reward",
    "cut_penalty", "control_period_s", "families", "reward_scale", "targets", "hold_periods",
    "validation",
}  # fmt: skip
TOLD_OTHERWISE = {  # options that a training leaves as they are, or has under another key
    CoordinationTraining: {"master_late_s", "model_error", "friction_error", "shield_tube_m", "max_episode_s"},
    BlendTraining: {"max_episode_s"},
    IKTraining: {"family", "max_episode_s"},
}


def test_every_kind_is_here() -> None:
    assert set(OPTIONS) == set(TASKS) == set(TOLD_OTHERWISE)


@pytest.mark.parametrize("training", OPTIONS)
def test_a_training_calls_options_as_episodes_do(training: Any) -> None:
    options = {field.name for field in fields(OPTIONS[training])}
    keys = set(training.model_fields) - OF_TRAININGS
    assert keys <= options
    assert options - keys == TOLD_OTHERWISE[training]


@pytest.mark.parametrize("training", OPTIONS)
def test_a_training_has_the_choices_of_episodes(training: Any) -> None:
    """What a key may say is what the option's record takes."""
    for key in set(training.model_fields) - OF_TRAININGS:
        for choice in get_args(training.model_fields[key].annotation):
            if isinstance(choice, str):
                with_shield = {"shield": True} if key in ("action", "observation", "orders") else {}  # they need one
                assert getattr(OPTIONS[training](**{key: choice}, **with_shield), key) == choice


def test_a_task_makes_environments_as_its_file_says() -> None:
    config = TrainConfig(
        name="one", algorithm="ppo", num_envs=3, blend_tracking=BlendTraining(profile="limit-aware", mapping="paper")
    )
    task = training_task(config)
    vector: Any = task.vector()
    single: Any = task.single(0)
    assert vector.num_envs == 3
    assert single.options == BlendOptions(physics="ideal", profile="limit-aware", mapping="paper")
    assert task.learners is None
    for env in (vector, single):
        env.close()

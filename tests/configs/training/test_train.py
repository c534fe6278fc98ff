"""Training files: every bundled one, and what is said of slips."""

from __future__ import annotations

from pathlib import Path

import pytest

from armtempo.configs import bundled_trainings, load_train_config, parse_train_config
from armtempo.errors import ConfigError, InputError, UnknownNameError

HEAD = "name: x\nalgorithm: ppo\n"
WHERE = HEAD + "coordination: {cells: [lee1991]}\n"
WRONG = {
    "a list": ("- 1", "", "no mapping"),
    "empty": ("", "", "is empty"),
    "not yaml": ("a: [", "", "line 1"),
    "a slip": (WHERE + "total_step: 5", "total_step", "did you mean 'total_steps'"),
    "no algorithm": ("name: x\ncoordination: {cells: [lee1991]}", "algorithm", "missing"),
    "no environment": (HEAD, "coordination", "got none"),
    "two environments": (WHERE + "feedback_ik: {}", "feedback_ik", "coordination and feedback_ik"),
    "other hyper-parameters": (WHERE + "sac: {}", "sac", "the algorithm is ppo"),
    "unknown algorithm": ("name: x\nalgorithm: dqn\ncoordination: {cells: [lee1991]}", "algorithm", "'ppo', 'sac'"),
    "no cells": (HEAD + "coordination: {}", "coordination.cells", "cells or benchmark"),
    "phase": (HEAD + "coordination: {cells: [a], start_phase: [0.5, 0.2]}", "coordination.start_phase", "lowest"),
    "deep slip": (
        HEAD + "coordination: {cells: [a], custom_disturbance: {late: [0, 1]}}",
        "coordination.custom_disturbance.late",
        "late_s",
    ),
    "range": (WHERE + "ppo: {gamma: 1.5}", "ppo.gamma", "Discount"),
    "no family": (HEAD + "feedback_ik: {families: []}", "feedback_ik.families", "at least 1"),
    "a word": (WHERE + "ppo: {learning_rate: fast}", "ppo.learning_rate", "number"),
    "a first action": (WHERE + "ppo: {first_action: 2}", "ppo.first_action[0]", "less than or equal to 1"),
    "of first actions": (WHERE + "ppo: {first_action: [0.5, fast]}", "ppo.first_action[1]", "number"),
    "targets": (HEAD + "feedback_ik: {families: [smooth, given], targets: 1}", "feedback_ik.targets", "2 at least"),
    "held in bullet": (HEAD + "feedback_ik: {physics: bullet, hold_periods: 2}", "feedback_ik.hold_periods", "ideal"),
    "team in bullet": (
        HEAD + "coordination: {cells: [a], reward: team, physics: bullet}",
        "coordination.reward",
        "ideal",
    ),
}


@pytest.mark.parametrize("name", bundled_trainings())
def test_bundled_trainings_load(name: str) -> None:
    config = load_train_config(name)
    assert config.environment
    assert f"name: {config.name}" in config.text


@pytest.mark.parametrize("case", WRONG)
def test_errors_name_file_key_and_remedy(case: str, tmp_path: Path) -> None:
    text, key, hint = WRONG[case]
    path = tmp_path / "mine.yaml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(ConfigError) as caught:
        load_train_config(path)
    assert str(path) in str(caught.value)
    assert caught.value.data["key"] == key
    assert hint in str(caught.value)
    assert caught.value.remedy


def test_defaults_and_changes() -> None:
    config = parse_train_config(WHERE, Path("x.yaml"))
    assert config.changed(seed=4, total_steps=None).seed == 4
    assert config.changed(seed=4).total_steps == config.total_steps
    assert config.changed(seed=4).text == WHERE


def test_unknown_names() -> None:
    with pytest.raises(UnknownNameError, match="lee1991"):
        load_train_config("lee1919")


@pytest.mark.parametrize(
    ("key", "value"),
    [("total_steps", 10**60), ("total_steps", 0), ("seed", 2**32), ("seed", -1), ("seed", True), ("num_envs", 10**9)],
)
def test_changes_are_what_a_file_could_say(key: str, value: int) -> None:
    with pytest.raises(InputError, match=f"{key}: Input should be"):
        load_train_config("lee1991").changed(**{key: value})
    assert load_train_config("lee1991").changed(total_steps=7).total_steps == 7

"""Search the numbers of a training with Optuna, by as many workers as share a folder."""

from __future__ import annotations

import itertools
import json
import logging
import math
import os
import socket
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from armtempo.configs import SearchedNumber, SweepConfig, SweepValue, TrainConfig, plain_number, trial_training
from armtempo.errors import InputError
from armtempo.files import check_output_folder

if TYPE_CHECKING:
    import optuna
    from optuna import Study

Objective = Callable[[TrainConfig, Path], float]
"""Trains in an empty folder; returns what is to become small, infinity at worst."""
LOG = logging.getLogger(__name__)
JOURNAL_FILE = "journal.log"
SPACE_ATTRIBUTE = "armtempo_sweep"  # the study remembers what is searched


@dataclass(frozen=True, kw_only=True)
class SweepTrial:
    """One trial that was finished.

    Attributes:
        number: Of the trial, counted over all workers.
        objective: What it came to; lower is better.
        values: What was tried, by dotted key.
        folder: Where its files are.
    """

    number: int
    objective: float
    values: dict[str, SweepValue]
    folder: Path


def sweep(
    config: SweepConfig,
    storage: Path,
    trials: int,
    *,
    objective: Objective,
    seed: int | None = None,
    on_trial: Callable[[SweepTrial, int], None] | None = None,
) -> list[SweepTrial]:
    """Take part in a sweep until ``trials`` are finished, by all workers together.

    The state is a journal in ``storage``: workers on other machines take part by giving the same folder on a shared
    disk, and one that was stopped is started again. The trial it was at is lost; it does not count. As many workers
    may overshoot by one trial each.

    Args:
        config: What is searched.
        storage: Folder of the journal and of what the trials write.
        trials: How many are to be finished, counting those that are in the journal already.
        objective: What a trial does.
        seed: Of the draws; workers with the same one begin with the same trials. None: from the system.
        on_trial: Called after each trial of this worker, with how many are finished.

    Returns:
        All finished trials, the best first.

    Raises:
        InputError: ``trials`` below 1, Optuna is not installed, ``storage`` cannot be written or holds a sweep of that
            name over something else, its journal is damaged, or a trial came to no number.
        Exception: Whatever the objective raises; that trial has failed.
    """
    if trials < 1:
        raise InputError(f"trials must be at least 1, got {trials}")
    check_output_folder(storage)
    optuna = _optuna()
    study = _open_study(optuna, config, storage, seed)
    while len(_finished(optuna, study)) < trials:
        trial = study.ask()
        try:
            folder = _empty_folder(_folder(storage, config, trial.number))
            values = {key: _suggest(trial, key, searched) for key, searched in config.space.items()}
            trial.set_user_attr("machine", socket.gethostname())
            reached = float(objective(trial_training(config, values), folder))
            if math.isnan(reached):
                raise InputError(
                    f"trial {trial.number} of {config.name} came to no number",
                    remedy=f"train with these values to see why: {json.dumps(values)}",
                )
        except BaseException:  # also when it is interrupted: it is over, and others need not wait for it
            study.tell(trial, state=optuna.trial.TrialState.FAIL)
            raise
        study.tell(trial, reached)
        if on_trial is not None:
            finished = len(_finished(optuna, study))
            on_trial(_trial(storage, config, trial.number, reached, values), finished)
    return sorted(
        (
            _trial(storage, config, one.number, float(one.values[0]), dict(one.params))
            for one in _finished(optuna, study)
        ),
        key=lambda one: (one.objective, one.number),
    )


def _folder(storage: Path, config: SweepConfig, number: int) -> Path:
    return storage / config.name / f"trial-{number:04d}"


def _empty_folder(folder: Path) -> Path:
    """The folder of a new trial; what a trial left there that the journal knows nothing of is moved aside."""
    if folder.is_dir() and any(folder.iterdir()):
        asides = (folder.with_name(f"{folder.name}-lost-{k}") for k in itertools.count(1))
        aside = next(one for one in asides if not one.exists())
        folder.rename(aside)
        LOG.warning("%s is of a trial that the journal has lost; it is %s now", folder, aside.name)
    folder.mkdir(parents=True, exist_ok=True)
    return folder


def _trial(
    storage: Path, config: SweepConfig, number: int, objective: float, values: dict[str, SweepValue]
) -> SweepTrial:
    folder = _folder(storage, config, number)
    return SweepTrial(number=number, objective=objective, values=values, folder=folder)


def _optuna() -> Any:
    try:
        import optuna
    except ImportError as error:
        raise InputError(
            "a sweep needs Optuna, which is not installed", remedy='pip install "armtempo[rl,sweep]"'
        ) from error
    optuna.logging.set_verbosity(optuna.logging.WARNING)
    return optuna


def _open_study(optuna: Any, config: SweepConfig, storage: Path, seed: int | None) -> Study:
    from optuna.storages import JournalStorage
    from optuna.storages.journal import JournalFileBackend, JournalFileOpenLock

    storage.mkdir(parents=True, exist_ok=True)
    path = storage / JOURNAL_FILE
    lock = JournalFileOpenLock(str(path))
    _take_cut_line_away(path, lock)
    samplers = optuna.samplers
    try:
        study: Study = optuna.create_study(
            study_name=config.name,
            direction="minimize",
            load_if_exists=True,
            storage=JournalStorage(JournalFileBackend(str(path), lock_obj=lock)),
            sampler=samplers.TPESampler(seed=seed, n_startup_trials=config.first_trials, constant_liar=True)
            if config.sampler == "tpe"
            else samplers.RandomSampler(seed=seed),
        )
    except (ValueError, LookupError, TypeError, AssertionError) as error:  # of lines that are not Optuna's
        raise InputError(
            f"{path}: a damaged journal: {' '.join(str(error).split())[:80]}",
            remedy="take its damaged lines out, or give another folder (--storage)",
        ) from error
    mine = config.model_dump(mode="json", include={"training", "total_steps", "space"})
    theirs = study.user_attrs.get(SPACE_ATTRIBUTE)
    if theirs is None:
        study.set_user_attr(SPACE_ATTRIBUTE, mine)
    elif theirs != mine:
        raise InputError(
            f"{storage} holds a sweep {config.name!r} over something else",
            remedy="give the sweep another name, or another folder",
        )
    return study


def _take_cut_line_away(path: Path, lock: Any) -> None:
    """Without the end of its last line, which a full disk or a loss of power took, a journal takes no further ones."""
    if not path.is_file():
        return
    lock.acquire()
    try:
        data = path.read_bytes()
        end = data.rfind(b"\n") + 1
        if end < len(data):
            os.truncate(path, end)
            LOG.warning("%s: its last line was cut off and is taken away", path)
    finally:
        lock.release()


def _suggest(trial: optuna.Trial, key: str, searched: SearchedNumber) -> SweepValue:
    if searched.choices is not None:
        return plain_number(trial.suggest_categorical(key, [plain_number(choice) for choice in searched.choices]))
    low, high = searched.low, searched.high
    assert low is not None  # a range has both
    assert high is not None
    if searched.integer:
        return int(trial.suggest_int(key, int(low), int(high), log=searched.log))
    return float(trial.suggest_float(key, low, high, log=searched.log))


def _finished(optuna: Any, study: optuna.Study) -> list[optuna.trial.FrozenTrial]:
    states = (optuna.trial.TrialState.COMPLETE,)
    return list(study.get_trials(deepcopy=False, states=states))

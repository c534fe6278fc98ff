"""Logs for TensorBoard that go on behind a checkpoint as if nothing had been lost, or written twice."""

from __future__ import annotations

import json
import os
import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from stable_baselines3.common.logger import Logger, configure

LOGS = "tensorboard"


@contextmanager
def open_logs(folder: Path, sizes: Mapping[str, int]) -> Iterator[Logger]:
    """A logger into the folder of a training, whose older logs are cut to these sizes: what follows is logged again.

    An OSError of the block names the folder, if it names nothing else: TensorBoard's thread tells of a full disk so.

    Args:
        folder: Of the training.
        sizes: By file, as ``log_sizes`` told them at the checkpoint; other files go. Empty: nothing was logged.
    """
    for file in _files(folder):
        if file.name not in sizes:
            file.unlink()
        elif file.stat().st_size > sizes[file.name]:
            os.truncate(file, sizes[file.name])
    logger = configure(str(folder / LOGS), ["tensorboard"])
    before, threading.excepthook = threading.excepthook, _told_by_the_next_dump
    try:
        yield logger
    except OSError as error:
        error.filename = error.filename or str(folder)
        raise
    finally:
        with suppress(OSError):  # of logs that were dumped before, nothing is left to be written
            logger.close()
        threading.excepthook = before


def _told_by_the_next_dump(told: threading.ExceptHookArgs) -> None:
    """What a thread that writes logs dies of is raised where the next ones are dumped, too."""
    if told.exc_type is None or not issubclass(told.exc_type, OSError):
        threading.__excepthook__(told)


def log_sizes(folder: Path) -> dict[str, int]:
    """How many bytes of logs there are by now, by file: whatever was dumped is on the disk."""
    return {file.name: file.stat().st_size for file in _files(folder)}


def _files(folder: Path) -> list[Path]:
    return sorted((folder / LOGS).glob("events.out.tfevents.*"))


def pending(logger: Logger) -> str:
    """What is recorded and not dumped yet."""
    return json.dumps([logger.name_to_value, logger.name_to_count, logger.name_to_excluded], default=float)


def put_back(logger: Logger, recorded: str) -> None:
    """Record what was ``pending`` at the checkpoint."""
    tables: list[dict[str, Any]] = [logger.name_to_value, logger.name_to_count, logger.name_to_excluded]
    for table, values in zip(tables, json.loads(recorded), strict=True):
        table.update(values)

"""Logs for TensorBoard that go on behind a checkpoint as if nothing had been lost, or written twice."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from stable_baselines3.common.logger import Logger, configure

LOGS = "tensorboard"


def open_logs(folder: Path, sizes: Mapping[str, int]) -> Logger:
    """A logger into the folder of a training, whose older logs are cut to these sizes: what follows is logged again.

    Args:
        folder: Of the training.
        sizes: By file, as ``log_sizes`` told them at the checkpoint; other files go. Empty: nothing was logged.
    """
    for file in _files(folder):
        if file.name not in sizes:
            file.unlink()
        elif file.stat().st_size > sizes[file.name]:
            os.truncate(file, sizes[file.name])
    return configure(str(folder / LOGS), ["tensorboard"])


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

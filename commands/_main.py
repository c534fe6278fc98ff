"""The ``armtempo`` command: reads the line, runs one subcommand, turns errors into one line and exit status 2."""

from __future__ import annotations

import errno
import io
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from types import FrameType

import platformdirs
import tyro

from armtempo import ArmtempoError, __version__
from armtempo.cache import can_be_made, private_folder
from armtempo.commands._cells import cells
from armtempo.commands._evaluate import Evaluate, evaluate
from armtempo.commands._generate import generate
from armtempo.commands._plan import plan
from armtempo.commands._plot import plot
from armtempo.commands._postures import fk, ik
from armtempo.commands._record import Record, record
from armtempo.commands._reproduce import reproduce
from armtempo.commands._sweep import sweep
from armtempo.commands._train import train
from armtempo.commands._view import View, view
from armtempo.commands.bench import BENCHES, bench
from armtempo.errors import printable

DESCRIPTION = """When robot arms move along given paths: plan their timing, simulate it, compare.

Begin with `armtempo evaluate lee1991`; `armtempo COMMAND --help` explains a command's options."""

COMMANDS: dict[str, Callable[..., object]] = {
    "evaluate": Evaluate,
    "plan": plan,
    "plot": plot,
    "view": View,
    "record": Record,
    "cells": cells,
    "fk": fk,
    "ik": ik,
    "reproduce": reproduce,
    "bench": bench,
    "train": train,
    "sweep": sweep,
}

OF_A_KIND: dict[str, Callable[[Sequence[str]], None]] = {"evaluate": evaluate, "view": view, "record": record}
"""Commands whose flags are those of the cell's kind."""

REMEDIES = {
    errno.ENOSPC: "make room, then run the same line again",
    errno.EDQUOT: "make room, then run the same line again",
    errno.EFBIG: "allow larger files, then run the same line again",
}
"""By what the system says; else path and permissions are what to look at."""


class Terminated(KeyboardInterrupt):
    """SIGTERM: ends a command as Ctrl-C does."""


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line ``argv`` (default: the process's own) and return the exit status.

    0: done; 1: the standard output was closed; 2: a wrong line or an error of armtempo, told in one line on stderr;
    130: interrupted; 143: told to end by SIGTERM. Of the last two one line says how to go on, where that is possible.
    """
    line = sys.argv[1:] if argv is None else list(argv)
    _house_matplotlib()
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="replace")  # tables in a locale that lacks their characters
    try:
        with _told_to_end():
            _run(line)
        sys.stdout.flush()  # a full disk is told here, not when the process ends
    except SystemExit as stop:  # --help, or a line that tyro has complained about
        return stop.code if isinstance(stop.code, int) else 0 if stop.code is None else 2
    except ArmtempoError as error:
        _complain(str(error))
        return 2
    except BrokenPipeError:  # `armtempo ... | head`
        sys.stderr.close()
        return 1
    except OSError as error:
        where = f"{error.filename}: " if error.filename else ""
        remedy = REMEDIES.get(error.errno or 0, "check the path and its permissions")
        _complain(f"{where}{error.strerror or error} ({remedy})")
        return 2
    except KeyboardInterrupt as stop:
        notes = getattr(stop, "__notes__", [])
        sys.stderr.write(": ".join(["armtempo: interrupted", *notes[-1:]]) + "\n")
        return 143 if isinstance(stop, Terminated) else 130
    return 0


def _run(line: Sequence[str]) -> None:
    """The subcommand that the line names."""
    if line == ["--version"]:
        sys.stdout.write(f"armtempo {__version__}\n")
    elif line[:2] == ["cells", "generate"]:  # cells itself takes a word: the name of a cell
        tyro.cli(generate, prog="armtempo cells generate", args=line[2:])
    elif line[:1] and line[0] in OF_A_KIND:
        OF_A_KIND[line[0]](line[1:])
    elif line[:1] == ["bench"]:
        tyro.extras.subcommand_cli_from_dict(
            dict(BENCHES), prog="armtempo bench", description=bench.__doc__, args=line[1:]
        )
    else:
        tyro.extras.subcommand_cli_from_dict(COMMANDS, prog="armtempo", description=DESCRIPTION, args=line)


@contextmanager
def _told_to_end() -> Iterator[None]:
    """SIGTERM raises Terminated, where this is the main thread of a process that nobody else has told what to do."""

    def end(number: int, frame: FrameType | None) -> None:
        raise Terminated

    mine = threading.current_thread() is threading.main_thread()
    if not mine or signal.getsignal(signal.SIGTERM) is not signal.SIG_DFL:
        yield
        return
    signal.signal(signal.SIGTERM, end)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, signal.SIG_DFL)


def _house_matplotlib() -> None:
    """Where the home cannot be written: matplotlib would complain, and look for its fonts anew each time."""
    private = private_folder()
    if private is not None and not can_be_made(platformdirs.user_config_path("matplotlib")):
        os.environ.setdefault("MPLCONFIGDIR", str(private / "matplotlib"))


def _complain(text: str) -> None:
    sys.stderr.write(f"armtempo: error: {printable(' '.join(text.split()))}\n")

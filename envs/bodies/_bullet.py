"""PyBullet, when it is wanted, and without the lines that it prints: errors of the commands are one line.

Planning, ``ideal`` and MuJoCo do without it, and there are systems for which nobody builds it.
"""

from __future__ import annotations

import ctypes
import os
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from importlib.metadata import PackageNotFoundError, version
from typing import Any

from armtempo.errors import InputError

PACKAGES = ("pybullet", "pybullet-arm64")  # two builds of one module


class _Redirection:
    """Standard output and error sent nowhere while anybody wants it; the last one to leave puts them back."""

    def __init__(self) -> None:
        self._lock, self._wanted, self._kept = threading.Lock(), 0, dict[int, int]()

    def enter(self) -> None:
        with self._lock:
            self._wanted += 1
            if self._wanted > 1:
                return
            _flush()
            nowhere = os.open(os.devnull, os.O_WRONLY)
            for number in (1, 2):
                with suppress(OSError):  # one that is closed stays so
                    self._kept[number] = os.dup(number)
                    os.dup2(nowhere, number)
            os.close(nowhere)

    def leave(self) -> None:
        with self._lock:
            self._wanted -= 1
            if self._wanted:
                return
            if sys.platform != "win32":
                ctypes.CDLL(None).fflush(None)  # C keeps a buffer of its own
            for number, copy in self._kept.items():
                os.dup2(copy, number)
                os.close(copy)
            self._kept.clear()


def _flush() -> None:
    for stream in (sys.stdout, sys.stderr):
        if stream is not None:
            with suppress(OSError, ValueError):
                stream.flush()


_REDIRECTION = _Redirection()


@contextmanager
def quiet() -> Iterator[None]:
    """Send what C code prints meanwhile nowhere, and what other threads print, too: keep it short."""
    _REDIRECTION.enter()
    try:
        yield
    finally:
        _REDIRECTION.leave()


def bullet_version() -> str:
    """Of the package that is installed, by either name; empty if none is."""
    for package in PACKAGES:
        with suppress(PackageNotFoundError):
            return version(package)
    return ""


class _Late:
    """The module ``pybullet``, imported when it is first asked for something."""

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):  # copies and pickles look for these
            raise AttributeError(name)
        try:
            with quiet():
                import pybullet as module
        except ModuleNotFoundError as error:
            # two packages write the same files: removing one takes them from the other
            broken = bool(bullet_version())
            raise InputError(
                "PyBullet is " + ("installed, but its files are gone" if broken else "not installed"),
                remedy='take physics="mujoco" (--physics mujoco) or "ideal", or pip install '
                + ("--force-reinstall --no-deps " if broken else "")
                + "pybullet",
            ) from error
        self.__dict__.update(vars(module))  # from now on looked up as quickly as in the module
        return getattr(module, name)


pybullet: Any = _Late()

__all__ = ["bullet_version", "pybullet", "quiet"]

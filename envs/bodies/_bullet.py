"""PyBullet, without the lines that it prints: errors of the commands are one line, and so is their JSON's first."""

from __future__ import annotations

import ctypes
import os
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress


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


with quiet():
    import pybullet

__all__ = ["pybullet", "quiet"]

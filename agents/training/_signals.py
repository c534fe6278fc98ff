"""Ctrl-C and SIGTERM while a training is between two of the places where it can be saved."""

from __future__ import annotations

import logging
import signal
import threading
from types import FrameType
from typing import Any, Self, final

LOG = logging.getLogger(__name__)
HELD = (signal.SIGINT, signal.SIGTERM)


@final
class HeldSignals:
    """Keeps the first Ctrl-C or SIGTERM back until ``pass_on``; a second one acts at once.

    Only the main thread of a process can hold signals; in another one nothing is held. A signal that the process
    ignores stays ignored.

    Attributes:
        received: The signal that is held back; None: none came.
    """

    def __init__(self) -> None:
        self.received: int | None = None
        self._before: dict[int, Any] = {}

    def __enter__(self) -> Self:
        if threading.current_thread() is threading.main_thread():
            for number in HELD:
                before = signal.getsignal(number)
                if before not in (signal.SIG_IGN, None):  # None: another language's
                    self._before[number] = signal.signal(number, self._hold)
        return self

    def __exit__(self, *_: object) -> None:
        self._let_go()

    def _hold(self, number: int, _: FrameType | None) -> None:
        self.received = number
        self._let_go()
        LOG.info("%s: the training ends once it is saved; another one ends it at once", signal.Signals(number).name)

    def _let_go(self) -> None:
        for number, before in self._before.items():
            signal.signal(number, before)
        self._before = {}

    def pass_on(self, note: str) -> None:
        """Send the signal that was held back again, to whom it would have gone.

        Raises:
            KeyboardInterrupt: Or what else a handler raises, with a note; without a handler the process ends.
        """
        assert self.received is not None
        self._let_go()
        LOG.info("%s", note)
        try:
            signal.raise_signal(self.received)
            raise KeyboardInterrupt  # a handler that says nothing
        except BaseException as told:
            told.add_note(note)
            raise

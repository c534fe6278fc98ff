"""Environments whose state is a value: taken, kept, sent elsewhere, gone on from."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from armtempo.envs.common._lifecycle import Lifecycle
from armtempo.errors import InputError
from armtempo.state import STATE_FORMAT, State, Stateful


class SavedEnv(Stateful):
    """What environments with a ``cell``, ``options`` and a ``Lifecycle`` give and take as their state."""

    cell: Any
    options: Any
    _life: Lifecycle

    def get_state(self) -> State:
        """All that changes, copied: an environment made alike, here or in another process, goes on from it bit for bit.

        Returns:
            ``format`` (``armtempo-state-1``), ``environment``, ``cell`` and ``options``: what it is the state of. All
            other names are those of what changes, dotted where it is nested: generator of random numbers, places,
            speeds and torques of the arms, clocks, what was drawn for the episode, what the shield decided, the rows of
            the trace where one is recorded. They hold arrays, plain values and the episode's cell. The samplers of the
            spaces and pictures are not in it.

        Raises:
            InputError: Nothing was reset yet, or the environment is closed.
        """
        self._life.check_open()
        if not self._life.begun:
            raise InputError("there is no state before a reset", remedy="call reset")
        return self._own_state()

    def _own_state(self) -> State:
        return {**self._header(), **super()._own_state()}

    def check_state(self, state: Mapping[str, Any]) -> None:
        """What ``set_state`` begins with; no reset is needed before.

        Raises:
            InputError: It is the state of another kind of environment, of another cell or of other options, or the
                environment is closed.
        """
        self._life.check_open()
        for name, own in self._header().items():
            if name not in state or state[name] != own:
                said = f"{state[name]!r:.80}" if name in state else "missing"
                what = f"the state's {name} is {said}, and this environment's is {own!r:.80}"
                raise InputError(what, remedy="make the environment with the same arguments")
        super().check_state(state)

    def _header(self) -> State:
        """What tells environments apart."""
        return {
            "format": STATE_FORMAT,
            "environment": type(self).__name__,
            "cell": self.cell.name,
            "options": self.options,
        }

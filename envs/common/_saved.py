"""Environments whose state is a value: taken, kept, sent elsewhere, gone on from."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from typing import Any

from armtempo.envs.common._lifecycle import Lifecycle
from armtempo.errors import InputError, brief
from armtempo.state import STATE_FORMAT, State, Stateful


class SavedEnvs(Stateful):
    """What one environment, or many at once, give and take as their state."""

    @abstractmethod
    def made_of(self) -> State:
        """What tells them apart from others: plain values by name."""

    @abstractmethod
    def _check_open(self) -> None:
        """Raise InputError if it is closed."""

    @abstractmethod
    def _was_reset(self) -> bool:
        """Whether there is a state."""

    def get_state(self) -> State:
        """All that changes, copied: what was made alike, here or in another process, goes on from it bit for bit.

        Returns:
            ``format`` (``armtempo-state-1``), ``environment``, ``cell`` and what else it was made of. All other names
            are those of what changes, dotted where it is nested: generators of random numbers, places, speeds and
            torques of the arms, clocks, what was drawn for the episode, what the shield decided, the rows of the trace
            where one is recorded. They hold arrays, plain values and the episode's cell. The samplers of the spaces and
            pictures are not in it.

        Raises:
            InputError: Nothing was reset yet, or it is closed.
        """
        self._check_open()
        if not self._was_reset():
            raise InputError("there is no state before a reset", remedy="call reset")
        return self._own_state()

    def check_state(self, state: Mapping[str, Any]) -> None:
        """What ``set_state`` begins with; no reset is needed before.

        Raises:
            InputError: It is the state of another kind of environment, of another cell or of other options, or this one
                is closed.
        """
        self._check_open()
        given: object = state  # whatever the annotation says
        if not isinstance(given, Mapping):
            raise InputError(f"a state maps names to values, got {brief(given)}", remedy="give what get_state returned")
        for name, own in self.header().items():
            if type(state.get(name)) is not type(own) or state[name] != own:
                said = brief(state[name]) if name in state else "missing"
                what = f"the state's {name} is {said}, and here it is {own!r:.80}"
                raise InputError(what, remedy="make the environment with the same arguments")
        super().check_state(state)

    def header(self) -> State:
        """What a state begins with: its format, the kind of environment, and what it is made of."""
        return {"format": STATE_FORMAT, "environment": type(self).__name__, **self.made_of()}

    def _own_state(self) -> State:
        return {**self.header(), **super()._own_state()}


class SavedEnv(SavedEnvs):
    """A single environment, with a ``cell``, ``options`` and a ``Lifecycle``."""

    cell: Any
    options: Any
    _life: Lifecycle

    def made_of(self) -> State:
        """The cell's name and the options."""
        return {"cell": self.cell.name, "options": self.options}

    def _check_open(self) -> None:
        self._life.check_open()

    def _was_reset(self) -> bool:
        return self._life.begun

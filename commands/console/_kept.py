"""Results of a long command, kept as they come: after an interruption the same line goes on with them."""

from __future__ import annotations

import hashlib
import json
import logging
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Any, BinaryIO, final

from armtempo import __version__
from armtempo.cache import content_key
from armtempo.errors import InputError
from armtempo.files import locked
from armtempo.reading import read_bytes, user_path, why_unreadable

LOG = logging.getLogger(__name__)
PARTIAL = Path("results") / "partial"
DIGEST_BYTES = 16
LARGEST_AGENT = 2**26  # bytes of its file


@contextmanager
def kept_results(command: str, arguments: Mapping[str, Any]) -> Iterator[Kept]:
    """Results of a command with these arguments: those of before, until it has ended; then they are gone.

    They are in ``results/partial`` under the working folder, in a file whose name tells the arguments apart: a line of
    JSON for each, behind its digest, below a first one with command, arguments and version. Where it cannot be written,
    or another process with the same arguments holds it, nothing is kept.

    Args:
        command: Without ``armtempo``.
        arguments: All that decides the results, as JSON can hold it.

    Raises:
        InputError: The file has been changed by something else.
        KeyboardInterrupt: Of the block, with a note that says how to go on.
    """
    head = json.loads(_text({"command": command, "armtempo": __version__, "arguments": arguments}))
    name = f"{command.replace(' ', '-')}-{content_key([_text(head)])[:12]}.jsonl"
    with ExitStack() as stack:
        kept = Kept(PARTIAL / name, head, stack)
        try:
            yield kept
        except KeyboardInterrupt as stop:
            if kept.count:
                stop.add_note(f"{kept.count} results are kept in {kept.file}; the same line goes on with them")
            raise
    if kept.count:
        kept.file.unlink(missing_ok=True)
        with suppress(OSError):  # others are there
            PARTIAL.rmdir()
            PARTIAL.parent.rmdir()


@final
class Kept:
    """Results by what they are of.

    Args:
        file: Where they are kept.
        head: What its first line says.
        stack: Closes the file.

    Attributes:
        file: That file, made with the first result.
        found: How many results were there.
        count: How many are in the file.
    """

    def __init__(self, file: Path, head: dict[str, Any], stack: ExitStack) -> None:
        self.file, self._head, self._stack = file, head, stack
        self._values: dict[str, Any] = {}
        self._stream: BinaryIO | None = None
        self._keeps, self.count = True, 0
        if file.is_file() and self._open():
            self._read()
        self.found = len(self._values)

    def get(self, unit: str) -> Any:
        """The result that is kept of something; None: there is none."""
        return self._values.get(unit)

    def put(self, unit: str, value: Any) -> Any:
        """Keep a result; returns what ``get`` will. One that JSON cannot hold is not kept."""
        try:
            text = _text([unit, value])
        except TypeError as error:
            LOG.warning("the result of %s is not kept: %s", unit, error)
            return value
        self._write(text)
        self._values[unit] = json.loads(text)[1]
        return self._values[unit]

    def result(self, unit: str, compute: Callable[[], Any]) -> Any:
        """What is kept of something, or what ``compute`` returns, which is kept from now on."""
        return self.get(unit) if unit in self._values else self.put(unit, compute())

    def _open(self) -> bool:
        try:
            self.file.parent.mkdir(parents=True, exist_ok=True)
            if self._stack.enter_context(locked(self.file)):
                self._stream = self._stack.enter_context(self.file.open("r+b"))
            else:
                LOG.warning("%s is another process's: this one's results are not kept", self.file)
        except OSError as error:
            LOG.warning("%s cannot be written: %s; results are not kept", self.file, error.strerror)
        self._keeps = self._stream is not None
        return self._keeps

    def _read(self) -> None:
        """What is there; a last line that was cut off is taken away."""
        assert self._stream is not None
        data = self._stream.read()
        end = data.rfind(b"\n") + 1
        if end < len(data):
            LOG.warning("%s: its last line was cut off and is taken away", self.file)
            self._stream.truncate(end)
        self._stream.seek(end)
        for number, line in enumerate(data[:end].split(b"\n")[:-1], 1):
            digest, _, text = line.partition(b" ")
            if digest != _digest(text) or (number == 1 and json.loads(text) != self._head):
                raise InputError(f"{self.file}: line {number} has been changed", remedy="delete it, and begin anew")
            if number > 1:
                unit, value = json.loads(text)
                self._values[unit] = value
        self.count = len(self._values)

    def _write(self, text: str) -> None:
        first = self._stream is None
        if not self._keeps or (first and not self._open()):
            return
        assert self._stream is not None
        try:
            for one in (_text(self._head), text) if first or self._stream.tell() == 0 else (text,):
                self._stream.write(_digest(one.encode()) + b" " + one.encode() + b"\n")
            self._stream.flush()
            self.count += 1
        except OSError as error:
            LOG.warning("%s cannot be written: %s; results are not kept from here on", self.file, error.strerror)
            self._keeps = False


def file_digests(names: Sequence[str]) -> dict[str, str]:
    """Of policies that are files of agents (``ppo:path/to/file.npz``), what is in them."""
    files = {name: user_path(name.partition(":")[2]) for name in names if name.endswith(".npz")}
    return {
        name: content_key([read_bytes(file, LARGEST_AGENT)])
        for name, file in files.items()
        if why_unreadable(file) is None
    }


def _text(value: Any) -> str:
    """JSON that gives the same numbers back, infinity among them."""

    def plain(one: Any) -> Any:
        if hasattr(one, "tolist"):
            return one.tolist()
        raise TypeError(f"{type(one).__name__} has no form in JSON")

    return json.dumps(value, default=plain)


def _digest(text: bytes) -> bytes:
    return hashlib.blake2b(text, digest_size=DIGEST_BYTES).hexdigest().encode()

"""Runs fuzzers, each in a process of its own that has a clock and a limit of memory, and counts what comes of it.

An input is *refused* by an ``ArmtempoError`` and *accepted* by anything finite. All else is a fault: another exception,
ten seconds of work without an answer, a gigabyte more memory, a process that dies. Such inputs are kept as files.
"""

from __future__ import annotations

import faulthandler
import hashlib
import json
import multiprocessing
import os
import resource
import select
import signal
import time
import traceback
import warnings
import zlib
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from armtempo.errors import ArmtempoError

HANG_S = 10.0  # of processor time, so that a busy machine makes no faults
LOST_S = 60.0  # a process that says nothing for so long, whatever it waits for, is ended from outside
MEMORY = 2**30  # bytes more than at the start
PER_PROCESS = 2000  # inputs, then a new one: what libraries keep is not counted for ever


class Fuzzer(Protocol):
    """Makes inputs and tries them."""

    spent: bool
    """Whether the next input needs a new process."""

    def make(self, random: np.random.Generator) -> Any:
        """An input."""
        ...

    def run(self, given: Any) -> bool:
        """Whether it is accepted; raises what it raises."""
        ...

    def shown(self, given: Any) -> bytes:
        """The input as the content of a file."""
        ...


class Hang(BaseException):
    """Raised where an input has taken too long; no library catches it by mistake for an error of its own."""


@dataclass
class Outcome:
    """What came of one fuzzer."""

    name: str
    inputs: int = 0
    refused: int = 0
    accepted: int = 0
    seconds: float = 0.0
    slowest_s: float = 0.0
    faults: dict[str, list[int]] = field(default_factory=dict)
    """Numbers of the inputs, by kind of fault."""
    files: dict[str, str] = field(default_factory=dict)
    """An input of each kind of fault, by kind."""
    details: dict[str, str] = field(default_factory=dict)

    @property
    def fault_count(self) -> int:
        return sum(map(len, self.faults.values()))

    def told(self) -> str:
        """One paragraph per kind of fault."""
        return "".join(
            f"FAULT {self.name}: {kind}: {len(at)} inputs, the first is {at[0]}: {self.files[kind]}\n"
            f"      {self.details[kind]}\n"
            for kind, at in self.faults.items()
        )


def random_of(name: str, seed: int, number: int) -> np.random.Generator:
    """The draws of one input: they depend on nothing but its fuzzer, seed and number."""
    return np.random.default_rng([seed, zlib.crc32(name.encode()), number])


def fuzz(name: str, start: Callable[[Path], Fuzzer], numbers: range, seed: int, kept: Path, folder: Path) -> Outcome:
    """Try the inputs with these numbers; faults are written to ``kept``, work is done in ``folder``."""
    outcome, todo = Outcome(name), list(numbers)
    began = _children_s()
    while todo:
        part = todo[:PER_PROCESS]
        done, lost = _run_process(name, start, part, seed, kept, folder, outcome)
        if lost:  # the input it was at is why the process is gone
            outcome.inputs += 1
            _note(outcome, kept, part[done], *_lost_input(folder))
            done += 1
        todo = todo[done:]
    outcome.seconds = _children_s() - began
    return outcome


def _children_s() -> float:
    """Processor time of the processes that have ended."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def _lost_input(folder: Path) -> tuple[str, str, bytes]:
    current = folder / "current"
    return "the process died or was ended", "", current.read_bytes() if current.exists() else b""


def _note(outcome: Outcome, kept: Path, number: int, kind: str, detail: str, content: bytes) -> None:
    if kind not in outcome.faults:
        kept.mkdir(parents=True, exist_ok=True)
        digest = hashlib.blake2b(kind.encode(), digest_size=4).hexdigest()
        file = kept / f"{outcome.name}-{digest}-{number}"
        file.write_bytes(content)
        outcome.files[kind], outcome.details[kind] = str(file), detail
    outcome.faults.setdefault(kind, []).append(number)


def _run_process(
    name: str,
    start: Callable[[Path], Fuzzer],
    numbers: list[int],
    seed: int,
    kept: Path,
    folder: Path,
    outcome: Outcome,
) -> tuple[int, bool]:
    """How many inputs a new process has answered for, and whether another one was too much for it."""
    read, write = os.pipe()
    process = multiprocessing.get_context("fork").Process(
        target=_child, args=(name, start, numbers, seed, folder, write, read), daemon=True
    )
    process.start()
    os.close(write)
    done, spent = 0, False
    with os.fdopen(read, "rb") as lines:
        for line in _lines(lines):
            said = json.loads(line)
            if "broken" in said:
                raise RuntimeError(f"fuzzer {name} cannot make its {said['broken']}")
            outcome.inputs += 1
            outcome.slowest_s = max(outcome.slowest_s, said["seconds"])
            if said["verdict"] == "fault":
                _note(outcome, kept, numbers[done], said["kind"], said["detail"], bytes.fromhex(said["content"]))
            elif said["verdict"] == "accepted":
                outcome.accepted += 1
            else:
                outcome.refused += 1
            done, spent = done + 1, said["spent"]
    process.kill()
    process.join()
    return done, done < len(numbers) and not spent


def _lines(stream: Any) -> Iterator[bytes]:
    """What the process says, until it ends or says nothing for too long."""
    waited = 600.0  # kernels may have to be compiled first
    buffer = b""
    while True:
        ready, _, _ = select.select([stream], [], [], waited)
        chunk = os.read(stream.fileno(), 2**16) if ready else b""
        if not chunk:
            if waited != LOST_S:
                raise RuntimeError("a fuzzer could not be started: see above")
            return
        *whole, buffer = (buffer + chunk).split(b"\n")
        yield from (line for line in whole if line != b"ready")
        waited = LOST_S


def _child(
    name: str, start: Callable[[Path], Fuzzer], numbers: list[int], seed: int, folder: Path, write: int, read: int
) -> None:
    os.close(read)
    faulthandler.enable()
    warnings.simplefilter("ignore")  # a warning is no fault; on the command line a second line is
    os.chdir(folder)
    fuzzer = start(folder)
    _limit_memory()
    signal.signal(signal.SIGPROF, _raise_hang)
    os.write(write, b"ready\n")
    for number in numbers:
        random = random_of(name, seed, number)
        try:
            given = fuzzer.make(random)
            content = fuzzer.shown(given)
        except Exception:
            os.write(write, json.dumps({"broken": f"input {number}: {traceback.format_exc()}"}).encode() + b"\n")
            raise
        (folder / "current").write_bytes(content)
        began = time.perf_counter()
        said = _verdict(fuzzer, given)
        if said["verdict"] == "fault":
            said["content"] = content.hex()
        said["seconds"] = time.perf_counter() - began
        said["spent"] = fuzzer.spent
        os.write(write, json.dumps(said).encode() + b"\n")
        if fuzzer.spent:
            break
    os._exit(0)


def _raise_hang(*_: Any) -> None:
    raise Hang


@contextmanager
def _clock(seconds: float) -> Iterator[None]:
    signal.setitimer(signal.ITIMER_PROF, seconds, 1.0)  # again, should somebody swallow it
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)


def _verdict(fuzzer: Fuzzer, given: Any) -> dict[str, Any]:
    try:
        with _clock(HANG_S):
            accepted = fuzzer.run(given)
    except ArmtempoError:
        return {"verdict": "refused"}
    except BaseException as error:  # noqa: BLE001 - that is what is looked for
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        return {"verdict": "fault", "kind": _kind(error), "detail": _detail(error)}
    return {"verdict": "accepted" if accepted else "refused"}


def _kind(error: BaseException) -> str:
    """Exception and the innermost place of ours that it passed: what is one fault."""
    frames = traceback.extract_tb(error.__traceback__)
    ours = [one for one in frames if "armtempo" in one.filename or "/tests/fuzz/" not in one.filename]
    inner = [one for one in ours if "site-packages" not in one.filename and "/lib/python" not in one.filename]
    place = f"{'/'.join(Path(inner[-1].filename).parts[-3:])}:{inner[-1].name}" if inner else "?"
    return f"{type(error).__name__} in {place}"


def _detail(error: BaseException) -> str:
    frames = traceback.extract_tb(error.__traceback__)
    where = " > ".join(f"{Path(one.filename).name}:{one.lineno}" for one in frames[-6:])
    return f"{' '.join(str(error).split())[:300]} [{where}]"


def _limit_memory() -> None:
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    limit = pages * resource.getpagesize() + MEMORY
    resource.setrlimit(resource.RLIMIT_AS, (limit, limit))


def summary(outcomes: list[Outcome]) -> str:
    """The table that is printed."""
    heads = {
        "fuzzer": -14,
        "inputs": 8,
        "refused": 9,
        "accepted": 10,
        "faults": 8,
        "kinds": 7,
        "CPU s": 7,
        "slowest s": 11,
    }
    head = "".join(name.ljust(-width) if width < 0 else name.rjust(width) for name, width in heads.items())
    rows = [
        f"{one.name:<14}{one.inputs:>8}{one.refused:>9}{one.accepted:>10}{one.fault_count:>8}{len(one.faults):>7}"
        f"{one.seconds:>7.1f}{one.slowest_s:>11.2f}"
        for one in outcomes
    ]
    total: Counter[str] = Counter()
    for one in outcomes:
        total.update(inputs=one.inputs, refused=one.refused, accepted=one.accepted, faults=one.fault_count)
    foot = f"{'all':<14}{total['inputs']:>8}{total['refused']:>9}{total['accepted']:>10}{total['faults']:>8}"
    return "\n".join([head, *rows, foot])

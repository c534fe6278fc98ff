"""A fuzzer of the command line, in-process: an exit status and at most one line of complaint, never a traceback.

Work that goes on for long is interrupted as by Ctrl-C, which must end it.
"""

from __future__ import annotations

import io
import os
import signal
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from typing import Any

from armtempo.commands import main
from tests.agents.trained import FILES
from tests.fuzz._files import _coarse
from tests.fuzz._mutations import NUMBERS, WORDS, Random, pick, times

INTERRUPTED_S = 3.0
TRAINING = """
name: small
algorithm: ppo
coordination: {cells: [lee1991]}
num_envs: 2
total_steps: 8
evaluation: {episodes: 0}
ppo: {rollout_steps: 4, batch_size: 8, epochs: 1}
"""
LINES = (
    "cells", "cells mine.yaml", "cells lee2006 --json -", "cells chung",
    "cells generate --out there --count 1 --seed 3",
    "plan mine.yaml --methods delay vci --json out.json",
    "plan lee2006 --methods line-speed --export there --rate-hz 100",
    "plan short.yaml --methods law", "evaluate mine.yaml --policies delay --physics ideal --no-figures --seed 3",
    "evaluate lee2006 --policies line-speed --physics ideal --no-figures --family zigzag --episodes 2",
    "evaluate short.yaml --policies feedback --physics ideal --no-figures --json -",
    "evaluate mine.yaml --policies ppo:agent.npz --physics ideal --no-figures --shield --start-phase 0 0.3",
    "evaluate mine.yaml --policies delay --physics ideal --no-figures --disturbance any --observation-noise 0.01",
    "plot mine.yaml --out there", "record mine.yaml --out there/a.gif --slow 0.1", "reproduce lee1991 --out there",
    "train t.yaml --steps 8 --output there/t --seed 1", "train t.yaml --resume --output there/u",
    "sweep lee1991 --storage there/s",
    "bench agents", "bench coordination", "bench arms", "--version", "--help", "evaluate --help",
    "plan mine.yaml --help",
)  # fmt: skip
OWN = (
    "--json", "--out", "--seed", "--episodes", "--policies", "--methods", "--steps", "--resume", "--shield",
    "--shield-tube",
    "--physics", "--physic", "--model-error", "--master-late", "--max-episode", "--count", "--family", "--", "-",
    "-h", "--no-figures",
    "-1", "--seed=-1", "--episodes=1e3", "--master-late=nan", "--slow", "--output", "/dev/full", "/proc/nohome/x",
    "there", "mine.yaml",
    "t.yaml", "lee2006", "chung", "sac:lee1991", "ppo:nowhere", "ppo:t.yaml", "ppo:mine.npz", "random", "delay",
    "optimal", "None",
)  # fmt: skip


class CommandFuzzer:
    """Lines whose words are dropped, doubled, exchanged, replaced."""

    spent = False

    def __init__(self, folder: Path) -> None:
        folder = folder / "here"  # nothing that a line names lies outside of the folder
        folder.mkdir(exist_ok=True)
        os.chdir(folder)
        os.environ |= {"COLUMNS": "100", "ARMTEMPO_CACHE": str(folder / "cache"), "HOME": str(folder)}
        (folder / "mine.yaml").write_bytes(_coarse("lee1991").replace(b"0.0001", b"0.002"))
        (folder / "short.yaml").write_bytes(_coarse("chung"))
        (folder / "t.yaml").write_text(TRAINING, encoding="utf-8")
        (folder / "agent.npz").write_bytes((FILES / "lee1991.npz").read_bytes())
        (folder / "mine.npz").write_bytes(b"PK")
        signal.signal(signal.SIGALRM, self._interrupt)
        for line in LINES[:13]:
            with redirect_stdout(io.StringIO()):
                assert main(line.split()) == 0, line  # compiles

    def make(self, random: Random) -> list[str]:
        words = str(pick(random, LINES)).split()
        for _ in range(times(random)):
            at, to = (int(random.integers(len(words) + 1)) for _ in range(2))
            match int(random.integers(6)):
                case 0 if words:
                    del words[at - 1]
                case 1 if words:
                    words.insert(to, words[at - 1])
                case 2 if words:
                    words.insert(to, words.pop(at - 1))
                case 3 if words:
                    words[at - 1] = _word(random)
                case _:
                    words.insert(at, _word(random))
        return words

    def run(self, given: list[str]) -> bool:
        out, told = io.StringIO(), io.StringIO()
        signal.setitimer(signal.ITIMER_REAL, INTERRUPTED_S)
        try:
            with redirect_stdout(out), redirect_stderr(told):
                status = main(given)
        finally:
            signal.setitimer(signal.ITIMER_REAL, 0.0)
        return self._judged(status, told.getvalue())

    def _interrupt(self, *_: Any) -> None:
        """Ctrl-C; what it cuts off may leave half-compiled kernels behind, in this process."""
        self.spent = True
        raise KeyboardInterrupt

    @staticmethod
    def _judged(status: int, told: str) -> bool:
        lines = [line for line in told.splitlines() if line.strip()]
        assert "Traceback" not in told, told[-300:]
        assert status in (0, 2, 130), f"status {status}: {told[-300:]}"
        boxed = "For full helptext" in " ".join(told.split())  # tyro's complaints about the line
        if status == 2:
            assert told.strip(), "status 2, and not a word"
            assert boxed or len(lines) == 1, f"{len(lines)} lines: {told[:300]}"
        return status != 2

    def shown(self, given: list[str]) -> bytes:
        return repr(given).encode("utf-8", "backslashreplace")


def _word(random: Random) -> str:
    return str(pick(random, pick(random, (OWN, OWN, NUMBERS, [word for word in WORDS if not word.startswith("/")]))))


def command_lines(folder: Path) -> CommandFuzzer:
    """The command line."""
    return CommandFuzzer(folder)

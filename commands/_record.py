"""``armtempo record``: a film of one episode, in slow motion."""

from __future__ import annotations

import errno
import io
import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import count
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import tyro
from numpy.typing import NDArray

from armtempo.commands.console import (
    CellName,
    Output,
    Seed,
    check_seed,
    open_cell,
    output_folder,
    read_kind_line,
    shown,
    silent_stdout,
)
from armtempo.errors import ArmtempoError, RenderError, UnknownNameError
from armtempo.files import check_output, check_output_folder, whole_file

Frame = NDArray[np.uint8]

MOST_FRAMES_PER_SECOND = 50.0
LAST_PICTURE_HELD = 1.0  # [s] the last picture stays
SUFFIXES = (".mp4", ".gif", "")
DEFAULTS: dict[str, tuple[str, float]] = {"coordination": ("vci", 20.0), "blend": ("limit-aware", 4.0)}
"""By kind of cell: who is filmed, and how many times slower than reality; else the first policy, as it is."""


@dataclass(frozen=True, kw_only=True)
class Record:
    """Film one episode of a policy in the simulated cell, in slow motion.

    Each kind of cell has options of its own besides these: "armtempo record CELL --help" lists them.
    """

    cell: CellName
    """A bundled cell's name (see "armtempo cells"), or your own YAML file."""
    policy: Annotated[
        str | None, tyro.conf.arg(metavar="NAME", help_behavior_hint="(default: vci, limit-aware or feedback)")
    ] = None
    """Who decides: phase-plane, sequential, constant-speed, constant-acceleration, delay, vci, offset, interval,
    optimal, random; under the shield search, search+stop, search+hold, longest-path, reorder, rollout; in blend
    cells line-speed, limit-aware, limit-aware-smooth, constant, random; in ik cells feedback, feedback-ff,
    feedback-damped, newton, law, law-scheduled, random. A learned agent is ppo:FILE.npz, with sac: or
    tqc: if these made it."""
    out: Annotated[
        Path | None, tyro.conf.arg(metavar="FILE", help_behavior_hint="(default: results/<cell>/<policy>.mp4)")
    ] = None
    """A file ending in .mp4 or .gif, or a folder for single PNG pictures."""
    slow: Annotated[
        float | None, tyro.conf.arg(metavar="X", help_behavior_hint="(default: 20, of a blend cell 4, of an ik cell 1)")
    ] = None
    """How many times slower than reality; arms that need a third of a second are shown for seven at 20."""
    seed: Seed = 0
    """Seed of the episode."""


def record(line: Sequence[str]) -> None:
    """Run ``armtempo record`` with what follows on the line; its flags are those of the cell's kind."""
    given, kind, options = read_kind_line(line, Record, "armtempo record")
    _check(given)
    usual, usually_slow = DEFAULTS.get(kind.name, (kind.policies[0], 1.0))
    policy, slow = given.policy or usual, given.slow or usually_slow
    from armtempo.agents.policies import chosen_policies  # late: --help is to be quick

    chosen_policies(policy, kind.policies, episodes=1)  # before a cell is opened, which may take a while
    output = Output(None)
    target = output_folder(given.cell, None) / f"{_file_name(policy)}.mp4" if given.out is None else given.out
    (check_output if target.suffix else check_output_folder)(target)
    cell = open_cell(given.cell, output)
    # One picture per decision at most; fewer where the film would run faster than screens do.
    skip = max(1, math.ceil(1.0 / (MOST_FRAMES_PER_SECOND * cell.control_period * slow) - 1e-9))
    rate = 1.0 / (cell.control_period * slow * skip)
    with output.progress(f"Filming {policy}") as (progress, task), silent_stdout():
        runner = kind.open(cell, policy, options, render_mode="rgb_array")
        try:
            with film_writer(target, rate) as write:
                camera = Camera(runner.env, write, skip)

                def on_step() -> None:
                    camera.look()
                    progress.update(task, description=f"Filming {policy}: {camera.taken} pictures")

                runner.run(given.seed, on_step)
                camera.finish()
        finally:
            runner.close()
    output.say(f"{camera.taken} pictures, {slow:g} times slower than reality: {shown(target)}")


def _check(given: Record) -> None:
    """Raise ArmtempoError for flags that no film can have."""
    check_seed(given.seed)
    if given.slow is not None and not (math.isfinite(given.slow) and given.slow > 0.0):
        raise ArmtempoError(f"--slow must be a positive number, got {given.slow}", remedy="try --slow 20")
    if given.out is not None and given.out.suffix.lower() not in SUFFIXES:
        raise UnknownNameError(
            "film format", given.out.suffix, SUFFIXES[:2], remedy="end --out in .mp4 or .gif, or name a folder"
        )


def _file_name(policy: str) -> str:
    """A policy's name as a file's: of a learned agent, its algorithm and what its file is called."""
    algorithm, _, agent = policy.rpartition(":")
    if not algorithm:
        return policy
    file = Path(agent)
    name = file.parent.name if file.stem == "agent" else file.stem  # as armtempo train calls them all
    return f"{algorithm}-{name or file.stem}"


@dataclass
class Camera:
    """Takes pictures of an environment: of every ``skip``-th decision, with the first and the last."""

    env: Any
    write: Callable[[Frame], None]
    skip: int
    looks: int = 0
    taken: int = 0

    def look(self) -> None:
        """There is something to see: at the start, and after each decision."""
        if self.looks % self.skip == 0:
            self._take()
        self.looks += 1

    def finish(self) -> None:
        """What was seen last is taken, too."""
        if (self.looks - 1) % self.skip:
            self._take()

    def _take(self) -> None:
        self.write(np.array(self.env.render(), dtype=np.uint8))
        self.taken += 1


@contextmanager
def film_writer(target: Path, rate: float) -> Iterator[Callable[[Frame], None]]:
    """Write pictures (H, W, 3) as ``.mp4`` or ``.gif``, whole or not at all, or as PNG files into a folder.

    Args:
        target: Its suffix tells the format.
        rate: Pictures per second.

    Returns:
        What writes the next picture.

    Raises:
        RenderError: The film cannot be encoded here.
    """
    import imageio  # late: it looks for its plugins

    if target.suffix == "":
        numbers = count()

        def write_file(frame: Frame) -> None:
            with whole_file(target / f"frame_{next(numbers):04d}.png") as temporary:
                imageio.imwrite(temporary, frame, format="PNG")

        yield write_file
        return
    with whole_file(target) as temporary:
        encode = _gif if target.suffix.lower() == ".gif" else _mp4
        with encode(temporary, target, rate) as write:
            last: list[Frame] = []

            def write_told(frame: Frame) -> None:
                with _told_of(target):
                    write(frame)
                last[:] = [frame]

            yield write_told
            for frame in last * round(LAST_PICTURE_HELD * rate):
                write_told(frame)


@contextmanager
def _gif(file: Path, target: Path, rate: float) -> Iterator[Callable[[Frame], None]]:
    """Encoded in memory: what writes it does not get over a full disk quietly."""
    import imageio

    film = io.BytesIO()
    with _told_of(target):
        writer: Any = imageio.get_writer(film, mode="I", format="GIF", duration=1e3 / rate, loop=0)
    try:
        yield writer.append_data
    finally:
        with _told_of(target):
            writer.close()
    file.write_bytes(film.getbuffer())


@contextmanager
def _mp4(file: Path, target: Path, rate: float) -> Iterator[Callable[[Frame], None]]:
    """Encoded by a process that does not say at its end whether it could write: its film is looked through."""
    import imageio
    from imageio_ffmpeg import count_frames_and_secs

    with _told_of(target):
        writer: Any = imageio.get_writer(
            file, mode="I", format="FFMPEG", fps=rate, codec="libx264", quality=8, macro_block_size=2,
            ffmpeg_log_level="fatal",
        )  # fmt: skip
    written = 0

    def write(frame: Frame) -> None:
        nonlocal written
        writer.append_data(frame)
        written += 1

    try:
        yield write
    finally:
        with _told_of(target):
            writer.close()
    with _told_of(target):
        try:
            whole = count_frames_and_secs(file)[0] == written
        except RuntimeError:
            whole = False
        if not whole:
            raise RuntimeError("not all of it got there; the disk may be full")


@contextmanager
def _told_of(target: Path) -> Iterator[None]:
    """What the encoder complains of becomes a RenderError; what the system does, of a full disk, is told as it is."""
    try:
        yield
    except (RuntimeError, ImportError, OSError) as error:
        if isinstance(error, OSError) and error.errno not in (None, errno.EPIPE):  # a pipe: to a process that died
            raise
        reason = (str(error).splitlines() or ["unknown reason"])[0]
        raise RenderError(f"cannot write {target}: {reason}", remedy="end --out in .gif, or name a folder") from error

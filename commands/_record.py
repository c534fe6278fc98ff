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
from typing import TYPE_CHECKING, Annotated, Any

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
    policy_label,
    read_kind_line,
    shown,
    silent_stdout,
)
from armtempo.errors import ArmtempoError, InputError, RenderError, UnknownNameError
from armtempo.files import check_output, check_output_folder, whole_file

if TYPE_CHECKING:
    from armtempo.agents import Kind
    from armtempo.envs.bodies import Trace

Frame = NDArray[np.uint8]

LAST_PICTURE_HELD = 1.0  # [s] the last picture stays
LONGEST_FILM = 3600.0  # [s]
SUFFIXES = (".mp4", ".gif", "")


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
        float | None,
        tyro.conf.arg(metavar="X", help_behavior_hint="(default: 1, 2, 5, 10 or 20, for about seven seconds of film)"),
    ] = None
    """How many times slower than reality; arms that need a third of a second are shown for seven at 20."""
    seed: Seed = 0
    """Seed of the episode."""


def record(line: Sequence[str]) -> None:
    """Run ``armtempo record`` with what follows on the line; its flags are those of the cell's kind."""
    given, kind, options = read_kind_line(line, Record, "armtempo record")
    _check(given)
    from armtempo.agents.policies import chosen_policies  # late, as the next: --help is to be quick
    from armtempo.commands.viewer import usual_policy

    policy = given.policy or usual_policy(kind)
    chosen_policies(policy, kind.policies, episodes=1)  # before a cell is opened, which may take a while
    output = Output(None)
    target = output_folder(given.cell, None) / f"{policy_label(policy)}.mp4" if given.out is None else given.out
    (check_output if target.suffix else check_output_folder)(target)
    cell = open_cell(given.cell, output)
    with output.progress(f"Simulating {policy}"):
        trace = _trace_of(kind, cell, policy, options, given.seed)
    from armtempo.commands.figures._film import FRAMES_PER_SECOND, film_times, pictures, usual_slowness

    duration = float(trace.time[-1])
    slow = given.slow or usual_slowness(duration)
    if duration * slow > LONGEST_FILM:
        raise InputError(
            f"--slow {slow:g} makes a film of {duration * slow:.3g} s",
            remedy=f"try --slow {usual_slowness(duration):g}",
        )
    times = film_times(duration, slow)
    filming = output.progress(f"Filming {policy}", len(times))
    with filming as (progress, task), silent_stdout(), film_writer(target, FRAMES_PER_SECOND) as write:
        for picture in pictures(cell, trace, times, f"{cell.name}, {policy_label(policy)}, 1/{slow:g}"):
            write(picture)
            progress.advance(task)
    output.say(f"{len(times)} pictures, {slow:g} times slower than reality: {shown(target)}")


def _trace_of(kind: Kind[Any, Any, Any, Any], cell: Any, policy: str, options: Any, seed: int) -> Trace[Any]:
    """What happens in an episode.

    Raises:
        InputError: Its environment keeps no trace of arms.
    """
    from armtempo.envs.bodies import Trace

    runner = kind.open(cell, policy, options)
    try:
        runner.run(seed)
        trace = runner.env.trace
    finally:
        runner.close()
    if not isinstance(trace, Trace):
        raise InputError(f"{kind.name} cells cannot be filmed", remedy="let their environments keep a Trace")
    return trace


def _check(given: Record) -> None:
    """Raise ArmtempoError for flags that no film can have."""
    check_seed(given.seed)
    if given.slow is not None and not (math.isfinite(given.slow) and given.slow > 0.0):
        raise ArmtempoError(f"--slow must be a positive number, got {given.slow}", remedy="try --slow 20")
    if given.out is not None and given.out.suffix.lower() not in SUFFIXES:
        raise UnknownNameError(
            "film format", given.out.suffix, SUFFIXES[:2], remedy="end --out in .mp4 or .gif, or name a folder"
        )


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

"""``armtempo record``: a film of one episode, in slow motion."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
import tyro
from numpy.typing import NDArray

from armtempo.commands.console import (
    CellName,
    Output,
    PhysicsName,
    Seed,
    check_seed,
    default_folder,
    open_cell,
    shown,
    silent_stdout,
)
from armtempo.errors import ArmtempoError, RenderError, UnknownNameError
from armtempo.files import whole_file

if TYPE_CHECKING:
    from armtempo.commands.films import Film

Frame = NDArray[np.uint8]

MOST_FRAMES_PER_SECOND = 50.0
HOLD = 1.0  # [s] the last picture stays
SUFFIXES = (".mp4", ".gif", "")


def record(
    cell: CellName,
    *,
    policy: Annotated[
        str | None, tyro.conf.arg(metavar="NAME", help_behavior_hint="(default: vci, limit-aware or law)")
    ] = None,
    out: Annotated[
        Path | None, tyro.conf.arg(metavar="FILE", help_behavior_hint="(default: results/<cell>/<policy>.mp4)")
    ] = None,
    slow: Annotated[
        float | None, tyro.conf.arg(metavar="X", help_behavior_hint="(default: 20, of a blend cell 4, of an ik cell 1)")
    ] = None,
    seed: Seed = 0,
    physics: PhysicsName = "bullet",
    master_late: Annotated[float, tyro.conf.arg(metavar="S")] = 0.0,
    shield: bool = False,
) -> None:
    """Film one episode of a policy in the simulated cell, in slow motion.

    Args:
        cell: A bundled cell's name (see "armtempo cells"), or your own YAML file.
        policy: Who decides: phase-plane, sequential, constant-speed, constant-acceleration, delay, vci,
            offset, interval, optimal, random; in blend cells line-speed, limit-aware, limit-aware-smooth,
            constant, random; in ik cells feedback, feedback-ff, feedback-damped, newton, law, law-scheduled,
            random. A learned agent is ppo:NAME (one that comes with armtempo) or ppo:FILE.npz, with sac: or
            tqc: if these made it; it is filmed in the settings that it was trained in.
        out: A file ending in .mp4 or .gif, or a folder for single PNG pictures.
        slow: How many times slower than reality; arms that need a third of a second are shown for seven at 20.
        seed: Seed of the episode.
        physics: "bullet" simulates the arms with torque control in PyBullet, "ideal" moves them exactly as commanded.
        master_late: In a cell of several arms: seconds by which the first starts late, which the others do not know.
        shield: In a cell of several arms: change actions from which they could not all stop in time and go on.
    """
    if slow is not None and not (math.isfinite(slow) and slow > 0.0):
        raise ArmtempoError(f"--slow must be a positive number, got {slow}", remedy="try --slow 20")
    check_seed(seed)
    if not (math.isfinite(master_late) and master_late >= 0.0):
        raise ArmtempoError(
            f"--master-late must be a number of seconds, 0 or more, got {master_late}", remedy="try 0.1"
        )
    if out is not None and out.suffix.lower() not in SUFFIXES:
        raise UnknownNameError(
            "film format", out.suffix, SUFFIXES[:2], remedy="end --out in .mp4 or .gif, or name a folder"
        )
    output = Output(None)
    built = open_cell(cell, output)
    from armtempo.commands.films import FILMS  # late: environments and PyBullet; --help is to be quick

    kind = FILMS[built.config.kind]
    policy, slow = policy or kind.POLICY, slow or kind.SLOW
    target = default_folder(built, None) / f"{_file_name(policy)}.mp4" if out is None else out
    # One picture per decision at most; fewer where the film would run faster than screens do.
    skip = max(1, math.ceil(1.0 / (MOST_FRAMES_PER_SECOND * built.control_period * slow) - 1e-9))
    rate = 1.0 / (built.control_period * slow * skip)
    with output.progress(f"Filming {policy}") as (progress, task), silent_stdout():
        film = kind(built, policy, physics=physics, master_late_s=master_late, shield=shield)
        count = 0

        def counted() -> Iterator[Frame]:
            nonlocal count
            for frame in _frames(film, seed, skip):
                count += 1
                progress.update(task, description=f"Filming {policy}: {count} pictures")
                yield frame

        write_film(counted(), target, rate)
    output.say(f"{count} pictures, {slow:g} times slower than reality: {shown(target)}")


def _file_name(policy: str) -> str:
    """A policy's name as a file's: of a learned agent, its algorithm and what its file is called."""
    algorithm, _, agent = policy.rpartition(":")
    return f"{algorithm}-{Path(agent).stem}" if algorithm else policy


def _frames(film: Film, seed: int, skip: int) -> Iterator[Frame]:
    """The pictures of one episode, every ``skip``-th decision, with the first and the last."""
    try:
        for k, over in enumerate(film.decisions(seed)):
            if k % skip == 0 or over:
                yield np.array(film.env.render(), dtype=np.uint8)
    finally:
        film.env.close()


def write_film(frames: Iterable[Frame], target: Path, rate: float) -> None:
    """Write pictures (H, W, 3) as ``.mp4`` or ``.gif``, whole or not at all, or as PNG files into a folder.

    Args:
        frames: At least one; each is written as it comes.
        target: Its suffix tells the format.
        rate: Pictures per second.

    Raises:
        RenderError: The film cannot be encoded here.
    """
    import imageio  # late: it looks for its plugins

    if target.suffix == "":
        for k, frame in enumerate(frames):
            with whole_file(target / f"frame_{k:04d}.png") as temporary:
                imageio.imwrite(temporary, frame, format="PNG")
        return
    options: dict[str, Any] = (
        {"format": "GIF", "duration": 1e3 / rate, "loop": 0}
        if target.suffix.lower() == ".gif"
        else {"format": "FFMPEG", "fps": rate, "codec": "libx264", "quality": 8, "macro_block_size": 2}
    )
    shots = iter(frames)
    shot = next(shots)  # an episode that cannot begin leaves no file
    with whole_file(target) as temporary:
        try:
            writer: Any = imageio.get_writer(temporary, mode="I", **options)
            with writer:
                writer.append_data(shot)
                for shot in shots:
                    writer.append_data(shot)
                for _ in range(round(HOLD * rate)):
                    writer.append_data(shot)
        except (RuntimeError, ImportError) as error:
            reason = (str(error).splitlines() or ["unknown reason"])[0]
            raise RenderError(
                f"cannot write {target}: {reason}", remedy="end --out in .gif, or name a folder"
            ) from error

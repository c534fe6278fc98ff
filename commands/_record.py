"""``armtempo record``: a film of one episode, in slow motion."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
import tyro
from numpy.typing import NDArray

from armtempo.commands.console import CellName, Output, default_folder, open_cell, shown, silent_stdout
from armtempo.files import whole_file

if TYPE_CHECKING:
    from armtempo.planners import CoordinationCell

Frame = NDArray[np.uint8]

MOST_FRAMES_PER_SECOND = 50.0
HOLD = 1.0  # [s] the last picture stays


def record(
    cell: CellName,
    *,
    policy: Annotated[str, tyro.conf.arg(metavar="NAME")] = "vci",
    out: Annotated[
        Path | None, tyro.conf.arg(metavar="FILE", help_behavior_hint="(default: results/<cell>/<policy>.mp4)")
    ] = None,
    slow: Annotated[float, tyro.conf.arg(metavar="X")] = 20.0,
    seed: Annotated[int, tyro.conf.arg(metavar="K")] = 0,
    physics: Literal["bullet", "ideal"] = "bullet",
    master_late: Annotated[float, tyro.conf.arg(metavar="S")] = 0.0,
) -> None:
    """Film one episode of a policy in the simulated cell, in slow motion.

    Args:
        cell: A bundled cell's name (see "armtempo cells"), or your own YAML file.
        policy: Who decides: phase-plane, sequential, constant-speed, constant-acceleration, delay, vci,
            offset, interval, optimal, random.
        out: A file ending in .mp4 or .gif, or a folder for single PNG pictures.
        slow: How many times slower than reality; arms that need a third of a second are shown for seven at 20.
        seed: Seed of the episode.
        physics: "bullet" simulates the arms with torque control in PyBullet, "ideal" moves them exactly as commanded.
        master_late: Seconds by which the first arm starts late, which the others do not know.
    """
    import math

    from armtempo.errors import ArmtempoError, UnknownNameError

    if not (math.isfinite(slow) and slow > 0.0):
        raise ArmtempoError(f"--slow must be a positive number, got {slow}", remedy="try --slow 20")
    if seed < 0:
        raise ArmtempoError(f"--seed must not be negative, got {seed}", remedy="try --seed 0")
    if not (math.isfinite(master_late) and master_late >= 0.0):
        raise ArmtempoError(
            f"--master-late must be a number of seconds, 0 or more, got {master_late}", remedy="try 0.1"
        )
    if out is not None and out.suffix.lower() not in (".mp4", ".gif", ""):
        raise UnknownNameError(
            "film format", out.suffix, (".mp4", ".gif"), remedy="end --out in .mp4 or .gif, or name a folder"
        )
    output = Output(None)
    built = open_cell(cell, output)
    target = default_folder(built, None) / f"{policy}.mp4" if out is None else out
    # One picture per decision at most; fewer where the film would run faster than screens do.
    skip = max(1, math.ceil(1.0 / (MOST_FRAMES_PER_SECOND * built.control_period * slow) - 1e-9))
    rate = 1.0 / (built.control_period * slow * skip)
    with output.progress(f"Filming {policy}") as (progress, task), silent_stdout():
        frames: list[Frame] = []
        for frame in _film(built, policy, seed=seed, physics=physics, master_late=master_late, skip=skip):
            frames.append(frame)
            progress.update(task, description=f"Filming {policy}: {len(frames)} pictures")
        progress.update(task, description=f"Writing {target.name}")
        write_film(frames, target, rate)
    output.say(f"{len(frames)} pictures, {slow:g} times slower than reality: {shown(target)}")


def _film(
    cell: CoordinationCell, name: str, *, seed: int, physics: Literal["bullet", "ideal"], master_late: float, skip: int
) -> Iterator[Frame]:
    """The pictures of one episode, every ``skip``-th decision, with the first and the last."""
    from armtempo import agents
    from armtempo.envs import coordination_v0

    policy = agents.make_policy(name, cell)
    env = coordination_v0.parallel_env(cell, physics=physics, render_mode="rgb_array", master_late_s=master_late)
    try:
        observations, _ = env.reset(seed=seed)
        policy.reset(seed)
        yield _picture(env.render())
        steps = 0
        while env.agents:
            seen = {agent: observations[agent] for agent in env.agents}
            observations, *_ = env.step(policy.act(seen, env))
            steps += 1
            if steps % skip == 0 or not env.agents:
                yield _picture(env.render())
    finally:
        env.close()


def _picture(frame: Frame | None) -> Frame:
    assert frame is not None  # render_mode is rgb_array
    return np.array(frame, dtype=np.uint8)


def write_film(frames: list[Frame], target: Path, rate: float) -> None:
    """Write pictures (H, W, 3) as ``.mp4`` or ``.gif``, whole or not at all, or as PNG files into a folder.

    Args:
        frames: At least one.
        target: Its suffix tells the format.
        rate: Pictures per second.

    Raises:
        RenderError: The film cannot be encoded here.
    """
    import imageio

    from armtempo.errors import RenderError

    if target.suffix == "":
        for k, frame in enumerate(frames):
            with whole_file(target / f"frame_{k:04d}.png") as temporary:
                imageio.imwrite(temporary, frame, format="PNG")
        return
    held: list[Any] = frames + [frames[-1]] * round(HOLD * rate)
    with whole_file(target) as temporary:
        try:
            if target.suffix.lower() == ".gif":
                imageio.mimwrite(temporary, held, format="GIF", duration=1e3 / rate, loop=0)
            else:
                imageio.mimwrite(
                    temporary, held, format="FFMPEG", fps=rate, codec="libx264", quality=8, macro_block_size=2
                )
        except (RuntimeError, ImportError) as error:
            reason = (str(error).splitlines() or ["unknown reason"])[0]
            raise RenderError(
                f"cannot write {target}: {reason}", remedy="end --out in .gif, or name a folder"
            ) from error

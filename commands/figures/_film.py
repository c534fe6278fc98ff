"""Pictures of an episode for films: its trace drawn between its ticks, too, with its clock."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import closing
from typing import Any, final

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray

from armtempo.arrays import Floats
from armtempo.commands.figures._style import INK, MUTED
from armtempo.envs.bodies import Renderer, Trace
from armtempo.planners import Cell, IKCell

Frame = NDArray[np.uint8]

FILM_SIZE = (1280, 720)
FRAMES_PER_SECOND = 25.0  # 40 ms: GIF counts hundredths of a second
CAPTION_HEIGHT = 56
SLOWNESSES = (1, 2, 5, 10, 20)
USUAL_LENGTH = 7.0  # [s] that a film lasts, about


def usual_slowness(duration: float) -> float:
    """How many times slower than reality an episode of so many seconds is shown."""
    return float(min(SLOWNESSES, key=lambda slow: abs(np.log(slow * max(duration, 1e-9) / USUAL_LENGTH))))


def film_times(duration: float, slow: float) -> Floats:
    """Instants (K,) of the pictures [s]: the first and the last of an episode, and between them as films run."""
    step = 1.0 / (FRAMES_PER_SECOND * slow)
    times = step * np.arange(int(np.ceil(duration / step - 1e-9)))
    return np.append(times, duration)


def pictures(cell: Cell, trace: Trace[Any], times: Floats, words: str) -> Iterator[Frame]:
    """The arms at instants (K,) [s] of an episode, (720, 1280, 3); ``words`` stand in the corner, beside the clock.

    Raises:
        RenderError: PyBullet cannot draw.
    """
    cell = getattr(trace, "cell", cell)  # paths and targets may have been drawn
    joints = _joints(trace.q if isinstance(trace.q, tuple) else (trace.q,), trace.time, times)
    caption = _Caption(words)
    with closing(Renderer(cell, "rgb_array", FILM_SIZE)) as renderer:
        for t, q in zip(times.tolist(), joints, strict=True):
            if isinstance(cell, IKCell):
                row = min(round(2.0 * t / cell.target.step), len(cell.target.position) - 1)
                renderer.show_target(cell.target.position[row], cell.target.rotation[row])
            frame = renderer.render(q)
            assert frame is not None  # a window is not asked for
            yield caption.write(frame, f"{t:.3f} s")


def _joints(q: Sequence[Floats], ticks: Floats, times: Floats) -> Floats:
    """(K, A, n) joints between the ticks, padded to the largest number of joints."""
    found = np.zeros((len(times), len(q), max(values.shape[1] for values in q)))
    for i, values in enumerate(q):
        for j, one in enumerate(values.T):
            found[:, i, j] = np.interp(times, ticks, one)
    return found


@final
class _Caption:
    """Words on the left and a clock on the right, upon the lower edge of pictures."""

    def __init__(self, words: str) -> None:
        width, _ = FILM_SIZE
        figure = Figure(figsize=(width / 100, CAPTION_HEIGHT / 100), dpi=100, facecolor="white")
        self._canvas: Any = FigureCanvasAgg(figure)  # its methods are untyped
        figure.text(0.02, 0.5, words, fontsize=17, color=MUTED, va="center")
        self._clock = figure.text(0.98, 0.5, "", fontsize=17, color=INK, va="center", ha="right")

    def write(self, frame: Frame, clock: str) -> Frame:
        """The picture with what it says: upon what is white there."""
        self._clock.set_text(clock)
        self._canvas.draw()
        said = np.asarray(self._canvas.buffer_rgba())[..., :3]
        frame[-CAPTION_HEIGHT:] = np.minimum(frame[-CAPTION_HEIGHT:], said)
        return frame

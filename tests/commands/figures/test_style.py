"""Figures as files."""

from __future__ import annotations

from pathlib import Path

import imageio.v3 as imageio

from armtempo.commands.figures._style import DPI, new_figure, write_png


def test_what_sticks_out_of_a_figure_is_not_cut(tmp_path: Path) -> None:
    sizes = []
    for text in ("short", "far too long for the figure that it stands in " * 3):
        figure = new_figure(3.0, 2.0)
        figure.text(0.1, 0.5, text, color="black")
        write_png(figure, tmp_path / "figure.png")
        picture = imageio.imread(tmp_path / "figure.png")
        sizes.append(picture.shape[:2])
        assert picture[:, -4:].min() > 250  # nothing touches the border
    assert sizes[0] == (2 * DPI, 3 * DPI)
    assert sizes[1][1] > 6 * DPI

"""Figures as files."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from matplotlib.figure import Figure

from armtempo.commands.console import Output
from armtempo.commands.figures._style import write_png


def draw(figures: Mapping[str, Figure], folder: Path, output: Output) -> list[str]:
    """Write figures as ``<name>.png``; returns the file names."""
    names = [f"{name}.png" for name in figures]
    with output.progress("Writing pictures", len(figures)) as (progress, task):
        for name, figure in zip(names, figures.values(), strict=True):
            write_png(figure, folder / name)
            progress.advance(task)
    return names

"""Episodes to be filmed, by kind of cell: an environment that renders, and who acts in it."""

from __future__ import annotations

from collections.abc import Mapping

from armtempo.commands.films._films import BlendFilm, CoordinationFilm, Film, IKFilm

__all__ = ["FILMS", "Film"]

FILMS: Mapping[str, type[Film]] = {"coordination": CoordinationFilm, "blend": BlendFilm, "ik": IKFilm}
"""By kind of cell."""

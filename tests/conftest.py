"""Fixtures that more than one folder of tests uses."""

from __future__ import annotations

import pytest

from armtempo.planners import Cell, load_cell


@pytest.fixture(scope="session")
def lee1991() -> Cell:
    """The bundled cell of the 1991 paper; immutable, so built once."""
    return load_cell("lee1991")

"""The command line: ``armtempo plan | evaluate | reproduce | plot | record | cells | ...``, its tables and figures.

Imports inside functions are late on purpose: planners and environments (numba, PyBullet), agents (torch), matplotlib
and rich are loaded by the command that needs them, so that ``--help`` and complaints about a line come at once. The
rooms ``plans``, ``reports``, ``papers`` and ``figures`` are themselves imported late, and import at their top.
"""

from __future__ import annotations

from armtempo.commands._main import main

__all__ = ["main"]

"""The command line: ``armtempo plan | evaluate | reproduce | plot | record | cells``, with its tables and figures."""

from __future__ import annotations

from armtempo.commands._main import main

__all__ = ["main"]

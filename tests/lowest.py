"""``python tests/lowest.py EXTRA...``: dependencies of pyproject.toml, each at the lowest version that it allows."""

from __future__ import annotations

import sys
import tomllib
from pathlib import Path

from packaging.requirements import Requirement


def lowest(text: str) -> str:
    """``numpy>=2.0,<3`` as ``numpy==2.0``; a bound that was never released fails to install, and so it should."""
    wanted = Requirement(text)
    bounds = [one.version for one in wanted.specifier if one.operator == ">="]
    if len(bounds) != 1:
        sys.exit(f"pyproject.toml: {text}: give it one lower bound (>=)")
    extras = f"[{','.join(sorted(wanted.extras))}]" if wanted.extras else ""
    marker = f"; {wanted.marker}" if wanted.marker else ""
    return f"{wanted.name}{extras}=={bounds[0]}{marker}"


project = tomllib.loads((Path(__file__).parents[1] / "pyproject.toml").read_text(encoding="utf-8"))["project"]
named = [*project["dependencies"], *(one for extra in sys.argv[1:] for one in project["optional-dependencies"][extra])]
sys.stdout.write("".join(f"{lowest(one)}\n" for one in named))

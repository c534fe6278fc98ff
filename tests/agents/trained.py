"""Agents that ``armtempo train`` made of the bundled training files with armtempo 0.1, kept to be read and run."""

from __future__ import annotations

from pathlib import Path

FILES = Path(__file__).parent / "files"
NAMES = tuple(sorted(file.stem for file in FILES.glob("*.npz")))


def trained(name: str) -> str:
    """The policy's name of one of them: ``lee1991``, ``feedback-ik``, ``blend-tracking``."""
    return f"ppo:{FILES / name}.npz"

"""The numbers of a URDF, each checked where it stands: how many, finite, of a size that arithmetic survives.

The reader behind this takes NaN, spreads one number over three axes, or fails in a way of its own. Signs, and what the
numbers mean together, are the business of those who use them.
"""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from collections.abc import Callable
from typing import Final, NamedTuple

from armtempo.errors import brief
from armtempo.robots._sizes import ANGLE_MAX, FORCE_MAX, INERTIA_MAX, LENGTH_MAX, LIMIT_MAX, MASS_MAX

__all__ = ["check_numbers", "check_part", "has_no_size", "numbers_of"]

Fail = Callable[[str, str, str], object]
"""Raises RobotError for an element, its problem and the remedy."""

DECIMAL: Final = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", re.ASCII)
NOT_FINITE: Final = re.compile(r"[+-]?(nan|inf|infinity)", re.ASCII | re.IGNORECASE)


class _Rule(NamedTuple):
    """What an attribute may hold."""

    counts: tuple[int, ...]
    most: float
    unit: str
    needed: bool = False
    zero: bool = True


_length, _angle = _Rule((1,), LENGTH_MAX, "metres", needed=True), _Rule((3,), ANGLE_MAX, "radians")
_triple, _limit = _Rule((3,), LENGTH_MAX, "metres"), _Rule((1,), LIMIT_MAX, "SI units")
_friction, _factor = _Rule((1,), FORCE_MAX, "SI units"), _Rule((1,), LIMIT_MAX, "SI units")

RULES: Final[dict[str, dict[str, _Rule]]] = {
    "origin": {"xyz": _triple, "rpy": _angle},
    "mass": {"value": _Rule((1,), MASS_MAX, "kg", needed=True)},
    "inertia": {
        name: _Rule((1,), INERTIA_MAX, "kg m^2", needed=True) for name in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
    },
    "box": {"size": _triple._replace(needed=True)},
    "sphere": {"radius": _length},
    "cylinder": {"radius": _length, "length": _length},
    "capsule": {"radius": _length, "length": _length},
    # One number for all axes is not URDF, but in files, and PyBullet and yourdfpy take it. Negative: a mirror image.
    "mesh": {"scale": _Rule((1, 3), LENGTH_MAX, "file units to metres, none of them 0", zero=False)},
    "axis": {"xyz": _Rule((3,), LENGTH_MAX, "any length")},
    "limit": dict.fromkeys(("lower", "upper", "effort", "velocity", "acceleration", "deceleration", "jerk"), _limit),
    "dynamics": {"damping": _friction, "friction": _friction},
    "mimic": {"multiplier": _factor, "offset": _factor},
    "calibration": {"rising": _factor, "falling": _factor, "reference_position": _factor},
    "safety_controller": dict.fromkeys(
        ("soft_lower_limit", "soft_upper_limit", "k_position", "k_velocity"), _factor
    ),
}  # fmt: skip


def numbers_of(text: str) -> list[float]:
    """The numbers of an attribute that was checked."""
    return [float(word) for word in text.split()]


def check_numbers(root: ET.Element, fail: Fail) -> None:
    """Let ``fail`` raise for the first number of a link or joint that is none, or there are too few or too many.

    What a link looks like is not looked at: that is the business of those who draw it.
    """
    for owner in root:
        if owner.tag in ("link", "joint"):
            for part in owner:
                if part.tag != "visual":
                    check_part(f"{owner.tag} {owner.get('name')!r}", part, fail)


def check_part(owner: str, part: ET.Element, fail: Fail) -> None:
    """The same for one element of a link or joint."""
    for element in part.iter():
        for name, rule in RULES.get(element.tag, {}).items():
            text = element.get(name)
            wrong = rule.needed if text is None else _wrong(text, rule)
            if wrong:
                where = f"<{part.tag}> " * (element is not part) + f"<{element.tag}"
                problem = f"a {where}> without {name}" if text is None else f"{where} {name}={brief(text)}>: {wrong}"
                count = " or ".join(map(str, rule.counts))
                remedy = f"give {count} finite number{'s' * (rule.counts != (1,))}, {rule.unit}"
                fail(owner, f"has {problem}", remedy)


def _wrong(text: str, rule: _Rule) -> str:
    """What is wrong with the numbers of an attribute; empty: nothing."""
    words = text.split()
    for word in words:
        if not DECIMAL.fullmatch(word):
            return f"{brief(word)} is not {'finite' if NOT_FINITE.fullmatch(word) else 'a number'}"
    if len(words) not in rule.counts:
        return f"{len(words)} number{'s' * (len(words) != 1)}"
    for word in words:
        value = float(word)
        if not abs(value) <= rule.most:
            return f"{brief(word)} is beyond {rule.most:g}"
        if value == 0.0 and not rule.zero:
            return "a scale of 0 leaves nothing of the mesh"
    return ""


def has_no_size(geometry: ET.Element) -> bool:
    """Whether a box, sphere, cylinder or capsule (checked) has no size at all, as dummies of some exporters have."""
    attributes = RULES.get(geometry.tag, {})
    if geometry.tag == "mesh" or not attributes:
        return False
    return all(value == 0.0 for name in attributes for value in numbers_of(geometry.get(name, "")))

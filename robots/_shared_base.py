"""Arms of one robot file: what carries them all is one static body, and each one's links are its own alone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np

from armtempo.errors import RobotError
from armtempo.robots._arm import Arm
from armtempo.robots._shapes import Shape, make_shape, pack

__all__ = ["share_bases"]


def share_bases(arms: Sequence[Arm]) -> tuple[tuple[Arm, ...], tuple[Shape, ...]]:
    """Arms of which several may be of one file at one place, as those of a torso, and the bodies that they share.

    Read alone, such an arm carries the whole robot at its base: the torso, and the other arms as they are at zero. Here
    it keeps what it moves; what none of them moves is static. An arm knows these bodies (``Arm.shared_base``), so that
    what touches by design counts no more than in itself.

    Returns:
        The arms in their order, and static bodies for ``Clearance``; all as it was where no two share a file and place.

    Raises:
        RobotError: A joint moves two of the arms, or they hold the others at different places.
    """
    shared, bodies = list(arms), list[Shape]()
    for group in _groups(arms):
        first = arms[group[0]]
        for one, other in combinations([arms[i] for i in group], 2):
            _check(one, other)
        moving = {shape.link_name for i in group for shape in arms[i].shapes if shape.link >= 0}
        bases = [shape for shape in first.shapes if shape.link < 0 and shape.link_name not in moving]
        names = tuple((f"{first.name}+/{shape.link_name}", shape.link_name) for shape in bases)
        for (name, _), shape in zip(names, bases, strict=True):
            T = first.T_world_base @ shape.T_link_shape
            bodies.append(make_shape(shape.kind, shape.size, T, link=-1, link_name=name, vertices=shape.vertices))
        for i in group:
            shapes = tuple(shape for shape in arms[i].shapes if shape.link >= 0)
            shared[i] = replace(arms[i], shapes=shapes, capsules=pack(shapes), shared_base=names)
    return tuple(shared), tuple(bodies)


def _groups(arms: Sequence[Arm]) -> list[list[int]]:
    """Numbers of arms of one file at one place, two at least."""
    found: list[list[int]] = []
    for i, arm in enumerate(arms):
        for group in found:
            other = arms[group[0]]
            if arm.urdf == other.urdf and np.allclose(arm.T_world_base, other.T_world_base, atol=1e-9):
                group.append(i)
                break
        else:
            found.append([i])
    return [group for group in found if len(group) > 1]


def _check(one: Arm, other: Arm) -> None:
    both = [name for name in other.joint_names if name in one.joint_names]
    if both == list(other.joint_names) == list(one.joint_names):
        raise RobotError(
            f"arms {one.name!r} and {other.name!r} are the same arm of {one.urdf.name} at the same place",
            remedy="give one of them another base, or another tip_link or group",
        )
    if both:
        raise RobotError(
            f"joint {both[0]!r} of {one.urdf.name} moves both {one.name!r} and {other.name!r}",
            remedy=f"hold it for both: locked: {{{both[0]}: 0.0}}",
        )
    for name, at in {**dict(one.locked), **dict(other.locked)}.items():
        places = [dict(arm.locked).get(name, 0.0) for arm in (one, other)]
        if places[0] != places[1] and name not in (*one.joint_names, *other.joint_names):
            raise RobotError(
                f"arms {one.name!r} and {other.name!r} hold joint {name!r} of {one.urdf.name} at {places[0]:g} and "
                f"{places[1]:g}",
                remedy=f"hold it at one place for both: locked: {{{name}: {at:g}}}",
            )

"""SRDF, which MoveIt keeps beside a URDF: groups of joints, named postures, pairs of links that need no look."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, final

from armtempo.errors import RobotError, UnknownNameError
from armtempo.reading import as_number

__all__ = ["Srdf", "SrdfGroup", "group_tip", "read_srdf"]


@dataclass(frozen=True, kw_only=True, slots=True)
class SrdfGroup:
    """What a group names: chains of links (base, tip), joints, links, other groups."""

    chains: tuple[tuple[str, str], ...]
    joints: tuple[str, ...]
    links: tuple[str, ...]
    groups: tuple[str, ...]


@final
@dataclass(frozen=True, kw_only=True, slots=True)
class Srdf:
    """What is read of a file."""

    file: Path
    groups: Mapping[str, SrdfGroup]
    states: Mapping[str, Mapping[str, Mapping[str, float]]]
    """By group and name: positions of joints [rad or m]."""
    disabled_pairs: tuple[tuple[str, str], ...]
    """Links whose collision with each other is not looked at."""
    end_effectors: Mapping[str, str]
    """By the group that carries one: the link that it is fixed to."""


def read_srdf(file: str | Path) -> Srdf:
    """Read an SRDF file.

    Raises:
        RobotError: It is none, or an element lacks what it needs; the message names it.
    """
    path = Path(file)
    try:
        root = ET.parse(path).getroot()  # noqa: S314 - the user's own file
    except (OSError, ET.ParseError) as error:
        raise RobotError(
            f"{path}: cannot be read as XML: {error}", remedy="give an SRDF file", file=str(path)
        ) from error
    if root.tag != "robot":
        raise RobotError(f"{path}: <{root.tag}> is not an SRDF's <robot>", remedy="give an SRDF file", file=str(path))

    def value(element: ET.Element, key: str) -> str:
        if not (found := element.get(key)):
            problem = f"{path}: <{element.tag} name={element.get('name')!r}> has no {key}"
            raise RobotError(problem, remedy="add it", file=str(path), element=element.tag)
        return found

    states: dict[str, dict[str, Mapping[str, float]]] = {}
    for state in root.findall("group_state"):
        joints = {value(joint, "name"): _position(path, state, joint) for joint in state.findall("joint")}
        states.setdefault(value(state, "group"), {})[value(state, "name")] = joints
    return Srdf(
        file=path,
        groups={
            value(group, "name"): SrdfGroup(
                chains=tuple((value(c, "base_link"), value(c, "tip_link")) for c in group.findall("chain")),
                joints=tuple(value(joint, "name") for joint in group.findall("joint")),
                links=tuple(value(link, "name") for link in group.findall("link")),
                groups=tuple(value(one, "name") for one in group.findall("group")),
            )
            for group in root.findall("group")
        },
        states=states,
        disabled_pairs=tuple((value(p, "link1"), value(p, "link2")) for p in root.findall("disable_collisions")),
        end_effectors={
            one.get("parent_group", ""): value(one, "parent_link")
            for one in root.findall("end_effector")
            if one.get("parent_group")
        },
    )


def _position(path: Path, state: ET.Element, joint: ET.Element) -> float:
    found = as_number((joint.get("value") or "").split()[0] if (joint.get("value") or "").split() else "")
    if found is None:
        raise RobotError(
            f"{path}: group_state {state.get('name')!r}: joint {joint.get('name')!r} has no number as its value",
            remedy="give radians or metres",
            file=str(path),
        )
    return found


def group_tip(
    srdf: Srdf, group: str, parent_joint: Mapping[str, Any], known: Callable[[str], str]
) -> tuple[str, tuple[str, ...]]:
    """The link at a group's end, and the names of its joints, fixed ones too.

    Args:
        srdf: Of the robot.
        group: Its name.
        parent_joint: By link, the joint before it.
        known: A remedy for the name of a link that there is not.

    Raises:
        UnknownNameError: There is no such group.
        RobotError: It names links or joints that the robot does not have, or no end of its own.
    """
    chains, joints, links = _members(srdf, group, [])
    child_of = {joint.name: link for link, joint in parent_joint.items()}
    for name in (*(end for chain in chains for end in chain), *links):
        if name not in parent_joint and not any(joint.parent == name for joint in parent_joint.values()):
            raise RobotError(f"{srdf.file}: group {group!r} names the unknown link {name!r}", remedy=known(name))
    for name in joints:
        if name not in child_of:
            raise RobotError(
                f"{srdf.file}: group {group!r} names the unknown joint {name!r}",
                remedy=f"joints: {', '.join(child_of)}",
            )
    own = set(joints) | {parent_joint[link].name for link in links if link in parent_joint}
    for base, tip in chains:
        link = tip
        while link != base:
            if link not in parent_joint:
                problem = f"{srdf.file}: group {group!r}: link {base!r} is not on the way to {tip!r}"
                raise RobotError(problem, remedy="swap base_link and tip_link, or name others")
            own.add(parent_joint[link].name)
            link = parent_joint[link].parent
    if len(chains) == 1:
        return chains[0][1], tuple(own)
    if group in srdf.end_effectors and srdf.end_effectors[group] in parent_joint:
        return srdf.end_effectors[group], tuple(own)
    inner = {parent_joint[child_of[name]].parent for name in own}
    ends = [child_of[name] for name in own if child_of[name] not in inner]
    if len(ends) != 1:
        raise RobotError(
            f"{srdf.file}: group {group!r} ends in {len(ends)} links: {', '.join(sorted(ends))}",
            remedy="choose one with tip_link",
        )
    return ends[0], tuple(own)


def _members(srdf: Srdf, group: str, above: Sequence[str]) -> tuple[list[tuple[str, str]], list[str], list[str]]:
    """Chains, joints and links of a group and of those in it."""
    if group not in srdf.groups:
        raise UnknownNameError("group", group, srdf.groups)
    if group in above:
        raise RobotError(f"{srdf.file}: group {group!r} is in itself", remedy="take it out")
    found = srdf.groups[group]
    chains, joints, links = list(found.chains), list(found.joints), list(found.links)
    for inner in found.groups:
        more = _members(srdf, inner, [*above, group])
        chains += more[0]
        joints += more[1]
        links += more[2]
    return chains, joints, links

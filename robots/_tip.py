"""Which link of a robot's tree carries the tool, where the file does not say."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

TOOL_FRAMES = ("tool0", "tcp", "tool_frame", "tool", "ee_link", "end_effector", "ee", "flange", "grasptarget", "hand")
"""Ends of the names of links, the preferred first, that files give to where a tool is."""

ARM_JOINTS = 3  # of a branch beside a longer one: as many may be another arm; a head or a wheel has fewer


class Tips(NamedTuple):
    """The tip, or what may be it."""

    link: str | None
    candidates: tuple[str, ...]


def choose_tip(root: str, children: Mapping[str, Sequence[Any]], turns: Callable[[Any], bool]) -> Tips:
    """The link at the end of the longest chain of joints that move, in front of a gripper.

    Where joints branch and none of the branches has more joints than lead there, they are fingers, and the tip is
    fixed to the link before them. Else the way goes on along the longest branch, unless a second one may be an arm,
    too. Of the links fixed to the last one that moves, it is the one with a name out of ``TOOL_FRAMES``, else the only
    one with nothing behind it.

    Args:
        root: The root link.
        children: Of each link, the joints behind it.
        turns: Whether a joint is of a type that moves. Those that mimic another count as fingers, not for lengths.
    """
    tree = [root]
    for link in tree:
        tree += [joint.child for joint in children[link]]
    depth: dict[str, int] = {}

    def length(joint: Any) -> int:
        return depth[joint.child] + (turns(joint) and joint.mimic is None)

    for link in reversed(tree):
        depth[link] = max(map(length, children[link]), default=0)
    here, before = root, 0
    while True:
        fixed = [here]
        for link in fixed:
            fixed += [joint.child for joint in children[link] if not turns(joint)]
        behind = [joint for link in fixed for joint in children[link] if turns(joint)]
        longest = max(map(length, behind), default=0)
        if longest == 0 or (len(behind) > 1 and longest <= before):
            break
        arms = [joint.child for joint in behind if length(joint) >= min(max(ARM_JOINTS, longest // 2), longest)]
        if len(arms) > 1:
            return Tips(None, tuple(name for link in arms for name in choose_tip(link, children, turns).candidates))
        here, before = arms[0], before + 1
    for name in TOOL_FRAMES:
        found = [link for link in fixed if link.lower() == name or link.lower().endswith(f"_{name}")]
        if len(found) == 1:
            return Tips(found[0], (found[0],))
    ends = [link for link in fixed if not children[link]] or [here]
    return Tips(ends[0] if len(ends) == 1 else None, tuple(ends))

"""The space of graphs."""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium.spaces import Box, Dict, Space

from armtempo.envs.common import Entry
from armtempo.envs.coordination.graph._entries import EDGE_ENTRIES, GRAPH_ARMS, NODE_ENTRIES


def graph_space(own: bool = True) -> Dict:
    """The space of graphs of up to 8 arms, for ``observation="graph"``: a Dict of float32 arrays.

    ``nodes`` (8, 19), of every arm, in their order; absent ones are 0:

    =====  ==============================  =======  ====================================================================
    index  name                            range    meaning
    =====  ==============================  =======  ====================================================================
    0      present                         [0, 1]   1 if there is such an arm
    1      arrived                         [0, 1]   1 if it is at its end
    2      progress                        [0, 1]   share of its path that is behind it
    3      speed                           [0, 1]   mu as a share of mu*, the highest speed from which the end can be
                                                    met
    4      at_rest                         [0, 1]   1 if it does not move
    5      minimum_time                    [0, 1]   of its whole path
    6      elapsed                         [0, 2]   since the start of the episode
    7      time_to_go                      [0, 2]   to its end at full speed from here, the rest it is expected to stand
                                                    included
    8      delay                           [0, 2]   how much later it arrives by the order that holds, behind all that
                                                    it waits for
    9      slack                           [0, 2]   how much earlier than the last arm it arrives then
    10     next_delay                      [0, 2]   what it waits at the first place where it has to wait; 0: nowhere
    11     next_wait                       [0, 2]   until it is at that place at full speed; longest if there is none
    12     restart                         [0, 2]   what it loses if it stops here and goes again
    13     stands                          [0, 1]   1 if it stands though it was sent on
    14     unchanged                       [0, 2]   since when it stands so, or goes
    15     expected_rest                   [0, 2]   how long it is expected to stand on, as those seen so far did
    16     stops                           [0, 1]   how often it came to stand so, a quarter for each, 1 at most
    17     rested                          [0, 2]   how long it has stood so in all, when it goes again
    18     obeyed                          [0, 1]   share of its last command that it obeyed, where that could be seen
    =====  ==============================  =======  ====================================================================

    ``edges`` (8, 8, 10), of every arm i and other arm j; where there is no region ahead all is 0:

    =====  ==============================  =======  ====================================================================
    index  name                            range    meaning
    =====  ==============================  =======  ====================================================================
    0      ahead                           [0, 1]   1 if the two have a collision region ahead; what follows is of the
                                                    next on i's path
    1      regions                         [0, 1]   how many they have ahead, an eighth for each, 1 at most
    2      first                           [-1, 1]  by the order that holds: 1 arm i passes first, -1 arm j, 0 nobody
                                                    waits
    3      open                            [0, 1]   1 if either may still pass first
    4      wait                            [-2, 2]  how much later than at full speed i gets there if j passes first
    5      lead                            [-2, 2]  how much later j gets there if i passes first
    6      entry                           [-2, 2]  until i is where it would have to wait, at full speed
    7      exit                            [-2, 2]  until i has left the region, at full speed
    8      tail                            [0, 2]   what i needs from there to its end
    9      delay                           [0, 2]   how late by the order that holds whoever waits there is
    =====  ==============================  =======  ====================================================================

    ``own`` (8,), 1 at the arm that sees it, for agents that decide for one arm.

    All times are in one unit, the longest minimum time of the cell's arms, and cut off at 2 of it. What cannot be, as
    passing first where the other is in already, takes 2. A path that is behind an arm is told as times below 0.

    Args:
        own: With ``own``; without it the space is that of what all arms see together.
    """
    spaces: dict[str, Space[Any]] = {
        "nodes": _box((GRAPH_ARMS,), NODE_ENTRIES),
        "edges": _box((GRAPH_ARMS, GRAPH_ARMS), EDGE_ENTRIES),
    }
    if own:
        spaces["own"] = Box(0.0, 1.0, (GRAPH_ARMS,), dtype=np.float32)
    return Dict(spaces)


def _box(shape: tuple[int, ...], entries: tuple[Entry, ...]) -> Box:
    low, high = (
        np.broadcast_to(np.array(ends, dtype=np.float32), (*shape, len(entries))).copy()
        for ends in ([entry.low for entry in entries], [entry.high for entry in entries])
    )
    return Box(low, high, dtype=np.float32)

"""What a graph of arms and pairs shows: one table gives the spaces, the docstrings and the tests.

All times are in one unit, the longest minimum time of the cell's arms, and cut off at ``LONGEST`` of it.
"""

from __future__ import annotations

from armtempo.envs.common import Entry

GRAPH_ARMS = 8
"""How many arms a graph has room for; entries of absent ones are 0."""
LONGEST = 2.0
"""Longest time that is told, in units."""

NODE_ENTRIES = (
    Entry("present", 0.0, 1.0, "1 if there is such an arm"),
    Entry("arrived", 0.0, 1.0, "1 if it is at its end"),
    Entry("progress", 0.0, 1.0, "share of its path that is behind it"),
    Entry("speed", 0.0, 1.0, "mu as a share of mu*, the highest speed from which the end can be met"),
    Entry("at_rest", 0.0, 1.0, "1 if it does not move"),
    Entry("minimum_time", 0.0, 1.0, "of its whole path"),
    Entry("elapsed", 0.0, LONGEST, "since the start of the episode"),
    Entry("time_to_go", 0.0, LONGEST, "to its end at full speed from here, the rest it is expected to stand included"),
    Entry("delay", 0.0, LONGEST, "how much later it arrives by the order that holds, behind all that it waits for"),
    Entry("slack", 0.0, LONGEST, "how much earlier than the last arm it arrives then"),
    Entry("next_delay", 0.0, LONGEST, "what it waits at the first place where it has to wait; 0: nowhere"),
    Entry("next_wait", 0.0, LONGEST, "until it is at that place at full speed; longest if there is none"),
    Entry("restart", 0.0, LONGEST, "what it loses if it stops here and goes again"),
    Entry("stands", 0.0, 1.0, "1 if it stands though it was sent on"),
    Entry("unchanged", 0.0, LONGEST, "since when it stands so, or goes"),
    Entry("expected_rest", 0.0, LONGEST, "how long it is expected to stand on, as those seen so far did"),
    Entry("stops", 0.0, 1.0, "how often it came to stand so, a quarter for each, 1 at most"),
    Entry("rested", 0.0, LONGEST, "how long it has stood so in all, when it goes again"),
    Entry("obeyed", 0.0, 1.0, "share of its last command that it obeyed, where that could be seen"),
)

EDGE_ENTRIES = (
    Entry("ahead", 0.0, 1.0, "1 if the two have a collision region ahead; what follows is of the next on i's path"),
    Entry("regions", 0.0, 1.0, "how many they have ahead, an eighth for each, 1 at most"),
    Entry("first", -1.0, 1.0, "by the order that holds: 1 arm i passes first, -1 arm j, 0 nobody waits"),
    Entry("open", 0.0, 1.0, "1 if either may still pass first"),
    Entry("wait", -LONGEST, LONGEST, "how much later than at full speed i gets there if j passes first"),
    Entry("lead", -LONGEST, LONGEST, "how much later j gets there if i passes first"),
    Entry("entry", -LONGEST, LONGEST, "until i is where it would have to wait, at full speed"),
    Entry("exit", -LONGEST, LONGEST, "until i has left the region, at full speed"),
    Entry("tail", 0.0, LONGEST, "what i needs from there to its end"),
    Entry("delay", 0.0, LONGEST, "how late by the order that holds whoever waits there is"),
)

NODE_PLACES = {entry.name: k for k, entry in enumerate(NODE_ENTRIES)}
EDGE_PLACES = {entry.name: k for k, entry in enumerate(EDGE_ENTRIES)}
"""Where each entry stands, by its name."""

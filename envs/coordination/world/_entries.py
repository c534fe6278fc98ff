"""What an arm among others observes: one table gives the space, the docstrings and the tests."""

from __future__ import annotations

from armtempo.envs.common import Entry

OTHERS = 2
"""How many other arms are seen: the most constraining ones, nearest collision region first; unused entries are 0."""


OWN = (
    Entry("progress", -1.0, 1.0, "position on the own path, start -1, end 1"),
    Entry("speed", -1.0, 1.0, "mu as a share of mu*, the highest speed from which the end can be met; 0 is -1"),
    Entry("lowest_acceleration", -1.0, 1.0, "LB as a share of 8 length / T^2 (T: minimum time)"),
    Entry("highest_acceleration", -1.0, 1.0, "UB as a share of the same"),
    Entry("time_to_go", -1.0, 1.0, "what the minimum-time motion still takes from here as a share of T; none is -1"),
)


OTHER = (
    Entry("present", 0.0, 1.0, "1 if the slot holds an arm"),
    Entry(
        "distance", -1.0, 1.0, "way to the next collision region with it, as a share of the own path; none ahead is 1"
    ),
    Entry(
        "release", -1.0, 1.0, "way it has still to go until that region is released, as a share of its path; 0 is -1"
    ),
    Entry("progress", -1.0, 1.0, "its position on its path, start -1, end 1"),
    Entry("speed", -1.0, 1.0, "its mu as a share of its mu*; 0 is -1"),
    Entry("time_to_go", -1.0, 1.0, "what its minimum-time motion still takes as a share of its T; none is -1"),
    Entry(
        "wait",
        -1.0,
        1.0,
        "how long to wait so that the minimum-time motion from here passes behind its one from where it is, as a share "
        "of T; 0 and less: no need; no region ahead is -1",
    ),
    Entry("lead", -1.0, 1.0, "the same of it behind this arm, as a share of its T"),
)


COORDINATION_ENTRIES = (
    *OWN,
    *(Entry(f"other_{k}.{e.name}", min(e.low, 0.0), e.high, e.meaning) for k in range(OTHERS) for e in OTHER),
)


SIZE = len(COORDINATION_ENTRIES)

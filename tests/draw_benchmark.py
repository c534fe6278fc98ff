"""``python tests/draw_benchmark.py [FAMILY [ARMS]]``: draw the benchmark set anew, or a part of it; takes hours.

Each part is written to ``configs/benchmarks/coordination.json`` when it is complete, and replaces what was there of it.
"""

from __future__ import annotations

import logging
import sys

from armtempo.configs import data_path
from armtempo.files import whole_file
from armtempo.planners.instances import PARTS, BenchmarkInstance, SetPart, benchmark_instances, draw_benchmark, dump

FILE = data_path("benchmarks/coordination.json")


def write(instances: list[BenchmarkInstance]) -> None:
    """The whole set, in the order of its parts."""
    with whole_file(FILE) as temporary:
        temporary.write_text(dump(one.record() for one in instances), encoding="utf-8")


def main(family: str | None = None, arms: str | None = None) -> None:
    """Draw the parts of a family and number of arms, by default all."""
    logging.basicConfig(level=logging.INFO, format="%(asctime)s %(message)s")
    kept: dict[tuple[str, int], list[BenchmarkInstance]] = {}
    for one in benchmark_instances():
        kept.setdefault((one.family, one.arms), []).append(one)

    def wanted(part: SetPart) -> bool:
        return family in (None, part.family) and arms in (None, str(part.arms))

    for part in filter(wanted, PARTS):
        kept[part.family, part.arms] = list(draw_benchmark(part, logging.info))
        write([one for part in PARTS for one in kept.get((part.family, part.arms), [])])


if __name__ == "__main__":
    main(*sys.argv[1:])

"""``python tests/draw_benchmark.py [FAMILY [ARMS]]``: draw the benchmark set anew, or a part of it; takes hours.

Each part is written to ``configs/benchmarks/coordination.json`` when it is complete, and replaces what was there of it.
"""

from __future__ import annotations

import json
import logging
import sys
from typing import Any

from armtempo.configs import data_path
from armtempo.files import whole_file
from armtempo.planners.instances import PARTS, SetPart, draw_benchmark, dump

FILE = data_path("benchmarks/coordination.json")


def replace(part: SetPart, records: list[dict[str, Any]]) -> None:
    """Write the set with these records for a part; read anew, for others may draw other parts meanwhile."""
    kept: dict[tuple[str, int], list[dict[str, Any]]] = {}
    for record in json.loads(FILE.read_text(encoding="utf-8"))["instances"]:
        kept.setdefault((record["family"], len(record["cell"]["arms"])), []).append(record)
    kept[part.family, part.arms] = records
    with whole_file(FILE) as temporary:
        text = dump(record for part in PARTS for record in kept.get((part.family, part.arms), []))
        temporary.write_text(text, encoding="utf-8")


def main(family: str | None = None, arms: str | None = None) -> None:
    """Draw the parts of a family and number of arms, by default all."""
    logging.basicConfig(level=logging.INFO, format="%(asctime)s %(message)s")
    for part in PARTS:
        if family in (None, part.family) and arms in (None, str(part.arms)):
            replace(part, [one.record() for one in draw_benchmark(part, logging.info)])


if __name__ == "__main__":
    main(*sys.argv[1:])

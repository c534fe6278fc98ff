"""Random cells, the benchmark set, instance files and the bench over them."""

from __future__ import annotations

from armtempo.planners.instances._bench import BenchResult, Claim, bench_cell, bench_claims
from armtempo.planners.instances._benchmark_set import (
    PARTS,
    SET_FAMILIES,
    SPLITS,
    BenchmarkInstance,
    SetPart,
    benchmark_instances,
    draw_benchmark,
    dump,
)
from armtempo.planners.instances._cell_draws import ARMS_OF, FAMILIES
from armtempo.planners.instances._generator import (
    CellLabels,
    GeneratedCell,
    cell_name,
    generate_cell,
    label_cell,
)
from armtempo.planners.instances._instance_file import PLANNED_METHODS, Instance, load_instance, save_instance

__all__ = [
    "ARMS_OF",
    "PARTS",
    "SET_FAMILIES",
    "SetPart",
    "dump",
    "BenchResult",
    "BenchmarkInstance",
    "CellLabels",
    "Claim",
    "FAMILIES",
    "GeneratedCell",
    "Instance",
    "PLANNED_METHODS",
    "SPLITS",
    "bench_cell",
    "bench_claims",
    "benchmark_instances",
    "cell_name",
    "draw_benchmark",
    "generate_cell",
    "label_cell",
    "load_instance",
    "save_instance",
]

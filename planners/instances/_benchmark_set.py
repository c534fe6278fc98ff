"""The fixed benchmark set: instances of the generator, kept as small records that build the same cells again."""

from __future__ import annotations

import itertools
import json
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any, Literal, final, get_args

from armtempo.configs import CellConfig, data_path
from armtempo.errors import UnknownNameError
from armtempo.planners.cells import CoordinationCell, build_cell
from armtempo.planners.instances._generator import CellLabels, config_of, generate_cell

Split = Literal["train", "validation", "test"]
SPLITS: tuple[str, ...] = get_args(Split)


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class BenchmarkInstance:
    """One cell of the benchmark set.

    Attributes:
        family: What kind of arms.
        seed: The generator's seed, and
        index: which instance of it.
        split: ``train``, ``validation`` or ``test``.
        data: What the cell's file says, as plain values.
        labels: What was known of it when the set was made.
    """

    family: str
    seed: int
    index: int
    split: Split
    data: Mapping[str, Any]
    labels: CellLabels

    @property
    def name(self) -> str:
        """The cell's name."""
        return str(self.data["name"])

    @property
    def config(self) -> CellConfig:
        """The checked cell file."""
        return config_of(self.name, self.data)

    def build(self) -> CoordinationCell:
        """Build and certify the cell; raises as ``build_cell``."""
        return build_cell(self.config)

    def record(self) -> dict[str, Any]:
        """As JSON can hold it."""
        return {
            "family": self.family,
            "seed": self.seed,
            "index": self.index,
            "split": self.split,
            "labels": self.labels.record(),
            "cell": dict(self.data),
        }


def split_of(place: int) -> Split:
    """The split of the instance that was kept as number ``place`` of its family and kind.

    Of every five: three train, one validation, one test.
    """
    return ("train", "test", "train", "validation", "train")[place % 5]


KINDS = ("mixed", "uniform", "other")


def kind_of(labels: CellLabels) -> str:
    """What the benchmark set is balanced over: feasible ``mixed``, feasible ``uniform``, ``other``."""
    return labels.priority_class if labels.status == "feasible" and labels.priority_class in KINDS else "other"


SET_SEED = 1991
QUOTAS: Mapping[str, Mapping[str, int]] = {
    "planar": {"mixed": 24, "uniform": 24, "other": 12},
    "panda": {"mixed": 8, "uniform": 4, "other": 4},
    "iiwa": {"mixed": 3, "uniform": 3, "other": 2},
}


def draw_benchmark(family: str, report: Callable[[str], None] = lambda _: None) -> Iterator[BenchmarkInstance]:
    """Draw a family of the benchmark set anew: instances 0, 1, 2, ... of its seed, each kept while its kind lacks some.

    Args:
        family: One of those in ``QUOTAS``.
        report: Called with one line per instance that was drawn, kept or not.
    """
    count: Counter[str] = Counter()
    quotas = QUOTAS[family]
    for index in itertools.count():
        if all(count[kind] >= quota for kind, quota in quotas.items()):
            return
        generated = generate_cell(family, SET_SEED, index)
        kind = kind_of(generated.labels)
        keep = count[kind] < quotas[kind]
        report(f"{generated.data['name']}: {kind}{'' if keep else ', not kept'}")
        if keep:
            yield BenchmarkInstance(
                family=family,
                seed=SET_SEED,
                index=index,
                split=split_of(count[kind]),
                data=generated.data,
                labels=generated.labels,
            )
            count[kind] += 1


def dump(records: Iterable[Mapping[str, Any]]) -> str:
    """The file of the set: one line per instance."""
    lines = ",\n".join(json.dumps(record, separators=(",", ":")) for record in records)
    rule = "per family, instances 0, 1, 2, ... of the seed, each kept while its kind lacks some; see draw_benchmark"
    return f'{{"version":1,"rule":"{rule}","instances":[\n{lines}\n]}}\n'


@cache
def _all() -> tuple[BenchmarkInstance, ...]:
    data = json.loads(data_path("benchmarks/coordination.json").read_text(encoding="utf-8"))
    return tuple(
        BenchmarkInstance(
            family=record["family"],
            seed=record["seed"],
            index=record["index"],
            split=record["split"],
            data=record["cell"],
            labels=CellLabels.from_record(record["labels"]),
        )
        for record in data["instances"]
    )


def benchmark_instances(split: str | None = None, *, family: str | None = None) -> tuple[BenchmarkInstance, ...]:
    """The instances of the benchmark set, or those of a split or family, in a fixed order.

    Args:
        split: ``train``, ``validation`` or ``test``; None: all.
        family: One of those in the set, ``QUOTAS``; None: all.

    Raises:
        UnknownNameError: No such split or family.
    """
    if split is not None and not (isinstance(split, str) and split in SPLITS):
        raise UnknownNameError("split", split, SPLITS)
    if family is not None and not (isinstance(family, str) and family in QUOTAS):
        raise UnknownNameError("family", family, tuple(QUOTAS))
    return tuple(one for one in _all() if split in (None, one.split) and family in (None, one.family))

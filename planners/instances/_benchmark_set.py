"""The fixed benchmark set: instances of the generator, kept as small records that build the same cells again."""

from __future__ import annotations

import itertools
import json
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any, Literal, final, get_args

from armtempo.configs import CellConfig, data_path
from armtempo.errors import InfeasibleError, UnknownNameError
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
    def arms(self) -> int:
        """How many arms it has."""
        return len(self.data["arms"])

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


SET_SEED = 1991
PAIR_SPLITS: tuple[Split, ...] = ("train", "test", "train", "validation", "train")
MANY_SPLITS: tuple[Split, ...] = ("train", "test", "validation", "test", "train")  # what is compared takes many cells


@dataclass(frozen=True, kw_only=True)
class SetPart:
    """Cells of one family and number of arms in the set.

    Attributes:
        family: One of ``FAMILIES``.
        arms: How many.
        kinds: How many cells of each kind, see ``kind_of``.
        splits: Of the cells that are kept of a kind, one after the other, and again.
    """

    family: str
    arms: int = 2
    kinds: Mapping[str, int]
    splits: tuple[Split, ...] = MANY_SPLITS

    def kind_of(self, labels: CellLabels) -> str:
        """What the part is balanced over: of feasible cells ``mixed`` and ``uniform`` or all as one; ``other``."""
        if labels.status != "feasible":
            return "other"
        return labels.priority_class if labels.priority_class in self.kinds else "feasible"


def _many(family: str, arms: Sequence[int], **kinds: int) -> list[SetPart]:
    return [SetPart(family=family, arms=count, kinds=kinds) for count in arms]


PARTS: tuple[SetPart, ...] = (
    SetPart(family="planar", kinds={"mixed": 24, "uniform": 24, "other": 12}, splits=PAIR_SPLITS),
    SetPart(family="panda", kinds={"mixed": 8, "uniform": 4, "other": 4}, splits=PAIR_SPLITS),
    SetPart(family="iiwa", kinds={"mixed": 3, "uniform": 3, "other": 2}, splits=PAIR_SPLITS),
    *_many("shaped", (2,), feasible=25),
    *_many("ring", (3, 4), feasible=25),
    *_many("ring", (5, 6), feasible=25, other=1),  # of fewer arms hardly any cannot be planned
    *_many("ring", (8,), feasible=5),
    *_many("rows", (4, 6), feasible=20),
    *_many("fixture", (3, 4), feasible=20),
    *_many("panda", (3, 4), feasible=5),
    *_many("ur5e", (3, 4), feasible=5),
)
SET_FAMILIES: tuple[str, ...] = tuple(dict.fromkeys(part.family for part in PARTS))


def draw_benchmark(part: SetPart, report: Callable[[str], None] = lambda _: None) -> Iterator[BenchmarkInstance]:
    """Draw a part of the benchmark set anew: instances 0, 1, 2, ... of its seed, each kept while its kind lacks some.

    Args:
        part: Which.
        report: Called with one line per instance that was drawn, kept or not.
    """
    count: Counter[str] = Counter()
    for index in itertools.count():
        if all(count[kind] >= wanted for kind, wanted in part.kinds.items()):
            return
        try:
            generated = generate_cell(part.family, SET_SEED, index, arms=part.arms)
        except InfeasibleError as nothing:
            report(nothing.message)
            continue
        kind = part.kind_of(generated.labels)
        keep = count[kind] < part.kinds.get(kind, 0)
        report(f"{generated.data['name']}: {kind}{'' if keep else ', not kept'}")
        if keep:
            yield BenchmarkInstance(
                family=part.family,
                seed=SET_SEED,
                index=index,
                split=part.splits[count[kind] % len(part.splits)],
                data=generated.data,
                labels=generated.labels,
            )
            count[kind] += 1


def dump(records: Iterable[Mapping[str, Any]]) -> str:
    """The file of the set: one line per instance."""
    lines = ",\n".join(json.dumps(record, separators=(",", ":")) for record in records)
    rule = "per part, instances 0, 1, 2, ... of the seed, each kept while its kind lacks some; see draw_benchmark"
    return f'{{"version":2,"rule":"{rule}","instances":[\n{lines}\n]}}\n'


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


def benchmark_instances(
    split: str | None = None, *, family: str | None = None, arms: Collection[int] | None = None
) -> tuple[BenchmarkInstance, ...]:
    """The instances of the benchmark set, or those of a split, a family, or some numbers of arms, in a fixed order.

    Args:
        split: ``train``, ``validation`` or ``test``; None: all.
        family: One of ``SET_FAMILIES``; None: all.
        arms: Numbers of arms; None: all.

    Raises:
        UnknownNameError: No such split or family.
    """
    if split is not None and not (isinstance(split, str) and split in SPLITS):
        raise UnknownNameError("split", split, SPLITS)
    if family is not None and not (isinstance(family, str) and family in SET_FAMILIES):
        raise UnknownNameError("family", family, SET_FAMILIES)
    return tuple(
        one
        for one in _all()
        if split in (None, one.split) and family in (None, one.family) and (arms is None or one.arms in arms)
    )

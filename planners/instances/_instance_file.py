r"""Instances as files: charts and path coefficients, for planning and learning without robots and meshes.

One compressed npz per cell. The states of a chart take two bits per cell before compression.
"""

from __future__ import annotations

import io
import json
import zipfile
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path
from typing import Any, final

import numpy as np
from numpy.typing import NDArray

from armtempo.errors import InputError, UnknownNameError
from armtempo.files import whole_file
from armtempo.planners.cells import CoordinationCell
from armtempo.planners.charts import CoordinationChart
from armtempo.planners.coordination import Motions, TimingProblem, delayed, offset, optimal, plan_vci, prioritised
from armtempo.planners.instances._generator import CellLabels
from armtempo.planners.topp import PathDynamics, PhasePlane, PhaseTrajectory

FILE_VERSION = 1
PLANNED_METHODS = ("delay", "offset", "vci", "interval", "optimal")
COEFFICIENTS = ("grid", "M", "Q", "R", "S", "torque_min", "torque_max", "speed_max")


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Instance:
    """What timing needs of a cell: ``Instance.of`` it, or read back from a file by ``load_instance``.

    Attributes:
        name: The cell's name.
        family: What kind of arms, empty if it was not generated.
        labels: What is known of it.
        timing: Phase planes, charts and bound.
        control_period: Time between two decisions [s].
    """

    name: str
    family: str
    labels: CellLabels
    timing: TimingProblem
    control_period: float

    @classmethod
    def of(cls, cell: CoordinationCell, labels: CellLabels, *, family: str = "") -> Instance:
        """A cell's planes, charts and bound motions, with no plan made yet."""
        return cls(
            name=cell.name,
            family=family,
            labels=labels,
            timing=TimingProblem(
                names=cell.timing.names,
                planes=cell.planes,
                chart_between=cell.chart_between,
                bound_chart_between=cell.bound_chart_between,
                bound_motions=lambda: cell.bound_motions,
            ),
            control_period=cell.control_period,
        )

    def plan(self, method: str, *, order: Sequence[int] | None = None) -> Motions:
        """Motions of all arms by one of ``PLANNED_METHODS``, as they leave the planner.

        ``schedule`` certifies these motions on the cell's joints, and gives up a ``vci`` plan that fails for one by
        ``interval``; here are no joints to certify, and ``vci`` stands as it is.

        Args:
            method: One of ``PLANNED_METHODS``.
            order: Arms by priority, by default as in the cell; ``optimal`` finds its own.

        Raises:
            UnknownNameError: No such method.
            InputError: ``order`` does not name every arm once.
            InfeasibleError: The method has no plan.
        """
        order = self.timing.arms if order is None else tuple(order)
        if sorted(order) != list(self.timing.arms):
            raise InputError(
                f"order {order} does not name each of the {len(self.timing.arms)} arms once",
                remedy="give their indices, the first never yields",
            )
        if method == "delay":
            return delayed(self.timing, self.timing.fastest, order)
        if method == "offset":
            return offset(self.timing, order)
        if method == "interval":
            return prioritised(self.timing, order)
        if method == "vci":
            return plan_vci(self.timing.planes, self.timing.chart_between, order, self.control_period)[0]
        if method == "optimal":
            return optimal(self.timing)[0]
        raise UnknownNameError("method", method, PLANNED_METHODS)


def pack_states(states: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Chart states 0, 1, 2 as two planes of bits (2, R R / 8)."""
    flat = states.ravel()
    return np.stack([np.packbits(flat & 1), np.packbits(flat >> 1)])


def unpack_states(packed: NDArray[np.uint8], resolution: int) -> NDArray[np.uint8]:
    """Back from ``pack_states``, (R, R)."""
    low, high = (np.unpackbits(plane, count=resolution**2) for plane in packed)
    return (low + 2 * high).reshape(resolution, resolution).astype(np.uint8)


def save_instance(file: Path, cell: CoordinationCell, labels: CellLabels, *, family: str = "") -> None:
    """Write a cell's charts, path coefficients, minimum-time motions of its bound and labels, whole or not at all."""
    arrays: dict[str, Any] = {}
    for i, (plane, (motion, share)) in enumerate(zip(cell.planes, cell.bound_motions, strict=True)):
        arrays |= {f"arm{i}_{name}": getattr(plane.dynamics, name) for name in COEFFICIENTS}
        arrays |= {f"arm{i}_bound_{name}": getattr(motion, name) for name in ("lam", "mu", "time")}
        arrays[f"arm{i}_bound_share"] = share
    for i, j in combinations(range(len(cell.arms)), 2):
        for kind, chart in (("chart", cell.chart_between(i, j)), ("bound", cell.bound_chart_between(i, j))):
            arrays[f"{kind}_{i}_{j}"] = pack_states(chart.states)
            arrays[f"{kind}_{i}_{j}_shape"] = [chart.resolution, chart.length_a, chart.length_b, chart.d_min]
    head = {
        "version": FILE_VERSION,
        "name": cell.name,
        "family": family,
        "arms": [arm.name for arm in cell.arms],
        "joints": [plane.dynamics.joints for plane in cell.planes],
        "mu_end": [plane.mu_end for plane in cell.planes],
        "control_period_s": cell.control_period,
        "labels": labels.record(),
    }
    arrays["head"] = np.frombuffer(json.dumps(head).encode(), dtype=np.uint8)
    packed = io.BytesIO()  # a full disk then leaves no open archive behind
    np.savez_compressed(packed, **arrays)
    with whole_file(file) as temporary:
        temporary.write_bytes(packed.getbuffer())


def load_instance(file: str | Path) -> Instance:
    """Read an instance that ``save_instance`` or ``armtempo cells generate`` wrote. Asks no robot, mesh or distance.

    Raises:
        InputError: The file cannot be read, or is no instance of this version.
    """
    path = Path(file)
    remedy = "armtempo cells generate --out DIR"
    try:
        with np.load(io.BytesIO(path.read_bytes()), allow_pickle=False) as archive:
            arrays = {name: archive[name] for name in archive.files}
        head = json.loads(arrays["head"].tobytes())
        version = head["version"]
    except (OSError, EOFError, TypeError, ValueError, KeyError, zipfile.BadZipFile, zlib.error) as error:
        raise InputError(f"{path}: is no instance: {error!r}", remedy=remedy) from error
    if version != FILE_VERSION:
        raise InputError(f"{path}: version {version}, this reads {FILE_VERSION}", remedy="generate it again")
    try:
        return _instance(head, arrays)
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(f"{path}: is no instance: {error!r}", remedy=remedy) from error


def _instance(head: Mapping[str, Any], arrays: Mapping[str, NDArray[Any]]) -> Instance:
    planes, motions = [], []
    for i, mu_end in enumerate(head["mu_end"]):
        dynamics = PathDynamics(*(arrays[f"arm{i}_{name}"] for name in COEFFICIENTS)).with_joints(head["joints"][i])
        planes.append(PhasePlane(dynamics, mu_end))
        lam, mu, time = (arrays[f"arm{i}_bound_{name}"] for name in ("lam", "mu", "time"))
        bound = PhaseTrajectory(lam=lam, mu=mu, time=time, dynamics=dynamics, mu_end=mu_end)
        motions.append((bound, float(arrays[f"arm{i}_bound_share"])))
    charts: dict[str, CoordinationChart] = {}
    for i, j in combinations(range(len(planes)), 2):
        for kind in ("chart", "bound"):
            resolution, length_a, length_b, d_min = arrays[f"{kind}_{i}_{j}_shape"].tolist()
            states = unpack_states(arrays[f"{kind}_{i}_{j}"], int(resolution))
            charts[f"{kind}_{i}_{j}"] = CoordinationChart(
                states=states, length_a=length_a, length_b=length_b, d_min=d_min
            )

    def chart(kind: str, i: int, j: int) -> CoordinationChart:
        return charts[f"{kind}_{i}_{j}"] if i < j else charts[f"{kind}_{j}_{i}"].swapped

    timing = TimingProblem(
        names=tuple(head["arms"]),
        planes=tuple(planes),
        chart_between=lambda i, j: chart("chart", i, j),
        bound_chart_between=lambda i, j: chart("bound", i, j),
        bound_motions=lambda: tuple(motions),
    )
    return Instance(
        name=head["name"],
        family=head["family"],
        labels=CellLabels.from_record(head["labels"]),
        timing=timing,
        control_period=head["control_period_s"],
    )

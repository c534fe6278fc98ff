r"""Instances as files: charts and path coefficients, for planning and learning without robots and meshes.

One compressed npz per cell. The states of a chart take two bits per cell before compression.
"""

from __future__ import annotations

import io
import json
import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path
from typing import Any, final

import numpy as np
from numpy.typing import NDArray

from armtempo.errors import ArmtempoError, InputError, UnknownNameError, brief
from armtempo.files import whole_file
from armtempo.planners.cells import CoordinationCell
from armtempo.planners.charts import BLOCKED, MAX_RESOLUTION, CoordinationChart
from armtempo.planners.coordination import Motions, TimingProblem, delayed, offset, optimal, plan_vci, prioritised
from armtempo.planners.instances._generator import CellLabels
from armtempo.planners.topp import PathDynamics, PhasePlane, PhaseTrajectory
from armtempo.reading import MOST_MAGNITUDE, parse_json, read_bytes, unpacked_arrays

FILE_VERSION = 1
LARGEST = 2**29  # bytes of a file, and of its arrays
LARGEST_HEAD = 2**20  # bytes
MOST_JOINTS = 100
PLANNED_METHODS = ("delay", "offset", "vci", "interval", "optimal")
COEFFICIENTS = ("grid", "M", "Q", "R", "S", "torque_min", "torque_max", "speed_max")
ARRAY_NAME = re.compile(
    rf"head|arm\d{{1,2}}_({'|'.join(COEFFICIENTS)}|bound_(lam|mu|time|share))|(chart|bound)_\d{{1,2}}_\d{{1,2}}(_(shape|joined))?"
)


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
        arms, given = self.timing.arms, order
        order = arms if given is None else tuple(given) if isinstance(given, Collection) else ()
        if len(order) != len(arms) or any(arm not in order for arm in arms):
            raise InputError(
                f"order {brief(given)} does not name each of the {len(self.timing.arms)} arms once",
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
            if len(chart.joined):
                arrays[f"{kind}_{i}_{j}_joined"] = chart.joined
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
        arrays = unpacked_arrays(
            read_bytes(path, LARGEST), LARGEST, lambda name: ARRAY_NAME.fullmatch(name) is not None
        )
        head = _head(arrays)
    except InputError as error:
        message = f"{path}: is no instance: {error.message.removeprefix(f'{path}: ')}"
        raise InputError(message, remedy=remedy) from error
    version = head["version"]
    if version != FILE_VERSION:
        raise InputError(f"{path}: version {brief(version)}, this reads {FILE_VERSION}", remedy="generate it again")
    try:
        return _instance(head, arrays)
    except (KeyError, TypeError, ValueError, OverflowError) as error:
        what = error.message if isinstance(error, ArmtempoError) else str(error)[:200]
        raise InputError(f"{path}: is no instance: {what}", remedy=remedy) from error


def _head(arrays: Mapping[str, NDArray[Any]]) -> Mapping[str, Any]:
    """The instance in words; raises InputError."""
    array = arrays.get("head")
    if array is None or array.dtype != np.uint8:
        raise InputError("it has no head")
    if array.size > LARGEST_HEAD:
        raise InputError(f"a head of {array.size} bytes")
    try:
        head = parse_json(array.tobytes().decode(), "its head")
    except UnicodeDecodeError:
        raise InputError("its head is not UTF-8 text") from None
    if not isinstance(head, dict) or "version" not in head:
        raise InputError("its head has no version")
    return head


def _numbers(name: str, values: Any, count: int, low: float, high: float) -> list[float]:
    """So many finite numbers between two; raises ValueError."""
    given = list(values)
    finite = all(isinstance(v, int | float) and not isinstance(v, bool) and low <= v <= high for v in given)
    if len(given) != count or not finite:
        raise ValueError(f"{name} is {brief(values)}")
    return given


def _labels(record: Mapping[str, Any], arms: int) -> CellLabels:
    """Raises KeyError, TypeError, ValueError."""
    _numbers("minimum_times_s", record["minimum_times_s"], arms, 0.0, MOST_MAGNITUDE)
    _numbers("undecided_share", [record["undecided_share"]], 1, 0.0, 1.0)
    bound = record["lower_bound_s"]
    _numbers("lower_bound_s", [0.0 if bound is None else bound], 1, 0.0, MOST_MAGNITUDE)
    return CellLabels.from_record(record)


def _chart(name: str, arrays: Mapping[str, NDArray[Any]], lengths: tuple[float, float]) -> CoordinationChart:
    """One chart, as large as its paths are long; raises KeyError, ValueError."""
    shape = arrays[f"{name}_shape"]
    resolution, length_a, length_b, d_min = _numbers(f"{name}_shape", shape.tolist(), 4, 0.0, MOST_MAGNITUDE)
    if not (1 <= resolution <= MAX_RESOLUTION and resolution == int(resolution)):
        raise ValueError(f"{name} has {resolution:g} cells along a side")
    if not np.allclose((length_a, length_b), lengths, rtol=1e-6, atol=0.0):
        raise ValueError(f"{name} is of paths of other lengths: {length_a:g} and {length_b:g}")
    packed = arrays[name]
    if packed.dtype != np.uint8 or packed.shape != (2, -(-(int(resolution) ** 2) // 8)):
        raise ValueError(f"{name} has shape {packed.shape}")
    states = unpack_states(packed, int(resolution))
    if states.max() > BLOCKED:
        raise ValueError(f"{name} has states that do not exist")
    joined = arrays.get(f"{name}_joined", np.empty((0, 4), dtype=np.int64))
    if joined.dtype != np.int64 or joined.ndim != 2 or joined.shape[1] != 4:
        raise ValueError(f"{name}_joined has shape {joined.shape}")
    if len(joined) and not (joined.min() >= 0 and joined.max() < resolution):
        raise ValueError(f"{name} joins cells outside it")
    if not (states[joined[:, ::2], joined[:, 1::2]] == BLOCKED).all():
        raise ValueError(f"{name} joins cells that are not blocked")
    return CoordinationChart(states=states, length_a=length_a, length_b=length_b, d_min=d_min, joined=joined)


def _bound_motion(arrays: Mapping[str, NDArray[Any]], i: int, plane: PhasePlane) -> tuple[PhaseTrajectory, float]:
    """The minimum-time motion of an arm for bounds; raises KeyError, ValueError."""
    lam, mu, time = (arrays[f"arm{i}_bound_{name}"] for name in ("lam", "mu", "time"))
    rows = [array.ndim == 1 and len(array) == len(time) and np.isfinite(array).all() for array in (lam, mu, time)]
    if not all(rows) or len(time) < 2 or (np.diff(time) < 0.0).any() or (np.diff(lam) < 0.0).any() or mu.min() < 0.0:
        raise ValueError(f"the bound's motion of arm {i} is none")
    (share,) = _numbers(f"arm{i}_bound_share", arrays[f"arm{i}_bound_share"].reshape(-1).tolist(), 1, 0.0, 1.0)
    motion = PhaseTrajectory(lam=lam, mu=mu, time=time, dynamics=plane.dynamics, mu_end=plane.mu_end)
    return motion, share


def _instance(head: Mapping[str, Any], arrays: Mapping[str, NDArray[Any]]) -> Instance:
    names = head["arms"]
    if not (isinstance(names, list) and names and all(isinstance(name, str) for name in names)):
        raise ValueError(f"its arms are {brief(names)}")
    (period,) = _numbers("control_period_s", [head["control_period_s"]], 1, 1e-6, MOST_MAGNITUDE)
    mu_ends = _numbers("mu_end", head["mu_end"], len(names), 0.0, MOST_MAGNITUDE)
    joints = _numbers("joints", head["joints"], len(names), 1, MOST_JOINTS)
    planes = []
    for i, mu_end in enumerate(mu_ends):
        dynamics = PathDynamics(*(arrays[f"arm{i}_{name}"] for name in COEFFICIENTS)).with_joints(int(joints[i]))
        planes.append(PhasePlane(dynamics, mu_end))
    motions = [_bound_motion(arrays, i, plane) for i, plane in enumerate(planes)]
    lengths = [float(plane.dynamics.grid[-1]) for plane in planes]
    charts = {
        (kind, i, j): _chart(f"{kind}_{i}_{j}", arrays, (lengths[i], lengths[j]))
        for i, j in combinations(range(len(planes)), 2)
        for kind in ("chart", "bound")
    }

    def chart(kind: str, i: int, j: int) -> CoordinationChart:
        return charts[kind, i, j] if i < j else charts[kind, j, i].swapped

    timing = TimingProblem(
        names=tuple(names),
        planes=tuple(planes),
        chart_between=lambda i, j: chart("chart", i, j),
        bound_chart_between=lambda i, j: chart("bound", i, j),
        bound_motions=lambda: tuple(motions),
    )
    return Instance(
        name=str(head["name"]),
        family=str(head["family"]),
        labels=_labels(head["labels"], len(names)),
        timing=timing,
        control_period=period,
    )

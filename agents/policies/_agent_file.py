"""Agent files: a trained actor and where it comes from, in a ``.npz`` without pickles, run by numpy alone.

Such a file holds numbers and one JSON text; reading it executes nothing that it says, whoever made it. Its arrays are

``header``               UTF-8 JSON: the fields of ``AgentHeader``, and ``version``
``weight_k``, ``bias_k`` float32, of layer k: (out, in) and (out,)

The layers of a ``graph`` are those of ``_graph_network``. Behind the archive stands a digest of it. Files of version 1
have none: the checksums inside the archive stand in; files before version 3 do not say which network they are of.
"""

from __future__ import annotations

import io
import json
import re
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any, Literal, final, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armtempo.agents.policies._graph_network import GRAPH_NAMES, graph_sizes, run_graph
from armtempo.arrays import Floats32
from armtempo.errors import InputError, brief
from armtempo.files import is_sealed, whole_file, write_sealed
from armtempo.reading import parse_json, read_bytes, unpacked_arrays, user_path, why_unreadable

Algorithm = Literal["ppo", "sac", "tqc"]
Learners = Literal["last", "all"]
Network = Literal["layers", "graph"]

ALGORITHMS: tuple[Algorithm, ...] = get_args(Algorithm)
VERSION, VERSION_WITHOUT_GRAPHS, VERSION_WITHOUT_DIGEST = 3, 2, 1
ENVIRONMENT_NAME = re.compile(r"[a-z][a-z0-9_-]*")
LARGEST = 2**26  # bytes of a file and of its arrays: 16 million numbers
LARGEST_HEADER = 2**22  # bytes
ARRAY_NAME = re.compile(r"header|(weight|bias)_\d{1,2}")
_ACTIVATIONS = ("tanh", "relu")
HEADER_TYPES: dict[str, Any] = {
    **dict.fromkeys(
        ("name", "algorithm", "activation", "environment", "command", "config", "armtempo", "network"), str
    ),
    **dict.fromkeys(("steps", "seed", "decide_every"), int),
    **dict.fromkeys(("entries", "cells", "curve"), list),
    "settings": dict,
    "learners": str | None,
}
"""Of the header's fields, as JSON has them."""


@dataclass(frozen=True, kw_only=True)
class AgentHeader:
    """Where an agent comes from and what it is for.

    Attributes:
        name: Of its configuration.
        algorithm: ``ppo`` (its actions are clipped to [-1, 1]), ``sac`` or ``tqc`` (theirs go through tanh).
        activation: Between layers: ``tanh`` or ``relu``.
        network: ``layers``, one after another, or ``graph``, see ``_graph_network``.
        decide_every: Control periods for which a graph's action is held.
        environment: Of its kind of cell: ``coordination``, ``blend-tracking``, ``feedback-ik``, or another's.
        settings: What the environment was made with, by name.
        learners: Of several arms: the ``last`` one, while the others run at full speed, or ``all``. None for one arm.
        entries: Names of the observation's entries.
        cells: Names of the cells that it was trained on.
        steps: Agent steps that it was trained for.
        seed: Of the training.
        command: The line that made it.
        config: The text of its configuration.
        curve: One mapping per evaluation while it was trained.
        armtempo: Version of armtempo that made it.
    """

    name: str
    algorithm: Algorithm
    activation: str
    environment: str
    settings: dict[str, Any]
    learners: Learners | None
    entries: list[str]
    cells: list[str]
    steps: int
    seed: int
    command: str
    config: str
    curve: list[dict[str, Any]]
    armtempo: str
    network: Network = "layers"
    decide_every: int = 1


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Agent:
    """An actor: layers of a network, (weight (out, in), bias (out,)) each, float32."""

    header: AgentHeader
    layers: tuple[tuple[Floats32, Floats32], ...]

    def __post_init__(self) -> None:
        for layer in self.layers:
            for array in layer:
                array.setflags(write=False)

    @property
    def actions(self) -> int:
        """How many numbers an action has."""
        return len(self.layers[-1][1])

    def act(self, observations: ArrayLike) -> Floats32:
        """Deterministic actions (..., n) in [-1, 1] for observations (..., entries)."""
        x: Floats32 = np.asarray(observations, dtype=np.float32)
        for k, (weight, bias) in enumerate(self.layers):
            x = x @ weight.T + bias
            if k + 1 < len(self.layers):
                x = np.tanh(x) if self.header.activation == "tanh" else np.maximum(x, np.float32(0.0))
        return np.clip(x, -1.0, 1.0) if self.header.algorithm == "ppo" else np.tanh(x)

    def act_on_graph(self, nodes: Floats32, edges: Floats32) -> Floats32:
        """Deterministic actions (A, n) in [-1, 1] of all arms of a graph: nodes (M, N), edges (M, M, K)."""
        return np.clip(run_graph(self.layers, self.header.activation, nodes, edges), -1.0, 1.0)


def save_agent(path: Path, agent: Agent) -> None:
    """Write an agent, whole or not at all; the same agent gives the same bytes."""
    header = json.dumps({"version": VERSION, **asdict(agent.header)}, sort_keys=True, ensure_ascii=False)
    arrays: dict[str, Any] = {"header": np.frombuffer(header.encode(), dtype=np.uint8)}
    for k, (weight, bias) in enumerate(agent.layers):
        arrays[f"weight_{k}"], arrays[f"bias_{k}"] = weight.astype(np.float32), bias.astype(np.float32)
    packed = io.BytesIO()
    np.savez(packed, **arrays)
    with whole_file(path) as temporary:
        write_sealed(temporary, packed.getbuffer())


def load_agent(path: Path) -> Agent:
    """Read an agent.

    Raises:
        InputError: There is no such file, it cannot be read as an agent, a bit of it is not as it was written, or a
            later armtempo made it.
    """
    remedy = "copy it again, or train the agent again with the command of its making"
    if (why := why_unreadable(path)) is not None:
        what = "no such agent file" if why == "no such file" else why
        raise InputError(f"{path}: {what}", remedy="give the path of a .npz that armtempo train wrote")
    content = read_bytes(path, LARGEST)
    try:
        arrays = unpacked_arrays(content, LARGEST, lambda name: ARRAY_NAME.fullmatch(name) is not None)
        header = _header(arrays)
        version = header.pop("version", None)
        if version in (VERSION, VERSION_WITHOUT_GRAPHS) and not is_sealed(io.BytesIO(content)):
            raise InputError("its digest is not that of its content")
    except InputError as error:
        message = f"{path}: not an agent file, or a damaged one: {error.message}"
        raise InputError(message, remedy=remedy) from error
    if version not in (VERSION, VERSION_WITHOUT_GRAPHS, VERSION_WITHOUT_DIGEST):
        raise InputError(
            f"{path}: an agent file of version {brief(version)}, and this armtempo reads up to version {VERSION}",
            remedy="use the armtempo that wrote it, or train the agent again",
        )
    if version != VERSION:
        header = {"network": "layers", "decide_every": 1, **header}
    wrong = _complaint(header, arrays)
    if wrong:
        raise InputError(f"{path}: a damaged agent file: {wrong}", remedy=remedy)
    layers = len(arrays) // 2
    return Agent(
        header=AgentHeader(**header),
        layers=tuple((arrays[f"weight_{k}"], arrays[f"bias_{k}"]) for k in range(layers)),
    )


def _header(arrays: dict[str, NDArray[Any]]) -> dict[str, Any]:
    """What the header says, its version included; raises InputError."""
    array = arrays.get("header")
    if array is None or array.dtype != np.uint8 or array.ndim != 1:
        raise InputError("it has no header")
    if array.size > LARGEST_HEADER:
        raise InputError(f"a header of {array.size} bytes")
    try:
        header = parse_json(array.tobytes().decode(), "its header")
    except UnicodeDecodeError:
        raise InputError("its header is not UTF-8 text") from None
    if not isinstance(header, dict):
        raise InputError("its header is no mapping")
    return header


def _complaint(header: dict[str, Any], arrays: dict[str, NDArray[Any]]) -> str | None:
    """What is wrong with the contents of a file."""
    wrong = _header_complaint(header)
    if wrong is not None or header["network"] == "layers":
        return wrong or _layers_complaint(arrays, len(header["entries"]))
    return _graph_complaint(header, arrays)


def _header_complaint(header: dict[str, Any]) -> str | None:
    wanted = {field.name for field in fields(AgentHeader)}
    if set(header) != wanted:
        return f"its header lacks or adds {brief(', '.join(sorted(wanted ^ set(header))))}"
    for name, type_ in HEADER_TYPES.items():
        if not isinstance(header[name], type_) or isinstance(header[name], bool):
            return f"its {name} is {brief(header[name])}"
    for name, least in (("steps", 0), ("seed", 0), ("decide_every", 1)):
        if not least <= header[name] < 2**63:
            return f"its {name} is {brief(header[name])}"
    for name in ("entries", "cells"):
        if not all(isinstance(one, str) for one in header[name]):
            return f"its {name} are no names: {brief(header[name])}"
    if not all(isinstance(row, dict) for row in header["curve"]):
        return "its curve is no list of mappings"
    for name, known in (("algorithm", ALGORITHMS), ("activation", _ACTIVATIONS), ("network", get_args(Network))):
        if header[name] not in known:
            return f"unknown {name} {brief(header[name])}"
    if not ENVIRONMENT_NAME.fullmatch(header["environment"]) or header["learners"] not in (None, *get_args(Learners)):
        return f"no environment {brief(header['environment'])} or learners {brief(header['learners'])}"
    return None


def _layers_complaint(arrays: dict[str, NDArray[Any]], width: int) -> str | None:
    layers = len(arrays) // 2
    if layers < 1:
        return "it has no layers"
    if len(arrays) != 2 * layers + 1:
        return "a layer lacks its weight or its bias"
    for k in range(layers):
        weight, bias = arrays.get(f"weight_{k}"), arrays.get(f"bias_{k}")
        if weight is None or bias is None:
            return f"layer {k} is missing"
        if weight.dtype != np.float32 or bias.dtype != np.float32:
            return f"layer {k} is of type {weight.dtype} and {bias.dtype}, not float32"
        if weight.ndim != 2 or weight.shape[1] != width or bias.shape != weight.shape[:1]:
            return f"layer {k} has the wrong shape: {weight.shape} and {bias.shape}, after {width} numbers"
        if not (np.isfinite(weight).all() and np.isfinite(bias).all()):
            return f"layer {k} is not finite"
        width = len(weight)
    return None


def _graph_complaint(header: dict[str, Any], arrays: dict[str, NDArray[Any]]) -> str | None:
    if header["algorithm"] != "ppo" or header["entries"] != GRAPH_NAMES:
        return "its entries are not those of this version's graphs"
    layers = [(arrays.get(f"weight_{k}"), arrays.get(f"bias_{k}")) for k in range(len(arrays) // 2)]
    for k, (weight, bias) in enumerate(layers):
        if weight is None or bias is None:
            return f"layer {k} is missing"
        if weight.dtype != np.float32 or bias.dtype != np.float32 or not np.isfinite(weight).all():
            return f"layer {k} is not of finite float32"
        if not np.isfinite(bias).all() or bias.shape != weight.shape[:1]:
            return f"layer {k} has a wrong bias"
    if graph_sizes([weight.shape for weight, _ in layers if weight is not None]) is None:
        return "its layers are not those of a graph network"
    return None


def is_agent_name(name: str) -> bool:
    """Whether a policy's name is that of a learned agent: ``ppo:path/to/file.npz``, or another algorithm's."""
    return name.partition(":")[0] in ALGORITHMS and ":" in name


def find_agent(name: str) -> Agent:
    """The agent of a policy's name, ``ppo:path/to/file.npz``.

    Raises:
        InputError: There is no such file, it cannot be used, or another algorithm made it than the name says.
    """
    algorithm, _, file = name.partition(":")
    if not file.endswith(".npz"):
        raise InputError(
            f"unknown agent {name!r}: agents are files that armtempo train writes",
            remedy=f"give one, such as {algorithm}:results/train/lee1991-0/agent.npz",
        )
    path = user_path(file)
    agent = load_agent(path)
    if agent.header.algorithm != algorithm:
        raise InputError(
            f"{path}: made by {agent.header.algorithm}, not {algorithm}",
            remedy=f"call it {agent.header.algorithm}:{file}",
        )
    return agent

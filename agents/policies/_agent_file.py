"""Agent files: a trained actor and where it comes from, in a ``.npz`` without pickles, run by numpy alone.

Such a file holds numbers and one JSON text; reading it executes nothing that it says, whoever made it. Its arrays are

``header``               UTF-8 JSON: the fields of ``AgentHeader``, and ``version``
``weight_k``, ``bias_k`` float32, of layer k: (out, in) and (out,)

Behind the archive stands a digest of it. Files of version 1 have none: the checksums inside the archive stand in.
"""

from __future__ import annotations

import io
import json
import re
import zipfile
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any, Literal, final, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armtempo.arrays import Floats32
from armtempo.errors import InputError, UnknownNameError
from armtempo.files import is_sealed, whole_file, write_sealed

Algorithm = Literal["ppo", "sac", "tqc"]
Learners = Literal["last", "all"]

ALGORITHMS: tuple[Algorithm, ...] = get_args(Algorithm)
VERSION, VERSION_WITHOUT_DIGEST = 2, 1
SHIPPED = Path(__file__).parents[1] / "shipped"
ENVIRONMENT_NAME = re.compile(r"[a-z][a-z0-9_-]*")
_ACTIVATIONS = ("tanh", "relu")


@dataclass(frozen=True, kw_only=True)
class AgentHeader:
    """Where an agent comes from and what it is for.

    Attributes:
        name: Of its configuration.
        algorithm: ``ppo`` (its actions are clipped to [-1, 1]), ``sac`` or ``tqc`` (theirs go through tanh).
        activation: Between layers: ``tanh`` or ``relu``.
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
    if not path.is_file():
        raise InputError(f"{path}: no such agent file", remedy="give the path of a .npz that armtempo train wrote")
    remedy = "copy it again, or train the agent again with the command of its making"
    try:
        stream = io.BytesIO(path.read_bytes())
        sealed = is_sealed(stream)
        with np.load(stream, allow_pickle=False) as data:
            arrays = {name: data[name] for name in data.files}
        if "header" not in arrays:
            raise ValueError("it has no header")
        header = json.loads(arrays["header"].tobytes().decode())
        version = header.pop("version", None) if isinstance(header, dict) else None
        if version == VERSION and not sealed:
            raise ValueError("its digest is not that of its content")
    except (OSError, ValueError, EOFError, KeyError, zipfile.BadZipFile) as error:
        raise InputError(f"{path}: not an agent file, or a damaged one: {_short(error)}", remedy=remedy) from error
    if version not in (VERSION, VERSION_WITHOUT_DIGEST):
        raise InputError(
            f"{path}: an agent file of version {version}, and this armtempo reads up to version {VERSION}",
            remedy="use the armtempo that wrote it, or train the agent again",
        )
    wrong = _complaint(header, arrays)
    if wrong:
        raise InputError(f"{path}: a damaged agent file: {wrong}", remedy=remedy)
    layers = (len(arrays) - 1) // 2
    return Agent(
        header=AgentHeader(**header),
        layers=tuple((arrays[f"weight_{k}"], arrays[f"bias_{k}"]) for k in range(layers)),
    )


def _complaint(header: dict[str, Any], arrays: dict[str, NDArray[Any]]) -> str | None:
    """What is wrong with the contents of a file."""
    wanted = {field.name for field in fields(AgentHeader)}
    if set(header) != wanted:
        return f"its header lacks or adds {', '.join(sorted(wanted ^ set(header)))}"
    if header["algorithm"] not in ALGORITHMS or header["activation"] not in _ACTIVATIONS:
        return f"unknown algorithm {header['algorithm']!r} or activation {header['activation']!r}"
    if not ENVIRONMENT_NAME.fullmatch(header["environment"]) or header["learners"] not in (None, *get_args(Learners)):
        return f"no environment {header['environment']!r} or learners {header['learners']!r}"
    layers, width = (len(arrays) - 1) // 2, len(header["entries"])
    if layers < 1:
        return "it has no layers"
    for k in range(layers):
        weight, bias = arrays.get(f"weight_{k}"), arrays.get(f"bias_{k}")
        if weight is None or bias is None:
            return f"layer {k} is missing"
        if weight.dtype != np.float32 or weight.ndim != 2 or weight.shape[1] != width or bias.shape != weight.shape[:1]:
            return f"layer {k} has the wrong shape: {weight.shape} and {bias.shape}, after {width} numbers"
        if not (np.isfinite(weight).all() and np.isfinite(bias).all()):
            return f"layer {k} is not finite"
        width = len(weight)
    return None


def _short(error: Exception) -> str:
    return " ".join(str(error).split())[:80] or type(error).__name__


def shipped_agents() -> tuple[str, ...]:
    """The agents that come with armtempo, as ``ppo:NAME``, sorted by name."""
    files = sorted(SHIPPED.glob("*.npz"))
    return tuple(f"{load_agent(path).header.algorithm}:{path.stem}" for path in files)


def is_agent_name(name: str) -> bool:
    """Whether a policy's name is that of a learned agent: ``ppo:NAME``, ``sac:path/to/file.npz``."""
    return name.partition(":")[0] in ALGORITHMS and ":" in name


def find_agent(name: str) -> Agent:
    """The agent of a policy's name, shipped (``ppo:NAME``) or from a file (``ppo:path/to/file.npz``).

    Raises:
        UnknownNameError: No such agent comes with armtempo.
        InputError: The file cannot be used, or another algorithm made it than the name says.
    """
    algorithm, _, which = name.partition(":")
    if which.endswith(".npz"):
        path = Path(which).expanduser()
    else:
        path = SHIPPED / f"{which}.npz"
        if which not in {file.stem for file in SHIPPED.glob("*.npz")}:
            raise UnknownNameError("agent", name, shipped_agents(), remedy=_where(name))
    agent = load_agent(path)
    if agent.header.algorithm != algorithm:
        raise InputError(
            f"{path}: made by {agent.header.algorithm}, not {algorithm}",
            remedy=f"call it {agent.header.algorithm}:{which}",
        )
    return agent


def _where(name: str) -> str:
    algorithm = name.partition(":")[0]
    known = ", ".join(shipped_agents()) or "none"
    return f"agents that come with armtempo: {known}; or give a file as {algorithm}:path/to/file.npz"

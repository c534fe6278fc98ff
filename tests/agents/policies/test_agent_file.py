"""Agent files: the numbers of SB3, round trips, and what is said of broken ones."""

from __future__ import annotations

import io
import json
import zipfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from armtempo.agents import Agent, AgentHeader, evaluate, find_agent, load_agent, save_agent
from armtempo.agents.training._export import agent_of
from armtempo.configs import load_train_config, parse_train_config
from armtempo.envs import COORDINATION_ENTRIES
from armtempo.errors import ArmtempoError, InputError
from armtempo.planners import CoordinationCell
from tests.agents.trained import FILES, NAMES, trained
from tests.fuzz._mutations import damaged_copies

SIZE = len(COORDINATION_ENTRIES)


def header(**changes: Any) -> AgentHeader:
    given = AgentHeader(
        name="test",
        algorithm="ppo",
        activation="tanh",
        environment="coordination",
        settings={"physics": "ideal"},
        learners="last",
        entries=[entry.name for entry in COORDINATION_ENTRIES],
        cells=["lee1991"],
        steps=1,
        seed=0,
        command="armtempo train test",
        config="name: test\n",
        curve=[{"steps": 1, "gap_percent": 3.5}],
        armtempo="0.0.0",
    )
    return replace(given, **changes)


def constant(action: float, **changes: Any) -> Agent:
    """An agent that always does the same."""
    layer = np.zeros((1, SIZE), np.float32), np.array([action], np.float32)
    return Agent(header=header(**changes), layers=(layer,))


@pytest.mark.rl
@pytest.mark.parametrize("activation", ["tanh", "relu"])
@pytest.mark.parametrize("algorithm", ["ppo", "sac", "tqc"])
def test_actions_are_those_of_the_trained_model(algorithm: str, activation: str, tmp_path: Path) -> None:
    torch = pytest.importorskip("torch")
    sb3, contrib = pytest.importorskip("stable_baselines3"), pytest.importorskip("sb3_contrib")
    import gymnasium

    class Blank(gymnasium.Env[Any, Any]):
        observation_space = gymnasium.spaces.Box(-1.0, 1.0, (SIZE,))
        action_space = gymnasium.spaces.Box(-1.0, 1.0, (2,))

    torch.set_num_threads(1)  # as in a training; another thread of torch was seen to be off by 1e-4
    torch.manual_seed(4)
    make = {"ppo": sb3.PPO, "sac": sb3.SAC, "tqc": contrib.TQC}[algorithm]
    function = {"tanh": torch.nn.Tanh, "relu": torch.nn.ReLU}[activation]
    model = make("MlpPolicy", Blank(), policy_kwargs={"net_arch": [32, 16], "activation_fn": function}, device="cpu")
    with torch.no_grad():
        for parameter in model.policy.parameters():
            parameter.mul_(3.0)  # so that clipping and squashing matter
        if algorithm == "ppo":  # begins with a last layer of almost nothing
            model.policy.action_net.weight.mul_(20.0)
    save_agent(tmp_path / "a.npz", agent_of(model, header(algorithm=algorithm, activation=activation)))
    agent = load_agent(tmp_path / "a.npz")
    seen = np.random.default_rng(0).uniform(-1.0, 1.0, (500, SIZE)).astype(np.float32)
    wanted, _ = model.predict(seen, deterministic=True)
    assert np.ptp(wanted) > 0.5
    np.testing.assert_allclose(agent.act(seen), wanted, rtol=0.0, atol=1e-6)
    np.testing.assert_allclose(agent.act(seen[7]), wanted[7], rtol=0.0, atol=1e-6)


def test_a_file_keeps_everything_and_its_bytes_do_not_depend_on_the_day(tmp_path: Path) -> None:
    agent = constant(0.25, curve=[{"steps": 7, "gap_percent": None}])
    for name in ("a.npz", "b.npz"):
        save_agent(tmp_path / name, agent)
    assert (tmp_path / "a.npz").read_bytes() == (tmp_path / "b.npz").read_bytes()
    again = load_agent(tmp_path / "a.npz")
    assert again.header == agent.header
    for one, other in zip(again.layers[0], agent.layers[0], strict=True):
        np.testing.assert_array_equal(one, other)
        assert one.dtype == np.float32
        assert not one.flags.writeable


def _write(path: Path, **arrays: Any) -> None:
    np.savez(path, **arrays)


def _header(**changes: Any) -> Any:
    said = {"version": 1, **vars(header())} | changes
    return np.frombuffer(json.dumps(said).encode(), np.uint8)


NAN = np.array([np.nan], np.float32)
LAYER = {"weight_0": np.zeros((1, SIZE), np.float32), "bias_0": np.zeros(1, np.float32)}


class Trap:
    """Unpickling it would write a file."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def __reduce__(self) -> tuple[Any, ...]:
        return Path.touch, (self.path,)


def _bare_array() -> bytes:
    stream = io.BytesIO()
    np.save(stream, NAN)
    return stream.getvalue()


BROKEN: dict[str, tuple[Callable[[Path], Any], str]] = {
    "missing": (lambda path: None, "no such agent file"),
    "empty": (lambda path: path.write_bytes(b""), "not an agent file"),
    "text": (lambda path: path.write_text("weights"), "not an agent file"),
    "no header": (lambda path: _write(path, **LAYER), "no header"),
    "later version": (lambda path: _write(path, header=_header(version=4), **LAYER), "version 4"),
    "no number": (lambda path: _write(path, header=_header(steps=None, extra=1), **LAYER), "extra"),
    "algorithm": (lambda path: _write(path, header=_header(algorithm="dqn"), **LAYER), "dqn"),
    "no layers": (lambda path: _write(path, header=_header()), "no layers"),
    "shape": (lambda path: _write(path, header=_header(entries=["x"]), **LAYER), "wrong shape"),
    "nan": (lambda path: _write(path, header=_header(), **LAYER | {"bias_0": NAN}), "finite"),
    "stranger": (lambda path: _write(path, header=_header(), **LAYER, junk=np.zeros(3)), "unknown array 'junk'"),
    "double": (lambda path: _write(path, header=_header(), **LAYER | {"bias_0": np.zeros(1)}), "and float64"),
    "odd": (lambda path: _write(path, header=_header(), **LAYER, bias_1=np.zeros(1, np.float32)), "lacks its weight"),
    "gap": (lambda path: _write(path, header=_header(), **LAYER, weight_2=LAYER["weight_0"], bias_2=LAYER["bias_0"]),
            "layer 1 is missing"),
    "one array": (lambda path: path.write_bytes(_bare_array()), "zip"),
    "folder": (lambda path: path.mkdir(), "is a folder"),
    "deep header": (lambda path: _write(path, header=np.frombuffer(b"[" * 100_000, np.uint8)), "too deep"),
    "no mapping": (lambda path: _write(path, header=np.frombuffer(b"[1]", np.uint8)), "no mapping"),
    "header of floats": (lambda path: _write(path, header=np.zeros(9), **LAYER), "no header"),
    "no text": (lambda path: _write(path, header=np.frombuffer(b"\xff\xfe", np.uint8)), "not UTF-8"),
    "long header": (lambda path: _write(path, header=np.full(5_000_000, 32, np.uint8)), "header of 5000000 bytes"),
    "nan in words": (lambda path: _write(path, header=_header(curve=[{"reward": np.nan}]), **LAYER), "NaN is no"),
    "entries": (lambda path: _write(path, header=_header(entries=[1] * SIZE), **LAYER), "entries are no names"),
    "settings": (lambda path: _write(path, header=_header(settings=["x"]), **LAYER), "its settings is"),
    "steps": (lambda path: _write(path, header=_header(steps=10**60), **LAYER), "about 61 digits"),
    "environment": (lambda path: _write(path, header=_header(environment=[1]), **LAYER), r"its environment is \[1\]"),
    "pickle": (lambda path: _write(path, header=np.array([Trap(path.with_name("sprung"))])), "not an agent file"),
}  # fmt: skip


@pytest.mark.parametrize("case", BROKEN)
def test_a_file_that_is_no_agent_is_refused_with_its_name_and_a_remedy(case: str, tmp_path: Path) -> None:
    path = tmp_path / "agent.npz"
    write, message = BROKEN[case]
    write(path)
    with pytest.raises(InputError, match=message) as caught:
        load_agent(path)
    assert str(path) in str(caught.value)
    assert caught.value.remedy
    assert not (tmp_path / "sprung").exists()


def test_no_prefix_of_a_file_is_taken_for_an_agent(tmp_path: Path) -> None:
    path = tmp_path / "agent.npz"
    save_agent(path, constant(0.5))
    whole = path.read_bytes()
    for length in range(0, len(whole), 97):
        path.write_bytes(whole[:length])
        with pytest.raises(InputError):
            load_agent(path)
    flipped = bytearray(whole)
    path.write_bytes(whole)
    with zipfile.ZipFile(path) as archive:
        start = archive.getinfo("weight_0.npy")
    flipped[start.header_offset + 200] ^= 0xFF
    path.write_bytes(bytes(flipped))
    with pytest.raises(InputError):
        load_agent(path)


@pytest.mark.parametrize("name", NAMES)
def test_no_damaged_agent_is_taken(name: str, tmp_path: Path) -> None:
    whole, path = (FILES / f"{name}.npz").read_bytes(), tmp_path / "agent.npz"
    for damaged in damaged_copies(whole, np.random.default_rng(1), 80):
        path.write_bytes(damaged)
        with pytest.raises(InputError, match=r"agent\.npz: ") as caught:
            load_agent(path)
        assert "copy it again" in caught.value.remedy


def test_agents_of_before_there_were_digests_are_read_and_their_checksums_with_them(tmp_path: Path) -> None:
    path = tmp_path / "agent.npz"
    _write(path, header=_header(), **LAYER)
    assert load_agent(path).header == header()
    whole = path.read_bytes()
    for place in range(0, len(whole), 13):
        path.write_bytes(whole[:place] + bytes([whole[place] ^ 2]) + whole[place + 1 :])
        try:
            read = load_agent(path)
        except InputError:
            continue
        assert read.header == header()  # a bit that means nothing, such as a date in the archive
        assert all(not array.any() for array in read.layers[0])
    _write(path, header=_header(version=2), **LAYER)
    with pytest.raises(InputError, match="its digest is not that of its content"):
        load_agent(path)


def test_names(tmp_path: Path) -> None:
    save_agent(tmp_path / "mine.npz", constant(0.5))
    assert find_agent(f"ppo:{tmp_path / 'mine.npz'}").actions == 1
    with pytest.raises(InputError, match="made by ppo, not sac"):
        find_agent(f"sac:{tmp_path / 'mine.npz'}")
    with pytest.raises(InputError, match=r"unknown agent 'ppo:nobody'.*files that armtempo train writes"):
        find_agent("ppo:nobody")


@pytest.mark.parametrize("name", NAMES)
def test_agents_of_an_earlier_version_say_where_they_come_from(name: str) -> None:
    header = find_agent(trained(name)).header
    assert header.command.startswith(f"armtempo train {header.name}")
    bundled = load_train_config(header.name)  # is the one that made it
    assert parse_train_config(header.config, bundled.source).model_dump() == bundled.model_dump()
    assert header.curve[-1]["steps"] == header.steps


def test_an_agent_at_full_speed_is_the_minimum_time_policy(lee1991: CoordinationCell, tmp_path: Path) -> None:
    """Alone for the slave and for all arms alike; braking ones do not arrive."""
    names = []
    for learners in ("last", "all"):
        save_agent(tmp_path / f"{learners}.npz", constant(1.0, learners=learners))
        names.append(f"ppo:{tmp_path / learners}.npz")
    result = evaluate(lee1991, ["phase-plane", *names], physics="ideal", master_late_s=0.2).results
    for name in names:
        np.testing.assert_array_equal(result[name].trace.lam, result["phase-plane"].trace.lam)
        assert result[name].reward == result["phase-plane"].reward


def test_a_slave_drives_the_last_arm_alone(lee1991: CoordinationCell, tmp_path: Path) -> None:
    save_agent(tmp_path / "stays.npz", constant(-1.0))
    name = f"ppo:{tmp_path / 'stays.npz'}"
    result = evaluate(lee1991, [name], physics="ideal").results[name]
    assert result.trace.arrival[0] == pytest.approx(lee1991.fastest[0].duration, abs=2e-3)
    assert not result.trace.lam[:, 1].any()
    assert (result.finished, result.makespan_s, result.makespan_interval_s) == (0, None, None)


def test_agents_for_something_else_are_refused(lee1991: CoordinationCell, tmp_path: Path) -> None:
    for changes, message in (
        ({"environment": "feedback-ik"}, "not of coordination"),
        ({"settings": {"mode": "acceleration"}}, "mode acceleration"),
    ):
        save_agent(tmp_path / "a.npz", constant(0.5, **changes))
        with pytest.raises(ArmtempoError, match=message):
            evaluate(lee1991, [f"ppo:{tmp_path / 'a.npz'}"], physics="ideal")
    layer = np.zeros((1, 3), np.float32), np.zeros(1, np.float32)
    save_agent(tmp_path / "a.npz", Agent(header=header(entries=["a", "b", "c"]), layers=(layer,)))
    with pytest.raises(InputError, match="sees 3 numbers"):
        evaluate(lee1991, [f"ppo:{tmp_path / 'a.npz'}"], physics="ideal")

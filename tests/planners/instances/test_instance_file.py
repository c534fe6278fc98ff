"""Instances as files: what is read back is what was written, and plans from it are the same."""

from __future__ import annotations

import dataclasses
import json
import time
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray

from armtempo.errors import InputError, UnknownNameError
from armtempo.planners import CoordinationCell, schedule
from armtempo.planners.instances import Instance, label_cell, load_instance, save_instance
from armtempo.planners.instances._instance_file import COEFFICIENTS, pack_states, unpack_states


@pytest.fixture(scope="module")
def file(lee1991: CoordinationCell, tmp_path_factory: pytest.TempPathFactory) -> Path:
    file = tmp_path_factory.mktemp("instances") / "lee1991.npz"
    save_instance(file, lee1991, label_cell(lee1991), family="planar")
    return file


@pytest.fixture(scope="module")
def instance(file: Path) -> Instance:
    return load_instance(file)


@given(arrays(np.uint8, st.integers(1, 17).map(lambda n: (n, n)), elements=st.integers(0, 2)))
def test_states_come_back(states: NDArray[np.uint8]) -> None:
    packed = pack_states(states)
    assert packed.size <= 2 * (states.size // 8 + 1)
    np.testing.assert_array_equal(unpack_states(packed, len(states)), states)


def test_charts_and_coefficients_come_back(instance: Instance, lee1991: CoordinationCell) -> None:
    for i, j in ((0, 1), (1, 0)):
        for read, built in (
            (instance.timing.chart_between(i, j), lee1991.chart_between(i, j)),
            (instance.timing.bound_chart_between(i, j), lee1991.bound_chart_between(i, j)),
        ):
            np.testing.assert_array_equal(read.states, built.states)
            assert (read.length_a, read.length_b, read.d_min) == (built.length_a, built.length_b, built.d_min)
    for read_plane, plane in zip(instance.timing.planes, lee1991.planes, strict=True):
        for name in COEFFICIENTS:
            np.testing.assert_array_equal(getattr(read_plane.dynamics, name), getattr(plane.dynamics, name))
        np.testing.assert_array_equal(read_plane.edges.high, plane.edges.high)
    assert instance.labels == label_cell(lee1991)
    assert instance.timing.bound.time == lee1991.lower_bound
    assert instance.family == "planar"
    assert instance.control_period == lee1991.control_period


def joined_in(cell: CoordinationCell, ends: list[int]) -> CoordinationCell:
    """A copy whose bound's chart says that two cells hang together."""
    copy = dataclasses.replace(cell)
    chart = dataclasses.replace(cell.bound_chart_between(0, 1), joined=np.array([ends]))
    copy.__dict__["_closer_charts"] = {(0, 1, cell.d_min): chart}
    return copy


def test_joined_cells_come_back_and_must_be_blocked(lee1991: CoordinationCell, tmp_path: Path) -> None:
    states = lee1991.bound_chart_between(0, 1).states
    blocked, free = np.argwhere(states == 2), np.argwhere(states == 0)
    file, label = tmp_path / "joined.npz", label_cell(lee1991)
    ends = [*blocked[0].tolist(), *blocked[-1].tolist()]
    save_instance(file, joined_in(lee1991, ends), label)
    assert load_instance(file).timing.bound_chart_between(0, 1).joined.tolist() == [ends]
    for bad in ([*ends[:2], *free[0].tolist()], [*ends[:3], len(states)], [-1, *ends[1:]]):
        save_instance(file, joined_in(lee1991, bad), label)
        with pytest.raises(InputError, match="joins cells"):
            load_instance(file)


@pytest.mark.parametrize("method", ["delay", "vci", "optimal"])
def test_plans_are_the_cells_own(instance: Instance, lee1991: CoordinationCell, method: str) -> None:
    for motion, own in zip(instance.plan(method), schedule(lee1991, method).trajectories, strict=True):
        np.testing.assert_allclose(motion.time, own.time, rtol=1e-12)
        np.testing.assert_allclose(motion.lam, own.lam, rtol=1e-12)


def test_a_cell_is_an_instance_too(lee1991: CoordinationCell) -> None:
    fresh = Instance.of(lee1991, label_cell(lee1991))
    assert fresh.timing.bound.time == lee1991.lower_bound
    with pytest.raises(UnknownNameError, match="interval"):
        fresh.plan("magic")


def test_other_files_are_refused(file: Path, tmp_path: Path) -> None:
    cut = tmp_path / "cut.npz"
    cut.write_bytes(file.read_bytes()[:5000])
    other = tmp_path / "other.npz"
    np.savez(other, a=np.zeros(3))
    empty, bare = tmp_path / "empty.npz", tmp_path / "bare.npy"
    empty.write_bytes(b"")
    np.save(bare, np.zeros(3))
    for wrong in (cut, other, empty, bare, tmp_path / "missing.npz"):
        with pytest.raises(InputError, match="is no instance"):
            load_instance(wrong)


def test_flipped_bytes_are_found(file: Path, tmp_path: Path) -> None:
    data = file.read_bytes()
    with zipfile.ZipFile(file) as archive:
        first = [member.header_offset for member in archive.infolist()]
    for k, start in enumerate(first):
        content = start + 30 + int.from_bytes(data[start + 26 : start + 28], "little")
        content += int.from_bytes(data[start + 28 : start + 30], "little")
        flipped = bytearray(data)
        flipped[content + k % 3] ^= 0xFF  # 0: no such kind of block
        (tmp_path / "flipped.npz").write_bytes(bytes(flipped))
        with pytest.raises(InputError, match="is no instance"):
            load_instance(tmp_path / "flipped.npz")


def test_other_versions_and_missing_arrays_are_named(file: Path, tmp_path: Path) -> None:
    with np.load(file) as archive:
        arrays: dict[str, Any] = dict(archive)
    head = json.loads(arrays["head"].tobytes())
    later: Any = np.frombuffer(json.dumps(head | {"version": 99}).encode(), dtype=np.uint8)
    np.savez(tmp_path / "later.npz", **(arrays | {"head": later}))
    with pytest.raises(InputError, match="version 99, this reads"):
        load_instance(tmp_path / "later.npz")
    del arrays["arm1_M"]
    np.savez(tmp_path / "less.npz", **arrays)
    with pytest.raises(InputError, match=r"is no instance.*arm1_M"):
        load_instance(tmp_path / "less.npz")


@pytest.mark.parametrize("order", [(0,), (0, 0), (0, 1, 2)])
def test_orders_that_do_not_name_every_arm_once(instance: Instance, order: tuple[int, ...]) -> None:
    with pytest.raises(InputError, match="each of the 2 arms once"):
        instance.plan("interval", order=order)


def _head(**changes: Any) -> Callable[[dict[str, Any]], dict[str, Any]]:
    def changed(arrays: dict[str, Any]) -> dict[str, Any]:
        said = json.loads(arrays["head"].tobytes()) | changes
        return arrays | {"head": np.frombuffer(json.dumps(said).encode(), dtype=np.uint8)}

    return changed


WRONG: dict[str, tuple[Callable[[dict[str, Any]], dict[str, Any]], str]] = {
    "a stranger": (lambda a: a | {"junk": np.zeros(2)}, "unknown array 'junk'"),
    "nan": (lambda a: a | {"arm0_M": np.full_like(a["arm0_M"], np.nan)}, "M is not finite"),
    "endless period": (_head(control_period_s=1e308), "control_period_s"),
    "no period": (_head(control_period_s="0.1"), "control_period_s"),
    "an arm less": (_head(arms=["one"]), "mu_end"),
    "numbers for names": (_head(arms=[1, 2]), "its arms are"),
    "joints": (_head(joints=[10**60, 2]), "joints"),
    "labels": (_head(labels={}), "is no instance"),
    "deep": (lambda a: a | {"head": np.frombuffer(b"[" * 50_000, np.uint8)}, "too deep"),
    "resolution": (lambda a: a | {"chart_0_1_shape": a["chart_0_1_shape"] * [1e3, 1, 1, 1]}, "cells along a side"),
    "half a chart": (lambda a: a | {"chart_0_1": a["chart_0_1"][:, : a["chart_0_1"].shape[1] // 2]}, "has shape"),
    "states": (lambda a: a | {"bound_0_1": np.full_like(a["bound_0_1"], 255)}, "states that do not exist"),
    "lengths": (lambda a: a | {"chart_0_1_shape": a["chart_0_1_shape"] * [1, 2, 1, 1]}, "other lengths"),
    "d_min": (lambda a: a | {"chart_0_1_shape": a["chart_0_1_shape"] * [1, 1, 1, np.nan]}, "chart_0_1_shape"),
    "time runs back": (lambda a: a | {"arm1_bound_time": -a["arm1_bound_time"]}, "the bound's motion of arm 1"),
    "share": (lambda a: a | {"arm0_bound_share": np.array(np.nan)}, "arm0_bound_share"),
}  # fmt: skip


@pytest.mark.parametrize("case", WRONG)
def test_every_number_of_an_instance_is_looked_at(case: str, file: Path, tmp_path: Path) -> None:
    with np.load(file) as archive:
        arrays: dict[str, Any] = dict(archive)
    change, message = WRONG[case]
    np.savez(tmp_path / "wrong.npz", **change(arrays))
    begin = time.perf_counter()
    with pytest.raises(InputError, match=rf"wrong\.npz: is no instance: .*{message}|{message}"):
        load_instance(tmp_path / "wrong.npz")
    assert time.perf_counter() - begin < 5.0

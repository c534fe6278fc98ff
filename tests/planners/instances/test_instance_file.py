"""Instances as files: what is read back is what was written, and plans from it are the same."""

from __future__ import annotations

import json
import zipfile
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
    np.savez(tmp_path / "later.npz", allow_pickle=False, **(arrays | {"head": later}))
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

"""Charts and tables kept on disk: the same bits with and without, and damaged files are never trusted."""

from __future__ import annotations

import logging
import os
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import platformdirs
import pytest

from armtempo.cache import cache_folder, cached, content_key, private_folder
from armtempo.planners import CoordinationChart, JointPath
from armtempo.planners.charts import _coordination_chart as coordination_chart
from armtempo.planners.charts import _quadtree as quadtree
from armtempo.planners.charts import clearance_table
from armtempo.robots import Arm

Pair = tuple[tuple[Arm, Arm], tuple[JointPath, JointPath]]


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("ARMTEMPO_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache"


def build(pair: Pair, d_min: float = 0.02, tolerance: float = 1 / 128) -> CoordinationChart:
    arms, paths = pair
    return CoordinationChart.build(arms[0], paths[0], arms[1], paths[1], d_min, tolerance)


def test_the_same_chart_with_and_without(
    panda_pair: Callable[[int], Pair], folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pair = panda_pair(1)
    monkeypatch.setenv("ARMTEMPO_CACHE", "off")
    bare = build(pair)
    assert not folder.exists()
    monkeypatch.setenv("ARMTEMPO_CACHE", str(folder))
    first = build(pair)
    (file,) = folder.iterdir()
    assert file.stat().st_size < 4000
    calls = []

    def counted(*arguments: object, **options: object) -> quadtree.Certified:
        calls.append(arguments)
        return quadtree.certify(*arguments, **options)  # type: ignore[arg-type]

    monkeypatch.setattr(coordination_chart, "certify", counted)
    again = build(pair)
    assert not calls
    for chart in (first, again):
        assert chart.states.tobytes() == bare.states.tobytes()
        assert chart.states.dtype == np.uint8
        assert not chart.states.flags.writeable
        assert (chart.pair_queries, chart.shape_queries) == (bare.pair_queries, bare.shape_queries)
    other = build(pair, d_min=0.021)
    assert len(calls) == 1
    assert other.states.tobytes() != bare.states.tobytes()
    build(panda_pair(2))
    build(pair, tolerance=1 / 64)
    assert len(calls) == 3
    arms, paths = pair
    CoordinationChart.build(arms[0], paths[0], arms[0], paths[1], 0.02, 1 / 128)  # another base
    assert len(calls) == 4
    assert len(list(folder.iterdir())) == 5


@pytest.mark.parametrize("damage", ["cut", "flipped", "empty", "foreign"])
def test_damaged_files_are_made_anew(
    panda_pair: Callable[[int], Pair], folder: Path, caplog: pytest.LogCaptureFixture, damage: str
) -> None:
    pair = panda_pair(1)
    good = build(pair).states
    (file,) = folder.iterdir()
    data = file.read_bytes()
    flipped = bytearray(data)
    flipped[len(data) // 2] ^= 1
    file.write_bytes({"cut": data[:-7], "flipped": bytes(flipped), "empty": b"", "foreign": b"x" * 500}[damage])
    with caplog.at_level(logging.WARNING):
        assert build(pair).states.tobytes() == good.tobytes()
    assert "damaged" in caplog.text
    caplog.clear()
    with caplog.at_level(logging.WARNING):
        assert build(pair).states.tobytes() == good.tobytes()
    assert not caplog.text
    assert [other.name for other in folder.iterdir()] == [file.name]


def test_a_folder_that_cannot_be_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    (tmp_path / "file").write_text("in the way")
    monkeypatch.setenv("ARMTEMPO_CACHE", str(tmp_path / "file"))
    with caplog.at_level(logging.WARNING):
        assert cached("thing", "0", lambda: {"x": np.arange(3)})["x"].tolist() == [0, 1, 2]
    assert "cannot" in caplog.text


def test_where_it_is(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.delenv("ARMTEMPO_CACHE")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert cache_folder() == platformdirs.user_cache_path("armtempo", appauthor=False) == tmp_path / "armtempo"
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    private_folder.cache_clear()
    for nowhere in ("~/.cache/armtempo", "/proc/nohome/.cache/armtempo"):  # no home to write to
        monkeypatch.setattr(platformdirs, "user_cache_path", lambda *_, nowhere=nowhere, **__: Path(nowhere))
        assert cache_folder() == tmp_path / f"armtempo-{os.getuid()}" / "cache"
    private_folder.cache_clear()
    monkeypatch.setattr(tempfile, "tempdir", "/proc/nohome")
    assert cache_folder() is None
    private_folder.cache_clear()
    monkeypatch.setenv("ARMTEMPO_CACHE", str(tmp_path / "named"))
    assert cache_folder() == tmp_path / "named"
    for off in ("off", "OFF"):
        monkeypatch.setenv("ARMTEMPO_CACHE", off)
        assert cache_folder() is None


def test_a_private_folder_is_nobody_elses(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    make = private_folder.__wrapped__
    folder = make()
    assert folder is not None
    assert folder == tmp_path / f"armtempo-{os.getuid()}"
    assert folder.stat().st_mode & 0o777 == 0o700
    assert make() == folder
    folder.chmod(0o770)  # others may have written there
    assert make() is None
    folder.rmdir()
    (tmp_path / "elsewhere").mkdir(mode=0o700)
    folder.symlink_to(tmp_path / "elsewhere")
    assert make() is None
    folder.unlink()
    folder.mkdir(mode=0o700)
    mine = os.getuid()
    monkeypatch.setattr(os, "getuid", lambda: mine + 1)
    folder.rename(tmp_path / f"armtempo-{mine + 1}")
    assert make() is None


def test_keys_tell_content_apart() -> None:
    x = np.arange(6.0)
    parts: list[list[object]] = [
        [x], [x.reshape(2, 3)], [x.astype(np.float32)], [x + 1e-16], [x, 1], [x, "1"], [1, x], [None], [x[::2]],
        [x * (1 + 1e-15)],
    ]  # fmt: skip
    keys = [content_key(own) for own in parts]
    assert len(set(keys)) == len(parts)
    assert content_key([x[::2]]) == content_key([x[::2].copy()])


def test_tables_go_by_the_same_door(panda_pair: Callable[[int], Pair], folder: Path) -> None:
    arms, paths = panda_pair(1)
    first = clearance_table(0, 1, arms, paths, 0.03)
    (file,) = folder.iterdir()
    assert file.name.startswith("clearance-")
    again = clearance_table(0, 1, arms, paths, 0.03)
    assert again.distance.tobytes() == first.distance.tobytes()
    assert len(list(folder.iterdir())) == 1

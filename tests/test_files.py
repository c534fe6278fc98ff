"""Files: whole or not at all, every changed bit noticed, one process at a time, and places that cannot be written."""

from __future__ import annotations

import errno
import io
import os
import random
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from armtempo.errors import InputError
from armtempo.files import check_output, check_output_folder, is_sealed, locked, whole_file, write_sealed


@pytest.mark.parametrize("size", [0, 1, 1000, (1 << 20) + 7])
def test_every_change_of_a_sealed_file_is_noticed(size: int, tmp_path: Path) -> None:
    file, draw = tmp_path / "sealed", random.Random(size)
    content = draw.randbytes(size)
    write_sealed(file, content)
    whole = file.read_bytes()
    assert whole.startswith(content)
    with file.open("rb") as stream:
        stream.read(1)  # wherever it stands
        assert is_sealed(stream)
        assert stream.read() == whole  # from its start
    for _ in range(60):
        place, bit = draw.randrange(len(whole)), 1 << draw.randrange(8)
        changed = whole[:place] + bytes([whole[place] ^ bit]) + whole[place + 1 :]
        cut, longer = whole[:place], whole + draw.randbytes(1 + place % 64)
        grown = whole[:place] + b"\0" + whole[place:]
        for damaged in (changed, cut, longer, grown):
            assert not is_sealed(io.BytesIO(damaged))


def test_a_file_is_written_whole_or_not_at_all_and_errors_name_it(tmp_path: Path) -> None:
    target = tmp_path / "deep" / "curve.csv"

    def full(temporary: Path) -> None:
        temporary.write_text("half")
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with pytest.raises(OSError, match=r"No space left on device: .*curve\.csv") as caught, whole_file(target) as one:
        full(one)
    assert caught.value.filename == str(target)
    assert list(target.parent.iterdir()) == []
    with whole_file(target) as temporary:
        temporary.write_text("whole")
        with pytest.raises(OSError, match="No space"), whole_file(target) as one:
            full(one)
    assert target.read_text() == "whole"
    assert [file.name for file in target.parent.iterdir()] == ["curve.csv"]


def test_a_device_is_written_to_and_not_replaced() -> None:
    check_output("/dev/full")
    with pytest.raises(OSError, match="No space left on device: '/dev/full'"), whole_file(Path("/dev/full")) as device:
        device.write_text("figures")
    assert Path("/dev/full").is_char_device()


HOLDER = """
import sys, time
from pathlib import Path
from armtempo.files import locked

with locked(Path(sys.argv[1])) as alone:
    print(alone, flush=True)
    time.sleep(600)
"""


def test_a_lock_is_one_processs_and_free_when_that_is_killed(tmp_path: Path) -> None:
    file = tmp_path / "lock"
    holder = subprocess.Popen([sys.executable, "-c", HOLDER, str(file)], stdout=subprocess.PIPE, text=True)
    assert holder.stdout is not None
    try:
        assert holder.stdout.readline() == "True\n"
        with locked(file) as alone:
            assert not alone
    finally:
        os.kill(holder.pid, signal.SIGKILL)
        holder.wait()
        holder.stdout.close()
    with locked(file) as alone:
        assert alone
        with locked(file) as again:
            assert not again  # nor in the same process
    with locked(file) as alone:
        assert alone


def test_places_that_cannot_be_written_are_told_and_nothing_is_left(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "taken").write_text("")
    check_output(tmp_path / "new" / "deep" / "figures.json")
    check_output(tmp_path / "taken")  # is replaced
    check_output_folder(tmp_path)
    check_output_folder(tmp_path / "new" / "deep")
    refused = [
        (check_output, tmp_path, "it is a folder"),
        (check_output, tmp_path / "taken" / "figures.json", "taken is no folder"),
        (check_output, tmp_path / ("x" * 400), "name too long"),
        (check_output, tmp_path / "zero\0byte", "null byte"),
        (check_output_folder, tmp_path / "taken", "taken is no folder"),
        (check_output_folder, tmp_path / "taken" / "deep", "taken is no folder"),
        (check_output_folder, tmp_path / ("x" * 400), "name too long"),
    ]
    for check, path, said in refused:
        with pytest.raises(InputError, match=said) as caught:
            check(path)
        assert caught.value.remedy
        assert len(str(caught.value)) < 400
    monkeypatch.setattr("tempfile.TemporaryFile", _read_only)  # root may write anywhere
    for check in (check_output, check_output_folder):
        with pytest.raises(InputError, match=r"new: Read-only file system \(check the path and its permissions\)"):
            check(tmp_path / "new")
    assert [file.name for file in tmp_path.iterdir()] == ["taken"]


def _read_only(dir: Path) -> None:  # noqa: A002 - tempfile's
    raise OSError(errno.EROFS, os.strerror(errno.EROFS))

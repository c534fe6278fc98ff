"""``armtempo ik`` finds what ``armtempo fk`` says."""

from __future__ import annotations

import json

import numpy as np
import pytest

from armtempo.commands import main


def _json(line: list[str], capsys: pytest.CaptureFixture[str]) -> dict[str, object]:
    assert main([*line, "--json", "-"]) == 0
    return dict(json.loads(capsys.readouterr().out))


def test_there_and_back(capsys: pytest.CaptureFixture[str]) -> None:
    q = [0.5, -1.2, 1.0, -0.4, 0.9, 0.3]
    there = _json(["fk", "ur5e_like.urdf", *map(str, q)], capsys)["postures"][0]  # type: ignore[index]
    position, rpy = there["tip_position_m"], there["tip_rpy_rad"]
    line = ["ik", "ur5e_like.urdf", "--position-m", *map(str, position), "--rpy-rad", *map(str, rpy), "--count", "20"]
    found = _json(line, capsys)["postures"]
    assert min(np.abs(np.array(one["joints"]) - q).max() for one in found) < 1e-6  # type: ignore[attr-defined]
    for one in found:  # type: ignore[attr-defined]
        np.testing.assert_allclose(one["tip_position_m"], position, atol=1e-9)
        assert 0.0 <= one["margin_share"] <= 0.5
        assert one["holding_share"] > 0.0


def test_the_table_has_a_line_for_every_posture(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["ik", "lee1991:slave", "--position-m", "0.5", "0.1", "0"]) == 0
    out = capsys.readouterr().out
    assert "Postures of lee1991:slave" in out
    assert "joint 2" in out
    assert "Tip at 0.5000, 0.1000, 0.0000 m" in out


@pytest.mark.parametrize(
    ("line", "said"),
    [
        (["fk", "puma560.urdf", "0", "0"], "2 joint positions for puma560.urdf (give 6"),
        (
            ["ik", "nosuch.urdf", "--position-m", "0", "0", "0"],
            "no robot 'nosuch.urdf' (give a file or a bundled robot",
        ),
        (["ik", "scara_800.urdf", "--position-m", "9", "0", "0"], "the nearest misses it by"),
        (["ik", "scara_800.urdf", "--position-m", "0.4", "0", "0.1", "--count", "0"], "--count"),
    ],
)
def test_what_cannot_be_is_told_in_a_line(line: list[str], said: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(line) == 2
    told = capsys.readouterr().err
    assert said in told
    assert told.count("\n") == 1

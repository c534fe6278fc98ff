"""``armtempo record`` in cells of every kind, of baselines and of learned agents."""

from __future__ import annotations

from pathlib import Path

import imageio.v3 as imageio
import numpy as np
import pytest

from armtempo.commands import main
from tests.agents.trained import trained


def test_record_films_an_episode(capfd: pytest.CaptureFixture[str]) -> None:
    assert (
        main(["record", "lee1991", "--policy", "delay", "--physics", "ideal", "--slow", "2", "--out", "film.gif"]) == 0
    )
    assert imageio.imread("film.gif", index=0).shape == (720, 1280, 3)
    assert imageio.immeta("film.gif")["duration"] == 40  # [ms]
    out = capfd.readouterr().out
    assert "film.gif" in out
    assert out.count("\n") <= 2, "the renderer's chatter stays out"


def test_record_writes_mp4_and_folders_whole(tmp_path: Path) -> None:
    from armtempo.commands._record import film_writer

    frames = [np.full((48, 64, 3), shade, dtype=np.uint8) for shade in (0, 100, 200)]
    for target in ("film.mp4", "pictures"):
        with film_writer(tmp_path / target, 12.5) as write:
            for frame in frames:
                write(frame)
    assert (tmp_path / "film.mp4").stat().st_size > 500
    assert len(list((tmp_path / "pictures").iterdir())) == 3


def test_an_interrupted_film_leaves_nothing(tmp_path: Path) -> None:
    from armtempo.commands._record import film_writer

    def interrupted() -> None:
        with film_writer(tmp_path / "film.gif", 12.5) as write:
            write(np.zeros((48, 64, 3), dtype=np.uint8))
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("policy", ["constant", "limit-aware-smooth", trained("blend-tracking")])
def test_record_films_a_blend_cell(policy: str) -> None:
    assert main(["record", "lee2006", "--policy", policy, "--physics", "ideal", "--slow", "0.2", "--out", "film"]) == 0
    pictures = [imageio.imread(file) for file in sorted(Path("film").iterdir())]
    assert len(pictures) > 8
    assert (pictures[0] != pictures[-1]).any(), "the arm has moved"


@pytest.mark.parametrize("policy", ["feedback-damped", "law", trained("feedback-ik")])
def test_record_films_an_ik_cell(policy: str, short_ik_cell: str) -> None:
    assert (
        main(["record", short_ik_cell, "--policy", policy, "--physics", "ideal", "--slow", "2", "--out", "film"]) == 0
    )
    pictures = [imageio.imread(file) for file in sorted(Path("film").iterdir())]
    assert len(pictures) == 11  # one in 20 ms, and the last
    assert (pictures[0] != pictures[-1]).any(), "the arm has moved"


def test_record_names_the_film_of_an_agent_after_its_file(
    capsys: pytest.CaptureFixture[str],
) -> None:
    line = ["record", "lee1991", "--policy", trained("lee1991"), "--physics", "ideal", "--slow", "0.5", "--shield"]
    assert main([*line, "--disturbance", "late"]) == 0
    assert Path("results/lee1991/ppo-lee1991.mp4").stat().st_size > 500
    assert "0.5 times slower than reality" in " ".join(capsys.readouterr().out.split())


def test_a_film_that_never_ends_is_refused(short_ik_cell: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["record", short_ik_cell, "--physics", "ideal", "--slow", "1e9", "--out", "film.mp4"]) == 2
    assert "--slow 1e+09 makes a film of 2e+08 s (try --slow 20)" in capsys.readouterr().err
    assert not Path("film.mp4").exists()

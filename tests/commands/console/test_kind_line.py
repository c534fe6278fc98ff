"""Command lines by the kind of their cell: which word is the cell, and which flags it has."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import pytest
import tyro

from armtempo.commands.console._kind_line import _cell_word, read_kind_line
from armtempo.errors import ArmtempoError, UnknownNameError


@dataclass(frozen=True, kw_only=True)
class Flags:
    """Do something in a cell.

    More about it.
    """

    cell: Annotated[str, tyro.conf.Positional]
    """The cell."""

    episodes: int = 3
    """How many."""

    out: str = ""
    """Where to."""


@pytest.mark.parametrize(
    ("line", "word"),
    [
        (["lee1991", "--episodes", "5"], "lee1991"),
        (["nonsense", "--episodes", "5"], "nonsense"),  # the first word is the cell, whatever it says
        (["--episodes", "5", "lee1991"], "lee1991"),  # behind flags only what can be one
        (["--policies", "vci", "own/cell.yml"], "own/cell.yml"),
        (["--episodes", "5"], None),
        ([], None),
        (["--help"], None),
    ],
)
def test_the_cell_is_the_first_word_or_behind_flags_one_that_can_be_a_cell(line: list[str], word: str | None) -> None:
    assert _cell_word(line) == word


def test_flags_of_the_kind_become_its_record() -> None:
    flags, kind, options = read_kind_line(["lee1991", "--episodes", "5", "--master-late", "0.1"], Flags, "armtempo do")
    assert (flags.cell, flags.episodes) == ("lee1991", 5)
    assert kind.name == "coordination"
    assert options == kind.options_type(master_late_s=0.1)


def test_flags_of_another_kind_are_unknown_here() -> None:
    with pytest.raises(UnknownNameError, match="option of armtempo do in blend cells '--master-late'"):
        read_kind_line(["lee2006", "--master-late", "0.1"], Flags, "armtempo do")
    with pytest.raises(UnknownNameError, match="did you mean '--episodes'"):
        read_kind_line(["lee1991", "--episode", "5"], Flags, "armtempo do")


def test_values_are_checked_by_the_record() -> None:
    with pytest.raises(ArmtempoError, match=r"--master-late must be .* 0 or more, got -1"):
        read_kind_line(["lee1991", "--master-late", "-1"], Flags, "armtempo do")


def test_help_of_a_cell_names_its_policies_and_options(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        read_kind_line(["lee1991", "--help"], Flags, "armtempo do")
    assert ended.value.code == 0
    said = " ".join(capsys.readouterr().out.replace("│", " ").split())
    assert "Policies of coordination cells: " in said
    assert "--master-late S" in said
    assert "More about it" not in said


def test_a_line_without_a_cell_is_answered_and_ends(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        read_kind_line([], Flags, "armtempo do")
    assert ended.value.code == 2
    captured = capsys.readouterr()
    assert "cell" in (captured.out + captured.err).lower()


def test_a_flags_value_that_is_a_cells_name_is_not_the_cell() -> None:
    line = ["--out", "lee1991", "chung", "--family", "smooth"]
    flags, kind, options = read_kind_line(line, Flags, "armtempo do")
    assert (flags.cell, flags.out, kind.name, options.family) == ("chung", "lee1991", "ik", "smooth")

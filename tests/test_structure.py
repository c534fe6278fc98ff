"""The house keeps its shape: functions stay small, modules have tests, nothing is imported late to dodge a circle.

Circles and the order of the rooms are import-linter's business (``make check``).
"""

from __future__ import annotations

import ast
import json
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[1]
FOLDERS = ("configs", "robots", "planners", "envs", "agents", "commands")
KERNELS = {"njit", "inlined", "unlocked"}

MOST_LINES, MOST_KERNEL_LINES = 60, 80  # without the docstring
MOST_ARGUMENTS = 8  # outside kernels
MOST_KERNEL_COMPLEXITY = 25  # of others: pyproject.toml

EXCEPTIONS: dict[str, str] = {}
"""Functions over a limit, ``file::name``, and why; ten at most."""

UNTESTED: dict[str, str] = {}
"""Modules without a test file of their own, and why."""

Function = ast.FunctionDef | ast.AsyncFunctionDef


def _modules() -> Iterator[Path]:
    for folder in FOLDERS:
        yield from sorted((ROOT / folder).rglob("*.py"))


def _functions() -> Iterator[tuple[str, Function, bool]]:
    """``file::name``, the function, whether it is compiled."""
    for file in _modules():
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if isinstance(node, Function):
                compiled = any(isinstance(one, ast.Name) and one.id in KERNELS for one in node.decorator_list)
                yield f"{file.relative_to(ROOT).as_posix()}::{node.name}", node, compiled


def _lines(function: Function) -> int:
    first = function.body[0]
    documented = isinstance(first, ast.Expr) and isinstance(first.value, ast.Constant)
    docstring = (first.end_lineno or 0) - first.lineno + 1 if documented else 0
    return (function.end_lineno or 0) - function.lineno + 1 - docstring


def test_functions_stay_small() -> None:
    over = set()
    for name, function, compiled in _functions():
        arguments = [one.arg for one in (*function.args.posonlyargs, *function.args.args, *function.args.kwonlyargs)]
        own = len([one for one in arguments if one not in ("self", "cls")])
        if _lines(function) > (MOST_KERNEL_LINES if compiled else MOST_LINES):
            over.add(name)
        if own > MOST_ARGUMENTS and not compiled:
            over.add(name)
    assert over - set(EXCEPTIONS) == set()
    assert set(EXCEPTIONS) - over == set(), "no exception that is not needed"
    assert len(EXCEPTIONS) <= 10


def test_kernels_stay_simple() -> None:
    compiled = {name for name, _, kernel in _functions() if kernel}
    limit = f"lint.mccabe.max-complexity={MOST_KERNEL_COMPLEXITY}"
    command = [sys.executable, "-m", "ruff", "check", "--isolated", "--select", "C901", "--config", limit]
    run = subprocess.run(
        [*command, "--output-format", "json", *FOLDERS], cwd=ROOT, capture_output=True, text=True, check=False
    )
    found = set()
    for complaint in json.loads(run.stdout):
        file = Path(complaint["filename"]).relative_to(ROOT).as_posix()
        found.add(f"{file}::{complaint['message'].split('`')[1]}")
    assert found & compiled == set()


def test_every_module_has_a_test_or_a_reason() -> None:
    missing = set()
    for file in _modules():
        module = file.relative_to(ROOT)
        if file.name == "__init__.py" or file.name == "kernels.py":
            continue  # faces
        if not (ROOT / "tests" / module.parent / f"test_{file.stem.lstrip('_')}.py").is_file():
            missing.add(module.as_posix())
    assert missing - set(UNTESTED) == set()
    assert set(UNTESTED) - missing == set(), "no reason that is not needed"


def test_nothing_of_ours_is_imported_late_below_the_commands() -> None:
    late = set()
    for name, function, _ in _functions():
        for node in ast.walk(function):
            if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("armtempo"):
                late.add(name)
    allowed = {name for name in late if name.startswith("commands/")}  # a command loads what it needs when it runs
    allowed |= {name for name in late if name.startswith("agents/training/")}  # torch and stable-baselines3
    assert late - allowed == set()

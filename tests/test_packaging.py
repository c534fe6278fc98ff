"""Guards on the layout: one import name, complete faces, a light import. The wheel itself is tried by `make build`."""

from __future__ import annotations

import json
import subprocess
import sys
import tomllib
from importlib import import_module
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path

import gymnasium
import pettingzoo
import pytest

import armtempo

ROOT = Path(__file__).parents[1]
FOLDERS = ("configs", "robots", "planners", "envs", "agents", "commands")


def test_folders_are_importable_only_below_armtempo(tmp_path: Path) -> None:
    code = f"import armtempo, importlib.util as u; print([f for f in {FOLDERS} if u.find_spec(f)])"
    run = subprocess.run([sys.executable, "-I", "-c", code], cwd=tmp_path, capture_output=True, text=True, check=True)
    assert run.stdout.strip() == "[]"
    assert not set(FOLDERS) & set(sys.modules)


@pytest.mark.parametrize("folder", FOLDERS)
def test_every_name_of_a_face_exists(folder: str) -> None:
    assert find_spec(f"armtempo.{folder}") is not None
    face = import_module(f"armtempo.{folder}")
    assert face.__doc__
    assert len(face.__all__) == len(set(face.__all__))
    assert [name for name in face.__all__ if not hasattr(face, name)] == []


def test_links_point_to_the_real_folders() -> None:
    if not (ROOT / "src" / "armtempo" / "configs").exists():
        pytest.skip("an unpacked sdist has no links")
    for folder in FOLDERS:
        assert (ROOT / "src" / "armtempo" / folder).resolve() == ROOT / folder


def test_no_tests_folder_is_a_package() -> None:
    assert list((ROOT / "tests").rglob("__init__.py")) == []


def test_pyproject_ships_every_folder() -> None:
    wheel = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["hatch"]["build"]["targets"]["wheel"]
    assert set(wheel["only-include"]) == {"src/armtempo", *FOLDERS}
    assert wheel["sources"] == {"src/armtempo": "armtempo"} | {folder: f"armtempo/{folder}" for folder in FOLDERS}
    assert set(wheel["exclude"]) == {f"/src/armtempo/{folder}" for folder in FOLDERS}


def test_git_ignores_no_package_data() -> None:
    files = [str(path.relative_to(ROOT)) for folder in FOLDERS for path in (ROOT / folder).rglob("*") if path.is_file()]
    files = [file for file in files if "__pycache__" not in file]
    git = subprocess.run(["git", "check-ignore", *files], cwd=ROOT, capture_output=True, text=True, check=False)
    if git.returncode not in (0, 1):
        pytest.skip("not a git checkout")
    assert git.stdout == ""


def test_version_is_the_installed_one() -> None:
    assert armtempo.__version__ == version("armtempo")


def test_import_stays_light_and_load_cell_comes_when_used(tmp_path: Path) -> None:
    code = "import sys, json, armtempo; print(json.dumps(sorted(sys.modules)))"
    run = subprocess.run([sys.executable, "-I", "-c", code], cwd=tmp_path, capture_output=True, text=True, check=True)
    loaded = set(json.loads(run.stdout))
    heavy = {"numba", "scipy", "pybullet", "fcl", "trimesh", "yourdfpy", "matplotlib", "torch", "armtempo.planners"}
    assert not loaded & heavy
    assert "load_cell" in dir(armtempo)
    assert callable(armtempo.load_cell)


def test_planners_need_no_statistics() -> None:
    """scipy.stats alone takes half a second."""
    code = "import sys, armtempo.planners; sys.exit('scipy.stats' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_unknown_attribute_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="module 'armtempo' has no attribute 'load_cel'"):
        _ = armtempo.load_cel


def test_environments_are_registered_with_plain_arguments() -> None:
    single = gymnasium.spec("armtempo/Yielding-v0")
    assert single.entry_point == "armtempo.envs:YieldingEnv"
    assert json.loads(json.dumps(single.kwargs)) == single.kwargs == {"cell": "lee1991"}
    several = pettingzoo.spec("parallel", "armtempo/Coordination-v0")
    assert several.entry_point == "armtempo.envs.coordination_v0:parallel_env"
    assert json.loads(json.dumps(several.kwargs)) == several.kwargs == {"cell": "lee1991"}

"""Guards on the layout: one import name, complete faces, a light import. The wheel itself is tried by `make build`."""

from __future__ import annotations

import json
import os
import shutil
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


def test_every_dependency_has_one_lower_bound_for_make_lowest_to_install() -> None:
    run = subprocess.run(
        [sys.executable, ROOT / "tests/lowest.py", "rl", "sweep", "xacro"], capture_output=True, text=True, check=True
    )
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    declared = [
        *project["dependencies"],
        *(one for extra in ("rl", "sweep", "xacro") for one in project["optional-dependencies"][extra]),
    ]
    bounds = [one.partition(",")[0].replace(">=", "==", 1) for one in declared]
    assert run.stdout.splitlines() == bounds


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


READ_ONLY = """
import sys, tempfile, pathlib
if sys.argv[1:]: tempfile.tempdir = sys.argv[1]
import armtempo
home = pathlib.Path(armtempo.__file__).parent
try:
    (home / "robots" / "written").touch()
except OSError:
    pass
else:
    sys.exit("the package can be written")
import numpy as np
from armtempo.cache import cached
from armtempo.commands import main
from armtempo.configs import data_path
from armtempo.robots import Arm, _kernels
assert main(["cells", "--json", "-"]) == 0
if not sys.argv[1:]:
    import matplotlib.font_manager  # asks for a place, wherever it is
Arm.from_urdf(data_path("robots/planar_two_link.urdf"), tip_link="tool").tip_pose(np.zeros(2))
cached("thing", "0", lambda: {"x": np.arange(3)})
print(sum(_kernels.batch_link_frames.stats.cache_hits.values()))
"""


def _read_only(folder: Path) -> list[str]:
    """What to put before a command so that its user cannot write below ``folder``: root is told to heed permissions."""
    for path in (folder, *folder.rglob("*")):
        path.chmod(path.stat().st_mode & ~0o222)
    return [] if os.geteuid() else ["setpriv", "--bounding-set=-dac_override", "--inh-caps=-dac_override"]


def test_an_installation_that_cannot_be_written_and_a_home_that_is_not_there(tmp_path: Path) -> None:
    package, places = tmp_path / "armtempo", tmp_path / "places"
    places.mkdir()
    shutil.copytree(Path(armtempo.__file__).parent, package, ignore=shutil.ignore_patterns("__pycache__"))
    before = _read_only(package)
    environment = {"PATH": os.defpath, "HOME": "/proc/nohome", "PYTHONPATH": str(tmp_path), "TMPDIR": str(places)}

    def run(*arguments: str) -> tuple[str, str]:
        done = subprocess.run(
            [*before, sys.executable, "-c", READ_ONLY, *arguments],
            env=environment, cwd=places, capture_output=True, text=True, check=False,
        )  # fmt: skip
        assert done.returncode == 0, done.stderr
        return done.stdout, done.stderr

    first, told = run()
    assert told == ""
    assert json.loads(first[: first.rindex("]") + 1])
    kept = sorted(path.name for path in (places / f"armtempo-{os.getuid()}").iterdir())
    assert kept == ["cache", "matplotlib", "numba"]
    again, told = run()
    assert told == ""
    assert int(again.split()[-1]) > int(first.split()[-1]) == 0  # compiled once
    _, told = run("/proc/nohome")  # nowhere at all
    assert told.count("\n") == 1
    assert "NUMBA_CACHE_DIR" in told

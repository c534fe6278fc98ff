"""Run by `make build` against the installed wheel, from another folder and isolated (`python -I`): is it whole?"""

from __future__ import annotations

import subprocess
import sys
from importlib.metadata import files
from importlib.util import find_spec
from pathlib import Path

import armtempo
from armtempo.configs import bundled_cells, load_cell_config, resolve_file
from armtempo.robots import Arm

FOLDERS = ("configs", "robots", "planners", "envs", "agents", "commands")

home = Path(armtempo.__file__).parent
assert "site-packages" in home.parts, f"not the wheel: {home}"
assert (home / "py.typed").is_file()
assert all((home / folder / "__init__.py").is_file() for folder in FOLDERS)
assert not any(find_spec(folder) for folder in FOLDERS), "a bare top-level folder was installed"
tops = {path.parts[0] for path in files("armtempo") or ()}
assert all(top.startswith(("armtempo", "..")) for top in tops), tops

assert "lee1991" in bundled_cells()
config = load_cell_config("lee1991")
for arm in config.arms:
    assert Arm.from_urdf(resolve_file(config, arm.urdf), tip_link=arm.tip_link).dof == 2
assert armtempo.load_cell("lee1991").name == "lee1991"
assert armtempo.load_cell("lee2006").arms[0].dof == 4
page = home / "commands" / "viewer" / "page"
assert all((page / name).stat().st_size > 0 for name in ("page.html", "page.css", "page.js", "three.js"))
subprocess.run([Path(sys.executable).parent / "armtempo", "--help"], check=True, stdout=subprocess.DEVNULL)
sys.stdout.write(f"armtempo {armtempo.__version__}: the wheel is whole\n")

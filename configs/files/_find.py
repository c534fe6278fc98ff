"""Where files are: bundled with armtempo, or the user's own."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

from armtempo.errors import ConfigError, InputError, UnknownNameError, closest
from armtempo.reading import read_text, user_path, why_unreadable

DATA = Path(__file__).parents[1]
SUFFIXES = (".yaml", ".yml")
LARGEST = 2**20  # bytes of a file; longer lists of waypoints have a file of their own


class DataFolder(NamedTuple):
    """A folder of bundled files, and what one of them is called."""

    name: str
    what: str

    def bundled(self) -> tuple[str, ...]:
        """Names of the files that come with armtempo, sorted."""
        return tuple(sorted(path.stem for path in (DATA / self.name).glob("*.yaml")))

    def find(self, name_or_path: str | Path) -> Path:
        """The bundled file of that name, or the user's own.

        Raises:
            InputError: It is neither a name nor a path.
            UnknownNameError: No such bundled file.
            ConfigError: No such file of the user's.
        """
        known = self.bundled()
        if not isinstance(name_or_path, str | Path):
            raise InputError(
                f"a {self.what} is a name or a file, got {type(name_or_path).__name__}",
                remedy=f"give a YAML file, or a bundled {self.what}: {', '.join(known)}",
            )
        if isinstance(name_or_path, str) and name_or_path in known:
            return DATA / self.name / f"{name_or_path}.yaml"
        path = user_path(name_or_path)
        what = why_unreadable(path)
        if what is None:
            return path
        looks_like_a_file = isinstance(name_or_path, Path) or path.suffix in SUFFIXES or len(path.parts) != 1
        if looks_like_a_file or what != "no such file":
            remedy = f"give a YAML file, or a bundled {self.what}: {', '.join(known)}"
            raise ConfigError(f"{path}: {what}", remedy=remedy, file=path, key="", value=None)
        remedy = f"{closest(str(name_or_path), known)}known: {', '.join(known)}; or give the path of a YAML file"
        raise UnknownNameError(self.what, str(name_or_path), known, remedy=remedy)

    def read(self, name_or_path: str | Path) -> tuple[str, Path]:
        """The text of such a file, and where it is.

        Raises:
            ConfigError: It cannot be read; and as ``find``.
        """
        path = self.find(name_or_path)
        try:
            return read_text(path, LARGEST), path.resolve()
        except InputError as error:
            raise ConfigError(error.message, remedy=error.remedy, file=path, key="", value=None) from error


CELL_FILES = DataFolder("cells", "cell")
TRAINING_FILES = DataFolder("train", "training")
SWEEP_FILES = DataFolder("sweep", "sweep")


def data_path(name: str) -> Path:
    """Path of a bundled data file.

    Args:
        name: Path from the folder of bundled data, such as ``"robots/planar_two_link.urdf"``.

    Raises:
        UnknownNameError: There is no such file.
    """
    path = DATA / name
    if not path.is_file():
        known = (p for p in DATA.rglob("*") if p.is_file() and p.suffix not in (".py", ".pyc"))
        raise UnknownNameError("data file", name, (p.relative_to(DATA).as_posix() for p in known))
    return path

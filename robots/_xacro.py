"""Robot files with xacro elements, expanded by xacro itself, without ROS (the extra ``xacro``)."""

from __future__ import annotations

import re
from contextlib import chdir
from pathlib import Path

from armtempo.errors import RobotError

MISSING = re.compile(r"Package not found: (\S+)")


def expand(file: Path) -> str:
    """The URDF that a file with xacro elements stands for, with its arguments' defaults.

    Includes are found beside the file, ``$(find package)`` in and beside the folders above it, and on ROS_PACKAGE_PATH.
    xacro evaluates the file's expressions: expand files of people whom you trust.

    Raises:
        RobotError: xacrodoc is not installed, or xacro cannot expand the file.
    """
    try:
        from xacrodoc import XacroDoc, packages
    except ModuleNotFoundError as error:
        raise RobotError(
            f"{file}: file holds xacro elements, and xacrodoc is not installed",
            remedy='pip install "armtempo[xacro]", or run xacro first and give its output',
            file=str(file),
        ) from error
    path, known = file.resolve(), dict[str, str]()
    while True:
        packages.reset()
        packages.update_package_cache(known)
        try:
            with chdir(path.parent):
                text: str = XacroDoc.from_file(path.as_posix()).to_urdf_string()
        except Exception as error:  # xacro, rospkg and minidom raise what they like, the first wraps the others
            missing = MISSING.search(str(error))
            name = missing[1] if missing else ""
            found = None if name in known else _folder_of(name, path)
            if found is not None:
                known[name] = found
                continue
            raise RobotError(
                f"{file}: xacro cannot expand it: {type(error).__name__}: {error}",
                remedy=f"put the folder {name!r} beside the file or above it, or on ROS_PACKAGE_PATH"
                if missing
                else "repair it, or put the files that it includes beside it",
                file=str(file),
            ) from error
        else:
            return text


def _folder_of(package: str, file: Path) -> str | None:
    """The folder of a package's name above a file, or beside one of those."""
    for above in file.parents if package else ():
        for folder in (above, above / package):
            if folder.name == package and folder.is_dir():
                return folder.as_posix()
    return None

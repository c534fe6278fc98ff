"""A per-user cache on disk, by content: the key is a hash of everything that decides the answer.

``ARMTEMPO_CACHE`` names another folder, or is ``off``; without a home that can be written it is among the temporary
files. Files may be deleted at any time. They are written beside their
place and moved there; one that is damaged is ignored and written anew.
"""

from __future__ import annotations

import hashlib
import io
import logging
import os
import stat
import sys
import tempfile
from collections.abc import Callable, Iterable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import platformdirs
from numpy.typing import NDArray

from armtempo.files import is_sealed, whole_file, write_sealed

Arrays = dict[str, NDArray[Any]]

LOG = logging.getLogger(__name__)


def cache_folder() -> Path | None:
    """Where cached files are kept; None: nowhere."""
    named = os.environ.get("ARMTEMPO_CACHE", "")
    if named:
        return None if named.lower() == "off" else Path(named)
    folder = platformdirs.user_cache_path("armtempo", appauthor=False)
    if folder.is_absolute() and can_be_made(folder):  # without a home it is not
        return folder
    private = private_folder()
    return None if private is None else private / "cache"


def can_be_made(folder: Path) -> bool:
    """Whether a folder is there, or is now."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError:
        return False
    return True


@cache
def private_folder() -> Path | None:
    """A folder of this user's alone among the temporary files, for what a home would keep; None: there is no place.

    Whoever could write there could have us run code, as numba's files are: somebody else's folder is not taken.
    """
    if sys.platform == "win32":
        return None  # a home can always be written there, and folders have no modes
    user = os.getuid()
    try:
        folder = Path(tempfile.gettempdir()) / f"armtempo-{user}"
        folder.mkdir(mode=stat.S_IRWXU, exist_ok=True)
        found = folder.lstat()
    except OSError:
        return None
    shared = found.st_uid != user or found.st_mode & (stat.S_IRWXG | stat.S_IRWXO)
    return folder if stat.S_ISDIR(found.st_mode) and not shared else None


def content_key(parts: Iterable[object]) -> str:
    """Hash of arrays (their type, shape and bytes) and plain values (their ``repr``)."""
    digest = hashlib.blake2b(digest_size=20)
    for part in parts:
        if isinstance(part, np.ndarray):
            digest.update(f"{part.dtype.str}{part.shape}".encode())
            digest.update(np.ascontiguousarray(part).tobytes())
        else:
            digest.update(repr(part).encode())
        digest.update(b";")
    return digest.hexdigest()


def cached(kind: str, key: str, compute: Callable[[], Arrays]) -> Arrays:
    """The arrays kept under a key, or else those ``compute`` returns, which are kept from now on."""
    folder = cache_folder()
    if folder is None:
        return compute()
    file = folder / f"{kind}-{key}.npz"
    arrays = _read(file)
    if arrays is None:
        arrays = compute()
        _write(file, arrays)
    return arrays


def _read(file: Path) -> Arrays | None:
    try:
        with file.open("rb") as stream:
            if is_sealed(stream):
                with np.load(stream, allow_pickle=False) as archive:
                    return {name: archive[name] for name in archive.files}
    except FileNotFoundError:
        return None
    except OSError as error:
        LOG.warning("cannot read %s: %s; its content is computed again", file, error)
        return None
    LOG.warning("%s is damaged, or of an earlier version; its content is computed again", file)
    return None


def _write(file: Path, arrays: Arrays) -> None:
    packed = io.BytesIO()
    named: dict[str, Any] = dict(arrays)
    np.savez_compressed(packed, **named)
    try:
        with whole_file(file) as temporary:
            write_sealed(temporary, packed.getbuffer())
    except OSError as error:
        LOG.warning("cannot write %s: %s; it will be computed again", file, error)

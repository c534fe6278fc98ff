"""Files that are written whole or not at all, that know when a bit of them has changed, and that one process holds."""

from __future__ import annotations

import errno
import hashlib
import logging
import os
import sys
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO

from armtempo.errors import InputError

__all__ = ["check_output", "check_output_folder", "is_sealed", "locked", "whole_file", "write_sealed"]

LOG = logging.getLogger(__name__)
SEAL = b"\narmtempo blake2b "  # stands before the digest
DIGEST_BYTES = 32
BLOCK_BYTES = 1 << 20
BUSY = (errno.EAGAIN, errno.EACCES, errno.EDEADLK)  # what systems say of a lock that another holds


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """A temporary file beside ``path``, with its suffix, that takes its place when the block ends without an error.

    What is there and no file (``/dev/stdout``, a pipe) is written to as it is. An OSError names ``path``.
    """
    temporary: Path | None = None
    try:
        if path.exists() and not path.is_file() and not path.is_dir():
            yield path
            return
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(prefix=f".{path.stem}-", suffix=path.suffix, dir=path.parent)
        os.close(handle)
        temporary = Path(name)
        yield temporary
        umask = os.umask(0)
        os.umask(umask)
        temporary.chmod(0o666 & ~umask)  # mkstemp's files are private
        temporary.replace(path)
    except OSError as error:
        if temporary is None or error.filename in (None, str(temporary)):
            error.filename, error.filename2 = str(path), None
        raise
    finally:
        if temporary is not None:
            temporary.unlink(missing_ok=True)


def check_output(file: str | Path) -> None:
    """Raise InputError unless a file can be written there, before the work whose outcome it is to hold."""
    path = Path(file)
    with _told_of(path):
        with suppress(FileNotFoundError, NotADirectoryError):
            path.stat()  # says what ``is_dir`` and the like do not: that a name is too long
        if path.is_dir():
            raise InputError(f"cannot write {path}: it is a folder", remedy="name a file")
        if path.is_file() or not path.exists():  # else a device or a pipe, which is written to as it is
            _try(path, path.absolute().parents)


def check_output_folder(folder: str | Path) -> None:
    """Raise InputError unless files can be written into a folder, which may not be there yet."""
    path = Path(folder)
    with _told_of(path):
        with suppress(FileNotFoundError, NotADirectoryError):
            path.stat()
        _try(path, [path, *path.absolute().parents])


def _try(target: Path, folders: Sequence[Path]) -> None:
    """Make a file in the first of these that is there; leaves no trace."""
    there = next(one for one in folders if one.exists())
    if not there.is_dir():
        raise InputError(f"cannot write {target}: {there} is no folder", remedy="move it, or give another path")
    with tempfile.TemporaryFile(dir=there):
        pass


@contextmanager
def _told_of(target: Path) -> Iterator[None]:
    """What the system, or a name that it cannot have, complains of becomes an InputError."""
    try:
        yield
    except InputError:
        raise
    except (OSError, ValueError) as error:
        said = repr(str(target))[1:-1]  # it may hold a zero byte
        said = said if len(said) < 200 else f"{said[:200]}..."
        why = getattr(error, "strerror", None) or error
        raise InputError(f"cannot write {said}: {why}", remedy="check the path and its permissions") from error


def write_sealed(file: Path, content: bytes | memoryview) -> None:
    """Write a file's content and, behind it, its digest.

    Readers of zip archives, numpy and torch among them, do not mind what stands behind the archive.
    """
    with file.open("wb") as stream:
        stream.write(content)
        stream.write(SEAL + hashlib.blake2b(content, digest_size=DIGEST_BYTES).digest())


def is_sealed(stream: BinaryIO) -> bool:
    """Whether an open file ends in the digest of all that stands before it; goes back to its start."""
    length = stream.seek(0, os.SEEK_END) - len(SEAL) - DIGEST_BYTES
    stream.seek(0)
    digest, left = hashlib.blake2b(digest_size=DIGEST_BYTES), length
    while left > 0 and (block := stream.read(min(left, BLOCK_BYTES))):
        digest.update(block)
        left -= len(block)
    sealed = length >= 0 and stream.read() == SEAL + digest.digest()
    stream.seek(0)
    return sealed


@contextmanager
def locked(file: Path) -> Iterator[bool]:
    """Hold the lock of a file, which is made if need be; whether nobody else held it.

    It is the system's: it is free again when the process ends, however it ends. The file stays.
    """
    with file.open("ab") as stream:
        try:
            _lock(stream.fileno())
        except OSError as error:
            if error.errno in BUSY:
                yield False
                return
            LOG.warning("%s cannot be locked: %s; nothing keeps two processes apart here", file, error.strerror)
        yield True


if sys.platform == "win32":
    import msvcrt

    def _lock(handle: int) -> None:
        os.lseek(handle, 1 << 30, os.SEEK_SET)  # nobody else could read what is locked
        msvcrt.locking(handle, msvcrt.LK_NBLCK, 1)

else:
    import fcntl

    def _lock(handle: int) -> None:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)

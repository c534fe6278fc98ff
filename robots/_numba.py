"""The one way to compile here: cached, typed for mypy, without fast math: results are certified.

Division by zero gives inf or nan as in numpy (``error_model="numpy"``), it does not raise.

numba keeps compiled functions on disk, and notices changes of a function's own file only; what it calls is compiled
into it. Here a cached function also knows the digest of all files with kernels, so a change in any of them counts.
"""

from __future__ import annotations

import hashlib
import logging
from collections.abc import Callable, Iterable
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from armtempo.cache import private_folder

__all__ = ["inlined", "njit", "uncounted", "unlocked"]

F = TypeVar("F", bound=Callable[..., object])
LOG = logging.getLogger("armtempo")
MARKS = (b"@njit", b"@inlined", b"@uncounted", b"@unlocked")


def kernel_digest(folders: Iterable[Path]) -> str:
    """A digest of all files in ``folders`` that hold kernels: their names and what they say."""
    digest = hashlib.blake2b(digest_size=8)
    for folder in folders:
        for file in sorted(folder.rglob("*.py")):
            text = file.read_bytes()
            if any(mark in text for mark in MARKS):
                digest.update(file.relative_to(folder).as_posix().encode() + b"\0" + text)
    return digest.hexdigest()


if TYPE_CHECKING:

    def njit(function: F) -> F: ...

    def inlined(function: F) -> F: ...

    def uncounted(function: F) -> F: ...

    def unlocked(function: F) -> F: ...

else:
    import numba
    from numba.core.caching import FunctionCache

    _PACKAGE = Path(__file__).parents[1]
    _DIGEST = kernel_digest(_PACKAGE / name for name in ("robots", "planners", "envs"))

    class _Cache(FunctionCache):
        """numba's own, but files of other kernels are those of another version.

        numba reads the version first. The rest of a file may name types that have moved since, and cannot be read then.
        """

        def __init__(self, function: Callable[..., object]) -> None:
            super().__init__(function)
            self._cache_file._version = f"{numba.__version__} {_DIGEST}"

    def _cache_of(function: Callable[..., object]) -> _Cache | None:
        """By the package, in the home, or else among the temporary files; None: no folder can be written."""
        try:
            return _Cache(function)
        except RuntimeError:  # numba: no locator available
            named, private = numba.config.CACHE_DIR, private_folder()
            try:
                numba.config.CACHE_DIR = str(private / "numba") if private is not None else ""
                return _Cache(function)
            except RuntimeError:
                _tell_that_nothing_is_kept()
                return None
            finally:
                numba.config.CACHE_DIR = named

    @cache
    def _tell_that_nothing_is_kept() -> None:
        LOG.warning(
            "no folder to keep compiled kernels in: each process compiles them anew, which takes a minute or more "
            "(set NUMBA_CACHE_DIR to a folder that can be written)"
        )

    def _compiled(**options: object) -> Callable[[F], F]:
        def decorate(function: F) -> F:
            dispatcher = numba.njit(error_model="numpy", **options)(function)
            if hasattr(dispatcher, "enable_caching"):  # else NUMBA_DISABLE_JIT has given the function back
                kept = _cache_of(function)
                if kept is not None:
                    dispatcher._cache = kept
            return dispatcher

        return decorate

    njit = _compiled()
    # Copied into its callers: a call with many arrays costs more (their reference counts) than a short body.
    inlined = _compiled(inline="always")
    # Lets other threads run meanwhile.
    unlocked = _compiled(nogil=True)
    # The same, and counts no references to arrays: each count is an atomic write, and those of the views in short loops
    # took up to half of the time. Only for what makes no arrays, gives none back, and calls nothing that gives one
    # back, unless that is inlined: numba refuses the first, a test finds the others.
    uncounted = _compiled(nogil=True, _nrt=False)

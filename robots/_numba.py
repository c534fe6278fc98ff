"""The one way to compile here: ``numba.njit(cache=True)``, typed for mypy, without fast math: results are certified.

Division by zero gives inf or nan as in numpy (``error_model="numpy"``), it does not raise.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, TypeVar

__all__ = ["inlined", "njit", "unlocked"]

F = TypeVar("F", bound=Callable[..., object])

if TYPE_CHECKING:

    def njit(function: F) -> F: ...

    def inlined(function: F) -> F: ...

    def unlocked(function: F) -> F: ...

else:
    import numba

    njit = numba.njit(cache=True, error_model="numpy")
    # Copied into its callers: a call with many arrays costs more (their reference counts) than a short body.
    inlined = numba.njit(cache=True, error_model="numpy", inline="always")
    # Lets other threads run meanwhile.
    unlocked = numba.njit(cache=True, error_model="numpy", nogil=True)

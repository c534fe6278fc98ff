"""Curve families of blends: how far the inner control points stand from the vertex, and the limits they are passed at.

``shares`` are distances along the tangents, as shares of the remaining distance L:

    cubic      1 - lambda/3    the paper's F' = lambda L n (Lee2006 eqs. 1-9); G2 between lines iff lambda = 3
    quintic    .64, .28        Hermite quintic with |F'| = mu L, mu = 1.8, and F'' only across the path; G2 for any
                               pair; at this mu both peak curvature and its slope are low at square corners
    low-peak   .76, .38        G2 for any pair, least peak curvature at a given deviation
    septic     .80, .60, .25   G3 for any pair

Any other shares may be given as a tuple: (a,), (a, b), (a, b, c).
"""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from armtempo.arrays import Floats, Ints
from armtempo.errors import InputError, UnknownNameError, brief
from armtempo.planners.geometry import floats

Curve = str | tuple[float, ...]


CURVES: dict[str, tuple[float, ...]] = {
    "cubic": (0.0,),
    "quintic": (0.64, 0.28),
    "low-peak": (0.76, 0.38),
    "septic": (0.80, 0.60, 0.25),
}


LEAST_TIME = "least-time"


class PassingLimits(Protocol):
    """Limits of the line speed: ``LineSpeedLimits``, or anything with its attributes.

    Speed [m/s], acceleration [m/s^2], jerk [m/s^3], normal acceleration [m/s^2] (None: as the acceleration).
    """

    @property
    def speed(self) -> float: ...

    @property
    def acceleration(self) -> float: ...

    @property
    def jerk(self) -> float: ...

    @property
    def normal_acceleration(self) -> float | None: ...


def curve_shares(curve: Curve, shape_factor: ArrayLike, count: int) -> tuple[Floats, Ints]:
    """``shares`` (count, 3) and degrees (count,) of a named curve or of a tuple of shares."""
    factor = per_corner("shape_factor", shape_factor, count)
    if ((factor <= 0.0) | (factor > 4.0)).any():
        raise InputError(
            f"shape_factor {brief(shape_factor)} is not in (0, 4]",
            remedy="3 keeps the curvature continuous, 4 cuts no corner",
        )
    named = isinstance(curve, str)
    if not (named and curve == "cubic") and (factor != 3.0).any():
        raise InputError(f"shape_factor belongs to the cubic, not to {brief(curve)}", remedy="drop it")
    if isinstance(curve, str):
        if curve not in CURVES:
            raise UnknownNameError("curve", curve, [*CURVES, LEAST_TIME])
        inner = CURVES[curve]
    else:
        given = floats(curve, "shares of a curve")
        lowest = -1.0 / 3.0 if given.size == 1 else -1.0  # a cubic's as of its shape factor, (0, 4]
        if given.shape not in ((1,), (2,), (3,)) or not ((given >= lowest) & (given < 1.0)).all():
            raise InputError(
                f"curve {brief(curve)} is not one share of the remaining distance in [-1/3, 1), or two or three in "
                "[-1, 1)",
                remedy=f"give numbers like {CURVES['quintic']}, or a name: {', '.join(CURVES)}",
            )
        inner = tuple(given.tolist())
    shares = np.zeros((count, 3))
    shares[:, : len(inner)] = inner
    if named and curve == "cubic":
        shares[:, 0] = 1.0 - factor / 3.0
    return shares, np.full(count, 2 * len(inner) + 1, dtype=np.int64)


def per_corner(name: str, value: ArrayLike, count: int, pairs: bool = False) -> Floats:
    """One number for all corners, one per corner, or (``pairs``) two per corner, as (count,) or (count, 2)."""
    given = floats(value, name)
    if pairs and given.ndim < 2:
        given = np.broadcast_to(given[..., None], (*given.shape, 2))
    wanted = (count, 2) if pairs else (count,)
    try:
        out = np.broadcast_to(given, wanted).copy()
    except ValueError:
        raise InputError(
            f"{name} has shape {np.shape(value)} but the path has {count} corners",
            remedy="give one value for all corners, or one per corner",
        ) from None
    if not np.isfinite(out).all() or (out < 0.0).any():
        raise InputError(f"{name} must be finite and not negative, got {brief(value)}")
    return out

r"""One blend between two segments (Lee2006 eqs. 1-9): the paper's cubic, and curves that are G2 or G3 for any pair.

The blend leaves segment a at the *remaining distance* L_r before the vertex, measured along the segment, and meets
segment b as far behind it. Facts that the tests hold it to, for two lines that meet at the interior angle phi:

    deviation / L_r = cos(phi/2) (1 - lambda/4)                 (the cubic; Lee2006 Table 2)
    curvature at both ends = |6 - 2 lambda| sin(phi) / (lambda^2 L_r)

so ``lambda = 3`` is exactly G2, at every angle and for unequal distances: both inner control points are the vertex.
Next to an arc of radius R the cubic leaves a jump of 2/(3R); the curves of higher degree leave none.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from armtempo.arrays import Floats
from armtempo.errors import InputError, PathError, brief
from armtempo.planners.blends import _path_kernels as kernels
from armtempo.planners.blends._corners import packed_segments, plan_corners
from armtempo.planners.blends._families import Curve, PassingLimits
from armtempo.planners.blends._path_kernels import PackedPath
from armtempo.planners.geometry import Arc, Line, floats


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Blend:
    """A polynomial segment ``F(u)``, ``0 <= u <= 1``, that rounds a corner. Made by ``blend``.

    Attributes:
        coefficients: (degree + 1, 3) [m], by rising powers of u.
        start_remaining: Distance from the vertex at which it leaves the first segment [m], along that segment.
        end_remaining: The same on the second segment.
        deviation: Distance of the vertex from the curve [m].
        continuity: Order of geometric continuity with the two segments: 1 (tangent), 2 (curvature), 3 (its slope).
        length: Arc length [m].
    """

    coefficients: Floats
    start_remaining: float
    end_remaining: float
    deviation: float
    continuity: tuple[int, int]
    length: float = field(init=False)
    packed: PackedPath = field(init=False, repr=False)

    def __post_init__(self) -> None:
        shape = np.zeros((1, 8, 3))
        shape[0, : len(self.coefficients)] = self.coefficients
        kind, lengths = np.array([len(self.coefficients) - 1]), np.zeros(1)
        first_panel, panel_start, panel_size, inverse = kernels.tabulate(kind, shape, lengths)
        object.__setattr__(self, "coefficients", shape[0, : len(self.coefficients)])
        self.coefficients.setflags(write=False)
        object.__setattr__(self, "length", float(lengths[0]))
        packed = PackedPath(
            breakpoints=np.array([0.0, lengths[0]]),
            kind=kind,
            shape=shape,
            first_panel=first_panel,
            panel_start=panel_start,
            panel_size=panel_size,
            inverse=inverse,
        )
        object.__setattr__(self, "packed", packed)

    @property
    def degree(self) -> int:
        """Of the polynomial: 3, 5 or 7."""
        return len(self.coefficients) - 1

    def evaluate(self, s: ArrayLike) -> tuple[Floats, Floats, Floats]:
        """Position, tangent and curvature vector at arc length ``s``: each (..., 3), [m], [1], [1/m]."""
        return self.derivatives(s)[:3]

    def derivatives(self, s: ArrayLike) -> tuple[Floats, Floats, Floats, Floats]:
        """``evaluate`` and the third derivative by arc length [1/m^2], each (..., 3)."""
        return path_derivatives(self.packed, s, False)


def lengths_on(s: ArrayLike) -> Floats:
    """Lengths of any shape; beyond the ends they mean the ends, but NaN means nothing."""
    s = floats(s, "lengths")
    if np.isnan(s).any():
        raise InputError("a length is not a number")
    return s


def path_derivatives(packed: PackedPath, s: ArrayLike, before: bool) -> tuple[Floats, Floats, Floats, Floats]:
    """Position and three derivatives by length of a packed path at lengths of any shape, each (..., 3)."""
    s = lengths_on(s)
    out = np.empty((s.size, 4, 3))
    kernels.blended_points(packed, s.reshape(-1), before, out)
    out = out.reshape(*s.shape, 4, 3)
    return out[..., 0, :], out[..., 1, :], out[..., 2, :], out[..., 3, :]


def blend(
    a: Line | Arc,
    b: Line | Arc,
    remaining_distance: float | tuple[float, float] | None = None,
    shape_factor: float = 3.0,
    *,
    tolerance: float | None = None,
    curve: Curve = "cubic",
    limits: PassingLimits | None = None,
) -> Blend:
    """The curve that rounds the corner between two segments, in space.

    Args:
        a: Segment that ends at the vertex.
        b: Segment that starts there.
        remaining_distance: Where the blend begins and ends, from the vertex along the segments [m]; or a pair.
        shape_factor: lambda of the cubic, in (0, 4].
        tolerance: Instead: the most that the curve leaves the vertex by [m], used up where the segments are long
            enough. With both, the remaining distance is the most that is taken (of a pair the smaller, on both sides).
        curve: ``cubic`` (Lee2006), ``quintic`` and ``low-peak`` (G2 for any pair), ``septic`` (G3), ``least-time`` (of
            all, the quickest to pass; needs ``tolerance`` and ``limits``), or shares of the inner control points, see
            ``_corners``.
        limits: For ``least-time``.

    Raises:
        InputError: A number that makes no sense, an unknown curve.
        PathError: The segments do not meet, continue each other, turn straight back, or are too short for the blend; a
            curve that cannot keep the tolerance.
    """
    kind, shape, lengths = packed_segments((a, b))
    given = None
    if remaining_distance is not None:
        given = floats(remaining_distance, "remaining_distance")
        if given.shape not in ((), (2,)):
            raise InputError(f"remaining_distance {brief(remaining_distance)} is not one number or a pair")
        given = np.broadcast_to(given, (1, 2))
    if tolerance is not None and np.ndim(floats(tolerance, "tolerance")) > 0:
        raise InputError(f"tolerance {brief(tolerance)} is not one number")
    corners = plan_corners(
        kind, shape, lengths, given, shape_factor=shape_factor, tolerance=tolerance, curve=curve, limits=limits
    )
    start, end = (float(x) for x in corners.remaining[0])
    if start == 0.0 or end == 0.0:
        raise PathError("the two segments continue each other", remedy="join them as they are: no blend is needed")
    coefficients = corners.curve[0, : corners.degree[0] + 1]
    out, ends = np.empty((2, 4, 3)), np.empty((2, 4, 3))
    kernels.segment_points(np.repeat(corners.degree, 2), np.repeat(corners.curve, 2, axis=0), np.array([0.0, 1.0]), out)
    kernels.segment_points(kind, shape, np.array([lengths[0] - start, end]), ends)
    size = 0.5 * (start + end)
    return Blend(
        coefficients=coefficients,
        start_remaining=start,
        end_remaining=end,
        deviation=float(corners.deviation[0]),
        continuity=(kernels.joint_order(ends[0], out[0], size), kernels.joint_order(out[1], ends[1], size)),
    )


def least_time_blend(
    a: Line | Arc,
    b: Line | Arc,
    tolerance: float,
    limits: PassingLimits,
    *,
    remaining_distance: float | tuple[float, float] | None = None,
) -> Blend:
    """The blend that is quickest to pass at a corner tolerance [m], by the estimate in ``_least_time``.

    The families and their shares are searched from the named curves; the tolerance is the most the path may leave the
    vertex by, and is used up unless the segments, or ``remaining_distance``, are too short for it.

    Raises:
        InputError: A number that makes no sense.
        PathError: As ``blend``.
    """
    return blend(a, b, remaining_distance, tolerance=tolerance, curve="least-time", limits=limits)

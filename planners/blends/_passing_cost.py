"""What a blend costs against running through its vertex at line speed."""

from __future__ import annotations

from armtempo.planners.blends._blend import Blend
from armtempo.planners.blends._families import PassingLimits
from armtempo.planners.blends._least_time import checked_limits, estimated_cost


def passing_cost(blend: Blend, limits: PassingLimits) -> float:
    """What a blend costs against running through its vertex at line speed [s]: what ``least-time`` minimises.

    An estimate from above, inf where no motion of the simple kind keeps the limits; see ``_least_time``.
    """
    remaining = blend.start_remaining + blend.end_remaining
    return float(estimated_cost(blend.packed.shape[0], blend.degree, remaining, checked_limits(limits)))

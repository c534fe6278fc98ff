"""Compiled loops that other rooms call. Not public: they change without notice."""

from __future__ import annotations

from armtempo.robots._kernels import (
    batch_inverse_dynamics,
    inverse_dynamics,
    link_frames,
    path_coefficients,
    segment_distance,
)
from armtempo.robots._small_linear_algebra import (
    cholesky,
    cholesky_solve,
    eigenvectors,
    invert,
    quaternion_angle,
    quaternion_between,
    quaternion_of,
    quaternion_product,
)

__all__ = [
    "batch_inverse_dynamics",
    "cholesky",
    "cholesky_solve",
    "eigenvectors",
    "inverse_dynamics",
    "invert",
    "link_frames",
    "path_coefficients",
    "quaternion_angle",
    "quaternion_between",
    "quaternion_of",
    "quaternion_product",
    "segment_distance",
]

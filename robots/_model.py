"""Plain arrays that describe an arm to the compiled kernels."""

from __future__ import annotations

from typing import NamedTuple

from armtempo.arrays import Bools, Floats, Ints

__all__ = ["ArmModel", "Capsules", "Floats"]


class ArmModel(NamedTuple):
    """A serial chain of n moving links; link i turns or slides about its own axis.

    Frames: link i's frame is the URDF frame of its first link; at q = 0 it sits at ``placement`` i in the frame
    of link i - 1 (of the base for i = 0). The axis has the same coordinates in both.
    """

    placement_R: Floats
    """(n, 3, 3) rotation from link i to link i - 1 at q = 0."""
    placement_p: Floats
    """(n, 3) origin of link i in link i - 1 at q = 0 [m]."""
    axis: Floats
    """(n, 3) unit joint axis in link i."""
    prismatic: Bools
    """(n,) True where the joint slides."""
    mass: Floats
    """(n,) [kg], merged over fixed joints."""
    com: Floats
    """(n, 3) centre of mass in link i [m]."""
    inertia: Floats
    """(n, 3, 3) about the centre of mass, in link axes [kg m^2]."""
    damping: Floats
    """(n,) viscous friction [N m s/rad or N s/m]."""
    gravity: Floats
    """(3,) world [m/s^2]."""
    base_R: Floats
    """(3, 3) rotation from base to world."""
    base_p: Floats
    """(3,) base in the world [m]."""
    tip_R: Floats
    """(3, 3) rotation from the tip to the last link."""
    tip_p: Floats
    """(3,) tip in the last link [m]."""


class Capsules(NamedTuple):
    """Capsules that enclose the collision shapes, one per shape, in link frames."""

    link: Ints
    """(k,) moving link 0..n-1, or -1 for the base."""
    p0: Floats
    """(k, 3) first end of the axis [m]."""
    p1: Floats
    """(k, 3) second end of the axis [m]."""
    radius: Floats
    """(k,) [m]."""
    exact: Bools
    """(k,) True where the capsule is the shape itself."""

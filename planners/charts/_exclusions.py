"""Rules as regions of a chart: parts of two paths in which arms are not to be at once, whatever their distance."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from armtempo.arrays import Bools
from armtempo.errors import InputError
from armtempo.planners.charts._arm_sweep import ArmSweep, swept_displacements
from armtempo.planners.joint_paths import AbstractJointPath
from armtempo.robots import Arm, Clearance, Shape

Part = tuple[float, float]

BORDER_ROUNDING = 1e-6  # of a cell: a part that ends so near to a border ends there


@dataclass(frozen=True, kw_only=True, slots=True)
class Exclusion:
    """Two arms are not to be inside these parts of their paths at once; parts are open intervals of lambda.

    Attributes:
        arms: Which two.
        part_a: Of the first one's path.
        part_b: Of the other's.
        rule: Why, in words.
        certain: Whether bounds count it, too; else it only keeps plans away.
    """

    arms: tuple[int, int]
    part_a: Part
    part_b: Part
    rule: str
    certain: bool = True

    @property
    def swapped(self) -> Exclusion:
        """The same with the arms exchanged."""
        return replace(self, arms=self.arms[::-1], part_a=self.part_b, part_b=self.part_a)


def after(second: int, beyond: float, first: int, reached: float, length: float, rule: str) -> Exclusion:
    """Arm ``second``, with a path of ``length``, stays at ``beyond`` or before until ``first`` has ``reached``.

    Progress never falls, so arms keep to it if and only if they keep out of [0, reached) x (beyond, length].
    """
    return Exclusion(arms=(first, second), part_a=(0.0, reached), part_b=(beyond, length), rule=rule)


def paint(
    states: NDArray[np.uint8], exclusion: Exclusion, steps: tuple[float, float], undecided: int, blocked: int
) -> None:
    """Mark cells (R, R): those inside as blocked, if it is certain, and all that it touches as undecided at least."""
    whole, touched = [], []
    for part, step in zip((exclusion.part_a, exclusion.part_b), steps, strict=True):
        low, high = part[0] / step, part[1] / step
        whole.append(slice(math.ceil(low - BORDER_ROUNDING), max(math.floor(high + BORDER_ROUNDING), 0)))
        touched.append(slice(max(math.floor(low + BORDER_ROUNDING), 0), math.ceil(high - BORDER_ROUNDING)))
    box = states[touched[0], touched[1]]
    np.maximum(box, undecided, out=box)
    if exclusion.certain:
        states[whole[0], whole[1]] = blocked


def inside_zone(arm: Arm, path: AbstractJointPath, zone: Shape, cells: int) -> tuple[Bools, Bools]:
    """(cells,) in which equal parts of a path the arm may meet a volume, and in which some point of it is inside.

    The first by certified bisection of the distance between the two; the other for boxes and cylinders only.

    Raises:
        InputError: ``cells`` is no power of two.
    """
    if cells < 1 or cells & (cells - 1):
        raise InputError(f"a path is cut into a power of two of cells, not into {cells}")
    clearance, sweeps = Clearance([arm], [zone]), swept_displacements(arm, path, cells)
    met, stack = np.zeros(cells, dtype=np.bool_), [(1, 0)]
    while stack:
        count, k = stack.pop()
        q = path.evaluate(path.length * (k + 0.5) / count)[0]
        if clearance.obstacles(0, q).distance > sweeps[count][k]:
            continue
        if count == cells:
            met[k] = True
        else:
            stack += [(2 * count, 2 * k), (2 * count, 2 * k + 1)]
    return met, met & (_depth(arm, path, zone, cells) > sweeps[cells])


def _depth(arm: Arm, path: AbstractJointPath, zone: Shape, cells: int) -> NDArray[np.float64]:
    """(cells,) how deep the deepest end of a capsule's axis is inside a volume at the middle of each part [m]."""
    axes = ArmSweep.of(arm, path, cells).axes[1::2]  # (cells, shapes, 2, 3)
    moving = np.asarray(arm.capsules.link) >= 0
    T = np.linalg.inv(zone.T_link_shape)
    local = np.abs(axes[:, moving].reshape(cells, -1, 3) @ T[:3, :3].T + T[:3, 3])
    if zone.kind == "box":
        deep = (0.5 * np.asarray(zone.size) - local).min(axis=-1)
    elif zone.kind == "cylinder":
        radius, height = zone.size[0], zone.size[1]
        deep = np.minimum(radius - np.hypot(local[..., 0], local[..., 1]), 0.5 * height - local[..., 2])
    else:
        return np.full(cells, -np.inf)
    return np.asarray(deep.max(axis=-1, initial=-np.inf))


def zone_exclusions(
    name: str, met: dict[int, tuple[Bools, Bools]], names: tuple[str, ...], lengths: tuple[float, ...]
) -> list[Exclusion]:
    """No two arms in a zone at once, from what ``inside_zone`` says of each arm by its number."""
    found = []
    for i, (outer_i, inner_i) in met.items():
        for j, (outer_j, inner_j) in met.items():
            if i >= j:
                continue
            rule = f"zone {name!r} holds one arm at a time, {names[i]!r} or {names[j]!r}"
            for certain, own, other in ((False, outer_i, outer_j), (True, inner_i, inner_j)):
                found += [
                    Exclusion(arms=(i, j), part_a=a, part_b=b, rule=rule, certain=certain)
                    for a in _runs(own, lengths[i])
                    for b in _runs(other, lengths[j])
                ]
    return found


def _runs(cells: Bools, length: float) -> list[Part]:
    """The parts of a path whose cells are set, those side by side as one."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], cells, [False]]).astype(np.int8)))
    step = length / len(cells)
    return [(float(a * step), float(b * step)) for a, b in edges.reshape(-1, 2)]

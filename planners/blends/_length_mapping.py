r"""From travelled length to a point of the path in every control tick: the paper's way, and the exact one.

The paper (Lee2006 eqs. 10-15) integrates ``S' = |F'|`` by Runge-Kutta for a blend's length, and in every tick solves

    u_{n+1} = u_n + dL_n / ((S'(u_n) + S'(u_{n+1})) / 2)                           (13)

by iteration from the predictor ``u_{n-1} + (dL_n + dL_{n-1}) / S'(u_n)`` (15). The trapezoid rule leaves, however often
it is iterated, a speed error of ``-v dL^2 S''' / (12 S'^3)``; what has piled up when a blend ends is thrown away at
the junction. ``ExactMapping`` has the same shape and neither error nor drift. Speeds measured between points are
lower for any mapping, by ``(curvature dL)^2 / 24``: chords are shorter than arcs.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import final

import numpy as np
from numpy.typing import ArrayLike

from armtempo.arrays import Floats, Ints
from armtempo.errors import InputError, brief
from armtempo.planners.blends import _path_kernels as kernels
from armtempo.planners.blends._blend import Blend
from armtempo.planners.blends._blended_path import BlendedPath
from armtempo.planners.blends._curve_kernels import GAUSS_U, PAIR_WEIGHTS, PANEL_NODES, curve_speed
from armtempo.planners.blends._path_kernels import ARC, PackedPath
from armtempo.planners.geometry import floats
from armtempo.robots import njit
from armtempo.state import Stateful


@njit
def corrected_step(
    shape: Floats, degree: int, u_before: float, u: float, d_before: float, d: float, iterations: int
) -> float:
    """One tick of eqs. (13) and (15): on from ``u`` by ``d`` [m], after a tick from ``u_before`` by ``d_before``."""
    here = curve_speed(shape, degree, u)
    ahead = u_before + (d + d_before) / here
    for _ in range(iterations):
        ahead = u + 2.0 * d / (here + curve_speed(shape, degree, ahead))
    return ahead


@njit
def corrected_parameters(
    packed: PackedPath, lengths: Floats, iterations: int, compensate: bool, state: Floats, piece: Ints, u: Floats
) -> None:
    """``PredictorCorrector.parameters`` into ``piece`` and ``u``, each (T,).

    ``state`` (7,): piece, drift, whether inside a blend, its parameters in the last two ticks, the way between these,
    the length before. Zeros before the first tick; left for the next ones.
    """
    breakpoints = packed.breakpoints
    last = packed.kind.shape[0] - 1
    k, drift, inside = int(state[0]), state[1], state[2] > 0.0
    now, before, d_before, length = state[3], state[4], state[5], state[6]
    for i in range(lengths.shape[0]):
        s = lengths[i] + drift
        came = k
        while k < last and s >= breakpoints[k + 1] and (compensate or packed.kind[k] <= ARC):
            k += 1
        if k != came:
            inside = False
        if packed.kind[k] > ARC:
            if inside:
                d = lengths[i] - length
                ahead = corrected_step(packed.shape[k], packed.kind[k], before, now, d_before, d, iterations)
                before, now, d_before = now, ahead, d
            else:  # the first tick: what is left of it behind the junction
                d = s - breakpoints[k]
                now = corrected_step(packed.shape[k], packed.kind[k], 0.0, 0.0, 0.0, d, iterations)
                before, d_before, inside = 0.0, d, True
            if now > 1.0 and not compensate and k < last:  # leaves the blend when its own count says so
                beyond = (now - 1.0) * curve_speed(packed.shape[k], packed.kind[k], 1.0)
                k += 1
                s = breakpoints[k] + beyond
                drift, inside = s - lengths[i], False
                if packed.kind[k] > ARC:
                    now = corrected_step(packed.shape[k], packed.kind[k], 0.0, 0.0, 0.0, beyond, iterations)
                    before, d_before, inside = 0.0, beyond, True
        length = lengths[i]
        piece[i] = k
        if packed.kind[k] > ARC:
            u[i] = min(max(now, 0.0), 1.0)
        else:
            u[i] = min((s - breakpoints[k]) / (breakpoints[k + 1] - breakpoints[k]), 1.0)
    state[0], state[1], state[2] = k, drift, 1.0 if inside else 0.0
    state[3], state[4], state[5], state[6] = now, before, d_before, length


@njit
def exact_parameters(packed: PackedPath, lengths: Floats, piece: Ints, u: Floats) -> None:
    """``ExactMapping.parameters`` into ``piece`` and ``u``, each (T,)."""
    breakpoints = packed.breakpoints
    last = packed.kind.shape[0] - 1
    k = 0
    for i in range(lengths.shape[0]):
        s = lengths[i]
        while k < last and s >= breakpoints[k + 1]:
            k += 1
        piece[i] = k
        if packed.kind[k] > ARC:
            u[i] = kernels.curve_parameter(packed, k, s - breakpoints[k])
        else:
            u[i] = min((s - breakpoints[k]) / (breakpoints[k + 1] - breakpoints[k]), 1.0)


@njit
def mapped_positions(packed: PackedPath, piece: Ints, u: Floats, out: Floats) -> None:
    """Positions at parameters ``u`` of pieces, each (T,), into ``out`` (T, 3)."""
    point = np.empty((4, 3))
    for i in range(piece.shape[0]):
        k = piece[i]
        size = 1.0 if packed.kind[k] > ARC else packed.breakpoints[k + 1] - packed.breakpoints[k]
        kernels.piece_point(packed.kind[k], packed.shape[k], u[i] * size, point)
        out[i] = point[0]


@njit
def _gauss_length(shape: Floats, degree: int, low: float, high: float) -> float:
    """Arc length between two parameters: 16-point Gauss-Legendre, halved until the halves agree with the whole."""
    rounding = 0.0  # of speeds: those of a very sharp corner are small differences of large numbers
    for k in range(1, degree + 1):
        rounding += 4e-16 * k * np.sqrt(np.sum(shape[k] ** 2))
    total, u, h = 0.0, low, high - low
    while u < high:
        h = min(h, high - u)
        whole = left = right = 0.0
        for g in range(16):
            node, weight = GAUSS_U[g], PAIR_WEIGHTS[PANEL_NODES - 1, g]
            whole += weight * curve_speed(shape, degree, u + h * node)
            left += 0.5 * weight * curve_speed(shape, degree, u + 0.5 * h * node)
            right += 0.5 * weight * curve_speed(shape, degree, u + 0.5 * h * (1.0 + node))
        if abs(left + right - whole) > 1e-14 * (left + right) + rounding:
            h *= 0.5
            continue
        total += h * (left + right)
        u += h
        h *= 2.0
    return total


def arc_length(blend: Blend, u: ArrayLike) -> Floats:
    """Arc length of a blend from 0 to ``u`` in [0, 1], any shape, to rounding [m]: adaptive Gauss-Legendre, no table.

    Raises:
        InputError: A parameter that is not on the blend.
    """
    u = floats(u, "u")
    if not ((u >= 0.0) & (u <= 1.0)).all():
        raise InputError(f"u must be in 0..1, got {u.min():.6g}..{u.max():.6g}")
    shape, degree = blend.packed.shape[0], blend.degree
    return np.array([_gauss_length(shape, degree, 0.0, float(x)) for x in u.reshape(-1)]).reshape(u.shape)


def rk4_length(blend: Blend, steps: int = 10) -> float:
    """Length of a blend by the fourth-order Runge-Kutta of the paper [m] (on a pure integral: Simpson's rule)."""
    if not isinstance(steps, int | np.integer) or steps < 1:
        raise InputError(f"steps is {steps}", remedy="give a whole number, at least 1")
    shape, degree = blend.packed.shape[0], blend.degree
    speed = np.array([curve_speed(shape, degree, i / (2 * steps)) for i in range(2 * steps + 1)])
    weights = np.array([1.0, *([4.0, 2.0] * steps)[:-1], 1.0])
    return float(weights @ speed) / (6.0 * steps)


class LengthMapping(ABC):
    """Maps travelled lengths, tick by tick, to points of a path.

    Args:
        path: A blended path, or one blend.
    """

    def __init__(self, path: BlendedPath | Blend) -> None:
        if not isinstance(path, BlendedPath | Blend):
            raise InputError(f"a mapping is of a BlendedPath or a Blend, got a {type(path).__name__}")
        self.packed = path.packed

    @abstractmethod
    def parameters(self, lengths: ArrayLike) -> tuple[Ints, Floats]:
        """Piece and its parameter u in [0, 1] in each tick, both (T,); ``lengths`` (T,) [m], never falling.

        On lines and arcs u is the share of their length.
        """

    def positions(self, lengths: ArrayLike) -> Floats:
        """Points (T, 3) [m]."""
        piece, u = self.parameters(lengths)
        out = np.empty((len(u), 3))
        mapped_positions(self.packed, piece, u, out)
        return out

    def _checked(self, lengths: ArrayLike) -> tuple[Floats, Ints, Floats]:
        given = floats(lengths, "lengths")
        if given.ndim != 1 or not np.isfinite(given).all() or (np.diff(given) < 0.0).any():
            raise InputError("lengths must be one row of finite metres that never falls")
        given = np.clip(given, 0.0, self.packed.breakpoints[-1])
        return given, np.zeros(len(given), dtype=np.int64), np.zeros(len(given))


@final
class ExactMapping(LengthMapping):
    """The inverse of the exact arc length: one polynomial per tick, no iteration, no drift."""

    def parameters(self, lengths: ArrayLike) -> tuple[Ints, Floats]:
        given, piece, u = self._checked(lengths)
        exact_parameters(self.packed, given, piece, u)
        return piece, u


@final
class PredictorCorrector(LengthMapping):
    """The paper's mapping (Lee2006 eqs. 13, 15).

    Args:
        path: A blended path, or one blend.
        iterations: Of the corrector; the paper takes 3, one is as good.
        compensate: At junctions go by the scheduled length, as the paper does. Otherwise a blend is left when its own u
            says so, and the error stays.
    """

    def __init__(self, path: BlendedPath | Blend, *, iterations: int = 3, compensate: bool = True) -> None:
        super().__init__(path)
        if not isinstance(iterations, int | np.integer) or iterations < 0:
            raise InputError(f"iterations is {brief(iterations)}", remedy="give 0 or more")
        self.iterations = iterations
        self.compensate = compensate

    def parameters(self, lengths: ArrayLike) -> tuple[Ints, Floats]:
        return self.start().parameters(lengths)

    def start(self) -> MappingRun:
        """A run from the start of the path that takes its lengths little by little."""
        return MappingRun(self)


@final
class MappingRun(LengthMapping, Stateful):
    """The paper's mapping tick by tick: goes on from call to call, and gives the same bits as all ticks at once.

    Args:
        mapping: Its path and settings.
    """

    changing = ("_state",)

    def __init__(self, mapping: PredictorCorrector) -> None:
        self.packed = mapping.packed
        self._settings = mapping.iterations, mapping.compensate
        self._state = np.zeros(7)

    def parameters(self, lengths: ArrayLike) -> tuple[Ints, Floats]:
        """As of ``LengthMapping``, for the next ticks; ``lengths`` (T,) [m] go on from those of the last call."""
        given, piece, u = self._checked(lengths)
        if len(given) and given[0] < self._state[6]:
            raise InputError("lengths must never fall, from one call to the next either")
        corrected_parameters(self.packed, given, *self._settings, self._state, piece, u)
        return piece, u

    def advance(self, lengths: ArrayLike) -> Floats:
        """Points (T, 3) [m] in the next ticks."""
        return self.positions(lengths)

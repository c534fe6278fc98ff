"""Upper bounds of the errors of a run of the feedback law, compiled, from sample to sample; see ``FeedbackIK``."""

from __future__ import annotations

import math

import numpy as np

from armtempo.arrays import Floats
from armtempo.planners.ik._law import Law, Targets
from armtempo.robots import njit
from armtempo.robots.kernels import quaternion_angle, quaternion_between, quaternion_of, quaternion_product

__all__ = ["step_bounds"]


@njit
def _decay(x: float, gain: float, cross: float, h: float) -> float:
    """X' = -gain sin x + cross (1 - cos x) after h, exactly: with t = tan(x/2), t' = cross t^2 - gain t."""
    if x >= math.pi:
        return math.pi
    t, left = math.tan(0.5 * x), math.exp(-gain * h)
    rest = 1.0 - cross / gain * t * (1.0 - left)
    return math.pi if rest <= 0.0 else min(2.0 * math.atan(t * left / rest), math.pi)


@njit
def _chord(J: Floats, dq: Floats, out: Floats) -> None:
    """Where dq takes the tip, from the Jacobian, into out (7,): its place to third order, its turning to second.

    out[6]: the second derivative of its place along dq.
    """
    fx = fy = fz = sx = sy = sz = tx = ty = tz = 0.0  # the place's derivatives by the joints from j on
    wx = wy = wz = vx = vy = vz = 0.0  # their turning, and half its derivative
    for j in range(dq.shape[0] - 1, -1, -1):
        d = dq[j]
        x, y, z = d * J[3, j], d * J[4, j], d * J[5, j]
        jx, jy, jz = d * J[0, j], d * J[1, j], d * J[2, j]
        ax, ay, az = jx + 3.0 * fx, jy + 3.0 * fy, jz + 3.0 * fz
        ax, ay, az = y * az - z * ay + 3.0 * sx, z * ax - x * az + 3.0 * sy, x * ay - y * ax + 3.0 * sz
        tx, ty, tz = tx + y * az - z * ay, ty + z * ax - x * az, tz + x * ay - y * ax
        ax, ay, az = jx + 2.0 * fx, jy + 2.0 * fy, jz + 2.0 * fz
        sx, sy, sz = sx + y * az - z * ay, sy + z * ax - x * az, sz + x * ay - y * ax
        fx, fy, fz = fx + jx, fy + jy, fz + jz
        vx, vy, vz = vx + 0.5 * (y * wz - z * wy), vy + 0.5 * (z * wx - x * wz), vz + 0.5 * (x * wy - y * wx)
        wx, wy, wz = wx + x, wy + y, wz + z
    out[0], out[1], out[2] = fx + sx / 2.0 + tx / 6.0, fy + sy / 2.0 + ty / 6.0, fz + sz / 2.0 + tz / 6.0
    out[3], out[4], out[5] = wx + vx, wy + vy, wz + vz
    out[6] = math.sqrt(sx * sx + sy * sy + sz * sz)


@njit
def step_bounds(
    law: Law,
    J: Floats,
    dq: Floats,
    feedback: Floats,
    plain: bool,
    targets: Targets,
    here: int,
    old: Floats,
    new: Floats,
) -> None:
    """Bounds (4,) after a step dq from where the Jacobian was J, from those before; see ``FeedbackIK``.

    feedback (6,): what the law asked for there; not ``plain``: it was not the law's (it left a half turn).
    """
    n, h = dq.shape[0], targets.step
    then = here + targets.stride
    move = np.empty(7)
    _chord(J, dq, move)
    # The next derivatives along dq at the worst posture: the fourth of the tip's place, the third of its turning.
    turn = pairs = place = bend = spin = 0.0
    for j in range(n):
        u = abs(dq[j])
        if J[3, j] * J[3, j] + J[4, j] * J[4, j] + J[5, j] * J[5, j] > 0.5:
            place += law.levers[j] * ((turn + u) ** 4 - turn**4)
            bend += law.levers[j] * ((turn + u) ** 3 - turn**3)
            spin += u * (turn * turn + pairs)
            pairs += u * turn
            turn += u
        else:
            place += 4.0 * u * turn**3
            bend += 3.0 * u * turn * turn
    rest = place / 24.0
    # The turn of an angular velocity that is not constant, against the turn of its mean.
    slack = spin / 6.0 + turn * (pairs + spin) / 8.0 + 0.5 * (0.25 * pairs + spin / 6.0) ** 2

    parted = off = 0.0
    for r in range(3):
        apart = targets.position[then, r] - targets.position[here, r] - move[r]
        parted += apart * apart
        off += (apart + h * feedback[r]) ** 2
    # The second: where the gain is too high for the step, the caps hold the tip, and the first would grow for ever.
    new[0] = min(abs(1.0 - law.position_gain * h) * old[0] + math.sqrt(off), old[0] + math.sqrt(parted)) + rest
    # Between the samples an error is off its chord by an eighth of its greatest second derivative: the tip's part.
    old[3] = max(old[0], new[0]) + 0.125 * (move[6] + bend)

    turned = quaternion_product(
        quaternion_of(-move[3], -move[4], -move[5]), quaternion_between(targets.rotation[here], targets.rotation[then])
    )
    apart = quaternion_angle(turned) + slack
    for r in range(1, 3):
        new[r] = min(old[r] + apart, math.pi)
    if not plain:
        return
    fx, fy, fz = h * feedback[3], h * feedback[4], h * feedback[5]
    fed = math.sqrt(fx * fx + fy * fy + fz * fz)
    off = quaternion_angle(quaternion_product(quaternion_of(fx, fy, fz), turned)) + slack
    if law.quaternion:  # the turn is about the error's own axis
        z = law.approach_gain * h
        left = max(old[2] - 2.0 * z * math.sin(0.5 * old[2]), (z - 1.0) * old[2])
        new[2] = min(new[2], left + off)
        new[1] = min(new[1], new[2])
        return
    # The feedback does not stay what it was at the step's start, as that of the exact solution does.
    chord = 2.0 * math.sin(min(0.5 * (old[2] + fed), 0.5 * math.pi))
    most = max(law.approach_gain, law.normal_gain)
    change = min(law.approach_gain + law.normal_gain, most + (law.approach_gain + 3.0 * law.normal_gain) * chord)
    for r in range(1, 3):
        gain = law.approach_gain if r == 1 else min(law.approach_gain, law.normal_gain)
        cross = 0.0 if r == 1 else law.normal_gain / math.sqrt(27.0)
        late = 0.5 * h * change * fed
        if math.tan(min(old[r] + fed, 1.57)) * cross >= gain or old[r] + fed >= 1.57:  # there errors part
            late *= math.exp(math.sqrt(gain * gain + cross * cross) * h)
        new[r] = min(new[r], _decay(old[r], gain, cross, h) + late + off)

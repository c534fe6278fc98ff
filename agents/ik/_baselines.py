"""Baselines for IK cells: who sets the joint speeds. All look at the cell's target itself, and at the arm's joints.

``feedback``         the paper's law without feed-forward and undamped
``feedback-ff``      with both feed-forwards
``feedback-damped``  that, damped near singularities as the cell says, with caps on the twist scaled to the arm
``newton``           one undamped Newton step per control period onto the target at its end
``law``              the cell's law at every tick, as it stands: gains where an agent of ``gains`` changes nothing
``law-scheduled``    that with two sets of gains: softer, damped and more for the orientation while the tip is off
``random``           uniform actions

``law`` and ``law-scheduled`` are for environments of ``gains``, ``random`` is for both, the others for ``speeds``.

A decision holds for a control period, and speeds change linearly over it. Each is therefore taken for its end: the law
at the place that the present speeds lead to, Newton's step from where the arm could have come to rest. Errors are those
of this period, not of a solver's step: at gain 50.9/s and 10 ms a period takes half of an error away.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import final

import numpy as np

from armtempo.agents.policies import Policy, RandomPolicy
from armtempo.arrays import Floats, Floats32
from armtempo.envs import ActionMode, FeedbackIKEnv
from armtempo.errors import UnknownNameError
from armtempo.planners import FeedbackIK, IKCell, PoseTarget

UNDAMPED = 1e-6  # damping, and the step [s] that the law is told, of a law that damps nothing
TURN_CAP_FACTOR = (
    2.0  # cap of the angular speed, in mean joint speed caps; that of the tip's speed is one times the length
)


SCHEDULED_FROM_ERROR = 0.5  # error scales of position from which gains are scheduled
SCHEDULED_ACTION = np.array([-1.0, 1.0, 1.0, 1.0], dtype=np.float32)


@final
class LawPolicy:
    """Inverse kinematics by feedback, once per control period.

    Args:
        feed_forward: Of the target's velocities.
        damped: With the cell's damping and caps on the twist, or the plain inverse.
    """

    def __init__(self, *, feed_forward: bool, damped: bool) -> None:
        self.feed_forward, self.damped = feed_forward, damped
        self._made: tuple[IKCell, FeedbackIK, PoseTarget] | None = None

    def reset(self, seed: int | None = None) -> None:
        """Nothing to forget."""

    def act(self, observation: Floats32, env: FeedbackIKEnv) -> Floats32:
        """The law's joint speeds at the end of the period."""
        simulation = env.simulation
        cell = simulation.cell
        solver, target = self._law_of(cell)
        q = simulation.joint_positions()[0] + cell.control_period * simulation.joint_speeds
        speeds, _ = solver.joint_speeds(
            np.clip(q, cell.arm.position_min, cell.arm.position_max), target, _end_of_period(env)
        )
        return _shares(cell, speeds)

    def _law_of(self, cell: IKCell) -> tuple[FeedbackIK, PoseTarget]:
        if self._made is None or self._made[0] is not cell:
            law, arm, pace = cell.law, cell.arm, float(cell.arm.speed_max.mean())
            solver = FeedbackIK(
                arm,
                cell.solver.gains,
                error=law.error,
                feed_forward=self.feed_forward,
                task=law.task,
                damping=law.damping if self.damped else UNDAMPED,
                linear_speed_max=cell.solver.length * pace if self.damped else np.inf,
                angular_speed_max=TURN_CAP_FACTOR * pace if self.damped else np.inf,
                joint_speed_max=arm.speed_max if self.damped else np.full(arm.dof, np.inf),
            )
            step = cell.control_period if self.damped else UNDAMPED
            self._made = cell, solver, replace(cell.target, step=step)
        return self._made[1:]


@final
class NewtonPolicy:
    """One Newton step per control period, undamped."""

    def reset(self, seed: int | None = None) -> None:
        """Nothing to forget."""

    def act(self, observation: Floats32, env: FeedbackIKEnv) -> Floats32:
        """Speeds that would make the step in a period."""
        simulation = env.simulation
        cell, row = simulation.cell, _end_of_period(env)
        arm, length, task = cell.arm, cell.solver.length, cell.solver.task
        q = simulation.joint_positions()[0] + 0.5 * cell.control_period * simulation.joint_speeds
        J, error = arm.jacobian(q).copy(), simulation.pose_errors(q, [row])[0]
        J[:3] /= length
        error[:3] /= length
        step: Floats = np.linalg.lstsq(task @ J, task @ error, rcond=None)[0].astype(np.float64)
        return _shares(cell, step / cell.control_period)


@final
class GainPolicy:
    """The cell's law (Chung, Ryu, Park) at every tick of an environment of ``gains``; its actions are (4,).

    Args:
        scheduled: A quarter of K_p and four times K_a, K_n and damping while the tip is half an error scale off.
    """

    def __init__(self, *, scheduled: bool) -> None:
        self.scheduled = scheduled

    def reset(self, seed: int | None = None) -> None:
        """Nothing to forget."""

    def act(self, observation: Floats32, env: FeedbackIKEnv) -> Floats32:
        """By which powers of four gains are multiplied."""
        off = env.simulation.position_error > SCHEDULED_FROM_ERROR * env.cell.error_scales[0]
        return SCHEDULED_ACTION.copy() if self.scheduled and off else np.zeros_like(SCHEDULED_ACTION)


def _end_of_period(env: FeedbackIKEnv) -> int:
    """The target's row at the end of the next control period."""
    simulation = env.simulation
    return min(2 * (simulation.tick + simulation.cell.ticks_per_period), 2 * simulation.cell.ticks)


def _shares(cell: IKCell, speeds: Floats) -> Floats32:
    """Speeds (n,) as an action: shares of the caps, each cut off at 1."""
    return np.clip(speeds / cell.arm.speed_max, -1.0, 1.0).astype(np.float32)


_BASELINES: dict[str, Callable[[], Policy[Floats32, Floats32]]] = {
    "feedback": lambda: LawPolicy(feed_forward=False, damped=False),
    "feedback-ff": lambda: LawPolicy(feed_forward=True, damped=False),
    "feedback-damped": lambda: LawPolicy(feed_forward=True, damped=True),
    "newton": NewtonPolicy,
    "law": lambda: GainPolicy(scheduled=False),
    "law-scheduled": lambda: GainPolicy(scheduled=True),
    "random": RandomPolicy,
}
IK_POLICIES = tuple(_BASELINES)


def action_mode_of(name: str) -> ActionMode:
    """What the actions of a baseline mean."""
    return "gains" if name in ("law", "law-scheduled") else "speeds"


def ik_policy(name: str) -> Policy[Floats32, Floats32]:
    """A baseline by name.

    Raises:
        UnknownNameError: No such policy.
    """
    if name not in _BASELINES:
        raise UnknownNameError("policy", name, IK_POLICIES)
    return _BASELINES[name]()

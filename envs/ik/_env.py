"""An arm follows a pose over time; the agent sets its joint speeds, or the gains of the law that does."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, final

import numpy as np
from gymnasium.spaces import Box

from armtempo.arrays import Floats32
from armtempo.envs.bodies import Physics, Renderer, render_modes
from armtempo.envs.common import (
    SingleArmEnv,
    action_space,
    check_names,
    deviation_reward,
    observation_space,
    read_actions,
)
from armtempo.envs.ik._observation import ik_entries, observe_ik, view_of
from armtempo.envs.ik._options import ACTION_MODES, ActionMode, IKOptions
from armtempo.envs.ik._simulation import IKSimulation, IKTrace
from armtempo.errors import InputError
from armtempo.planners import IKCell
from armtempo.planners.cells import TARGET_FAMILIES, TargetFamilyName, as_cell, draw_target

RESET_OPTIONS = ("family",)
REWARD_WEIGHTS = {"position": 1.0, "orientation": 1.0, "effort": 0.1, "caps": 1.0}
"""Of the terms of the reward, in the order of ``IKSimulation.shares``."""
GAINS = 4


def ik_cell(cell: IKCell | str | Path, action_mode: str, families: Sequence[str]) -> IKCell:
    """A built cell of an arm that follows poses.

    Raises:
        UnknownNameError: No such cell, action mode or family of targets.
        InputError: It is of another kind.
    """
    check_names(("action mode", action_mode, ACTION_MODES))
    if not families:
        raise InputError("there is no family of targets", remedy=f"give some of {', '.join(TARGET_FAMILIES)}")
    check_names(*(("family of targets", family, TARGET_FAMILIES) for family in families))
    return as_cell(cell, IKCell)


def ik_spaces(cell: IKCell, action_mode: ActionMode) -> tuple[Box, Box]:
    """Of observations and of actions."""
    joints = cell.arm.dof
    return observation_space(ik_entries(joints)), action_space(joints if action_mode == "speeds" else GAINS)


@final
class FeedbackIKEnv(SingleArmEnv[IKSimulation]):
    """The tip of an arm follows a position and orientation over time (``armtempo/FeedbackIK-v0``; Chung, Ryu, Park).

    **Action**, Box(-1, 1, float32), for one control period, by ``action_mode``:

    - ``speeds``, (n,): the speeds of the n joints' reference at the end of the period, as shares of their caps; within
      it they change linearly.
    - ``gains``, (4,): K_p, K_a, K_n and the damping of the cell's feedback law, which runs at every tick on its own
      state, the reference: 4^a times the cell's; 0 leaves it as it is.

    What would break a cap of speed or acceleration, or leave a joint no room to brake before its position limit, is cut
    to the nearest that does not. If torques cannot follow that, or if there would be no way to stop after it, the
    period is drawn towards braking, all joints in one ratio, until they can and there is. So torques stay within their
    limits with ``model_error`` 0, whatever the actions, and the arm is where its reference is; postures that take more
    than 0.95 of a limit to hold are not entered. If torques are clipped nevertheless, as with heavier bodies, the
    reference starts over from the arm and brakes for the rest of the period.

    **Observation**, Box, float32. For 6 joints (46,); with n joints ``3 n + 28``:

    {table}

    *What an agent knows.* With ``model_error`` 0 joint positions and speeds, the arm's own, are its whole state (the
    reference's are the same), but for how hard it planned to brake. Of the target it sees pose and velocity now, and
    poses 1 and 10 periods ahead, not the rest of the way: with ``given``, progress tells that; with drawn families it
    is hidden, and an episode is Markov only up to what comes later than these. Errors beyond some ten scales are all
    but alike.

    **Reward**, the sum of four terms, each an integral over the time of the step in units of the target's duration, so
    that an episode's is the mean over time:

    - ``position``, ``orientation``: minus ``x / (1 + x)``, x the error in the cell's scales (10 mm, 0.05 rad); -1 to 0.
    - ``effort``: minus a tenth of the mean square of the torques as shares of their limits; -0.1 to 0.
    - ``caps``: minus what was cut, in shares of the speed caps, mean over the joints; -1 to 0.

    An episode returns between -3.1 and 0. They are in ``info["reward_terms"]``.

    **Start**: at rest in the cell's posture. With a ``family`` other than ``given`` every reset draws start and target.

    **End**: *terminated* with the target; *truncated* at ``max_episode_s``. ``is_success``: it lasted to the target's
    end, and the rms errors over all ticks were below the cell's scales.

    **Reset options**, for this episode: ``family``.

    Args:
        cell: Name of a bundled cell of kind ik, a cell file, or a built ``IKCell``.
        action_mode: ``speeds`` or ``gains``.
        family: ``given`` target, or random ones: ``smooth``, ``near-singular``, ``partly-unreachable``.
        physics: ``bullet`` or ``ideal`` (always on the reference).
        model_error: The simulated bodies are heavier by this share than the controller believes (``bullet`` only).
        render_mode: ``rgb_array`` (works without a display), ``human`` or None.
        max_episode_s: Time limit [s], if it is to end before its target.
        record: Keep an ``IKTrace``.

    Version history:
        v0: first release.
    """

    metadata = {"render_modes": render_modes(), "render_fps": 25}  # noqa: RUF012 (as Gymnasium declares it)

    def __init__(
        self,
        cell: IKCell | str | Path = "chung",
        *,
        action_mode: ActionMode = "speeds",
        family: TargetFamilyName = "given",
        physics: Physics = "bullet",
        model_error: float = 0.0,
        render_mode: str | None = None,
        max_episode_s: float | None = None,
        record: bool = False,
    ) -> None:
        super().__init__(render_mode, max_episode_s)
        self.cell = ik_cell(cell, action_mode, (family,))
        self.action_mode: ActionMode = action_mode
        self.family: TargetFamilyName = family
        options = IKOptions(
            physics=physics, action_mode=action_mode, family=family, model_error=model_error,
            max_episode_s=max_episode_s,
        )  # fmt: skip
        self.simulation = IKSimulation(self.cell, options, record=record)
        seen, actions = ik_spaces(self.cell, action_mode)
        self.observation_space: Box = seen  # type: ignore[assignment]
        self.action_space: Box = actions  # type: ignore[assignment]

    @property
    def trace(self) -> IKTrace:
        """What happened since the reset; needs ``record=True``."""
        return self.simulation.trace()

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Floats32, dict[str, Any]]:
        """Put the arm where it starts, before a new target unless ``family`` is ``given``.

        Args:
            seed: Of the draws.
            options: For this episode: ``family``.

        Raises:
            UnknownNameError: No such option, or family.
            PathError: No target of the family suits the arm.
            InputError: ``options`` is no mapping, or the environment is closed.
        """
        given = self._begin(options, RESET_OPTIONS)
        super().reset(seed=seed)
        cell = draw_target(self.cell, given.get("family", self.family), self.np_random)
        self.simulation.reset(cell)
        self._limit = np.inf if self._max_episode is None else self._max_episode
        self._running = True
        if self.render_mode == "human":
            self.render()
        info = {
            "duration_s": cell.duration,
            "position_error_mm": 1e3 * self.simulation.position_error,
            "orientation_error_rad": self.simulation.orientation_error,
        }
        return self._observed(), info

    def step(self, action: Floats32) -> tuple[Floats32, float, bool, bool, dict[str, Any]]:
        """Run one control period.

        Raises:
            ActionError: The action is not as many finite numbers as the space has, the episode is over, or the
                environment is closed.
        """
        self._check_running()
        simulation = self.simulation
        simulation.step(read_actions(action, self.action_space.shape[0], self.cell.arm.name))
        cell = simulation.cell
        elapsed, duration = cell.control_period, cell.duration
        terms = {
            name: weight * deviation_reward(share, elapsed, duration)
            for (name, weight), share in zip(REWARD_WEIGHTS.items(), simulation.shares.tolist(), strict=True)
        }
        terminated = simulation.done
        truncated = not terminated and simulation.time >= self._limit - 1e-9
        singular_value = simulation.singular_value
        info: dict[str, Any] = {
            "time_s": simulation.time,
            "position_error_mm": 1e3 * simulation.position_error,
            "orientation_error_rad": simulation.orientation_error,
            "singular_value": singular_value,
            "damped": singular_value < cell.damping,
            "capped": bool(simulation.shares[3] > 0.0),
            "reward_terms": terms,
        }
        if terminated or truncated:
            position, orientation = np.sqrt(simulation.squares / simulation.tick).tolist()
            info["position_error_rms_mm"], info["orientation_error_rms_rad"] = 1e3 * position, orientation
            position_scale, orientation_scale = cell.error_scales
            close = position < position_scale and orientation < orientation_scale
            info["is_success"] = terminated and close
            self._running = False
        if self.render_mode == "human":
            self.render()
        return self._observed(), float(sum(terms.values())), terminated, truncated, info

    def _observed(self) -> Floats32:
        (observation,) = observe_ik(self.cell, view_of(self.simulation))
        return np.asarray(observation)

    def _draw_extras(self, renderer: Renderer) -> None:
        """The target's axes now."""
        target, row = self.simulation.cell.target, 2 * self.simulation.tick
        renderer.show_target(target.position[row], target.rotation[row])

"""An arm follows a pose over time; the agent sets its joint speeds, or the gains of the law that does."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, ClassVar, Unpack, final

import numpy as np
from gymnasium.spaces import Box

from armtempo.arrays import Floats32
from armtempo.envs.bodies import Renderer, render_modes
from armtempo.envs.common import (
    SingleAgentEnv,
    action_space,
    deviation_reward,
    observation_space,
    options_of,
    read_actions,
)
from armtempo.envs.ik._observation import ik_entries, observe_ik, view_of
from armtempo.envs.ik._options import ActionMode, IKKeywords, IKOptions
from armtempo.envs.ik._simulation import IKSimulation, IKTrace
from armtempo.planners import IKCell
from armtempo.planners.cells import as_cell, draw_target

REWARD_WEIGHTS = {"position": 1.0, "orientation": 1.0, "effort": 0.1, "caps": 1.0}
"""Of the terms of the reward, in the order of ``IKSimulation.shares``."""
GAINS_PER_ACTION = 4


def ik_spaces(cell: IKCell, action_mode: ActionMode) -> tuple[Box, Box]:
    """Of observations and of actions."""
    joints = cell.arm.dof
    return observation_space(ik_entries(joints)), action_space(joints if action_mode == "speeds" else GAINS_PER_ACTION)


@final
class FeedbackIKEnv(SingleAgentEnv[IKSimulation]):
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

    =====  ==============================  =======  ====================================================================
    index  name                            range    meaning
    =====  ==============================  =======  ====================================================================
    0      joint_0                         [-1, 1]  joint position, lowest -1, highest 1; an angle without limits in
                                                    half turns
    1      joint_1                         [-1, 1]  joint position, lowest -1, highest 1; an angle without limits in
                                                    half turns
    2      joint_2                         [-1, 1]  joint position, lowest -1, highest 1; an angle without limits in
                                                    half turns
    3      joint_3                         [-1, 1]  joint position, lowest -1, highest 1; an angle without limits in
                                                    half turns
    4      joint_4                         [-1, 1]  joint position, lowest -1, highest 1; an angle without limits in
                                                    half turns
    5      joint_5                         [-1, 1]  joint position, lowest -1, highest 1; an angle without limits in
                                                    half turns
    6      joint_speed_0                   [-1, 1]  its speed as a share of its cap
    7      joint_speed_1                   [-1, 1]  its speed as a share of its cap
    8      joint_speed_2                   [-1, 1]  its speed as a share of its cap
    9      joint_speed_3                   [-1, 1]  its speed as a share of its cap
    10     joint_speed_4                   [-1, 1]  its speed as a share of its cap
    11     joint_speed_5                   [-1, 1]  its speed as a share of its cap
    12     joint_lag_0                     [-1, 1]  x / (1 + |x|), x: how far it is behind its reference [mrad, mm]
    13     joint_lag_1                     [-1, 1]  x / (1 + |x|), x: how far it is behind its reference [mrad, mm]
    14     joint_lag_2                     [-1, 1]  x / (1 + |x|), x: how far it is behind its reference [mrad, mm]
    15     joint_lag_3                     [-1, 1]  x / (1 + |x|), x: how far it is behind its reference [mrad, mm]
    16     joint_lag_4                     [-1, 1]  x / (1 + |x|), x: how far it is behind its reference [mrad, mm]
    17     joint_lag_5                     [-1, 1]  x / (1 + |x|), x: how far it is behind its reference [mrad, mm]
    18     position_error_x                [-1, 1]  x / (1 + |x|), x: from the tip to the target in error scales, x
    19     position_error_y                [-1, 1]  x / (1 + |x|), x: from the tip to the target in error scales, y
    20     position_error_z                [-1, 1]  x / (1 + |x|), x: from the tip to the target in error scales, z
    21     rotation_error_x                [-1, 1]  the same of the rotation vector, x
    22     rotation_error_y                [-1, 1]  the same of the rotation vector, y
    23     rotation_error_z                [-1, 1]  the same of the rotation vector, z
    24     target_velocity_x               [-1, 1]  x / (1 + |x|), x: velocity of the target in lengths of the arm per
                                                    second, x
    25     target_velocity_y               [-1, 1]  x / (1 + |x|), x: velocity of the target in lengths of the arm per
                                                    second, y
    26     target_velocity_z               [-1, 1]  x / (1 + |x|), x: velocity of the target in lengths of the arm per
                                                    second, z
    27     target_turning_x                [-1, 1]  x / (1 + |x|), x: angular velocity of the target [rad/s], x
    28     target_turning_y                [-1, 1]  x / (1 + |x|), x: angular velocity of the target [rad/s], y
    29     target_turning_z                [-1, 1]  x / (1 + |x|), x: angular velocity of the target [rad/s], z
    30     ahead_1_position_x              [-1, 1]  as position_error, to the target in 1 control period, in 10 error
                                                    scales, x
    31     ahead_1_position_y              [-1, 1]  as position_error, to the target in 1 control period, in 10 error
                                                    scales, y
    32     ahead_1_position_z              [-1, 1]  as position_error, to the target in 1 control period, in 10 error
                                                    scales, z
    33     ahead_1_rotation_x              [-1, 1]  the same of the rotation vector, x
    34     ahead_1_rotation_y              [-1, 1]  the same of the rotation vector, y
    35     ahead_1_rotation_z              [-1, 1]  the same of the rotation vector, z
    36     ahead_10_position_x             [-1, 1]  as position_error, to the target in 10 control periods, in 10 error
                                                    scales, x
    37     ahead_10_position_y             [-1, 1]  as position_error, to the target in 10 control periods, in 10 error
                                                    scales, y
    38     ahead_10_position_z             [-1, 1]  as position_error, to the target in 10 control periods, in 10 error
                                                    scales, z
    39     ahead_10_rotation_x             [-1, 1]  the same of the rotation vector, x
    40     ahead_10_rotation_y             [-1, 1]  the same of the rotation vector, y
    41     ahead_10_rotation_z             [-1, 1]  the same of the rotation vector, z
    42     singular_value                  [-1, 1]  s / (s + damping), 0 is -1, s: the smallest singular value now
    43     margin                          [-1, 1]  distance of the nearest position limit as a share of half its range,
                                                    0 is -1
    44     torque_use                      [-1, 1]  largest torque asked for as a share of its limit, 0 is -1
    45     progress                        [-1, 1]  time, start of the target -1, end 1
    =====  ==============================  =======  ====================================================================

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

    **Infos**: ``time_s``, ``position_error_m``, ``orientation_error_rad``, ``singular_value``, ``damped``, ``capped``,
    ``reward_terms``; after a reset ``duration_s`` and the errors; at the end ``position_error_rms_m`` and
    ``orientation_error_rms_rad`` over all ticks, ``is_success``. ``position_error_mm`` and
    ``position_error_rms_mm`` say the same in mm; they go with the next release.

    **Reset options**, for this episode: ``family``.

    Args:
        cell: Name of a bundled cell of kind ik, a cell file, or a built ``IKCell``.
        render_mode: ``rgb_array`` (works without a display), ``human`` or None.
        record: Keep an ``IKTrace``.
        options: ``IKOptions`` by keyword: ``physics``, ``action_mode``, ``family``, ``model_error``, ``max_episode_s``.

    Attributes:
        options: The ``IKOptions``.

    Raises:
        UnknownNameError: No such cell, option, or name as an option's value.
        InputError: An option's value that an episode cannot have, or a cell of another kind.
        RenderError: No such render mode.

    Version history:
        v0: first release.
    """

    metadata = {"render_modes": render_modes(), "render_fps": 25}  # noqa: RUF012 (as Gymnasium declares it)
    reset_options: ClassVar[tuple[str, ...]] = ("family",)

    changing = (*SingleAgentEnv.changing, "_limit")

    def __init__(
        self,
        cell: IKCell | str | Path = "chung",
        *,
        render_mode: str | None = None,
        record: bool = False,
        **options: Unpack[IKKeywords],
    ) -> None:
        super().__init__(render_mode)
        self.options = options_of(IKOptions, options, FeedbackIKEnv)
        self.cell = as_cell(cell, IKCell)
        self.simulation = IKSimulation(self.cell, self.options, record=record)
        self._limit: float = np.inf
        seen, actions = ik_spaces(self.cell, self.options.action_mode)
        self.observation_space: Box = seen  # type: ignore[assignment]
        self.action_space: Box = actions  # type: ignore[assignment]

    @property
    def trace(self) -> IKTrace:
        """What happened since the reset; needs ``record=True``."""
        return self.simulation.trace()

    def _begin(self, options: Mapping[str, Any], seeded: bool) -> tuple[Floats32, dict[str, Any]]:
        """Where the arm starts, before a new target unless ``family`` is ``given``.

        Raises:
            UnknownNameError: No such family.
            PathError: No target of the family suits the arm.
        """
        cell = draw_target(self.cell, options.get("family", self.options.family), self.np_random)
        self.simulation.reset(cell)
        self._limit = np.inf if self.options.max_episode_s is None else self.options.max_episode_s
        return self._observed(), {"duration_s": cell.duration, **self._errors()}

    def _errors(self) -> dict[str, Any]:
        """Of the pose now; in mm too, for one release."""
        position = self.simulation.position_error
        return {
            "position_error_m": position,
            "position_error_mm": 1e3 * position,
            "orientation_error_rad": self.simulation.orientation_error,
        }

    def _run(self, action: Floats32) -> tuple[Floats32, float, bool, bool, dict[str, Any]]:
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
            **self._errors(),
            "singular_value": singular_value,
            "damped": singular_value < cell.damping,
            "capped": bool(simulation.shares[3] > 0.0),
            "reward_terms": terms,
        }
        if terminated or truncated:
            position, orientation = np.sqrt(simulation.squares / simulation.tick).tolist()
            info["position_error_rms_m"], info["position_error_rms_mm"] = position, 1e3 * position
            info["orientation_error_rms_rad"] = orientation
            most_position, most_orientation = cell.error_scales
            info["is_success"] = terminated and position < most_position and orientation < most_orientation
        return self._observed(), float(sum(terms.values())), terminated, truncated, info

    def _observed(self) -> Floats32:
        (observation,) = observe_ik(self.cell, view_of(self.simulation))
        return np.asarray(observation)

    def _draw_extras(self, renderer: Renderer) -> None:
        """The target's axes now."""
        target, row = self.simulation.cell.target, 2 * self.simulation.tick
        renderer.show_target(target.position[row], target.rotation[row])

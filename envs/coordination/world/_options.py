"""What can be asked of episodes of several arms: said once, for environments, evaluations and commands."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, TypedDict, get_args

from armtempo.envs.bodies import Physics
from armtempo.envs.common import check_bodies, check_flags, check_names, check_time_limit, is_number
from armtempo.envs.coordination.world._disturbance import (
    DISTURBANCES,
    Disturbance,
    Range,
    as_noise,
    as_range,
    disturbs_first_alone,
)
from armtempo.errors import InputError, brief
from armtempo.planners.topp import Mode

ActionForm = Literal["speed", "speed+priority"]
ObservationForm = Literal["local", "graph"]
OrderRule = Literal["asked", "search", "search+stop"]

MODES: tuple[Mode, ...] = get_args(Mode)
ACTION_FORMS: tuple[ActionForm, ...] = get_args(ActionForm)
OBSERVATION_FORMS: tuple[ObservationForm, ...] = get_args(ObservationForm)
ORDER_RULES: tuple[OrderRule, ...] = get_args(OrderRule)


@dataclass(frozen=True, kw_only=True)
class CoordinationOptions:
    """Options of the episodes of a coordination cell.

    Raises:
        UnknownNameError: No such physics, mode or disturbance.
        InputError: A value that an episode cannot have. Arms of a ``Disturbance`` are looked for when there is a cell.
    """

    physics: Physics = "bullet"
    """"bullet", "mujoco": torque control in that engine, FCL distances at every tick; "ideal": exactly on the paths."""

    mode: Mode = "speed"
    """What an action means: a share of the highest safe "speed", or of the admissible "acceleration"."""

    action: ActionForm = "speed"
    """What an action has: a "speed" (of that mode), (1,), or "speed+priority", (2,), the other for the shield."""

    observation: ObservationForm = "local"
    """What agents see: "local", their own arm and the two nearest others; or, under the shield, the "graph" of all
    arms and pairs with the order in which they pass."""

    orders: OrderRule = "asked"
    """Who decides the orders of passing under the shield: what is "asked" for, and commands; or the "search" for the
    order that is quickest if all go on at full speed, made anew on the way; with "search+stop" arms that stand are
    expected to stand on."""

    disturbance: str | Disturbance | None = None
    """What goes wrong with the first arm, drawn for every episode: late, slow, stop-and-go, any; with all-any and so
    on, with every arm."""

    observation_noise: float = 0.0
    """Standard deviation of normal noise on what agents see, but for "present" and padding."""

    start_phase: float | Range = 0.0
    """Share of the path where each arm starts, at rest: a number, or (lowest, highest) to draw from."""

    master_late_s: float | Range = 0.0
    """How long the first arm stands before it obeys [s]: a number, or (lowest, highest) to draw from."""

    model_error: float = 0.0
    """With physics: by what share the simulated bodies are heavier than the plans'."""

    friction_error: float = 0.0
    """With physics: by what share damping and dry friction of the joints are larger."""

    shield: bool = False
    """Let through only commands that can neither collide nor end in a deadlock; infos say what it changed."""

    shield_tube_m: float = 0.0
    """How far arms may be off their references beyond what plans keep in reserve [m]."""

    max_episode_s: float | None = None
    """Time limit [s] instead of five sequential times."""

    @property
    def action_size(self) -> int:
        """How many numbers an action has."""
        return 1 + ACTION_FORMS.index(self.action)

    def __post_init__(self) -> None:
        check_bodies(self.physics, model_error=self.model_error, friction_error=self.friction_error)
        check_names(
            ("mode", self.mode, MODES),
            ("action", self.action, ACTION_FORMS),
            ("observation", self.observation, OBSERVATION_FORMS),
            ("orders", self.orders, ORDER_RULES),
        )
        if isinstance(self.disturbance, str):
            check_names(("disturbance", self.disturbance, DISTURBANCES))
        elif not isinstance(self.disturbance, Disturbance | None):
            raise InputError(
                f"disturbance must be a name or a Disturbance, got {brief(self.disturbance)}",
                remedy=f"known: {', '.join(DISTURBANCES)}",
            )
        check_flags(shield=self.shield)
        if self.action_size > 1 and not self.shield:
            raise InputError(
                "a priority tells the shield who passes first, and there is none", remedy="add shield=True"
            )
        self._check_orders()
        as_noise(self.observation_noise)
        as_range(self.start_phase, "start_phase", 0.999)
        as_range(self.master_late_s, "master_late_s", math.inf)
        if not (is_number(self.shield_tube_m) and self.shield_tube_m >= 0.0):
            raise InputError(
                f"shield_tube_m must be a distance [m], got {brief(self.shield_tube_m)}", remedy="give 0 or more"
            )
        check_time_limit(self.max_episode_s)

    def _check_orders(self) -> None:
        for name, given, usual in (("observation", self.observation, "local"), ("orders", self.orders, "asked")):
            if given != usual and not self.shield:
                raise InputError(
                    f"{name} is {given!r}, and without a shield there are no orders of passing",
                    remedy="add shield=True",
                )
        if self.orders != "asked" and self.action_size > 1:
            raise InputError(
                f"orders is {self.orders!r}, and priorities ask for others",
                remedy='use action="speed", or orders="asked"',
            )
        if self.observation == "graph" and self.observation_noise:
            raise InputError("noise is for what agents see locally", remedy="leave observation_noise out")

    @property
    def first_alone(self) -> bool:
        """Whether no arm but the first is disturbed."""
        return disturbs_first_alone(self.disturbance)

    @property
    def on_the_way(self) -> bool:
        """Whether arms may start on the way: what is known of whole paths, as bounds, then says nothing."""
        return as_range(self.start_phase, "start_phase", 0.999)[1] > 0.0


class CoordinationKeywords(TypedDict, total=False):
    """``CoordinationOptions`` as keywords."""

    physics: Physics
    mode: Mode
    action: ActionForm
    observation: ObservationForm
    orders: OrderRule
    disturbance: str | Disturbance | None
    observation_noise: float
    start_phase: float | Range
    master_late_s: float | Range
    model_error: float
    friction_error: float
    shield: bool
    shield_tube_m: float
    max_episode_s: float | None

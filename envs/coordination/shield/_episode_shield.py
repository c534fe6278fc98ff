"""The shield of a running episode: over its simulation, with sums of what it changed, and orders that it decides."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, final

import numpy as np
from numpy.typing import ArrayLike

from armtempo.arrays import Bools, Floats
from armtempo.envs.coordination.shield._deciding import best_order, hold_back, look_all
from armtempo.envs.coordination.shield._keeper import OrderKeeper
from armtempo.envs.coordination.shield._kernels import Orders
from armtempo.envs.coordination.shield._shield import Foresight, Shield
from armtempo.envs.coordination.shield._stops_seen import note_commands, still_standing, stops_seen
from armtempo.envs.coordination.world import CoordinationSimulation, Episodes, World, check_torque_left
from armtempo.errors import InfeasibleError, InputError
from armtempo.planners import Execution, Precedence
from armtempo.planners.coordination import PassingOrders
from armtempo.state import Stateful


def plan_of(execution: Execution | None) -> Precedence | None:
    """What the arms of an execution obey; None: nothing, they run at full speed.

    Raises:
        InputError: It does not say.
    """
    if execution is None:
        return None
    plan = getattr(execution, "precedence", None)
    if not isinstance(plan, Precedence):
        raise InputError(
            f"the shield does not know whom {type(execution).__name__} waits for",
            remedy="give it an attribute 'precedence', a Precedence that its arms obey",
        )
    return plan


@final
class EpisodeShield(Stateful):
    """A shield over a running simulation, and what it changed.

    Args:
        simulation: The world of an environment.
        scripted: See ``Shield``.
        plan: See ``Shield``.
        tube_m: See ``shield_tables``.

    Attributes:
        shield: The shield.
        keeper: What was seen of the episode.
        order_work: Scratch of compiled loops.

    Raises:
        InfeasibleError: As ``Shield.reset``, or arms not as planned cannot even go slowly along their paths.
    """

    changing = ("shield", "keeper", "_watching", "_changed", "_change", "_sum", "_count", "_steps", "_tube")

    def __init__(
        self,
        simulation: CoordinationSimulation,
        *,
        scripted: Sequence[int] = (),
        plan: Precedence | None = None,
        tube_m: float = 0.0,
    ) -> None:
        self._simulation = simulation
        check_torque_left(simulation.cell, simulation.options)
        self.shield = Shield(simulation.cell, simulation.world, scripted=scripted, plan=plan, tube_m=tube_m)
        # Plans keep the reserve between two arms: half of it is for each.
        self._tube = tube_m + 0.5 * (simulation.cell.planned_clearance - simulation.cell.d_min)
        self.keeper = OrderKeeper(
            simulation.cell, self.shield.regions, stops_seen(1, simulation.arms), simulation.options.orders
        )
        self._watching = self.keeper.decides or simulation.options.observation == "graph"
        self._changed, self.order_work, self._every = False, self.keeper.work(), np.ones(1, dtype=np.bool_)
        self.shield.reset(np.zeros(simulation.arms))  # not from where it is: what is drawn there may be drawn again
        self._clear()

    def check_state(self, state: Mapping[str, Any]) -> None:
        """Raise InputError for the state of a shield with another tube, too."""
        super().check_state(state)
        if state["tube"] != self._tube:
            raise InputError("the state's tube is another one", remedy="make the shield with the same tube_m")

    def reset(self) -> None:
        """Begin an episode where the simulation is; raises as ``Shield.reset``."""
        self.shield.reset(self._simulation.lam, self._simulation.uncertain)
        self.keeper.forget(self._every)
        self._clear()
        self.look()

    def _clear(self) -> None:
        arms = self._simulation.arms
        self._change, self._sum, self._count = np.zeros(arms), np.zeros(arms), np.zeros(arms, dtype=np.int64)
        self._steps = 0

    def leads_on(self) -> bool:
        """Whether there is a way on from where the simulation begins."""
        try:
            self.shield.reset(self._simulation.lam)
        except InfeasibleError:
            return False
        return True

    def commands(self, commands: Floats) -> Floats:
        """(A,) what is let through of the commands for the next period."""
        if self._simulation.clock < 1.0:
            self.shield.doubt_all()
        admitted = self.shield.admit(self._simulation.lam, self._simulation.mu, commands)
        if self._watching:
            note_commands(self.keeper.seen, self._simulation.episodes, 0, admitted)
        self._change = commands - admitted
        self._sum += self._change
        self._count += self._change != 0.0
        self._steps += 1
        return admitted

    @property
    def world(self) -> World:
        """The cell as compiled loops take it."""
        return self._simulation.world

    @property
    def episodes(self) -> Episodes:
        """The episode as compiled loops take it."""
        return self._simulation.episodes

    def watch(self) -> None:
        """From now on see which arms stand though they were sent on."""
        self._watching = True

    def look(self) -> None:
        """After a control period: see who stands, and decide the orders where that is asked for; see ``watch``."""
        if not self._watching:
            return
        keeper, shield = self.keeper, self.shield
        self._changed = look_all(
            self._simulation.world, shield.tables, keeper.prices, keeper.seen, self._simulation.episodes, 0, 1,
            self._every, keeper.decides, keeper.expects(), shield.scripted, shield.uncertain[None], shield.ticks,
            shield.orders[None], shield.asked[None], self.order_work, shield.work,
        )  # fmt: skip

    @property
    def stands(self) -> Bools:
        """(A,) arms that stand though they were sent on, of those that are watched; a new array."""
        stands: Bools = self.keeper.seen.stands[0].copy()
        return stands

    @property
    def stands_changed(self) -> bool:
        """Whether one came to stand in the last control period, or went again."""
        return self._changed

    def still(self) -> Floats:
        """(A,) for how long each arm is expected to stand on [s]: as long as those seen so far did, 0 if it goes."""
        still = np.zeros(self._simulation.arms)
        period = self._simulation.cell.control_period
        still_standing(self.keeper.seen, 0, self._simulation.time, self.keeper.expected, period, still)
        return still

    def search(self, *, expects: bool = False, first: bool = False) -> Orders:
        """Keep to the order that is quickest if all go on at full speed (see ``OrderSearch``), if it can be had.

        Args:
            expects: That arms that stand go on standing, as ``still`` says.
            first: Take any better one; else it must be 2 % better.

        Returns:
            ``orders`` (R,) that hold now, a new array.
        """
        simulation, shield = self._simulation, self.shield
        best_order(
            simulation.world, shield.tables, self.keeper.prices, simulation.lam, simulation.mu,
            self.still() if expects else np.zeros(simulation.arms), first, shield.scripted, shield.uncertain,
            shield.ticks, shield.orders, shield.asked, self.order_work, shield.work,
        )  # fmt: skip
        return self.orders

    def hold_back(self) -> Floats:
        """(A,) for how long arms at rest had better wait where they are than on their way [s].

        As much of the time that they will lose behind others, of four shares of it, as is quickest when all is run
        ahead in the order that holds; 0 where none is, and for arms that move or stand. Arms that stand are expected
        to stand on.
        """
        simulation, shield = self._simulation, self.shield
        holds = np.zeros(simulation.arms)
        hold_back(
            simulation.world, shield.tables, self.keeper.prices, simulation.lam, simulation.mu, self.still(),
            shield.orders, shield.scripted, shield.uncertain, shield.ticks, shield.longest, holds, self.order_work,
            shield.work,
        )  # fmt: skip
        return holds

    @property
    def change(self) -> Floats:
        """(A,) how much of each command was taken off in the last period."""
        return self._change.copy()

    @property
    def orders(self) -> Orders:
        """(R,) who passes first in each collision region, now; see ``Shield``. A new array."""
        return self.shield.orders.copy()

    @property
    def regions(self) -> PassingOrders:
        """The collision regions, R."""
        return self.shield.regions

    @property
    def precedence(self) -> Precedence:
        """What ``orders`` mean: how far every arm may go while another one is where it is."""
        return self.shield.precedence

    def ask(self, wanted: Precedence | ArrayLike) -> Orders:
        """As ``Shield.ask``, for arms as they are now: the (R,) orders that hold; raises as it does."""
        return self.shield.ask(wanted, self._simulation.lam, self._simulation.mu)

    def run_ahead(
        self, wanted: Precedence | ArrayLike, *, stands: ArrayLike = 0.0, horizon: float = np.inf
    ) -> Foresight:
        """As ``Shield.run_ahead``, for arms as they are now; raises as it does."""
        simulation = self._simulation
        return self.shield.run_ahead(wanted, simulation.lam, simulation.mu, stands=stands, horizon=horizon)

    def prefer(self, priority: ArrayLike) -> None:
        """As ``Shield.prefer``."""
        self.shield.prefer(priority)

    def report(self, i: int, info: dict[str, Any], over: bool) -> None:
        """Add to arm i's info what was changed in the last period; when it is over, the sums too."""
        change, orders = float(self._change[i]), tuple(self.shield.orders.tolist())
        info["shield"] = {"changed": change != 0.0, "change": change, "orders": orders}
        if self._simulation.physics != "ideal":
            info["shield_tube_exceeded"] = not self._simulation.tracking_error().max() <= self._tube
        if over:
            info["shield_steps"], info["shield_changed"] = self._steps, int(self._count[i])
            info["shield_change"] = float(self._sum[i])

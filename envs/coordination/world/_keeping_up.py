"""Whether arms in physics keep up with their references: what is said and refused when an environment is made."""

from __future__ import annotations

import logging
import math

import numpy as np

from armtempo.envs.coordination.world._options import CoordinationOptions
from armtempo.envs.coordination.world._pace import SLOWEST, hardest_tick
from armtempo.envs.coordination.world._world import World
from armtempo.errors import InfeasibleError
from armtempo.planners import CoordinationCell
from armtempo.planners.cells import build_cell, needed_torque_reserve, rate_that_holds

_LOG = logging.getLogger("armtempo")

RATE_TRIALS = 6
RATE_MARGIN = 1e-4  # of a torque limit


def first_rate(world: World, cell: CoordinationCell, options: CoordinationOptions, *, enough: bool) -> float:
    """How fast the references' time may go from the start.

    Full speed of every arm, in ticks, keeps its limits: 1 where plans leave the controller some torque. Plans at the
    limits need up to 0.6 % more in ticks than they have: what is clipped of it, feedback asks for again, and more and
    more of it. Where the torque reserve is not ``enough`` for the errors of the options, any motion keeps its limits:
    feedback alone learns of an error as an arm speeds up, and where less torque is left to brake, that is too late.
    """
    rate = 1.0
    if not enough:
        rate = max(rate_that_holds(cell, options.model_error, options.friction_error), SLOWEST)
    for i in range(world.torque_max.shape[0]):
        for _ in range(RATE_TRIALS):
            worst = hardest_tick(world, i, rate)
            if worst <= 1.0:
                break
            rate /= math.sqrt(worst * (1.0 + RATE_MARGIN))
    return rate


def with_auto_reserve(cell: CoordinationCell, options: CoordinationOptions) -> CoordinationCell:
    """The cell; where its file says ``torque_reserve: auto``, with what the errors of these options need.

    Raises:
        InfeasibleError: No reserve will do, or the arms are too weak with it.
    """
    if cell.config.torque_reserve != "auto" or not _told(cell, options):
        return cell
    needed = needed_torque_reserve(cell, options.model_error, options.friction_error)
    if needed <= cell.torque_reserve:
        return cell
    if math.isinf(needed):
        raise InfeasibleError(
            f"no torque_reserve of cell {cell.name!r} is enough for {_errors(options)}",
            remedy="make the errors smaller, or limits.torque_nm larger",
        )
    return build_cell(cell.config.model_copy(update={"torque_reserve": needed}))


def keeps_up(cell: CoordinationCell, options: CoordinationOptions) -> bool:
    """Whether the cell's torque reserve is enough for the errors of the options; says so in the log where it is not."""
    if not _told(cell, options):
        return True
    needed = needed_torque_reserve(cell, options.model_error, options.friction_error)
    if needed <= cell.torque_reserve + 1e-9:
        return True
    _LOG.warning(
        "cell %r has a torque_reserve of %.4g, for %s it should be %s: where torques do not suffice arms will be late",
        cell.name, cell.torque_reserve, _errors(options), _number(needed),
    )  # fmt: skip
    return False


def check_torque_left(cell: CoordinationCell, options: CoordinationOptions) -> None:
    """For a shield, which takes the errors of the options for bounds.

    Raises:
        InfeasibleError: However slowly, arms have not the torque for their paths.
    """
    if not _told(cell, options) or rate_that_holds(cell, options.model_error, options.friction_error) > 0.0:
        return
    needed = needed_torque_reserve(cell, options.model_error, options.friction_error)
    none = math.isinf(needed)
    raise InfeasibleError(
        f"the shield cannot promise anything in cell {cell.name!r}: {_errors(options)} leave an arm too little "
        f"torque for its path, however slowly, with a torque_reserve of {cell.torque_reserve:.4g}",
        remedy="make the errors smaller, or limits.torque_nm larger: no reserve helps"
        if none
        else f"torque_reserve: {_number(needed)} in the cell's file, or auto",
    )


def _told(cell: CoordinationCell, options: CoordinationOptions) -> bool:
    """Whether arms are not as planned: bodies, or friction where there is some."""
    rubs = any(arm.damping.any() or arm.coulomb.any() for arm in cell.arms)
    return bool(options.model_error or (rubs and options.friction_error))


def _errors(options: CoordinationOptions) -> str:
    given = {"model_error": options.model_error, "friction_error": options.friction_error}
    return " and ".join(f"{name} {value:g}" for name, value in given.items() if value)


def _number(needed: float) -> str:
    """Rounded up: as much as is said is enough."""
    return "more than there is" if math.isinf(needed) else f"{np.ceil(1e4 * needed - 1e-6) / 1e4:g}"

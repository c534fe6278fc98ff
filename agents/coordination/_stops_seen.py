"""Which arms stand though they were sent on, seen from where they are; and for how long one should expect it."""

from __future__ import annotations

from typing import final

import numpy as np

from armtempo.arrays import Bools, Floats
from armtempo.envs import CoordinationEnv, EpisodeShield
from armtempo.planners import CoordinationCell

EXPECTED_REST_SHARE = 0.3  # of the mean minimum time: how long a stop lasts, before one was seen
BEHIND_SHARE = 1e-6  # of a path: an arm that is so far behind where it was sent is disturbed


@final
class StopsSeen:
    """Who stands, and since when. Where the references of the arms are is known to whoever commands them."""

    def __init__(self, cell: CoordinationCell) -> None:
        self._expected = EXPECTED_REST_SHARE * float(np.mean([motion.duration for motion in cell.fastest]))
        self._arms = len(cell.arms)
        self.reset()

    def reset(self) -> None:
        """Forget the episode."""
        self._before: tuple[Floats, Floats, float, Floats] | None = None
        self.stood, self._since = np.zeros(self._arms, dtype=np.bool_), np.zeros(self._arms)
        self.rests: list[float] = []

    def look(self, env: CoordinationEnv, shield: EpisodeShield) -> bool:
        """Whether an arm stands that went before, or goes again; true at first."""
        simulation = env.simulation
        if self._before is None:
            return True
        stands, now = self._stands(env, shield, *self._before), float(simulation.time)
        self.rests += list(now - self._since[self.stood & ~stands])
        self._since[stands & ~self.stood] = now
        changed = bool((stands != self.stood).any())
        self.stood = stands
        return changed

    def sent(self, env: CoordinationEnv, commands: Floats) -> None:
        """Note the commands (A,) that the arms are given where they are now."""
        simulation = env.simulation
        self._before = simulation.lam.copy(), simulation.mu.copy(), simulation.clock, commands

    def still(self, env: CoordinationEnv) -> Floats:
        """(A,) for how long each arm is expected to stand on [s]: as long as those seen so far did, 0 if it goes."""
        rest = (self._expected + sum(self.rests)) / (1 + len(self.rests))
        left = np.maximum(rest - (float(env.simulation.time) - self._since), env.cell.control_period)
        return np.where(self.stood, left, 0.0)

    def _stands(
        self, env: CoordinationEnv, shield: EpisodeShield, lam: Floats, mu: Floats, clock: float, commands: Floats
    ) -> Bools:
        """(A,) arms that do as if they had been told to brake, from ``lam`` with ``mu`` a period ago."""
        here, time, mode = env.simulation.lam, clock * env.cell.control_period, env.options.mode
        admitted = commands - shield.change
        out = np.zeros(len(lam), dtype=np.bool_)
        for i, plane in enumerate(env.cell.planes):
            if here[i] >= plane.length or admitted[i] <= 0.0:
                out[i] = self.stood[i] and here[i] < plane.length
                continue
            near = BEHIND_SHARE * plane.length
            where = (float(lam[i]), float(mu[i]))
            if here[i] < plane.advance(*where, float(admitted[i]), time, mode=mode)[0] - near:
                out[i] = here[i] <= plane.advance(*where, 0.0, time, mode=mode)[0] + near
        return out

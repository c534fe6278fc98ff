"""armtempo: when robot arms move along given paths.

Plan the timing of several arms with classical planners, let learned agents decide it instead, simulate both and
compare. Every folder is usable alone: ``armtempo.configs``, ``.robots``, ``.planners``, ``.envs``, ``.agents``,
``.commands``.

Importing the package registers its environments with Gymnasium and PettingZoo by name only. The numerical parts
(numba, PyBullet, FCL) load when they are first used.
"""

from __future__ import annotations

from importlib.metadata import PackageNotFoundError, version
from typing import TYPE_CHECKING, Any

import gymnasium
import pettingzoo

from armtempo.errors import ArmtempoError

if TYPE_CHECKING:
    from armtempo.planners import load_cell

__all__ = ["ArmtempoError", "__version__", "load_cell"]

try:
    __version__ = version("armtempo")
except PackageNotFoundError:  # a source tree on sys.path that was never installed
    __version__ = "0.0.0"

gymnasium.register(
    id="armtempo/Yielding-v0",
    entry_point="armtempo.envs:YieldingEnv",
    vector_entry_point="armtempo.envs:YieldingVectorEnv",
    kwargs={"cell": "lee1991"},
)
gymnasium.register(
    id="armtempo/BlendTracking-v0",
    entry_point="armtempo.envs:BlendTrackingEnv",
    vector_entry_point="armtempo.envs:BlendTrackingVectorEnv",
    kwargs={"cell": "lee2006"},
)
gymnasium.register(
    id="armtempo/FeedbackIK-v0",
    entry_point="armtempo.envs:FeedbackIKEnv",
    vector_entry_point="armtempo.envs:FeedbackIKVectorEnv",
    kwargs={"cell": "chung"},
)
pettingzoo.register(
    "parallel",
    "armtempo/Coordination-v0",
    entry_point="armtempo.envs.coordination_v0:parallel_env",
    kwargs={"cell": "lee1991"},
)


def __getattr__(name: str) -> Any:
    """Import ``load_cell`` on first use (PEP 562): it brings in numba and FCL."""
    if name == "load_cell":
        from armtempo.planners import load_cell

        return load_cell
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})

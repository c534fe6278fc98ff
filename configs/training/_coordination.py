"""What a training in coordination cells says."""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import Field, StrictBool, model_validator

from armtempo.configs.schema import FileModel, NonNegative, Positive
from armtempo.configs.training._base import Count, EnvironmentTraining, Few, File, Share

Times = tuple[NonNegative, NonNegative]
Stops = Annotated[int, Field(ge=0, le=16, strict=True)]


class BenchmarkFilter(FileModel):
    """Cells of the benchmark set, out of one split. Infeasible ones are left out."""

    split: Literal["train", "validation", "test"] = "train"
    """Which split."""
    family: Literal["planar", "shaped", "panda", "iiwa", "ur5e", "ring", "rows", "fixture"] | None = None
    """Kind of cells; null: all."""
    arms: Annotated[tuple[Few, ...], Field(min_length=1)] | None = None
    """Numbers of arms; null: all."""
    priority_class: Literal["mixed", "uniform"] | None = None
    """Who goes first in the optimum: not the same arm everywhere (mixed), or the same; null: both."""
    most: Count | None = None
    """Take no more than so many cells, the first ones; null: all."""


class DisturbanceConfig(FileModel):
    """A disturbance in ranges, [lowest, highest], drawn uniformly for every episode."""

    late_s: Times = (0.0, 0.0)
    """How long the arm stands at its start [s]."""
    speed: tuple[Share, Share] = (1.0, 1.0)
    """Multiplies its command."""
    stops: tuple[Stops, Stops] = (0, 0)
    """How often it stops on the way."""
    stop_s: Times = (0.0, 0.0)
    """How long each stop lasts [s]."""
    arms: tuple[Annotated[int, Field(ge=0, le=1000, strict=True)], ...] = (0,)
    """Numbers of the disturbed arms, 0 is the master."""

    @model_validator(mode="after")
    def _low_before_high(self) -> Self:
        for key in ("late_s", "speed", "stops", "stop_s"):
            low, high = getattr(self, key)
            if low > high:
                raise ValueError(f"{key}: must be [lowest, highest], the lowest first")
        return self


class CoordinationTraining(EnvironmentTraining):
    """Arms on given paths that learn when to go."""

    cells: Annotated[tuple[File, ...], Field(min_length=1)] | None = None
    """Names of bundled cells, or cell files; null: those of ``benchmark``."""
    benchmark: BenchmarkFilter | None = None
    """Or cells of the benchmark set."""
    learners: Literal["last", "all"] = "last"
    """``last``: the last arm, the others ask for full speed; ``all``: all arms, by one shared policy."""
    physics: Literal["ideal", "bullet", "mujoco"] = "ideal"
    """``ideal`` moves arms exactly as commanded, thousands at once; ``bullet`` simulates torque control."""
    mode: Literal["speed", "acceleration"] = "speed"
    """What an action means."""
    action: Literal["speed", "speed+priority"] = "speed"
    """What an action has: one number, or two, the second saying whom the shield lets pass first."""
    shield: StrictBool = False
    """Admit only actions from which all arms can still stop in time and go on."""
    observation: Literal["local", "graph"] = "local"
    """What agents see: ``local``, an arm and the two nearest others; ``graph``, all arms and pairs, at once."""
    orders: Literal["asked", "search", "search+stop"] = "asked"
    """Who decides the orders of passing under the shield: commands and priorities, or a search on the way."""
    hold_periods: Few = 1
    """Of graphs: control periods for which an action is held, one decision of every arm."""
    disturbance: (
        Literal["late", "slow", "stop-and-go", "any", "all-late", "all-slow", "all-stop-and-go", "all-any"] | None
    ) = None
    """A named family of disturbances of the master, or of all arms; null: none."""
    custom_disturbance: DisturbanceConfig | None = None
    """Or ranges of your own."""
    observation_noise: NonNegative = 0.0
    """Standard deviation of the noise on what agents see."""
    start_phase: tuple[Share, Share] = (0.0, 0.0)
    """Where on their paths the arms start, as a share, drawn from [lowest, highest]."""
    undisturbed_share: Share = 0.0
    """Share of the environments in which neither a disturbance nor a start phase is drawn; ideal only."""
    undisturbed_until: Share = 0.0
    """Share of the training before which that holds for all of them."""
    reward: Literal["own", "team"] = "own"
    """``own``: progress and time of the arm itself; ``team``: of all arms, the same for each."""
    cut_penalty: NonNegative = 0.0
    """What asking for more than the shield lets through costs per step, times what it cuts."""
    validation: BenchmarkFilter | None = None
    """Of graphs: cells in which the agent is watched; null: those that it learns in."""
    control_period_s: Positive | None = None
    """Time between two decisions instead of the cells' own [s]."""

    @model_validator(mode="after")
    def _one_source(self) -> Self:
        if (self.cells is None) == (self.benchmark is None):
            raise ValueError("cells: give either cells or benchmark")
        if self.disturbance is not None and self.custom_disturbance is not None:
            raise ValueError("custom_disturbance: give it or disturbance, not both")
        if not self.start_phase[0] <= self.start_phase[1] < 1.0:
            raise ValueError("start_phase: must be [lowest, highest], the lowest first and both below 1")
        if self.physics != "ideal" and self.reward == "team":
            raise ValueError("reward: team needs physics: ideal")
        if self.action == "speed+priority" and not self.shield:
            raise ValueError("action: speed+priority needs shield: true")
        self._check_graph()
        for key in ("undisturbed_share", "undisturbed_until", "cut_penalty"):
            if self.physics != "ideal" and getattr(self, key):
                raise ValueError(f"{key}: needs physics: ideal")
        return self

    def _check_graph(self) -> None:
        if self.observation == "local":
            for key in ("orders", "hold_periods", "validation"):
                if key in self.model_fields_set:
                    raise ValueError(f"{key}: needs observation: graph")
            return
        for key, needed in (("shield", True), ("learners", "all"), ("reward", "team"), ("physics", "ideal")):
            if getattr(self, key) != needed:
                raise ValueError(f"observation: graph needs {key}: {str(needed).lower()}")
        if self.orders != "asked" and self.action != "speed":
            raise ValueError("orders: agents with priorities ask for their own, leave it out")
        for key in ("observation_noise", "cut_penalty"):
            if getattr(self, key):
                raise ValueError(f"{key}: needs observation: local")

"""What a training file may say: who learns, where, by which algorithm, and how the outcome is watched.

**Steps** are agent steps everywhere: decisions of one learning arm. Two arms that learn in 64 environments make 128 of
them per control period.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import BeforeValidator, Field, PrivateAttr, StrictBool, StringConstraints, model_validator

from armtempo.configs.schema import CellTitle, NonNegative, Positive, Real, _Model

Share = Annotated[Real, Field(ge=0, le=1)]
Signed = Annotated[Real, Field(ge=-1, le=1)]
Count = Annotated[int, Field(ge=1, strict=True)]
Times = tuple[NonNegative, NonNegative]
File = Annotated[str, StringConstraints(min_length=1)]


def _listed(value: object) -> object:
    """A number as a list of one."""
    return (value,) if isinstance(value, int | float) else value


class BenchmarkFilter(_Model):
    """Cells of the benchmark set, out of one split. Infeasible ones are left out."""

    split: Literal["train", "validation", "test"] = "train"
    """Which split."""
    family: Literal["planar", "panda", "iiwa"] | None = None
    """Kind of arms; null: all."""
    priority_class: Literal["mixed", "uniform"] | None = None
    """Who goes first in the optimum: not the same arm everywhere (mixed), or the same; null: both."""
    most: Count | None = None
    """Take no more than so many cells, the first ones; null: all."""


class DisturbanceConfig(_Model):
    """A disturbance in ranges, [lowest, highest], drawn uniformly for every episode."""

    late_s: Times = (0.0, 0.0)
    """How long the arm stands at its start [s]."""
    speed: tuple[Share, Share] = (1.0, 1.0)
    """Multiplies its command."""
    stops: tuple[Annotated[int, Field(ge=0)], Annotated[int, Field(ge=0)]] = (0, 0)
    """How often it stops on the way."""
    stop_s: Times = (0.0, 0.0)
    """How long each stop lasts [s]."""
    arms: tuple[Annotated[int, Field(ge=0)], ...] = (0,)
    """Numbers of the disturbed arms, 0 is the master."""

    @model_validator(mode="after")
    def _low_before_high(self) -> Self:
        for key in ("late_s", "speed", "stops", "stop_s"):
            low, high = getattr(self, key)
            if low > high:
                raise ValueError(f"{key}: must be [lowest, highest], the lowest first")
        return self


class CoordinationTraining(_Model):
    """Arms on given paths that learn when to go."""

    cells: Annotated[tuple[File, ...], Field(min_length=1)] | None = None
    """Names of bundled cells, or cell files; null: those of ``benchmark``."""
    benchmark: BenchmarkFilter | None = None
    """Or cells of the benchmark set."""
    learners: Literal["last", "all"] = "last"
    """``last``: the last arm, the others ask for full speed; ``all``: all arms, by one shared policy."""
    physics: Literal["ideal", "bullet"] = "ideal"
    """``ideal`` moves arms exactly as commanded, thousands at once; ``bullet`` simulates torque control."""
    mode: Literal["speed", "acceleration"] = "speed"
    """What an action means."""
    shield: StrictBool = False
    """Admit only actions from which all arms can still stop in time and go on."""
    disturbance: Literal["late", "slow", "stop-and-go", "any"] | None = None
    """A named family of disturbances of the master; null: none."""
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
        if self.physics == "bullet" and self.reward == "team":
            raise ValueError("reward: team needs physics: ideal")
        for key in ("undisturbed_share", "undisturbed_until", "cut_penalty"):
            if self.physics == "bullet" and getattr(self, key):
                raise ValueError(f"{key}: needs physics: ideal")
        return self


class BlendTraining(_Model):
    """An arm that overrides the feed rate on a blended path."""

    cell: File = "lee2006"
    """Name of a bundled blend cell, or its file."""
    family: Literal["given", "polyline", "zigzag", "line-arc"] = "given"
    """Paths: the given one, or drawn for every episode."""
    profile: Literal["line-speed", "limit-aware"] = "line-speed"
    """The profile whose rate is overridden."""
    mapping: Literal["exact", "paper"] = "exact"
    """From the profile's length to the path's."""
    physics: Literal["ideal", "bullet"] = "ideal"
    """``ideal`` moves the arm exactly as commanded; ``bullet`` simulates torque control."""
    model_error: Real = 0.0
    """The simulated bodies are heavier by this share than the controller believes."""


class IKTraining(_Model):
    """An arm that follows poses."""

    cell: File = "chung"
    """Name of a bundled ik cell, or its file."""
    families: Annotated[
        tuple[Literal["given", "smooth", "near-singular", "partly-unreachable"], ...], Field(min_length=1)
    ] = ("given",)
    """Targets: the given one, or drawn. In ``ideal`` the ``targets`` take them in turn, else the environments do."""
    action_mode: Literal["speeds", "gains"] = "gains"
    """What an action means: joint speeds, or the gains of the paper's law."""
    physics: Literal["ideal", "bullet"] = "ideal"
    """``ideal`` moves the arm exactly as commanded; ``bullet`` simulates torque control."""
    model_error: Real = 0.0
    """The simulated bodies are heavier by this share than the controller believes."""
    reward_scale: Positive = 1.0
    """Multiplies what the algorithm is told, where rewards are too small to learn from; the curve has them unscaled."""
    targets: Count = 96
    """In ``ideal``: how many are drawn before the training, which takes one of them for every episode."""
    hold_periods: Count = 1
    """In ``ideal``: control periods for which the training holds an action, one agent step; the agent decides in each.
    What gains do to an error shows seconds later: a choice of 10 ms is lost in what is drawn."""

    @model_validator(mode="after")
    def _ideal(self) -> Self:
        for key in ("targets", "hold_periods"):
            if self.physics == "bullet" and key in self.model_fields_set:
                raise ValueError(f"{key}: needs physics: ideal")
        if self.targets < len(self.families):
            raise ValueError(f"targets: must be {len(self.families)} at least, one for each of the families")
        return self


class NetworkConfig(_Model):
    """Layers of the actor, and of every critic."""

    sizes: tuple[Count, ...] = (64, 64)
    """Widths of the hidden layers."""
    activation: Literal["tanh", "relu"] = "tanh"
    """Between them."""


class _Hyper(_Model):
    learning_rate: Positive = 3e-4
    """Of Adam, at the start."""
    learning_rate_end: NonNegative | None = None
    """At the end of the training, linearly in the steps; null: as at the start."""
    gamma: Annotated[Real, Field(gt=0, le=1)] = 0.999
    """Discount per step."""


class PPOConfig(_Hyper):
    """Proximal policy optimisation, as in stable-baselines3."""

    rollout_steps: Count = 128
    """Steps of every environment between two updates."""
    batch_size: Annotated[int, Field(ge=2, strict=True)] = 4096
    """Agent steps per gradient step."""
    epochs: Count = 10
    """How often a rollout is gone through."""
    gae_lambda: Share = 0.95
    """Of the advantage estimate."""
    clip_range: Positive = 0.2
    """Of the ratio of probabilities."""
    entropy: NonNegative = 0.0
    """Weight of the entropy."""
    value_weight: NonNegative = 0.5
    """Weight of the critic's error."""
    max_gradient: Positive = 0.5
    """Longest gradient."""
    target_kl: Positive | None = None
    """Stop an update beyond this divergence; null: never."""
    log_std_start: Real = 0.0
    """Logarithm of the spread of the first actions."""
    first_action: Annotated[tuple[Signed, ...], BeforeValidator(_listed), Field(min_length=1)] = (0.0,)
    """Mean of the first actions, one number for all or a list with one for each: 1 is full speed."""


class SACConfig(_Hyper):
    """Soft actor-critic, as in stable-baselines3."""

    buffer_size: Count = 300_000
    """Agent steps that are remembered."""
    learning_starts: Count = 1000
    """Agent steps of random actions before the first update."""
    batch_size: Count = 256
    """Agent steps per gradient step."""
    tau: Annotated[Real, Field(gt=0, le=1)] = 0.005
    """How fast target networks follow."""
    train_every: Count = 1
    """Steps of every environment between two updates."""
    gradient_steps: Count = 1
    """Gradient steps per update."""
    entropy: Positive | None = None
    """Weight of the entropy; null: found on the way."""


class TQCConfig(SACConfig):
    """Truncated quantile critics, as in sb3-contrib."""

    quantiles: Count = 25
    """Per critic."""
    critics: Count = 2
    """How many."""
    dropped_per_critic: Annotated[int, Field(ge=0, strict=True)] = 2
    """The highest quantiles that are left out."""


class EvaluationConfig(_Model):
    """How the agent is watched: one undisturbed episode per cell, and some as it is trained."""

    every_steps: Count = 100_000
    """Steps between two evaluations."""
    episodes: Annotated[int, Field(ge=0, strict=True)] = 20
    """Disturbed episodes, over all cells together."""
    cells: Count = 8
    """In no more than so many cells, the first ones."""
    seed: Annotated[int, Field(ge=0, strict=True)] = 10_000
    """Of the first episode."""


_ENVIRONMENTS = ("coordination", "blend_tracking", "feedback_ik")
_ALGORITHMS = ("ppo", "sac", "tqc")


class TrainConfig(_Model):
    """One training. Exactly one of ``coordination``, ``blend_tracking`` and ``feedback_ik`` is given."""

    name: CellTitle
    """Of the agent."""
    algorithm: Literal["ppo", "sac", "tqc"]
    """What trains it."""
    coordination: CoordinationTraining | None = None
    """Several arms on given paths."""
    blend_tracking: BlendTraining | None = None
    """One arm on a blended path."""
    feedback_ik: IKTraining | None = None
    """One arm that follows poses."""
    num_envs: Count = 64
    """Environments that run side by side."""
    total_steps: Count = 1_000_000
    """Agent steps of the whole training."""
    checkpoint_every_steps: Count = 200_000
    """Agent steps between two checkpoints."""
    seed: Annotated[int, Field(ge=0, strict=True)] = 0
    """Of everything that is drawn."""
    evaluation: EvaluationConfig = EvaluationConfig()
    """How it is watched."""
    network: NetworkConfig = NetworkConfig()
    """Actor and critics."""
    ppo: PPOConfig = PPOConfig()
    """Hyper-parameters, if algorithm is ppo."""
    sac: SACConfig = SACConfig()
    """Likewise, if it is sac."""
    tqc: TQCConfig = TQCConfig()
    """Likewise, if it is tqc."""

    _source: Path = PrivateAttr(default=Path())
    _text: str = PrivateAttr(default="")

    @property
    def source(self) -> Path:
        """The file it came from."""
        return self._source

    @property
    def text(self) -> str:
        """What that file says."""
        return self._text

    def read_from(self, source: Path, text: str) -> Self:
        """Remember the file."""
        self._source, self._text = source, text
        return self

    @property
    def environment(self) -> CoordinationTraining | BlendTraining | IKTraining:
        """The one that is given."""
        given = self.coordination or self.blend_tracking or self.feedback_ik
        assert given is not None
        return given

    def changed(self, **changes: Any) -> Self:
        """The same training with other values of top-level keys; None keeps what there is."""
        given = {key: value for key, value in changes.items() if value is not None}
        return self.model_copy(update=given).read_from(self._source, self._text)

    @model_validator(mode="after")
    def _one_of_each(self) -> Self:
        given = [key for key in _ENVIRONMENTS if getattr(self, key) is not None]
        if len(given) != 1:
            said = " and ".join(given) if given else "none"
            key = given[-1] if given else "coordination"
            raise ValueError(f"{key}: give one of {', '.join(_ENVIRONMENTS)}, got {said}")
        for key in _ALGORITHMS:
            if key in self.model_fields_set and key != self.algorithm:
                raise ValueError(f"{key}: the algorithm is {self.algorithm}; give hyper-parameters of that one alone")
        return self

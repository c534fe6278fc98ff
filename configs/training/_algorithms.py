"""Networks and algorithms of a training, with their hyper-parameters."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BeforeValidator, Field

from armtempo.configs.schema import FileModel, NonNegative, Positive, Real
from armtempo.configs.training._base import Count, Few, Many, Share, Signed


def _listed(value: object) -> object:
    """A number as a list of one."""
    return (value,) if isinstance(value, int | float) else value


class NetworkConfig(FileModel):
    """Layers of the actor, and of every critic."""

    kind: Literal["layers", "graph"] = "layers"
    """``layers``, one after another; ``graph``: messages along pairs of arms, for observations that are graphs."""
    sizes: Annotated[tuple[Few, ...], Field(max_length=32)] = (64, 64)
    """Widths of the hidden layers; of a graph: of the rounds of messages."""
    activation: Literal["tanh", "relu"] = "tanh"
    """Between them."""


class _Hyper(FileModel):
    learning_rate: Annotated[Positive, Field(le=10)] = 3e-4
    """Of Adam, at the start."""
    learning_rate_end: Annotated[NonNegative, Field(le=10)] | None = None
    """At the end of the training, linearly in the steps; null: as at the start."""
    gamma: Annotated[Real, Field(gt=0, le=1)] = 0.999
    """Discount per step."""


class PPOConfig(_Hyper):
    """Proximal policy optimisation, as in stable-baselines3."""

    rollout_steps: Few = 128
    """Steps of every environment between two updates."""
    batch_size: Annotated[Many, Field(ge=2)] = 4096
    """Agent steps per gradient step."""
    epochs: Few = 10
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
    log_std_start: Annotated[Real, Field(ge=-20, le=20)] = 0.0
    """Logarithm of the spread of the first actions."""
    first_action: Annotated[tuple[Signed, ...], BeforeValidator(_listed), Field(min_length=1)] = (0.0,)
    """Mean of the first actions, one number for all or a list with one for each: 1 is full speed."""


class SACConfig(_Hyper):
    """Soft actor-critic, as in stable-baselines3."""

    buffer_size: Many = 300_000
    """Agent steps that are remembered."""
    learning_starts: Count = 1000
    """Agent steps of random actions before the first update."""
    batch_size: Many = 256
    """Agent steps per gradient step."""
    tau: Annotated[Real, Field(gt=0, le=1)] = 0.005
    """How fast target networks follow."""
    train_every: Few = 1
    """Steps of every environment between two updates."""
    gradient_steps: Few = 1
    """Gradient steps per update."""
    entropy: Positive | None = None
    """Weight of the entropy; null: found on the way."""


class TQCConfig(SACConfig):
    """Truncated quantile critics, as in sb3-contrib."""

    quantiles: Few = 25
    """Per critic."""
    critics: Annotated[Few, Field(le=100)] = 2
    """How many."""
    dropped_per_critic: Annotated[int, Field(ge=0, le=10**5, strict=True)] = 2
    """The highest quantiles that are left out."""

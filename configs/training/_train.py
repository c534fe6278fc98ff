"""What a training file may say: who learns, where, by which algorithm, and how the outcome is watched.

**Steps** are agent steps everywhere: decisions of one learning arm. Two arms that learn in 64 environments make 128 of
them per control period. Where agents see graphs, a step is a decision for all arms of an episode, held for a while.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal, Self, get_args

from pydantic import Field, PrivateAttr, ValidationError, model_validator

from armtempo.configs.schema import CellTitle, FileModel, Positive
from armtempo.configs.training._algorithms import NetworkConfig, PPOConfig, SACConfig, TQCConfig
from armtempo.configs.training._base import Count, EnvironmentTraining, Few, Many, SeedNumber
from armtempo.configs.training._blend import BlendTraining
from armtempo.configs.training._coordination import CoordinationTraining
from armtempo.configs.training._ik import IKTraining
from armtempo.errors import InputError, brief


class EvaluationConfig(FileModel):
    """How the agent is watched: one undisturbed episode per cell, and some as it is trained."""

    every_steps: Count = 100_000
    """Steps between two evaluations."""
    episodes: Annotated[int, Field(ge=0, le=10**6, strict=True)] = 20
    """Disturbed episodes, over all cells together."""
    cells: Count = 8
    """In no more than so many cells, the first ones."""
    seed: SeedNumber = 10_000
    """Of the first episode."""
    select: Literal["last", "best"] = "last"
    """Which agent is kept: the last one, or the best of those that were evaluated."""


class ImitationConfig(FileModel):
    """What an agent is shown before it learns by itself: decisions of a teacher, in episodes as in training."""

    teacher: Literal["search+hold"] = "search+hold"
    """Who shows it: the policy of that name."""
    decisions: Many = 20_000
    """How many it is shown, over all cells together."""
    passes: Few = 20
    """How often it goes through them."""
    batch_size: Few = 256
    """Decisions per gradient step."""
    learning_rate: Annotated[Positive, Field(le=10)] = 1e-3
    """Of Adam."""


_ALGORITHMS = ("ppo", "sac", "tqc")


class TrainConfig(FileModel):
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
    num_envs: Few = 64
    """Environments that run side by side."""
    total_steps: Count = 1_000_000
    """Agent steps of the whole training."""
    checkpoint_every_steps: Count = 200_000
    """Agent steps between two checkpoints; besides, there is one every half minute."""
    seed: SeedNumber = 0
    """Of everything that is drawn."""
    evaluation: EvaluationConfig = EvaluationConfig()
    """How it is watched."""
    imitation: ImitationConfig | None = None
    """Who teaches it first, of graphs; null: nobody."""
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
    def environment(self) -> EnvironmentTraining:
        """The one that is given."""
        (given,) = (getattr(self, key) for key in _environment_keys(type(self)) if getattr(self, key) is not None)
        assert isinstance(given, EnvironmentTraining)  # by _one_of_each
        return given

    def changed(self, **changes: Any) -> Self:
        """The same training with other values of top-level keys; None keeps what there is.

        Raises:
            InputError: A value that a file could not have.
        """
        given = {key: value for key, value in changes.items() if value is not None}
        try:
            type(self).model_validate({**self.model_dump(exclude_unset=True), **given})
        except ValidationError as error:
            first = error.errors(include_url=False)[0]
            key = ".".join(map(str, first["loc"]))
            raise InputError(f"{key}: {first['msg']}, got {brief(first['input'])}", remedy="change it") from None
        return self.model_copy(update=given).read_from(self._source, self._text)

    @model_validator(mode="after")
    def _one_of_each(self) -> Self:
        known = _environment_keys(type(self))
        given = [key for key in known if getattr(self, key) is not None]
        if len(given) != 1:
            said = " and ".join(given) if given else "none"
            key = given[-1] if given else "coordination"
            raise ValueError(f"{key}: give one of {', '.join(known)}, got {said}")
        for key in _ALGORITHMS:
            if key in self.model_fields_set and key != self.algorithm:
                raise ValueError(f"{key}: the algorithm is {self.algorithm}; give hyper-parameters of that one alone")
        graph = self.coordination is not None and self.coordination.observation == "graph"
        if graph != (self.network.kind == "graph"):
            raise ValueError("network: kind: graph and coordination: observation: graph go together")
        if graph and self.algorithm != "ppo":
            raise ValueError("algorithm: graphs are for ppo")
        if self.imitation is not None and not graph:
            raise ValueError("imitation: needs coordination: observation: graph")
        return self


def _environment_keys(model: type[TrainConfig]) -> list[str]:
    """The keys for one kind of environment each."""
    return [
        name
        for name, field in model.model_fields.items()
        if any(isinstance(one, type) and issubclass(one, EnvironmentTraining) for one in get_args(field.annotation))
    ]

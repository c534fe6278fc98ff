"""Numbers of training files."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, StringConstraints

from armtempo.configs.schema import FileModel, Real

Share = Annotated[Real, Field(ge=0, le=1)]
Signed = Annotated[Real, Field(ge=-1, le=1)]
Count = Annotated[int, Field(ge=1, le=10**12, strict=True)]
Few = Annotated[int, Field(ge=1, le=10**5, strict=True)]
Many = Annotated[int, Field(ge=1, le=10**8, strict=True)]
SeedNumber = Annotated[int, Field(ge=0, le=2**32 - 1, strict=True)]
File = Annotated[str, StringConstraints(min_length=1, max_length=4096)]


class EnvironmentTraining(FileModel):
    """Where agents learn: what a training file says under the key of one kind of environment."""

"""Numbers of training files."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, StringConstraints

from armtempo.configs.schema import Real

Share = Annotated[Real, Field(ge=0, le=1)]


Signed = Annotated[Real, Field(ge=-1, le=1)]


Count = Annotated[int, Field(ge=1, strict=True)]


File = Annotated[str, StringConstraints(min_length=1)]

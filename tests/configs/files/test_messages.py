"""pydantic's complaints in our words: key, value and remedy, the most telling one first."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from armtempo.configs.files._messages import config_error, dotted, either, shown, with_article
from armtempo.errors import ConfigError, closest


class Wheel(BaseModel):
    model_config = ConfigDict(extra="forbid")
    radius_m: float = Field(gt=0.0, description="Radius of the\n wheel [m], ``> 0``.")


class Cart(BaseModel):
    model_config = ConfigDict(extra="forbid")
    name: str = Field(description="Its name.")
    wheels: tuple[Wheel, ...] = Field((), max_length=2)
    spare: Wheel | None = None
    span_m: tuple[float, float] = (0.0, 1.0)

    @model_validator(mode="after")
    def _rising(self) -> Cart:
        if self.span_m[0] > self.span_m[1]:
            raise ValueError("span_m.1: must not be below the first")
        return self


def complaint(**values: Any) -> ConfigError:
    with pytest.raises(ValidationError) as caught:
        Cart.model_validate(values)
    return config_error(Path("cart.yaml"), caught.value, Cart)


@pytest.mark.parametrize(
    ("values", "key", "words"),
    [
        ({"nam": "x"}, "nam", ["unknown key", "did you mean 'name'?", "known: name, wheels, spare, span_m"]),
        ({}, "name", ["missing", "add it: Its name"]),
        ({"name": 3}, "name", ["must be a valid string, got 3", "Its name"]),
        (
            {"name": "x", "wheels": [{"radius_m": 1}, {"radius_m": -1}]},
            "wheels[1].radius_m",
            ["must be greater than 0, got -1", "Radius of the wheel [m], > 0"],
        ),
        ({"name": "x", "spare": {"radius": 1}}, "spare.radius", ["did you mean 'radius_m'?", "known: radius_m"]),
        ({"name": "x", "spare": 5}, "spare", ["must be a mapping of keys to values, got 5"]),
        ({"name": "x", "span_m": [1.0]}, "span_m", ["has too few items, got [1.0]"]),
        ({"name": "x", "span_m": [2, 1]}, "span_m[1]", ["must not be below the first"]),
        ({"name": "x", "wheels": [{"radius_m": 1}] * 3}, "wheels", ["must have at most 2 items"]),
    ],
    ids=["misspelt", "missing", "type", "nested", "nested key", "no mapping", "too few", "check", "too many"],
)
def test_complaints_name_key_value_and_what_to_do(values: dict[str, Any], key: str, words: list[str]) -> None:
    error = complaint(**values)
    assert error.data["key"] == key
    assert str(error).startswith(f"cart.yaml: {key}: ")
    for word in words:
        assert word in str(error)


def test_a_value_that_a_check_points_at_is_the_one_that_is_kept() -> None:
    assert complaint(name="x", span_m=[2, 1]).data["value"] == 1


def test_words_for_keys_values_and_lists() -> None:
    assert dotted(("arms", 0, "path", "segments", 2)) == "arms[0].path.segments[2]"
    assert shown(None) == "null"
    assert shown("a\n  b") == r"'a\n b'"
    assert len(shown("x" * 100)) == 60
    assert "..." in shown("x" * 100)
    assert len(shown("x" * 58)) == 60
    assert either(["a", "b", "c"]) == "a, b or c"
    assert (with_article("ik"), with_article("blend")) == ("an ik", "a blend")
    assert closest("cel", ["cell", "arm"]) == "did you mean 'cell'? "
    assert closest("zzz", ["cell", "arm"]) == ""

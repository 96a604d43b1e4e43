"""Parameters from outside: read, bounded, refused with the bound and the nearest name."""

from __future__ import annotations

import math
from typing import Annotated, Any

import pytest
from msgspec import Meta

from services.runtime.errors import BadInput
from services.runtime.parameters import bounds, build, describe, read_assignments, read_value
from services.runtime.service import Parameters


class Gains(Parameters, frozen=True, kw_only=True):
    gain: Annotated[float, Meta(ge=0, le=5, description="how hard", extra={"unit": "1/s"})] = 1.0
    steps: Annotated[int, Meta(ge=1)] = 3
    points: tuple[tuple[float, float], ...] = ()
    law: str = "steady"
    on: bool = True


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("1", 1),
        ("1.5", 1.5),
        ("true", True),
        ("[[5, 0], [1, -4]]", [[5, 0], [1, -4]]),
        ('"quoted"', "quoted"),
        ("plain words", "plain words"),
        ("", ""),
        ("1_000", 1000),
        ("{ x = 1 }", {"x": 1}),
    ],
)
def test_values_are_json_toml_or_text(text: str, value: Any) -> None:
    assert read_value(text) == value


def test_assignments() -> None:
    assert read_assignments(["gain=2.5", "law=a=b"]) == {"gain": 2.5, "law": "a=b"}
    for bad in ("gain", "=2"):
        with pytest.raises(BadInput, match="name=value"):
            read_assignments([bad])


def test_a_record_is_built_with_its_defaults() -> None:
    assert build(Gains, {"gain": 2, "points": [[1, 2]]}) == Gains(gain=2.0, points=((1.0, 2.0),))


@pytest.mark.parametrize(
    ("values", "text"),
    [
        ({"gain": 5.1}, r"gain = 5.1.*<= 5"),
        ({"gain": -0.1}, r"gain = -0.1.*>= 0"),
        ({"gain": "much"}, r"gain = 'much'.*float"),
        ({"gain": math.nan}, r"gain = nan.*not finite"),
        ({"points": [[math.inf, 0.0]]}, "not finite"),
        ({"points": [[1, 2, 3]]}, "points"),
        ({"steps": 0}, r"steps = 0.*>= 1"),
        ({"on": 1}, "bool"),
        ({"gian": 1}, r"unknown parameter 'gian'; did you mean 'gain'\?"),
    ],
)
def test_what_is_wrong_is_refused_with_name_value_and_bound(values: dict[str, Any], text: str) -> None:
    with pytest.raises(BadInput, match=text) as caught:
        build(Gains, values, "fleet.toml")
    assert str(caught.value).startswith("fleet.toml: ")


def test_descriptions_tell_bounds_units_and_text() -> None:
    gain, steps, *_ = describe(Gains)
    assert (gain.name, gain.type, gain.default, bounds(gain), gain.unit) == ("gain", "float", 1.0, "0 to 5", "1/s")
    assert gain.text == "how hard"
    assert bounds(steps) == "at least 1"

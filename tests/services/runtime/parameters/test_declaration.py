"""``param`` declares a parameter as an annotation does."""

from __future__ import annotations

from typing import Annotated, Literal

import msgspec
import pytest
from msgspec import Meta

from services.runtime.errors import BadInput
from services.runtime.parameters.base import Parameters, param
from services.runtime.parameters.validation import build, describe_parameters


class Declared(Parameters):
    slow: float = param(0.1, 0.0, 1.0, "m/s", "Low speed.", at_most="fast")
    fast: float = param(0.2, 0.0, 1.0, "m/s", "Top speed.")
    law: Literal["pd", "pid"] = param("pd", text="The law.", live=False)
    points: tuple[tuple[float, float], ...] = param((), text="Where to.", level=2, max_length=3)
    yaw: float | None = param(None, -3.2, 3.2, "rad", "Heading.")


class Annotations(Parameters):
    slow: Annotated[float, Meta(ge=0.0, le=1.0, description="Low speed.", extra={"unit": "m/s", "at_most": "fast"})] = (
        0.1
    )
    fast: Annotated[float, Meta(ge=0.0, le=1.0, description="Top speed.", extra={"unit": "m/s"})] = 0.2
    law: Annotated[Literal["pd", "pid"], Meta(description="The law.", extra={"live": False})] = "pd"
    points: Annotated[
        tuple[tuple[float, float], ...], Meta(max_length=3, description="Where to.", extra={"level": 2})
    ] = ()
    yaw: Annotated[float, Meta(ge=-3.2, le=3.2, description="Heading.", extra={"unit": "rad"})] | None = None


def test_it_is_described_as_by_annotations() -> None:
    assert list(describe_parameters(Declared)) == list(describe_parameters(Annotations))


def test_bounds_and_relations_hold_and_the_record_is_frozen() -> None:
    made = build(Declared, {"slow": 0.15, "points": [[1, 2]], "yaw": 1})
    assert made == Declared(slow=0.15, points=((1.0, 2.0),), yaw=1.0)
    for bad in ({"fast": 1.5}, {"slow": 0.3}, {"law": "p"}, {"points": [[0, 0]] * 4}, {"yaw": 4}, {"fats": 0.1}):
        with pytest.raises(BadInput):
            build(Declared, bad)
    with pytest.raises(AttributeError):
        made.slow = 0.0  # type: ignore[misc]
    assert msgspec.structs.fields(Declared)[0].default == 0.1

"""Parameters from outside: parsed, bounded, rejected with the bound and the nearest name."""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal

import msgspec
import pytest
from msgspec import Meta

from messages.base import decoder, encode
from messages.parameters import ParameterDescription
from services.runtime.errors import BadInput
from services.runtime.parameters.base import Parameters
from services.runtime.parameters.schema import describe_length, describe_range, describe_relations, flatten, nest
from services.runtime.parameters.validation import (
    build,
    check_value,
    describe_parameters,
    read_assignments,
    read_value,
    stated,
)


class Gains(Parameters):
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
        ("1" * 5000, "1" * 5000),
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


class Limits(Parameters):
    top: Annotated[float, Meta(gt=0, lt=2, extra={"unit": "m/s"})] | None = None
    must: Annotated[int, Meta(ge=1)]


class Entry(msgspec.Struct, frozen=True):
    name: str
    at: float | None = None


class All(Parameters):
    limits: Annotated[Limits, Meta(extra={"level": 8})] | None = None
    law: Annotated[Literal["a", "b"] | None, Meta(description="which", extra={"level": 2})] = None
    path: tuple[tuple[Annotated[float, Meta(ge=-1, le=1)], float], ...] = ((0.5, 0.5),)
    seed: Annotated[int, Meta(ge=0, le=2**63 - 1, extra={"live": False})] = 0
    entries: tuple[Entry, ...] = (Entry("x"),)


def test_descriptions_of_tables_choices_lists_and_what_is_fixed() -> None:
    top, must, law, path, seed, entries = describe_parameters(All)
    assert (top.name, top.type, top.optional, top.low, top.above, top.below) == (
        "limits.top",
        "float",
        True,
        0,
        True,
        True,
    )
    assert (describe_range(top), top.level) == ("above 0 and below 2 m/s", 8)
    assert (must.name, must.default, must.optional, must.level) == ("limits.must", None, True, 8)
    assert (law.type, law.choices, law.optional, law.text, law.level) == ("str", ("a", "b"), True, "which", 2)
    assert (path.type, path.default, path.low, path.high) == ("float[][]", ((0.5, 0.5),), -1, 1)
    assert (seed.live, seed.high, law.live) == (False, None, True), "a bound that no float holds is none"
    assert (entries.type, entries.default, entries.live) == ("str", '[{"name": "x"}]', False)
    given = next(describe_parameters(All, All(limits=Limits(top=1.5, must=2))))
    assert given.default == 1.5
    for each in describe_parameters(All):
        assert decoder(ParameterDescription)(encode(each)) == each


class Band(Parameters):
    low: Annotated[float | None, Meta(extra={"at_most": "high"})] = None
    high: float = 1.0


class Bands(Parameters):
    band: Band = Band()
    slow: Annotated[float, Meta(extra={"at_most": "fast"})] = 1.0
    fast: float = 2.0
    smooth: Annotated[bool, Meta(extra={"excludes": ("band.low",)})] = False
    corners: Annotated[tuple[tuple[float, float], ...], Meta(max_length=4)] = ()
    name: Annotated[str, Meta(max_length=8)] = ""
    names: tuple[Annotated[str, Meta(min_length=1, max_length=8)], ...] = ()


def test_descriptions_tell_lengths_and_what_holds_between_parameters() -> None:
    low, high, slow, fast, smooth, corners, name, names = describe_parameters(Bands)
    assert (low.at_most, high.at_most, slow.at_most, fast.at_most) == ("band.high", "", "fast", "")
    assert (smooth.excludes, low.excludes) == (("band.low",), ())
    assert (corners.shortest, corners.longest) == ((0, 2), (4, 2))
    assert (name.shortest, name.longest, names.shortest, names.longest) == ((0,), (8,), (0, 1), (0, 8))
    assert (describe_length(corners), describe_length(name)) == (
        "at most 4 items, 2 items each",
        "at most 8 characters",
    )
    assert describe_length(names) == "at least 1 and at most 8 characters each"
    assert (describe_relations(slow), describe_relations(smooth)) == ("at most fast", "not with band.low")


def test_values_that_contradict_each_other_are_refused_wherever_they_come_from() -> None:
    assert build(Bands, {"slow": 3, "fast": 3, "band": {"low": None, "high": -1}}).slow == 3
    for values, says in (
        ({"slow": 3}, "here: slow = 3.0 is above fast = 2.0, which it may not exceed"),
        ({"band": {"low": 2}}, "band.low = 2.0 is above band.high = 1.0"),
        ({"smooth": True, "band": {"low": 0}}, "smooth = True and band.low = 0.0 exclude each other"),
    ):
        with pytest.raises(BadInput, match=says):
            build(Bands, values, "here")


@pytest.mark.parametrize("record", [All(), All(limits=Limits(must=3), law="b", path=((1.0, 0.0), (0.0, 1.0)))])
def test_a_record_taken_apart_is_put_together_again(record: All) -> None:
    assert build(All, nest(All, flatten(record))) == record


def test_what_a_table_states_is_told_by_dotted_names() -> None:
    assert stated(All, {"limits": {"must": 2}, "law": "a"}) == {"limits.must": 2, "law": "a"}
    for name, value, says in (
        ("limits.top", 2.5, "< 2"),
        ("limits.topp", 1.0, "did you mean 'limits.top'"),
        ("law", "c", "law = 'c'"),
        ("seed", 1, "cannot change while"),
        ("entries", "[]", "cannot change while"),
        ("limits.top", math.inf, "not finite"),
    ):
        with pytest.raises(BadInput, match=says):
            check_value(All, name, value, "here")
    check_value(All, "limits.top", None)


def test_descriptions_tell_bounds_units_and_text() -> None:
    gain, steps, *_ = describe_parameters(Gains)
    assert (gain.name, gain.type, gain.default, describe_range(gain)) == ("gain", "float", 1.0, "0 to 5 1/s")
    assert gain.text == "how hard"
    assert describe_range(steps) == "at least 1"

"""Checking values against descriptions: valid ones, rejected ones with the reason, and clamped ones."""

from __future__ import annotations

import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from messages.base import LARGEST
from messages.parameters import ParameterDescription
from services.params.value_check import describe_expected, fit, parse_type
from services.runtime.errors import BadInput
from services.runtime.parameters.schema import describe_range
from tests.messages.strategies import DETERMINISTIC


def described(**given: Any) -> ParameterDescription:
    return ParameterDescription(**{"name": "p", **given})


@pytest.mark.parametrize(
    ("kind", "value", "taken"),
    [
        ("bool", True, True),
        ("int", 3, 3),
        ("float", 3, 3.0),
        ("float", 3.5, 3.5),
        ("str", "sine", "sine"),
        ("float[]", (1, 2.5), (1.0, 2.5)),
        ("float[]", (), ()),
        ("float[][]", ((1, 2), (3.0, 4)), ((1.0, 2.0), (3.0, 4.0))),
        ("bool[]", (True, False), (True, False)),
        ("str[]", ("a", "b"), ("a", "b")),
    ],
)
def test_what_fits_comes_in_the_parameters_type(kind: str, value: Any, taken: Any) -> None:
    fitted = fit(described(type=kind), value).value
    assert repr(fitted) == repr(taken)


@pytest.mark.parametrize(
    ("kind", "value", "says"),
    [
        ("int", True, "it is a bool, expected int"),
        ("float", True, "it is a bool, expected float"),
        ("int", 3.0, "it is a float, expected int"),
        ("bool", 1, "it is an int, expected bool"),
        ("bool", "true", "it is a text, expected bool"),
        ("float", "1", "it is a text, expected float"),
        ("str", 1, "it is an int, expected str"),
        ("float", None, "a value is needed"),
        ("float", math.nan, "not finite"),
        ("float", math.inf, "not finite"),
        ("float", 10**13, "no number may exceed"),
        ("float[]", 1.0, "expected a list"),
        ("float", (1.0,), "expected no list"),
        ("float[]", (1.0, "x"), r"p\[1\] = 'x': it is a text"),
        ("float[]", (1.0, None), r"p\[1\] = None: it is null"),
        ("float[][]", ((1.0,), 2.0), r"p\[1\] = 2.0: expected a list"),
        ("float[][]", ((1.0, True),), r"p\[0\]\[1\] = True: it is a bool"),
    ],
)
def test_another_type_is_refused_with_its_place(kind: str, value: Any, says: str) -> None:
    with pytest.raises(BadInput, match=says):
        fit(described(type=kind), value)


@pytest.mark.parametrize(
    ("bounds", "value", "says"),
    [
        ({"low": 0, "high": 5, "unit": "m/s"}, 5.1, r"p = 5.1 is out of bounds: 0 to 5 m/s"),
        ({"low": 0, "above": True}, 0.0, "p = 0.0 is out of bounds: above 0"),
        ({"high": 5, "below": True}, 5.0, "below 5"),
        ({"low": 0, "high": 5, "above": True}, 6.0, "above 0 and at most 5"),
        ({"low": 1}, -LARGEST, "at least 1"),
    ],
)
def test_out_of_bounds_is_refused_with_the_bound_and_the_value(bounds: Any, value: float, says: str) -> None:
    with pytest.raises(BadInput, match=says):
        fit(described(**bounds), value)


def test_a_choice_is_one_of_them() -> None:
    with pytest.raises(BadInput, match="p = 'sin': expected one of step, sine"):
        fit(described(type="str", choices=("step", "sine")), "sin")


def test_a_choice_is_named_by_what_it_stands_for_too() -> None:
    """For a ROS enum: by name first, then by its number, as number or text, or by its string value."""
    kinds = described(type="str", choices=("step", "sine", "0"), choice_values=("0", "1", "2"))
    given: dict[Any, str] = {
        "sine": "sine",
        1: "sine",
        "1": "sine",
        " 1 ": "sine",
        2.0: "0",
        "0": "0",
        0: "step",
    }
    assert {each: fit(kinds, each).value for each in given} == given
    for wrong in (3, "3", "sin", 1.5, float("nan")):
        with pytest.raises(BadInput, match=r"one of step \(0\), sine \(1\), 0 \(2\)"):
            fit(kinds, wrong)
    with pytest.raises(BadInput, match="expected str"):
        fit(kinds, value=True)
    sizes = described(type="str", choices=("Small", "Large"), choice_values=("s", "l"))
    assert fit(sizes, "l").value == "Large"


LISTS = {"type": "float[][]", "shortest": (1, 2), "longest": (3, 2)}


@pytest.mark.parametrize(
    ("bounds", "value", "says"),
    [
        (LISTS, (), r"it has length 0, expected float\[\]\[\], at least 1 and at most 3 items, 2 items each"),
        (LISTS, ((1, 2),) * 4, "it has length 4"),
        (LISTS, ((1, 2), (1, 2, 3)), r"p\[1\] = \(1, 2, 3\): it has length 3"),
        ({"type": "str", "shortest": (0,), "longest": (4,)}, "abcde", "length 5, expected str, at most 4 characters"),
        ({"type": "str[]", "shortest": (0, 1), "longest": (0, 0)}, ("a", ""), r"p\[1\] = '': it has length 0"),
    ],
)
def test_lists_and_texts_have_the_length_that_their_record_wants(bounds: Any, value: Any, says: str) -> None:
    with pytest.raises(BadInput, match=says):
        fit(described(**bounds), value)
    with pytest.raises(BadInput, match=says):
        fit(described(**bounds), value, clamp=True)
    assert fit(described(**LISTS), ((1, 2), (3, 4))).value == ((1.0, 2.0), (3.0, 4.0))


def test_whole_numbers_have_64_bits_and_no_int_is_too_large_to_be_refused() -> None:
    assert fit(described(type="int"), 2**63 - 1).value == 2**63 - 1
    with pytest.raises(BadInput, match="an int has 64 bits"):
        fit(described(type="int"), 2**63)
    with pytest.raises(BadInput, match="no number may exceed"):
        fit(described(), 10**400)


def test_null_is_for_optional_ones() -> None:
    assert fit(described(optional=True), None).value is None
    assert describe_expected(described(optional=True, low=0)) == "float or null, at least 0"


def test_a_clamp_says_what_it_did() -> None:
    fitted = fit(described(type="float[]", low=-1, high=1), (0.5, 7.0, -3), clamp=True)
    assert fitted.value == (0.5, 1.0, -1.0)
    assert fitted.notes == ("p[1] = 7.0 was clamped to 1.0 (-1 to 1)", "p[2] = -3.0 was clamped to -1.0 (-1 to 1)")


def test_a_clamp_does_not_invent_a_value_beside_an_excluded_bound() -> None:
    assert fit(described(type="int", low=0, above=True), -5, clamp=True).value == 1
    with pytest.raises(BadInput, match="the bound itself is excluded"):
        fit(described(low=0, above=True), -5.0, clamp=True)
    with pytest.raises(BadInput, match="not finite"):
        fit(described(low=0), math.nan, clamp=True)
    for empty in ({"low": 0.2, "high": 0.8}, {"low": 0, "high": 1, "above": True, "below": True}):
        with pytest.raises(BadInput, match="it cannot be clamped"):
            fit(described(type="int", **empty), -5, clamp=True)


NUMBERS = st.one_of(st.integers(-200, 200), st.floats(-200, 200))
BOUNDS = st.tuples(st.floats(-100, 0), st.floats(0, 100), st.booleans(), st.booleans()).map(
    lambda b: {"low": b[0], "high": b[1], "above": b[2], "below": b[3]}
)


@DETERMINISTIC
@given(kind=st.sampled_from(("int", "float")), bounds=BOUNDS, value=NUMBERS)
def test_whatever_is_taken_lies_within_and_a_clamp_moves_nothing_that_fits(
    kind: str, bounds: dict[str, Any], value: float
) -> None:
    one = described(type=kind, **bounds)
    try:
        fitted = fit(one, value).value
    except BadInput:
        fitted = None
    else:
        assert fit(one, value, clamp=True) == (fitted, ())
    try:
        clamped = fit(one, value, clamp=True).value
    except BadInput:
        return
    assert isinstance(clamped, float if kind == "float" else int)
    assert fit(one, clamped).value == clamped
    if fitted is None:
        assert clamped != value


def test_types_and_bounds_in_words() -> None:
    assert parse_type("float[][]") == ("float", 2)
    assert parse_type("float[][][]") is None
    assert parse_type("double") is None
    assert describe_range(described()) == ""
    assert describe_range(described(low=0.1, high=3, unit="rad")) == "0.1 to 3 rad"

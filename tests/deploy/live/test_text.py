"""Messages as text: YAML that can be read back, truncated lists, CSV rows."""

from __future__ import annotations

import csv
import io
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from deploy.live.message_format import csv_cells, csv_row, to_flow_yaml, to_yaml, truncate
from messages.nav import Odometry
from messages.plain import plain_record
from models.yaml_reader import read_yaml

TEXTS = st.text(max_size=20)
SCALARS = st.none() | st.booleans() | st.integers(-(2**63), 2**63) | st.floats(allow_nan=False) | TEXTS
VALUES = st.recursive(
    SCALARS, lambda inner: st.lists(inner, max_size=4) | st.dictionaries(TEXTS, inner, max_size=4), max_leaves=12
)
ODOMETRY = plain_record(Odometry())


@pytest.mark.slow
@settings(deadline=None)  # the first example imports yaml
@given(VALUES)
def test_both_styles_read_back(value: Any) -> None:
    assert read_yaml(to_yaml(value)) == value
    assert read_yaml(to_flow_yaml(value)) == value
    assert to_flow_yaml(value).isprintable()


@pytest.mark.parametrize(
    "text", ["", "yes", "Null", "1e3", "0x10", "a: b", "- a", "#", "a\nb", "~", "2020-01-01", "'", '"']
)
def test_text_stays_text(text: str) -> None:
    assert read_yaml(to_yaml({text: text})) == {text: text}


def test_it_looks_as_ros_users_know_it() -> None:
    assert to_yaml(ODOMETRY).startswith(
        "header:\n  stamp:\n    sec: 0\n    nanosec: 0\n  frame_id: ''\nchild_frame_id: ''\n"
    )
    assert "      x: 0.0\n      y: 0.0\n" in to_yaml(ODOMETRY)
    assert "  covariance:\n  - 0.0\n" in to_yaml(ODOMETRY)


def test_long_lists_are_cut() -> None:
    value = {"list": list(range(200)), "text": "x" * 200, "data": bytes(200)}
    cut = truncate(value)
    assert [len(each) for each in cut.values()] == [129, 131, 129]
    assert to_yaml(cut).count("- ...\n") == 2
    assert truncate(value, most=None)["list"] == value["list"]
    assert truncate(value, arrays=False, strings=False) == {
        "list": "<array of 200 values>",
        "text": "<string of 200 characters>",
        "data": "<array of 200 bytes>",
    }


def test_rows() -> None:
    value = {"a": [1.5, float("inf")], "b": {"c": 'x,"y'}, "d": True}
    names, values = zip(*csv_cells(value), strict=True)
    assert names == ("a[0]", "a[1]", "b.c", "d")
    assert next(csv.reader(io.StringIO(csv_row(list(values))))) == ["1.5", "inf", 'x,"y', "true"]

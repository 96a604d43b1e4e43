"""The ROS 1 parameter tree: rosmaster's semantics, limits, and the order of changes in lockstep."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import pytest

from messages.rosparam import (
    MAX_TREE_BYTES,
    RosparamDelete,
    RosparamGet,
    RosparamKey,
    RosparamSearch,
    RosparamSet,
    RosparamTree,
)
from messages.std import Empty
from services.params.parameter_tree import ParameterTreeServer, read_tree_file
from services.runtime.errors import BadInput
from services.runtime.parameters.tree import MAX_DEPTH, ParameterTree


def asked(key: str, value: Any, **more: Any) -> RosparamSet:
    return RosparamSet(key=key, value=json.dumps(value), **more)


def test_inner_nodes_are_maps_and_values_give_way() -> None:
    tree = ParameterTree()
    tree.set("gains", {"P": 1, "I": 2.5})
    assert tree.get("/gains") == {"P": 1, "I": 2.5}
    assert tree.get("/gains/P") == 1
    assert isinstance(tree.get("/gains/P"), int)
    assert tree.has("/gains/I")
    assert tree.has("/gains/")
    assert tree.has("/")
    assert not tree.has("/gains/P/deeper")
    tree.set("/gains/P/low", 3)
    assert tree.get("/gains") == {"P": {"low": 3}, "I": 2.5}
    tree.set("/gains", {"D": (1, 2)})
    assert tree.get("/") == {"gains": {"D": [1, 2]}}
    tree.set("/list", [{"name": "a", "at": [0.0, 1]}, {"name": "b"}])
    assert tree.get("/list")[0]["at"] == [0.0, 1]
    assert tree.names() == ["/gains/D", "/list"]
    tree.delete("/gains/D")
    assert tree.get("/gains") == {}
    assert tree.names() == ["/list"]
    for missing in ("/gains/D", "/nope", "/list/0"):
        with pytest.raises(KeyError, match=missing):
            tree.get(missing)
        with pytest.raises(KeyError):
            tree.delete(missing)
    with pytest.raises(KeyError, match="root"):
        tree.delete("/")


def test_what_is_read_or_written_is_a_copy() -> None:
    tree, given = ParameterTree(), {"a": [1]}
    tree.set("/x", given)
    given["a"].append(2)
    tree.get("/x")["a"].append(3)
    assert tree.get("/x") == {"a": [1]}


def test_search_goes_upwards_by_the_first_part() -> None:
    tree = ParameterTree({"robot_description": "top", "pr2": {"robot_description": {"base": 1}}})
    assert tree.search("/pr2/foo", "robot_description") == "/pr2/robot_description"
    assert tree.search("/pr2/foo", "robot_description/arm") == "/pr2/robot_description/arm"
    assert tree.search("/other", "robot_description") == "/robot_description"
    assert tree.search("/other", "nope") is None
    assert tree.search("/x", "/robot_description") == "/robot_description"
    assert tree.search("/x", "/nope") is None


def test_what_is_no_parameter_is_refused_with_its_name() -> None:
    tree = ParameterTree({"kept": 1})
    endless: list[Any] = []
    endless.append(endless)
    for key, value, text in (
        ("/n", None, "/n: None"),
        ("/n", {"a": [1, None]}, r"/n/a\[1\]: None"),
        ("/n", {1: 2}, "/n: the key 1"),
        ("/n", b"x", "/n: bytes"),
        ("/n", {"a": object()}, "/n/a: object"),
        ("/n", 2**63, "64 bits"),
        ("/n", endless, f"deeper than {MAX_DEPTH}"),
        ("/n", [0] * 30_000, "20000 values"),
        ("/n", "x" * (MAX_TREE_BYTES + 1), "characters"),
        ("/" + "n" * 2000, 1, "1024 characters"),
        ("/", 3, "the root"),
    ):
        with pytest.raises(BadInput, match=text):
            tree.set(key, value)
    assert tree.get("/") == {"kept": 1}


def test_json_keeps_types_order_and_numbers_that_are_none() -> None:
    tree = ParameterTree({"b": 1, "a": 1.0, "t": True, "s": "1", "far": math.inf, "none": math.nan, "é": "\ud800"})
    again = ParameterTree.from_json(tree.to_json())
    assert [type(each) for each in again.get("/").values()] == [int, float, bool, str, float, float, str]
    assert list(again.get("/")) == ["b", "a", "t", "s", "far", "none", "é"]
    for text, reason in (("[1]", "expected a map"), ("{", "not JSON"), ('{"a": null}', "/a: None")):
        with pytest.raises(BadInput, match=reason):
            ParameterTree.from_json(text)


def test_the_service_answers_and_publishes_each_change_once() -> None:
    told: list[RosparamTree] = []
    server = ParameterTreeServer(told.append, ParameterTree({"a": {"b": 1}}))
    server.publish_changes()
    server.publish_changes()
    assert [json.loads(each.tree) for each in told] == [{"a": {"b": 1}}]
    server.set(asked("/a/c", 2, writer="/n", number=1))
    server.set(asked("/d", "text", writer="/n", number=2))
    server.publish_changes()
    assert len(told) == 2
    assert told[1].revision > told[0].revision
    assert json.loads(told[1].tree) == {"a": {"b": 1, "c": 2}, "d": "text"}
    assert [(each.node, each.number) for each in told[1].writers] == [("/n", 2)]
    assert json.loads(server.get(RosparamGet(key="/a")).value) == {"b": 1, "c": 2}
    assert server.get(RosparamGet(writer="/n")).number == 2
    assert server.has(RosparamKey(key="/a/c")).data
    assert not server.has(RosparamKey(key="/x")).data
    assert server.search(RosparamSearch(namespace="/a", key="c")).key == "/a/c"
    assert server.search(RosparamSearch(namespace="/a", key="x")).key == ""
    assert server.names(Empty()).names == ("/a/b", "/a/c", "/d")
    server.delete(RosparamDelete(key="/a"))
    assert server.names(Empty()).names == ("/d",)
    for call, text in (
        (lambda: server.get(RosparamGet(key="/dd")), "did you mean '/d'"),
        (lambda: server.delete(RosparamDelete(key="/a")), "no parameter /a"),
        (lambda: server.delete(RosparamDelete(key="/")), "root"),
        (lambda: server.set(RosparamSet(key="/x", value="{")), "not JSON"),
        (lambda: server.set(asked("/", 3)), "root"),
        (lambda: server.set(asked("/x", None)), "None"),
    ):
        with pytest.raises(BadInput, match=text):
            call()


def test_a_tree_that_would_be_too_large_is_refused() -> None:
    server = ParameterTreeServer(lambda _: None)
    for number in range(4):
        server.set(asked(f"/urdf{number}", "x" * 1_000_000))
    with pytest.raises(BadInput, match="nothing was changed"):
        server.set(asked("/urdf4", "x" * 1_000_000))
    assert len(server.names(Empty()).names) == 4


def test_changes_that_wait_and_characters_that_json_escapes_count_for_the_size_of_the_tree() -> None:
    told: list[RosparamTree] = []
    server = ParameterTreeServer(told.append)
    server.set(asked("/a", "x" * 3_000_000, writer="/a", number=1, time=0))
    with pytest.raises(BadInput, match="nothing was changed"):
        server.set(asked("/b", "x" * 3_000_000, writer="/b", number=1, time=0))
    with pytest.raises(BadInput, match="nothing was changed"):
        server.set(RosparamSet(key="/c", value=json.dumps("ü" * 1_000_000, ensure_ascii=False)))
    server.tick(0, reset=False)
    server.delete(RosparamDelete(key="/a"))
    server.set(asked("/b", "x" * 3_000_000, writer="/b", number=2, time=100))  # the first one no longer waits
    server.tick(200, reset=False)
    assert server.names(Empty()).names == ("/b",)
    assert all(len(each.tree) <= MAX_TREE_BYTES for each in told)


def test_changes_of_a_tick_count_in_the_order_of_time_and_writer() -> None:
    """This holds for any order of arrival, before or after the service's own tick at that time."""
    changes = [
        asked("/who", "b", writer="/b", number=1, time=100),
        asked("/who", "a", writer="/a", number=1, time=100),
        asked("/who", "c", writer="/c", number=1, time=50),
        RosparamDelete(key="/gone", writer="/a", number=2, time=100),
    ]
    seen = []
    for order in (changes, changes[::-1]):
        told: list[RosparamTree] = []
        server = ParameterTreeServer(told.append, ParameterTree({"gone": 1}))
        server.tick(0, reset=False)
        for each in order:
            if isinstance(each, RosparamSet):
                server.set(each)
            else:
                server.delete(each)
        server.tick(100, reset=False)
        assert json.loads(told[-1].tree) == {"gone": 1, "who": "c"}
        server.tick(200, reset=False)
        assert json.loads(told[-1].tree) == {"who": "b"}
        server.set(asked("/late", 1, writer="/a", number=3, time=250))
        server.tick(0, reset=True)
        assert json.loads(told[-1].tree) == {"who": "b", "late": 1}
        seen.append(told)
    assert seen[0] == seen[1]


def test_changes_from_before_time_begins_count_from_the_first_tick() -> None:
    """Until then others read the initial tree, whichever change arrived first."""
    server = ParameterTreeServer(lambda _: None)
    server.set(asked("/x", "b", writer="/b", number=1, time=0))
    server.set(asked("/x", "a", writer="/a", number=1, time=0))
    server.set(asked("/y", 1, writer="/a", number=2, time=1))
    assert server.names(Empty()).names == ()
    server.tick(0, reset=False)
    assert server.get(RosparamGet(key="/")).value == '{"x":"b"}'
    server.tick(100, reset=False)
    assert server.names(Empty()).names == ("/x", "/y")


def test_the_file_of_the_start(tmp_path: Path) -> None:
    file = tmp_path / "tree.json"
    file.write_text('{"robot": {"wheels": 2}}')
    assert read_tree_file(str(file)).get("/robot/wheels") == 2
    assert read_tree_file("").names() == []
    file.write_text("[1]")
    with pytest.raises(BadInput, match=r"tree\.json: the tree of parameters is list"):
        read_tree_file(str(file))
    with pytest.raises(BadInput, match="missing"):
        read_tree_file(str(tmp_path / "missing.json"))

"""Remapping rules: written ``from:=to``, resolved on both sides, exact, not transitive, the first one wins."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from messages.names import BadName, Identity, Remap, parse_assignment, parse_remap, remap, resolve
from tests.messages.strategies import DETERMINISTIC
from tests.messages.test_names import ABSOLUTE, PART, PRIVATE, RELATIVE


def apply(name: str, *rules: str) -> str:
    return remap(name, "/tb3_0", "waypoint", [parse_remap(rule) for rule in rules])


@pytest.mark.parametrize(
    ("name", "rule", "resolved"),
    [
        ("cmd_vel", "cmd_vel:=teleop/cmd_vel", "/tb3_0/teleop/cmd_vel"),
        ("cmd_vel", "cmd_vel:=/p3dx/cmd_vel", "/p3dx/cmd_vel"),
        ("cmd_vel", "/tb3_0/cmd_vel:=out", "/tb3_0/out"),
        ("/tb3_0/cmd_vel", "cmd_vel:=out", "/tb3_0/out"),
        ("cmd_vel", "cmd_vel:=~/cmd_vel", "/tb3_0/waypoint/cmd_vel"),
        ("~/state", "~state:=state", "/tb3_0/state"),
        ("~/state", "waypoint/state:=state", "/tb3_0/state"),
        ("/clock", "/clock:=/other/clock", "/other/clock"),
        ("cmd_vel", "/cmd_vel:=out", "/tb3_0/cmd_vel"),
        ("camera/image", "camera:=eye", "/tb3_0/camera/image"),
        ("cmd_vel2", "cmd_vel:=out", "/tb3_0/cmd_vel2"),
        ("odom", "__ns:=/elsewhere", "/tb3_0/odom"),
    ],
)
def test_a_rule_matches_the_whole_resolved_name(name: str, rule: str, resolved: str) -> None:
    assert apply(name, rule) == resolved


def test_the_first_rule_wins_and_its_target_is_final() -> None:
    assert apply("a", "a:=b", "a:=c") == "/tb3_0/b"
    assert apply("a", "a:=b", "b:=c") == "/tb3_0/b"
    assert [apply(name, "a:=b", "b:=a") for name in "ab"] == ["/tb3_0/b", "/tb3_0/a"]


@DETERMINISTIC
@given(st.one_of(RELATIVE, ABSOLUTE, PRIVATE), st.one_of(RELATIVE, ABSOLUTE, PRIVATE), PART)
def test_a_rule_moves_its_origin_and_nothing_else(origin: str, target: str, other: str) -> None:
    origin = f"~{origin}" if origin.startswith("_") else origin
    rule = f"{origin}:={target}"
    assert apply(origin, rule) == resolve(target, "/tb3_0", "waypoint")
    if resolve(other, "/tb3_0", "waypoint") != resolve(origin, "/tb3_0", "waypoint"):
        assert apply(other, rule) == resolve(other, "/tb3_0", "waypoint")


def test_a_private_parameter_is_no_rule() -> None:
    assert parse_assignment("_speed:=0.3") == ("speed", "0.3")
    assert [parse_assignment(each) for each in ("__ns:=/a", "a:=_b", "/_a:=b", "~_a:=b", "_a=b")] == [None] * 5
    with pytest.raises(BadName, match=r"'_speed:=fast' is not a remapping rule: _name:=value sets .* 'speed'"):
        parse_remap("_speed:=fast")


def test_rules_read_as_written() -> None:
    assert parse_remap("cmd_vel:=/teleop/cmd_vel") == Remap("cmd_vel", "/teleop/cmd_vel")


@pytest.mark.parametrize(
    ("rules", "identity"),
    [
        ((), ("/tb3_0", "/tb3_0/waypoint")),
        (("__node:=driver",), ("/tb3_0", "/tb3_0/driver")),
        (("__name:=driver",), ("/tb3_0", "/tb3_0/driver")),
        (("__ns:=/tb3_1",), ("/tb3_1", "/tb3_1/waypoint")),
        (("__ns:=/", "__node:=x"), ("/", "/x")),
        (("__node:=first", "__name:=second", "__ns:=/a", "__ns:=/b"), ("/a", "/a/first")),
        (("cmd_vel:=out", "waypoint:=driver"), ("/tb3_0", "/tb3_0/waypoint")),
    ],
)
def test_special_rules_say_who_a_node_is(rules: tuple[str, ...], identity: tuple[str, str]) -> None:
    found = Identity.of("waypoint", "tb3_0", map(parse_remap, rules))
    assert (found.namespace, found.node) == identity


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("cmd_vel", r"'cmd_vel' is not a remapping rule: write from:=to"),
        ("cmd_vel=out", "write from:=to"),
        ("cmd_vel:out", "write from:=to"),
        (":=out", "write from:=to"),
        ("cmd_vel:=", "write from:=to"),
        ("cmd_vel:=a:=b", "in the remapping rule .*':' at position 1"),
        ("cmd vel:=out", "in the remapping rule .*' ' at position 3"),
        ("cmd_vel:=/a/*", "in the remapping rule .*wildcards are not allowed"),
        ("node:cmd_vel:=out", "':' at position 4"),
        (
            "__node:=/tb3_0/x",
            "'/tb3_0/x' is not a node name: a node name has no '/' and no '~'; __ns sets the namespace",
        ),
        ("__name:=~", "not a node name"),
        ("__node:=9", "does not start with a digit"),
        ("__ns:=/a//b", "parts are joined by a single '/'"),
        ("__ns:=~x", "a namespace is not private"),
        ("__log:=/tmp/x", "'__log' is unknown; the special rules are __node, __name, __ns"),
    ],
)
def test_what_is_no_rule_is_refused(text: str, says: str) -> None:
    with pytest.raises(BadName, match=says):
        parse_remap(text)


@pytest.mark.parametrize("name", ["a/b", "/a", "~a", "", "a b"])
def test_a_node_has_a_single_name(name: str) -> None:
    with pytest.raises(BadName):
        Identity.of(name, "/tb3_0")

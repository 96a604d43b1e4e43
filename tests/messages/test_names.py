"""Names: validity, resolution, and conversion to a Zenoh key and back."""

import re

import pytest
from hypothesis import assume, example, given
from hypothesis import strategies as st

from messages.names import BadName, Identity, absolute_namespace, key, mangle, name_of, resolve, unmangle, validate
from tests.messages.strategies import DETERMINISTIC

PART = st.from_regex(r"[A-Za-z_][A-Za-z0-9_]{0,8}", fullmatch=True)
RELATIVE = st.lists(PART, min_size=1, max_size=4).map("/".join)
ABSOLUTE = RELATIVE.map("/".__add__)
PRIVATE = st.tuples(st.sampled_from(("~", "~/")), RELATIVE).map("".join)
LEGAL = re.compile(r"(~/?|/)?[A-Za-z_][A-Za-z0-9_]*(/[A-Za-z_][A-Za-z0-9_]*)*|~")


def test_legal_names() -> None:
    names = ["odom", "camera/image", "/clock", "~", "~/state", "~state", "_hidden", "a1/_b", "A"]
    names += ["foo_", "foo_/bar", "_", "cmd__vel", "__ns", "/tb3_/odom", "/" + "a" * 246]
    for name in names:
        assert validate(name) == name


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("", "it is empty"),
        ("/", "nothing follows the '/'"),
        ("~/", "nothing follows the '/'"),
        ("//", "'/' at position 0: parts are joined by a single '/'"),
        ("//odom", "'/' at position 0: parts are joined by a single '/'"),
        ("a//b", "'/' at position 1: parts are joined by a single '/'"),
        ("~//b", "'/' at position 1: parts are joined by a single '/'"),
        ("/tb3_0/", "'/' at position 6: a name does not end in '/'"),
        ("/tb3_0/9lives", "'9' at position 7: a part does not start with a digit"),
        ("cmd vel", "' ' at position 3: a name has letters, digits, '_' and '/' only"),
        ("odom\n", r"'\\n' at position 4"),
        ("tb3-0", "'-' at position 3"),
        ("a/~b", "'~' at position 2"),
        ("~~", "'~' at position 1"),
        ("größe", "'ö' at position 2"),
        ("tb3_²", "'²' at position 4"),
        ("a%b", "'%' at position 1"),
        ("@elea/x", "'@' at position 0"),
        ("*", r"'\*' at position 0: names are written out, wildcards are not allowed"),
        ("/tb3_0/**", r"'\*' at position 7: names are written out"),
        ("a$*", r"'\$' at position 1: names are written out"),
        ("odom?x=1", r"'\?' at position 4: names are written out"),
        ("/" + "a" * 247, "a{39}'… has 248 characters; a name has at most 247"),
    ],
)
def test_illegal_names_are_refused_with_character_and_rule(name: str, says: str) -> None:
    with pytest.raises(BadName, match=says):
        validate(name)


@DETERMINISTIC
@given(st.one_of(st.text(alphabet="ab_9/~* ", max_size=12), st.text(max_size=12)))
@example("odom\n")
def test_what_is_legal_is_what_the_grammar_says(name: str) -> None:
    legal = bool(LEGAL.fullmatch(name))
    try:
        validate(name)
    except BadName:
        assert not legal
    else:
        assert legal


@pytest.mark.parametrize(
    ("name", "namespace", "resolved"),
    [
        ("odom", "/tb3_0", "/tb3_0/odom"),
        ("odom", "tb3_0", "/tb3_0/odom"),
        ("odom", "/", "/odom"),
        ("odom", "", "/odom"),
        ("camera/image", "/lab/tb3_0", "/lab/tb3_0/camera/image"),
        ("/clock", "/tb3_0", "/clock"),
        ("~state", "/tb3_0", "/tb3_0/waypoint/state"),
        ("~/state", "/tb3_0", "/tb3_0/waypoint/state"),
        ("~/a/b", "/", "/waypoint/a/b"),
        ("~", "/tb3_0", "/tb3_0/waypoint"),
    ],
)
def test_names_resolve_against_namespace_and_node(name: str, namespace: str, resolved: str) -> None:
    assert resolve(name, namespace, "waypoint") == resolved
    absolute_node = absolute_namespace(namespace).rstrip("/") + "/waypoint"
    assert resolve(name, namespace, absolute_node) == resolved


@DETERMINISTIC
@given(st.one_of(RELATIVE, ABSOLUTE, PRIVATE), st.one_of(st.just("/"), ABSOLUTE), PART)
def test_a_resolved_name_is_absolute_legal_and_final(name: str, namespace: str, node: str) -> None:
    resolved = resolve(name, namespace, node)
    assert resolved.startswith("/")
    assert validate(resolved) == resolved
    assert resolve(resolved, "/elsewhere", "other") == resolved
    assert resolved.endswith(name.lstrip("~/"))


@DETERMINISTIC
@given(ABSOLUTE)
def test_keys_and_chunks_lead_back_to_the_name(name: str) -> None:
    assert "/" + key(name) == name
    assert name_of(key(name)) == name
    assert unmangle(mangle(name)) == name
    assert "/" not in mangle(name)


@pytest.mark.slow
@DETERMINISTIC
@given(ABSOLUTE, ABSOLUTE)
def test_different_names_have_different_keys_and_chunks(one: str, other: str) -> None:
    assume(one != other)
    assert key(one) != key(other)
    assert mangle(one) != mangle(other)


def test_keys_of_the_wire() -> None:
    assert key("/tb3_0/cmd_vel") == "tb3_0/cmd_vel"
    assert mangle("/tb3_0/cmd_vel") == "%tb3_0%cmd_vel"
    assert mangle("geometry_msgs/Twist") == "geometry_msgs%Twist"


@pytest.mark.parametrize("name", ["odom", "~/odom", "", "/", "/a//b", "/**"])
def test_only_legal_absolute_names_have_a_key(name: str) -> None:
    with pytest.raises(BadName):
        key(name)


@pytest.mark.parametrize("foreign", ["", "/tb3_0/odom", "**", "tb3_0/*", "@elea/x", "a b", "odom/", "x" * 255])
def test_foreign_keys_have_no_name(foreign: str) -> None:
    with pytest.raises(BadName):
        name_of(foreign)


@pytest.mark.parametrize("text", ["", "a%b", "/a/*", "/a b", "a$", "a?b", "a#b", "a\n"])
def test_what_a_token_cannot_hold_is_not_mangled(text: str) -> None:
    with pytest.raises(BadName):
        mangle(text)


def test_a_name_is_measured_after_it_is_resolved() -> None:
    assert len(resolve("a" * 120, "/" + "b" * 125, "node")) == 247
    with pytest.raises(BadName, match="248 characters; a name has at most 247"):
        resolve("a" * 121, "/" + "b" * 125, "node")
    with pytest.raises(BadName, match="248 characters; a name has at most 247"):
        resolve("~/" + "a" * 120, "/" + "b" * 121, "node")


def test_namespaces_and_nodes_have_the_lengths_of_rmw() -> None:
    """RMW_NAMESPACE_MAX_LENGTH is 245 and RMW_NODE_NAME_MAX_NAME_LENGTH is 255, independently."""
    namespace, name = "/" + "n" * 244, "m" * 255
    identity = Identity.of(name, namespace)
    assert (identity.namespace, identity.node) == (namespace, f"{namespace}/{name}")
    assert key(identity.node) == identity.node[1:]
    with pytest.raises(BadName, match="246 characters; a namespace has at most 245"):
        absolute_namespace("n" * 245)
    with pytest.raises(BadName, match="256 characters; a node's name has at most 255"):
        Identity.of("m" * 256)
    with pytest.raises(BadName, match="501 characters; a name has at most 247"):
        resolve("~", namespace, name)


@pytest.mark.parametrize(
    ("name", "namespace", "node"),
    [
        ("odom", "/tb3-0", "n"),
        ("odom", "~x", "n"),
        ("odom", "//", "n"),
        ("~x", "/tb3_0", ""),
        ("~x", "/tb3_0", "~"),
        ("~x", "/", "a b"),
    ],
)
def test_a_bad_namespace_or_node_is_refused(name: str, namespace: str, node: str) -> None:
    with pytest.raises(BadName):
        resolve(name, namespace, node)

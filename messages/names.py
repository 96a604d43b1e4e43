"""ROS names: which are legal, how they are resolved for a node and its remapping rules, and their Zenoh keys.

A part is ``[A-Za-z_][A-Za-z0-9_]*``; parts are joined by single slashes. The rules and maximum lengths are those that
ROS 2 checks (rmw_validate_full_topic_name, rmw_validate_namespace and rmw_validate_node_name), plus the ``~name`` and
``__name`` of ROS 1. All such names are legal Zenoh keys, and none contains a wildcard.
"""

import re
from collections.abc import Iterable
from dataclasses import dataclass
from typing import NamedTuple, Self

from messages.errors import BadInput

LONGEST = 247
"""Maximum length of the absolute name of a topic or a request; rmw's RMW_TOPIC_MAX_NAME_LENGTH."""
LONGEST_NAMESPACE = 245
"""Maximum length of an absolute namespace; rmw's RMW_NAMESPACE_MAX_LENGTH."""
LONGEST_NODE = 255
"""Maximum length of a node's own name, without its namespace; rmw's RMW_NODE_NAME_MAX_NAME_LENGTH."""
_LONGEST_ABSOLUTE = LONGEST_NAMESPACE + 1 + LONGEST_NODE

_PART = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")
_ODD = re.compile(r"[^A-Za-z0-9_/]")
_UNFIT = re.compile(r"[%*$?#\s]")
_WILD = "names are written out, wildcards are not allowed"
_CHARACTERS = "a name has letters, digits, '_' and '/' only"


class BadName(BadInput):
    """A name or rule from outside is not legal; the text names it, the offending character and the rule."""


class Remap(NamedTuple):
    """A rule ``origin:=target``; both sides as written, not resolved."""

    origin: str
    target: str


NODE_RULES = ("__node", "__name")
"""Origins of the rule that renames the node itself; the second is ROS 1's."""
NAMESPACE_RULE = "__ns"
"""Origin of the rule that moves the node to another namespace."""


def validate(name: str, longest: int = LONGEST) -> str:
    """Return ``name`` if it is a legal relative, absolute or private topic name; raises BadName otherwise."""
    _measure(name, longest, "a name")
    if not name:
        raise BadName("'' is not a name: it is empty")
    if name == "~":
        return name
    body = name.removeprefix("~").removeprefix("/")
    if not body:
        raise BadName(f"{name!r} is not a name: nothing follows the {name[-1]!r}")
    start = len(name) - len(body)
    if odd := _ODD.search(name, start):
        raise _bad(name, odd.start(), _WILD if odd[0] in "*$?#" else _CHARACTERS)
    for part in body.split("/"):
        _check_part(name, part, start)
        start += len(part) + 1
    return name


def resolve(name: str, namespace: str, node: str) -> str:
    """Resolve ``name`` to its absolute name for a node.

    ``/name`` is unchanged, ``name`` is in ``namespace``, ``~/name`` and ``~name`` are below the node, ``~`` is the
    node. ``namespace`` may lack its leading slash; ``node`` is relative to it, or absolute. Raises BadName.
    """
    validate(name)
    if name.startswith("/"):
        return name
    if name.startswith("~"):
        inner = name[1:].removeprefix("/")
        owner = _absolute_node(node, namespace)
        return validate(join(owner, inner) if inner else owner)
    return validate(join(absolute_namespace(namespace), name))


def absolute_namespace(namespace: str) -> str:
    """Return ``/`` for the root (also written as an empty text), ``/tb3_0`` for ``tb3_0``; raises BadName."""
    if namespace in ("", "/"):
        return "/"
    if namespace.startswith("~"):
        raise _bad(namespace, 0, "a namespace is not private")
    absolute = "/" + namespace.removeprefix("/")
    _measure(absolute, LONGEST_NAMESPACE, "a namespace")
    validate(namespace)
    return absolute


def join(namespace: str, name: str) -> str:
    """Return ``name`` in an absolute namespace: ``/odom`` in ``/``, ``/tb3_0/odom`` in ``/tb3_0``."""
    return f"{namespace.rstrip('/')}/{name}"


def key(absolute: str) -> str:
    """Return the Zenoh key of the absolute name of a topic or node: ``tb3_0/cmd_vel`` for ``/tb3_0/cmd_vel``."""
    if not absolute.startswith("/"):
        raise BadName(f"{absolute!r} has no key: it is not absolute; resolve it first")
    return validate(absolute, _LONGEST_ABSOLUTE)[1:]


def name_of(zenoh_key: str) -> str:
    """Return the absolute topic name of a Zenoh key; raises BadName for a key that is not a topic's."""
    return validate("/" + zenoh_key)


def parse_assignment(text: str) -> tuple[str, str] | None:
    """Parse ``_name:=value``, ROS 1's syntax for a private parameter, to name and value; None for any other text."""
    origin, mark, value = text.partition(":=")
    return (origin[1:], value) if mark and origin.startswith("_") and not origin.startswith("__") else None


def parse_remap(text: str) -> Remap:
    """Parse a remapping rule ``from:=to``; raises BadName, also for ``_name:=value``, which sets a parameter."""
    if (assigned := parse_assignment(text)) is not None:
        raise BadName(
            f"{text!r} is not a remapping rule: _name:=value sets the private parameter {assigned[0]!r}; "
            "a hidden topic is written with its namespace, as /_name"
        )
    origin, mark, target = text.partition(":=")
    if not mark or not origin or not target:
        raise BadName(f"{text!r} is not a remapping rule: write from:=to, as in cmd_vel:=/teleop/cmd_vel")
    try:
        if origin in NODE_RULES:
            _node_name(target)
        elif origin == NAMESPACE_RULE:
            absolute_namespace(target)
        elif origin.startswith("__"):
            raise BadName(f"{origin!r} is unknown; the special rules are {', '.join((*NODE_RULES, NAMESPACE_RULE))}")
        else:
            validate(origin)
            validate(target)
    except BadName as error:
        raise BadName(f"in the remapping rule {text!r}: {error}") from None
    return Remap(origin, target)


@dataclass(frozen=True)
class Identity:
    """Namespace (``/`` or ``/tb3_0``), absolute name (``/tb3_0/waypoint``) and remapping rules of a node."""

    namespace: str
    node: str
    rules: tuple[Remap, ...] = ()

    @classmethod
    def of(cls, name: str, namespace: str = "/", rules: Iterable[Remap] = ()) -> Self:
        """Apply the rules ``__node`` or ``__name`` and ``__ns``, the first of each; raises BadName."""
        rules = tuple(rules)
        name = next((rule.target for rule in rules if rule.origin in NODE_RULES), name)
        namespace = next((rule.target for rule in rules if rule.origin == NAMESPACE_RULE), namespace)
        namespace = absolute_namespace(namespace)
        return cls(namespace, _absolute_node(_node_name(name), namespace), rules)

    def resolve(self, name: str) -> str:
        """Return the absolute name of ``name`` after remapping; raises BadName."""
        return remap(name, self.namespace, self.node, self.rules)

    def key(self, name: str) -> str:
        """Return the Zenoh key of ``name`` after remapping; raises BadName."""
        return key(self.resolve(name))


def remap(name: str, namespace: str, node: str, rules: Iterable[Remap]) -> str:
    """Resolve ``name`` to its absolute name for a node with remapping rules.

    Both sides of a rule are resolved like ``name``; the first rule whose resolved origin equals the resolved name
    applies, and its target is not remapped again.
    """
    resolved = resolve(name, namespace, node)
    for origin, target in rules:
        special = origin in NODE_RULES or origin == NAMESPACE_RULE
        if not special and resolve(origin, namespace, node) == resolved:
            return resolve(target, namespace, node)
    return resolved


def mangle(text: str) -> str:
    """Encode a name or type as one chunk of a liveliness token's key: ``%tb3_0%cmd_vel`` for ``/tb3_0/cmd_vel``."""
    if unfit := _UNFIT.search(text):
        raise _bad(text, unfit.start(), "a token's key cannot hold it")
    if not text:
        raise BadName("'' is not a name: it is empty")
    return text.replace("/", "%")


def unmangle(chunk: str) -> str:
    """Decode a chunk encoded by ``mangle``, without validation."""
    return chunk.replace("%", "/")


def _absolute_node(node: str, namespace: str) -> str:
    """Return the absolute name of a node, given relative to its namespace or absolute."""
    if node.startswith("/"):
        return validate(node, _LONGEST_ABSOLUTE)
    return join(absolute_namespace(namespace), _node_name(node))


def _node_name(name: str) -> str:
    if "/" in name or "~" in name:
        raise BadName(
            f"{name!r} is not a node name: a node name has no '/' and no '~'; {NAMESPACE_RULE} sets the namespace"
        )
    _measure(name, LONGEST_NODE, "a node's name")
    return validate(name, LONGEST_NODE)


def _measure(name: str, longest: int, what: str) -> None:
    if len(name) > longest:
        raise BadName(f"{name[:40]!r}… has {len(name)} characters; {what} has at most {longest}")


def _check_part(name: str, part: str, start: int) -> None:
    if not part:
        at_end = start == len(name)
        raise _bad(name, start - 1, "a name does not end in '/'" if at_end else "parts are joined by a single '/'")
    if not _PART.fullmatch(part):
        raise _bad(name, start, "a part does not start with a digit")


def _bad(name: str, position: int, rule: str) -> BadName:
    return BadName(f"{name!r} is not a name: {name[position]!r} at position {position}: {rule}")

"""Definitions of messages, services and actions, and the parser of ``.msg``, ``.srv`` and ``.action`` files.

The syntax is that of both ROS 1 (genmsg) and ROS 2 (rosidl): one field or constant per line, comments after ``#``.
``time`` and ``duration`` of ROS 1 correspond to ``builtin_interfaces/Time`` and ``Duration`` of ROS 2; both are
accepted, and ``ros1_form`` and ``ros2_form`` convert between them.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import NamedTuple

from messages.errors import BadInput

SIZES = {
    "bool": ("?", 1),
    "byte": ("B", 1),
    "char": ("B", 1),
    "uint8": ("B", 1),
    "int8": ("b", 1),
    "uint16": ("H", 2),
    "int16": ("h", 2),
    "uint32": ("I", 4),
    "int32": ("i", 4),
    "uint64": ("Q", 8),
    "int64": ("q", 8),
    "float32": ("f", 4),
    "float64": ("d", 8),
}
"""The ``struct`` code and the size in bytes of each number type."""

TIMES = {"time": "builtin_interfaces/Time", "duration": "builtin_interfaces/Duration"}
"""The time types by their ROS 1 names."""
SIMPLE = frozenset((*SIZES, "string"))
"""Primitive types and strings, in ROS 1 and ROS 2."""

MOST_LINES = 10_000
"""Maximum number of lines of a definition."""

Scalar = bool | int | float | str

_ROS1_TIMES = {ros2: ros1 for ros1, ros2 in TIMES.items()}
_FIELD = re.compile(
    r"([A-Za-z][\w/]*)(?:<=\d{1,12})?(?:\[(<=)?(\d{0,12})\])?\s+([A-Za-z]\w*)(?:\s+(?!=)(.*))?", re.ASCII
)
_CONSTANT = re.compile(r"([A-Za-z][\w/]*)(?:<=\d{1,12})?\s+([A-Za-z]\w*)\s*=\s*(.*)", re.ASCII)
_STRING_CONSTANT = re.compile(r"\s*w?string(?:<=\d{1,12})?\s+[A-Za-z]\w*\s*=", re.ASCII)
_DIVIDER = re.compile(r"\s*---\s*")
_RANGES = {
    name: (-(1 << 8 * size - 1), (1 << 8 * size - 1) - 1) if code.islower() else (0, (1 << 8 * size) - 1)
    for name, (code, size) in SIZES.items()
    if code not in "?fd"
} | {"byte": (-128, 255)}


class BadDefinition(BadInput):
    """A text is not a valid definition; the error names the place."""


class Field(NamedTuple):
    """A field: ``extent`` is None for a single value, -1 for a sequence, else the length of the array.

    ``bound`` is the maximum length of a sequence, 0 if unbounded. ``default`` is the text of ROS 2's default value.
    """

    name: str
    type: str
    extent: int | None = None
    bound: int = 0
    default: str = ""

    def __str__(self) -> str:
        return f"{self.full_type} {self.name}"

    @property
    def full_type(self) -> str:
        """The type including array brackets."""
        match self.extent:
            case None:
                return self.type
            case -1:
                return f"{self.type}[{f'<={self.bound}' if self.bound else ''}]"
            case length:
                return f"{self.type}[{length}]"


class Constant(NamedTuple):
    """A named value of a message type; ``text`` is the value as written in the definition."""

    name: str
    type: str
    value: Scalar
    text: str

    def __str__(self) -> str:
        return f"{self.type} {self.name}={self.text}"


@dataclass(frozen=True)
class MessageDefinition:
    """A message type, ``pkg/Type``: its fields and constants in order; other types have full names, ``pkg/Type``."""

    name: str
    fields: tuple[Field, ...] = ()
    constants: tuple[Constant, ...] = ()

    @property
    def text(self) -> str:
        """The definition in ``.msg`` format, without comments."""
        return "".join(f"{line}\n" for line in (*self.constants, *self.fields))


@dataclass(frozen=True)
class ServiceDefinition:
    """A service type; its messages are named ``pkg/TypeRequest`` and ``pkg/TypeResponse``."""

    name: str
    request: MessageDefinition
    response: MessageDefinition

    @property
    def messages(self) -> tuple[MessageDefinition, ...]:
        """Request and response."""
        return self.request, self.response

    @property
    def text(self) -> str:
        """The definition in ``.srv`` format."""
        return f"{self.request.text}---\n{self.response.text}"


@dataclass(frozen=True)
class ActionDefinition:
    """An action type; its parts are named ``pkg/TypeGoal``, ``pkg/TypeResult`` and ``pkg/TypeFeedback``.

    ``messages`` are the seven messages of ROS 1, including these parts.
    """

    name: str
    goal: MessageDefinition
    result: MessageDefinition
    feedback: MessageDefinition
    messages: tuple[MessageDefinition, ...]

    @property
    def text(self) -> str:
        """The definition in ``.action`` format."""
        return f"{self.goal.text}---\n{self.result.text}---\n{self.feedback.text}"


Definitions = Mapping[str, tuple[Field, ...]]
"""Fields of each type in order, by type name (``geometry_msgs/Pose``)."""


def short_type_name(name: str) -> str:
    """Return ``geometry_msgs/Pose`` for ``geometry_msgs/msg/Pose``."""
    return name.replace("/msg/", "/", 1)


def parse_message(name: str, text: str, where: str = "") -> MessageDefinition:
    """Parse a message type from the text of its ``.msg`` file.

    Args:
        name: The type, ``pkg/Type``.
        text: The definition.
        where: The file for errors; the type's name by default.

    Raises:
        BadDefinition: A line is neither a field nor a constant, or a name is used twice.
    """
    return parse_lines(name, enumerate(text.splitlines(), 1), where or name)


def parse_service(name: str, text: str, where: str = "") -> ServiceDefinition:
    """Parse a service type from its ``.srv`` text; without '---' it is a request alone. Raises BadDefinition."""
    where = where or name
    if not any(_DIVIDER.fullmatch(line.partition("#")[0]) for line in text.splitlines()):
        text += "\n---"
    request, response = _sections(text, 2, where, "a service has a request, '---' and a response")
    return ServiceDefinition(
        name, parse_lines(f"{name}Request", request, where), parse_lines(f"{name}Response", response, where)
    )


def parse_action(name: str, text: str, where: str = "") -> ActionDefinition:
    """Parse an action type from the text of its ``.action`` file; raises BadDefinition."""
    where = where or name
    parts = _sections(text, 3, where, "an action has a goal, '---', a result, '---' and feedback")
    goal, result, feedback = (
        parse_lines(f"{name}{part}", lines, where)
        for part, lines in zip(("Goal", "Result", "Feedback"), parts, strict=True)
    )
    return ActionDefinition(name, goal, result, feedback, _action_messages(name, goal, result, feedback))


def parse_lines(name: str, lines: Iterable[tuple[int, str]], where: str) -> MessageDefinition:
    """Parse a message type from numbered lines; raises BadDefinition."""
    package = name.partition("/")[0]
    fields, constants = dict[str, Field](), dict[str, Constant]()
    for number, line in lines:
        if number > MOST_LINES:
            raise BadDefinition(f"{where}: a definition has at most {MOST_LINES} lines")
        is_text = _STRING_CONSTANT.match(line) is not None
        bare = line.strip() if is_text else line.partition("#")[0].strip()
        if not bare:
            continue
        place = f"{where}:{number}"
        if found := _CONSTANT.fullmatch(bare):
            constant = _constant(found[1], found[2], found[3], place)
            if constant.name in constants or constant.name in fields:
                raise BadDefinition(f"{place}: {constant.name} is defined twice")
            constants[constant.name] = constant
        elif found := _FIELD.fullmatch(bare):
            field = _field(package, *found.groups())
            if field.name in fields or field.name in constants:
                raise BadDefinition(f"{place}: {field.name} is defined twice")
            fields[field.name] = field
        else:
            raise BadDefinition(f"{place}: {bare[:80]!r} is not a field{_hint(bare)}")
    return MessageDefinition(name, tuple(fields.values()), tuple(constants.values()))


def ros1_form(definition: MessageDefinition) -> MessageDefinition:
    """Return the type with ROS 1's ``time`` and ``duration``, without defaults and bounds."""
    return _with_fields(
        definition,
        tuple(Field(each.name, _ROS1_TIMES.get(each.type, each.type), each.extent) for each in definition.fields),
    )


def ros2_form(definition: MessageDefinition) -> MessageDefinition:
    """Return the type with ROS 2's time types."""
    return _with_fields(
        definition, tuple(each._replace(type=TIMES.get(each.type, each.type)) for each in definition.fields)
    )


def _with_fields(definition: MessageDefinition, fields: tuple[Field, ...]) -> MessageDefinition:
    return MessageDefinition(definition.name, fields, definition.constants)


def _sections(text: str, count: int, where: str, rule: str) -> list[list[tuple[int, str]]]:
    parts: list[list[tuple[int, str]]] = [[]]
    for number, line in enumerate(text.splitlines(), 1):
        if _DIVIDER.fullmatch(line.partition("#")[0]):
            parts.append([])
            if len(parts) > count:
                raise BadDefinition(f"{where}:{number}: too many lines '---'; {rule}")
        else:
            parts[-1].append((number, line))
    if len(parts) < count:
        raise BadDefinition(f"{where}: {len(parts) - 1} lines '---' instead of {count - 1}; {rule}")
    return parts


def _field(package: str, kind: str, bounded: str | None, length: str | None, name: str, default: str | None) -> Field:
    kind = "std_msgs/Header" if kind == "Header" else short_type_name(kind)
    if kind not in SIMPLE and kind not in TIMES and kind != "wstring" and "/" not in kind:
        kind = f"{package}/{kind}"
    extent = None if length is None else -1 if bounded or not length else int(length)
    return Field(name, kind, extent, int(length) if bounded and length else 0, (default or "").strip())


def _constant(kind: str, name: str, text: str, place: str) -> Constant:
    text = text.strip()
    if kind in ("string", "wstring"):
        quoted = len(text) > 1 and text[0] == text[-1] and text[0] in "'\""
        return Constant(name, kind, text[1:-1] if quoted else text, text)
    try:
        return Constant(name, kind, _number(kind, text), text)
    except ValueError as error:
        raise BadDefinition(f"{place}: {name}: {error}") from None


def _number(kind: str, text: str) -> Scalar:
    if kind == "bool":
        word = text.lower()
        if word not in ("true", "false", "0", "1"):
            raise ValueError(f"{text[:40]!r} is not a bool")
        return word in ("true", "1")
    if kind.startswith("float"):
        return float(text)
    if kind not in _RANGES:
        raise ValueError(f"a constant cannot be of type {kind[:80]}")
    digits = text[:40]
    value = int(digits) if digits.lstrip("+-").isdigit() else int(digits, 0)
    low, high = _RANGES[kind]
    if not low <= value <= high:
        raise ValueError(f"{value} does not fit {kind}")
    return value


def _hint(bare: str) -> str:
    if re.fullmatch(r"[\w/\[\]<=]+", bare):
        return ": a type and a name are needed"
    if bare.endswith((";", ",")):
        return f": a line does not end in {bare[-1]!r}"
    return ""


def _action_messages(
    name: str, goal: MessageDefinition, result: MessageDefinition, feedback: MessageDefinition
) -> tuple[MessageDefinition, ...]:
    """Return the messages that ROS 1 generates from an action, in genaction's order."""
    header = Field("header", "std_msgs/Header")
    goal_id, status = Field("goal_id", "actionlib_msgs/GoalID"), Field("status", "actionlib_msgs/GoalStatus")
    wrapped = (
        MessageDefinition(
            f"{name}Action",
            tuple(Field(f"action_{part.lower()}", f"{name}Action{part}") for part in ("Goal", "Result", "Feedback")),
        ),
        MessageDefinition(f"{name}ActionGoal", (header, goal_id, Field("goal", goal.name))),
        MessageDefinition(f"{name}ActionResult", (header, status, Field("result", result.name))),
        MessageDefinition(f"{name}ActionFeedback", (header, status, Field("feedback", feedback.name))),
    )
    return (*wrapped, goal, result, feedback)

"""Field paths: ``pose.pose.position``, ``ranges[0]``, ``transforms.0.child_frame_id``."""

from __future__ import annotations

import re
from typing import Any

from deploy.live.shape import element_in, fields_of, record_in
from messages.base import Message
from services.runtime.errors import BadInput, unknown

Path = tuple[str, ...]
"""Names of fields and numbers of elements, as written."""

_STEP = re.compile(r"[^.\[\]/]+")
_LEGAL = re.compile(r"/?[^.\[\]/]+(?:[./][^.\[\]/]+|\[-?\d+\])*")


def parse_path(text: str) -> Path:
    """The steps of a path; raises BadInput."""
    if not _LEGAL.fullmatch(text):
        raise BadInput(f"{text!r} is not a field path: write it as pose.pose.position, or ranges[0]")
    return tuple(_STEP.findall(text))


def check_path(record: type[Message], path: Path) -> None:
    """Refuse a path that no message of this type has, before any came; raises BadInput with the nearest name."""
    kind: Any = record
    for step in path:
        inner = record_in(kind)
        if inner is not None:
            names = fields_of(inner)
            if step not in names:
                raise unknown("field", step, names, f"{inner.ROS_TYPE} in {'.'.join(path)!r}")
            kind = names[step]
        elif (element := element_in(kind)) is not None:
            _number(step, path)
            kind = element
        elif kind is not Any:
            raise BadInput(f"{'.'.join(path)!r}: there is nothing below a single value, as {step!r} asks for")


def pick(value: Any, path: Path) -> Any:
    """What lies at the path in a message shown as plain values; raises BadInput."""
    for step in path:
        if isinstance(value, dict):
            if step not in value:
                raise unknown("field", step, value, f"{'.'.join(path)!r}")
            value = value[step]
        elif isinstance(value, list):
            number = _number(step, path)
            if not -len(value) <= number < len(value):
                raise BadInput(f"{'.'.join(path)!r}: there are {len(value)} elements, no number {number}")
            value = value[number]
        else:
            raise BadInput(f"{'.'.join(path)!r}: there is nothing below a single value, as {step!r} asks for")
    return value


def completions(record: type[Message], begun: str) -> list[str]:
    """The paths that go on from what was typed so far, one step further."""
    above, _, _ = begun.rpartition(".")
    kind: Any = record
    for step in above.split(".") if above else ():
        inner = record_in(kind)
        kind = fields_of(inner).get(step) if inner is not None else element_in(kind)
    inner = record_in(kind)
    prefix = f"{above}." if above else ""
    return [f"{prefix}{name}" for name in (fields_of(inner) if inner is not None else ())]


def _number(step: str, path: Path) -> int:
    if not re.fullmatch(r"-?\d{1,9}", step):
        raise BadInput(f"{'.'.join(path)!r}: an element of a list is asked by its number, not by {step!r}")
    return int(step)

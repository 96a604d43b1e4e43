"""Looks up topics, requests and message types by name."""

from __future__ import annotations

from typing import Any

from messages.base import Message
from messages.records import RECORDS, UnknownRecord, record
from messages.requests import REQUESTS, Request
from messages.topics import TOPICS, Topic
from services.runtime.errors import BadInput


def known_topic(name: str) -> Topic[Any] | None:
    """The topic called ``name`` in some namespace; of several, the one with the longest name."""
    found = [each for each in TOPICS if name == each.name or name.endswith("/" + each.name.lstrip("~/"))]
    fitting = [each for each in found if not each.name.startswith("/") or each.name == name]
    return max(fitting, key=lambda each: len(each.name), default=None)


def known_request(name: str) -> Request[Any, Any] | None:
    """The request of an absolute name; a node's own (``~name``) lies under the name of any node."""
    for each in REQUESTS:
        if each.name == name or (each.name.startswith("~") and name.endswith(f"/{each.name[1:]}")):
            return each
    return None


def known_record(type_name: str) -> type[Message] | None:
    """The record of a ROS type in either spelling, or None when this project has none."""
    return RECORDS.get(canonical_type(type_name))


def record_by_type(type_name: str) -> type[Message]:
    """The record of a ROS type in either spelling; raises BadInput with the nearest name."""
    try:
        return record(canonical_type(type_name))
    except UnknownRecord as error:
        raise BadInput(str(error)) from None


def canonical_type(type_name: str) -> str:
    """``geometry_msgs/Twist``, however it is written: ROS 2 puts ``msg`` or ``srv`` in the middle."""
    parts = type_name.split("/")
    return "/".join((parts[0], parts[2])) if len(parts) == 3 and parts[1] in ("msg", "srv") else type_name

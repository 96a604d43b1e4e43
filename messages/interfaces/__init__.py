"""Interfaces of ROS packages: the definitions of their messages, services and actions.

``catalogue()`` knows the standard packages of both ROSes, whose definitions lie in ``packages/``, and those of a
workspace that are added to it. What ROS 1 and ROS 2 define differently is written in both forms there; on the wire a
message has ROS 2's field names.
"""

from messages.interfaces.catalogue import Catalogue, UnknownType, catalogue
from messages.interfaces.definition import (
    ActionDefinition,
    BadDefinition,
    Constant,
    Field,
    MessageDefinition,
    ServiceDefinition,
)

__all__ = [
    "ActionDefinition",
    "BadDefinition",
    "Catalogue",
    "Constant",
    "Field",
    "MessageDefinition",
    "ServiceDefinition",
    "UnknownType",
    "catalogue",
]

"""Interfaces of ROS packages: the definitions of their messages, services and actions.

``catalogue()`` contains the standard packages of ROS 1 and ROS 2, defined in ``packages/``, and the packages of a
workspace that are added to it. Where the definitions of ROS 1 and ROS 2 differ, ``packages/`` has both forms; on the
wire, a message has ROS 2's field names.
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

"""elea_msgs of ROS 1's parameters: one tree of values shared by all nodes. Values are encoded as JSON."""

from typing import Annotated, ClassVar

from msgspec import Meta

from messages.base import MOST_ITEMS, Count, Message, NameStr, Nanoseconds

MAX_TREE_BYTES = 4 << 20
"""Maximum length of the JSON text of the tree, or of one value."""

ParamKey = Annotated[str, Meta(max_length=1024)]
JsonText = Annotated[str, Meta(max_length=MAX_TREE_BYTES)]


class RosparamSet(Message, frozen=True, kw_only=True):
    """Set the value at ``key``, or with a map, a whole branch; ``value`` is its JSON text.

    ``writer`` is the node, which numbers its changes from 1 in ``number``. With a ``time`` [ns], the change is applied
    at the first later tick of the parameter service, which makes it the same in every lockstep run; 0 means before
    simulation time started. Without one, it is applied at once.
    """

    ROS_TYPE: ClassVar[str] = "elea_msgs/RosparamSet"
    key: ParamKey = ""
    value: JsonText = ""
    writer: NameStr = ""
    number: Count = 0
    time: Nanoseconds | None = None


class RosparamDelete(Message, frozen=True, kw_only=True):
    """Delete the value or branch at ``key``; the other fields are as in RosparamSet."""

    ROS_TYPE: ClassVar[str] = "elea_msgs/RosparamDelete"
    key: ParamKey = ""
    writer: NameStr = ""
    number: Count = 0
    time: Nanoseconds | None = None


class RosparamGet(Message, frozen=True, kw_only=True):
    """Get the value or branch at ``key``; ``/`` is the whole tree. ``writer`` is optional."""

    ROS_TYPE: ClassVar[str] = "elea_msgs/RosparamGet"
    key: ParamKey = "/"
    writer: NameStr = ""


class RosparamValue(Message, frozen=True, kw_only=True):
    """A value as JSON text, the revision of the tree, and the number of the requesting writer's last change in it."""

    ROS_TYPE: ClassVar[str] = "elea_msgs/RosparamValue"
    value: JsonText = "{}"
    revision: Count = 0
    number: Count = 0


class RosparamKey(Message, frozen=True, kw_only=True):
    """The absolute name of a parameter or branch; empty in a reply if none was found."""

    ROS_TYPE: ClassVar[str] = "elea_msgs/RosparamKey"
    key: ParamKey = ""


class RosparamSearch(Message, frozen=True, kw_only=True):
    """Search ``key`` in ``namespace`` and its parents."""

    ROS_TYPE: ClassVar[str] = "elea_msgs/RosparamSearch"
    namespace: ParamKey = "/"
    key: ParamKey = ""


class RosparamNames(Message, frozen=True, kw_only=True):
    """The names of all values, in the order in which they were set."""

    ROS_TYPE: ClassVar[str] = "elea_msgs/RosparamNames"
    names: tuple[str, ...] = ()


class RosparamWriter(Message, frozen=True, kw_only=True):
    """A node that has changed the tree, and the number of its last change in it."""

    ROS_TYPE: ClassVar[str] = "elea_msgs/RosparamWriter"
    node: NameStr = ""
    number: Count = 0


class RosparamTree(Message, frozen=True, kw_only=True):
    """The whole tree as JSON text, latched on ``/rosparam/tree`` after each change; ``revision`` counts the changes."""

    ROS_TYPE: ClassVar[str] = "elea_msgs/RosparamTree"
    revision: Count = 0
    tree: JsonText = "{}"
    writers: Annotated[tuple[RosparamWriter, ...], Meta(max_length=MOST_ITEMS)] = ()

"""elea_msgs of joints: efforts as in Gazebo's ``apply_joint_effort``, controllers' targets, and joint properties."""

from typing import Annotated, ClassVar, Literal

from msgspec import Meta

from messages.base import MOST_ITEMS, Finite, Message, NameStr
from messages.std import Header, Time

Effort = Annotated[float, Meta(ge=-1e6, le=1e6, extra={"unit": "N m"})]


class JointEffort(Message, frozen=True, kw_only=True):
    """An effort [N m or N] on a joint, from ``start_time`` (now, if past) for ``duration`` seconds.

    It acts while start <= time <= start + duration; with a negative duration, until the joint is cleared. On the topic
    ``joint_effort``, the joint belongs to the model of the topic's namespace.
    """

    ROS_TYPE: ClassVar[str] = "elea_msgs/JointEffort"
    joint_name: NameStr = ""
    effort: Effort = 0.0
    start_time: Time = Time()
    duration: Annotated[float, Meta(ge=-1, le=1e9, extra={"unit": "s"})] = 0.0


JointInterface = Literal["position", "velocity", "effort"]
"""The quantity by which a joint is commanded, as in ros_control."""


class JointTarget(Message, frozen=True, kw_only=True):
    """The target of one joint: a position [rad or m], a velocity [rad/s or m/s] or an effort [N m or N], depending on
    ``interface``. ``rate`` [rad/s or m/s] is the speed at which a position target moves on."""

    ROS_TYPE: ClassVar[str] = "elea_msgs/JointTarget"
    joint_name: NameStr = ""
    interface: JointInterface = "position"
    value: Finite = 0.0
    rate: Finite = 0.0


class JointCommand(Message, frozen=True, kw_only=True):
    """The targets of all joints that a controller manager commands, valid from ``header.stamp`` for ``duration``
    seconds.

    A joint that is missing from the next command, or whose command has expired, holds its position, or moves freely if
    it was commanded by effort.
    """

    ROS_TYPE: ClassVar[str] = "elea_msgs/JointCommand"
    header: Header = Header()
    duration: Annotated[float, Meta(ge=0, le=10, extra={"unit": "s"})] = 0.1
    targets: Annotated[tuple[JointTarget, ...], Meta(max_length=MOST_ITEMS)] = ()


class JointProperties(Message, frozen=True, kw_only=True):
    """Properties of a joint (URDF type, damping, friction, limits) and its state (position, rate, applied effort)."""

    ROS_TYPE: ClassVar[str] = "elea_msgs/JointProperties"
    model: str = ""
    joint_name: str = ""
    type: str = "revolute"
    damping: Finite = 0.0
    friction: Finite = 0.0
    lower: Finite | None = None
    upper: Finite | None = None
    effort_limit: Finite | None = None
    velocity_limit: Finite | None = None
    position: Finite = 0.0
    rate: Finite = 0.0
    applied_effort: Finite = 0.0
    jobs: Annotated[int, Meta(ge=0, le=1_000_000)] = 0


_END = {"unit": "deg", "live": False}
LowerEnd = Annotated[float, Meta(ge=-36_000, le=36_000, description="Lower end of the joint's range.", extra=_END)]
UpperEnd = Annotated[float, Meta(ge=-36_000, le=36_000, description="Upper end of the joint's range.", extra=_END)]
"""Parameters of services that must keep to a joint's range; a fleet sets them from the model."""

"""elea_msgs of joints: effort jobs, as Gazebo's ``apply_joint_effort`` took them, targets of controllers, and what a
joint is and does."""

from typing import Annotated, ClassVar, Literal

from msgspec import Meta

from messages.base import MOST_ITEMS, Finite, Message, NameStr
from messages.std import Header, Time

Effort = Annotated[float, Meta(ge=-1e6, le=1e6, extra={"unit": "N m"})]


class JointEffort(Message, frozen=True, kw_only=True):
    """A job: this effort on a joint, N m or N, from ``start`` (now, if that is past) for ``duration`` seconds.

    It acts while start <= time <= start + duration; a negative duration holds until the joint is cleared. On the topic
    ``joint_effort`` the joint is one of the model in whose namespace the topic lies.
    """

    ROS_TYPE: ClassVar[str] = "elea_msgs/JointEffort"
    joint_name: NameStr = ""
    effort: Effort = 0.0
    start_time: Time = Time()
    duration: Annotated[float, Meta(ge=-1, le=1e9, extra={"unit": "s"})] = 0.0


JointInterface = Literal["position", "velocity", "effort"]
"""What a joint is commanded by, as ros_control names it."""


class JointTarget(Message, frozen=True, kw_only=True):
    """The target of one joint: be at a position [rad or m], turn at a velocity [rad/s or m/s] or feel an effort [N m or
    N], as ``interface`` says. ``rate`` [rad/s or m/s] is how fast a position moves on."""

    ROS_TYPE: ClassVar[str] = "elea_msgs/JointTarget"
    joint_name: NameStr = ""
    interface: JointInterface = "position"
    value: Finite = 0.0
    rate: Finite = 0.0


class JointCommand(Message, frozen=True, kw_only=True):
    """The targets of all joints that a controller manager commands, as of ``header.stamp``, for ``duration`` seconds.

    A joint that is not among the next ones, or whose time is over, is held where it is, or free if it felt an effort.
    """

    ROS_TYPE: ClassVar[str] = "elea_msgs/JointCommand"
    header: Header = Header()
    duration: Annotated[float, Meta(ge=0, le=10, extra={"unit": "s"})] = 0.1
    targets: Annotated[tuple[JointTarget, ...], Meta(max_length=MOST_ITEMS)] = ()


class JointProperties(Message, frozen=True, kw_only=True):
    """What a joint is (its URDF type, damping, friction and limits) and does (position, rate, applied effort)."""

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
"""Parameters of every service of a set that must keep to a joint's range; a fleet wires those of the model."""

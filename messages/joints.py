"""elea_msgs of joints: effort jobs, as Gazebo's ``apply_joint_effort`` took them, and what a joint is and does."""

from typing import Annotated, ClassVar

from msgspec import Meta

from messages.base import Finite, Message, NameStr
from messages.std import Time

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

"""control_msgs: what a controller of one joint wants, sees and does."""

from typing import ClassVar

from messages.base import Finite, Message
from messages.std import Header


class JointControllerState(Message, frozen=True, kw_only=True):
    """One tick of a controller; ``header.stamp`` is the time of the tick.

    ``command`` is the effort [N m]; ``p``, ``i`` and ``d`` are the gains in force, ``i_clamp`` bounds the integral's
    share of the effort. ROS leaves the unit of the rest to the controller: services/arm has degrees, degrees per second
    and N m per degree. ``time_step`` [s] is the time since the last tick, ``set_point`` what was wanted at this one.
    """

    ROS_TYPE: ClassVar[str] = "control_msgs/JointControllerState"
    header: Header = Header()
    set_point: Finite = 0.0
    process_value: Finite = 0.0
    process_value_dot: Finite = 0.0
    error: Finite = 0.0
    time_step: Finite = 0.0
    command: Finite = 0.0
    p: Finite = 0.0
    i: Finite = 0.0
    d: Finite = 0.0
    i_clamp: Finite = 0.0
    antiwindup: bool = False

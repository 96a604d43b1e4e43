"""controller_manager_msgs: the controllers of a robot and their states."""

from typing import Annotated, ClassVar

from msgspec import Meta

from messages.base import MOST_ITEMS, Message, NameStr

Names = Annotated[tuple[NameStr, ...], Meta(max_length=MOST_ITEMS)]


class ControllerState(Message, frozen=True, kw_only=True):
    """One controller: ``state`` is ``running``, ``stopped``, or ``initialized`` before its first start.

    ``claimed_interfaces`` are the joints that it commands, each as ``joint/interface``.
    """

    ROS_TYPE: ClassVar[str] = "controller_manager_msgs/ControllerState"
    name: NameStr = ""
    state: NameStr = ""
    type: NameStr = ""
    claimed_interfaces: tuple[str, ...] = ()


class ListControllersResponse(Message, frozen=True, kw_only=True):
    """All controllers, in the order of the configuration file."""

    ROS_TYPE: ClassVar[str] = "controller_manager_msgs/ListControllersResponse"
    controller: tuple[ControllerState, ...] = ()


class SwitchController(Message, frozen=True, kw_only=True):
    """Controllers to start and to stop, all at one tick. ``strictness`` 1 or 0 (best effort) skips those that
    cannot be switched; with any other value (strict, 2) nothing is switched then."""

    ROS_TYPE: ClassVar[str] = "controller_manager_msgs/SwitchController"
    start_controllers: Names = ()
    stop_controllers: Names = ()
    strictness: Annotated[int, Meta(ge=0, le=255)] = 2


class SwitchControllerResponse(Message, frozen=True, kw_only=True):
    """Whether the controllers were switched."""

    ROS_TYPE: ClassVar[str] = "controller_manager_msgs/SwitchControllerResponse"
    ok: bool = False

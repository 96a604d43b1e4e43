"""elea_msgs: what this project says that ROS has no record for: health, goals, bases, models, fleets."""

from typing import Annotated, ClassVar, Literal

from msgspec import Meta

from messages.base import Count, Message, Metres
from messages.geometry import Pose, Twist
from messages.std import Header, Time

Seconds = Annotated[float, Meta(ge=0, le=1e9, extra={"unit": "s"})]


class InputHealth(Message, frozen=True, kw_only=True):
    """What came in on one topic: samples taken, lost (gaps in sequence numbers), refused (with the last reason)."""

    ROS_TYPE: ClassVar[str] = "elea_msgs/InputHealth"
    topic: str = ""
    received: Count = 0
    lost: Count = 0
    refused: Count = 0
    foreign: Count = 0
    reason: str = ""


class OutputHealth(Message, frozen=True, kw_only=True):
    """What went out on one topic."""

    ROS_TYPE: ClassVar[str] = "elea_msgs/OutputHealth"
    topic: str = ""
    sent: Count = 0


class Health(Message, frozen=True, kw_only=True):
    """The heartbeat of a node, sent by its own loop; its absence means that the loop hangs."""

    ROS_TYPE: ClassVar[str] = "elea_msgs/Health"
    node: str = ""
    pid: Count = 0
    beat: Count = 0
    state: Literal["starting", "waiting", "running", "paused", "stopping"] = "starting"
    note: str = ""
    ticks: Count = 0
    inputs: tuple[InputHealth, ...] = ()
    outputs: tuple[OutputHealth, ...] = ()


class GoalStatus(Message, frozen=True, kw_only=True):
    """Where a robot is on its way: ``index`` of ``count`` goals, the distance left to the present one."""

    ROS_TYPE: ClassVar[str] = "elea_msgs/GoalStatus"
    header: Header = Header()
    state: Literal["idle", "driving", "reached", "finished", "waiting"] = "idle"
    index: Count = 0
    count: Count = 0
    goal: Pose = Pose()
    distance: Metres = 0.0


class BaseStatus(Message, frozen=True, kw_only=True):
    """What a base obeys and refuses; the counts grow from spawn to delete.

    ``last_command`` is the simulation time of the newest command that it took.
    """

    ROS_TYPE: ClassVar[str] = "elea_msgs/BaseStatus"
    header: Header = Header()
    model: str = ""
    source: str = ""
    timed_out: bool = False
    e_stopped: bool = False
    commands: Count = 0
    commands_timed_out: Count = 0
    stale_dropped: Count = 0
    refused: Count = 0
    last_command: Time = Time()
    colliding: bool = False
    collisions: Count = 0


class ModelState(Message, frozen=True, kw_only=True):
    """Pose and twist of a model's base in the world frame."""

    ROS_TYPE: ClassVar[str] = "elea_msgs/ModelState"
    name: str = ""
    model: str = ""
    pose: Pose = Pose()
    twist: Twist = Twist()


class ProcessState(Message, frozen=True, kw_only=True):
    """One supervised process."""

    ROS_TYPE: ClassVar[str] = "elea_msgs/ProcessState"
    name: str = ""
    state: Literal["waiting", "starting", "ready", "backing off", "stopping", "stopped", "finished", "failed"] = (
        "waiting"
    )
    pid: Count = 0
    restarts: Count = 0
    exit_status: int | None = None
    reason: str = ""


class FleetState(Message, frozen=True, kw_only=True):
    """The processes of a running fleet."""

    ROS_TYPE: ClassVar[str] = "elea_msgs/FleetState"
    fleet: str = ""
    mode: str = ""
    processes: tuple[ProcessState, ...] = ()

"""elea_msgs: what this project says that ROS has no record for: health, goals, bases, models, fleets."""

from typing import Annotated, ClassVar, Literal

from msgspec import Meta

from messages.base import MOST_ITEMS, Count, Finite, Message, Metres, NameStr
from messages.geometry import Pose, Twist
from messages.std import Header, Time

Seconds = Annotated[float, Meta(ge=0, le=1e9, extra={"unit": "s"})]


class InputHealth(Message, frozen=True, kw_only=True):
    """Input of one topic: samples received, lost (gaps in sequence numbers), and refused, with the last reason.

    ``repeated`` samples were dropped because their number does not grow; ``resynced`` counts how often a publisher's
    numbers were followed although they do not continue: it restarted under its old id, or its numbers were forged.
    ``foreign`` samples have no number.
    """

    ROS_TYPE: ClassVar[str] = "elea_msgs/InputHealth"
    topic: str = ""
    received: Count = 0
    lost: Count = 0
    refused: Count = 0
    foreign: Count = 0
    reason: str = ""
    repeated: Count = 0
    resynced: Count = 0


class OutputHealth(Message, frozen=True, kw_only=True):
    """Output on one topic."""

    ROS_TYPE: ClassVar[str] = "elea_msgs/OutputHealth"
    topic: str = ""
    sent: Count = 0


class Health(Message, frozen=True, kw_only=True):
    """The heartbeat of a node, sent by its own loop; its absence means that the loop hangs.

    ``missed`` counts ticks skipped because the node was late. ``received`` to ``sent`` are totals over all topics, of
    which the node subscribes to ``reads`` and publishes ``writes``. ``inputs`` and ``outputs`` list all of them if they
    fit into one heartbeat; of a node with hundreds, those with new trouble first and the others in turn, each every few
    heartbeats. ``refused_requests`` counts requests answered by an error, ``request_reason`` is the last one.
    """

    ROS_TYPE: ClassVar[str] = "elea_msgs/Health"
    node: str = ""
    pid: Count = 0
    beat: Count = 0
    state: Literal["starting", "waiting", "running", "paused", "stopping"] = "starting"
    note: str = ""
    ticks: Count = 0
    missed: Count = 0
    inputs: tuple[InputHealth, ...] = ()
    outputs: tuple[OutputHealth, ...] = ()
    reads: Count = 0
    writes: Count = 0
    received: Count = 0
    lost: Count = 0
    refused: Count = 0
    repeated: Count = 0
    resynced: Count = 0
    foreign: Count = 0
    sent: Count = 0
    refused_requests: Count = 0
    request_reason: str = ""


class GoalStatus(Message, frozen=True, kw_only=True):
    """Progress of a robot: ``index`` of ``count`` goals, and the distance left to the current one."""

    ROS_TYPE: ClassVar[str] = "elea_msgs/GoalStatus"
    header: Header = Header()
    state: Literal["idle", "driving", "reached", "finished", "waiting"] = "idle"
    index: Count = 0
    count: Count = 0
    goal: Pose = Pose()
    distance: Metres = 0.0


class BaseStatus(Message, frozen=True, kw_only=True):
    """The commands that a base obeys and refuses; the counts grow from spawn to delete.

    ``last_command`` is the simulation time of the newest accepted command. ``stopped_by`` names the nodes that hold
    its emergency stop.
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
    stopped_by: tuple[str, ...] = ()


class EmergencyStop(Message, frozen=True, kw_only=True):
    """One holder's emergency stop of one robot, or of all.

    ``robot`` is empty for the stop of all. ``topic`` is the one on which the holder gave it, and resets it by false.
    ``holder`` is the name of the holder's node, ``id`` what stays the same of its publisher ids through all its lives:
    their first 6 bytes in hexadecimal. ``since`` is the simulation machine's clock when it was given, ns.
    """

    ROS_TYPE: ClassVar[str] = "elea_msgs/EmergencyStop"
    robot: Annotated[str, Meta(max_length=255)] = ""
    topic: Annotated[str, Meta(max_length=255)] = ""
    holder: Annotated[str, Meta(max_length=255)] = ""
    id: Annotated[str, Meta(max_length=255)] = ""
    since: Count = 0


class EmergencyStops(Message, frozen=True, kw_only=True):
    """All emergency stops that hold at present."""

    ROS_TYPE: ClassVar[str] = "elea_msgs/EmergencyStops"
    stops: tuple[EmergencyStop, ...] = ()


MOST_CHECKS = 64
"""Checks that one node may state."""

CheckName = Annotated[str, Meta(pattern=r"^[A-Za-z_][A-Za-z0-9_]*\Z", max_length=64)]


class Check(Message, frozen=True, kw_only=True):
    """A figure that a node has measured itself, with the lowest and highest passing value; null: not measured.

    ``reason`` explains it to people.
    """

    ROS_TYPE: ClassVar[str] = "elea_msgs/Check"
    name: CheckName = "check"
    value: Finite | None = None
    min: Finite | None = None
    max: Finite | None = None
    reason: Annotated[str, Meta(max_length=200)] = ""


class Checks(Message, frozen=True, kw_only=True):
    """All checks of one node; its newest message counts."""

    ROS_TYPE: ClassVar[str] = "elea_msgs/Checks"
    node: Annotated[str, Meta(max_length=255)] = ""
    checks: Annotated[tuple[Check, ...], Meta(max_length=MOST_CHECKS)] = ()


class ModelState(Message, frozen=True, kw_only=True):
    """Pose and twist of a model's base in the world frame."""

    ROS_TYPE: ClassVar[str] = "elea_msgs/ModelState"
    name: str = ""
    model: str = ""
    pose: Pose = Pose()
    twist: Twist = Twist()


class ProcessState(Message, frozen=True, kw_only=True):
    """One supervised process; ``nodes`` are the names of those that share it, if several do."""

    ROS_TYPE: ClassVar[str] = "elea_msgs/ProcessState"
    name: str = ""
    state: Literal["waiting", "starting", "ready", "backing off", "stopping", "stopped", "finished", "failed"] = (
        "waiting"
    )
    pid: Count = 0
    restarts: Count = 0
    exit_status: int | None = None
    reason: str = ""
    nodes: tuple[str, ...] = ()


class FleetState(Message, frozen=True, kw_only=True):
    """The processes of a running fleet; ``note`` says what hinders their supervision, if anything does."""

    ROS_TYPE: ClassVar[str] = "elea_msgs/FleetState"
    fleet: str = ""
    mode: str = ""
    processes: tuple[ProcessState, ...] = ()
    note: str = ""


class LockstepState(Message, frozen=True, kw_only=True):
    """The members of lockstep, for which the simulation waits at its ticks.

    ``lost`` are the nodes without which it has continued since time began: their processes ended, did not answer, or
    never started. ``left`` are those that left in order. A node that returned is among ``members`` as well.
    """

    ROS_TYPE: ClassVar[str] = "elea_msgs/LockstepState"
    members: tuple[str, ...] = ()
    lost: tuple[str, ...] = ()
    left: tuple[str, ...] = ()


class InterfaceDefinition(Message, frozen=True, kw_only=True):
    """The definition of a message type, in the language ``ros2msg``, with the types that it uses."""

    ROS_TYPE: ClassVar[str] = "elea_msgs/InterfaceDefinition"
    type: NameStr = ""
    text: Annotated[str, Meta(max_length=1 << 16)] = ""


class InterfaceDefinitions(Message, frozen=True, kw_only=True):
    """The types that a node uses and that belong to no standard package, those of its services as two each."""

    ROS_TYPE: ClassVar[str] = "elea_msgs/InterfaceDefinitions"
    definitions: Annotated[tuple[InterfaceDefinition, ...], Meta(max_length=MOST_ITEMS)] = ()

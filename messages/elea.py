"""elea_msgs: messages for which ROS has no type: health, goals, bases, models, fleets."""

from typing import Annotated, ClassVar, Literal

from msgspec import Meta

from messages.base import MOST_ITEMS, Count, Finite, Message, Metres, NameStr
from messages.geometry import Pose, Twist
from messages.std import Header, Time

Seconds = Annotated[float, Meta(ge=0, le=1e9, extra={"unit": "s"})]


class InputHealth(Message, frozen=True, kw_only=True):
    """Counters of one subscription: samples received, lost (gaps in sequence numbers) and refused, with the last
    reason.

    ``repeated`` samples were dropped because their sequence number did not increase; ``resynced`` counts how often a
    publisher's numbers were followed although they did not continue: it restarted under its old ID, or its numbers were
    forged. ``foreign`` samples have no sequence number.
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
    """Counter of one publication."""

    ROS_TYPE: ClassVar[str] = "elea_msgs/OutputHealth"
    topic: str = ""
    sent: Count = 0


class Health(Message, frozen=True, kw_only=True):
    """The heartbeat of a node, published by its own loop; if it stops, the loop hangs.

    ``missed`` counts ticks skipped because the node was late. ``received`` to ``sent`` are totals over all topics;
    ``reads`` and ``writes`` are the numbers of topics that the node subscribes to and publishes. ``inputs`` and
    ``outputs`` list all of them if they fit into one heartbeat; for a node with hundreds, those with new faults come
    first and the others in turn, each every few heartbeats. ``refused_requests`` counts requests answered with an
    error, ``request_reason`` is the last error.
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
    """Accepted and refused commands of a base; the counts run from its spawn or the last reset of time.

    ``last_command`` is the simulation time of the newest accepted command. ``stopped_by`` names the nodes that hold its
    emergency stop.
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
    """An emergency stop of one robot, or of all, by one holder.

    ``robot`` is empty for a stop of all robots. ``topic`` is the one on which the holder published it, and on which it
    publishes false to release it. ``holder`` is the name of the holder's node, ``id`` the part of its publisher IDs
    that survives its restarts: their first 6 bytes in hexadecimal. ``since`` is the time [ns] of the stop by the clock
    of the simulation's machine.
    """

    ROS_TYPE: ClassVar[str] = "elea_msgs/EmergencyStop"
    robot: Annotated[str, Meta(max_length=255)] = ""
    topic: Annotated[str, Meta(max_length=255)] = ""
    holder: Annotated[str, Meta(max_length=255)] = ""
    id: Annotated[str, Meta(max_length=255)] = ""
    since: Count = 0


class EmergencyStops(Message, frozen=True, kw_only=True):
    """All active emergency stops."""

    ROS_TYPE: ClassVar[str] = "elea_msgs/EmergencyStops"
    stops: tuple[EmergencyStop, ...] = ()


MOST_CHECKS = 64
"""Maximum number of checks of one node."""

CheckName = Annotated[str, Meta(pattern=r"^[A-Za-z_][A-Za-z0-9_]*\Z", max_length=64)]


class Check(Message, frozen=True, kw_only=True):
    """A value measured by a node, with the lowest and highest passing value; null if not measured.

    ``reason`` explains it to users.
    """

    ROS_TYPE: ClassVar[str] = "elea_msgs/Check"
    name: CheckName = "check"
    value: Finite | None = None
    min: Finite | None = None
    max: Finite | None = None
    reason: Annotated[str, Meta(max_length=200)] = ""


class Checks(Message, frozen=True, kw_only=True):
    """All checks of one node; its newest message replaces earlier ones."""

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
    """One supervised process; ``nodes`` are the names of the nodes that share it, if there are several."""

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
    """The processes of a running fleet; ``note`` says what impairs their supervision, if anything."""

    ROS_TYPE: ClassVar[str] = "elea_msgs/FleetState"
    fleet: str = ""
    mode: str = ""
    processes: tuple[ProcessState, ...] = ()
    note: str = ""


class LockstepState(Message, frozen=True, kw_only=True):
    """The members of lockstep, for which the simulation waits at each tick.

    ``lost`` are nodes without which it has continued since simulation time started: their processes ended, did not
    answer, or never started. ``left`` are nodes that left properly. A node that returned is listed in ``members`` as
    well.
    """

    ROS_TYPE: ClassVar[str] = "elea_msgs/LockstepState"
    members: tuple[str, ...] = ()
    lost: tuple[str, ...] = ()
    left: tuple[str, ...] = ()


class InterfaceDefinition(Message, frozen=True, kw_only=True):
    """The definition of a message type and the types that it uses, in the ``ros2msg`` format."""

    ROS_TYPE: ClassVar[str] = "elea_msgs/InterfaceDefinition"
    type: NameStr = ""
    text: Annotated[str, Meta(max_length=1 << 16)] = ""


class InterfaceDefinitions(Message, frozen=True, kw_only=True):
    """The types of a node that belong to no standard package; a service type counts as two."""

    ROS_TYPE: ClassVar[str] = "elea_msgs/InterfaceDefinitions"
    definitions: Annotated[tuple[InterfaceDefinition, ...], Meta(max_length=MOST_ITEMS)] = ()

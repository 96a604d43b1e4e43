"""Requests and replies: what a service may be asked, with typed arguments and results."""

from dataclasses import dataclass
from typing import Annotated, ClassVar, Generic, TypeVar

from msgspec import Meta

from messages.base import Count, Message, Metres, Radians
from messages.elea import ModelState
from messages.geometry import Pose, Twist
from messages.parameters import (
    Announcement,
    HistoryOf,
    ParameterHistory,
    ParameterSet,
    ParameterSets,
    ParameterValues,
    ResetParameters,
    SetParameters,
    UndoParameters,
)
from messages.std import Empty

Q_co = TypeVar("Q_co", bound=Message, covariant=True)
R_co = TypeVar("R_co", bound=Message, covariant=True)


@dataclass(frozen=True)
class Request(Generic[Q_co, R_co]):
    """A named request: its ROS name (relative, absolute or private), the records asked and replied."""

    name: str
    asks: type[Q_co]
    replies: type[R_co]
    about: str


class Name(Message, frozen=True, kw_only=True):
    """The name of a model or process."""

    ROS_TYPE: ClassVar[str] = "elea_msgs/Name"
    name: str = ""


class Refusal(Message, frozen=True, kw_only=True):
    """The error reply to any request: why it was not carried out."""

    ROS_TYPE: ClassVar[str] = "elea_msgs/Refusal"
    reason: str = ""


class Done(Message, frozen=True, kw_only=True):
    """It is done; ``text`` says what."""

    ROS_TYPE: ClassVar[str] = "elea_msgs/Done"
    text: str = ""


class SpawnModel(Message, frozen=True, kw_only=True):
    """Put a model of ``models/`` into the world as ``name``, its topics in ``namespace`` (the name when empty)."""

    ROS_TYPE: ClassVar[str] = "elea_msgs/SpawnModel"
    name: str = ""
    model: str = ""
    pose: Pose = Pose()
    namespace: str = ""


class SetModelState(Message, frozen=True, kw_only=True):
    """Move a model; joint angles keep their values."""

    ROS_TYPE: ClassVar[str] = "elea_msgs/SetModelState"
    name: str = ""
    pose: Pose = Pose()
    twist: Twist = Twist()


class SetOdometry(Message, frozen=True, kw_only=True):
    """From now on, the wheel odometry of the robot ``name`` counts from here: ROS 2's ``set_odometry``."""

    ROS_TYPE: ClassVar[str] = "elea_msgs/SetOdometry"
    name: str = ""
    x: Metres = 0.0
    y: Metres = 0.0
    yaw: Radians = 0.0


Multiplier = Annotated[float, Meta(ge=0.5, le=1.5)]


class DriveSettings(Message, frozen=True, kw_only=True):
    """The live parameters of the base of the robot ``name``; asked, None leaves one as it is.

    They are replaced together between two physics steps, or, when one is out of bounds, not at all.
    """

    ROS_TYPE: ClassVar[str] = "elea_msgs/DriveSettings"
    name: str = ""
    wheel_separation_multiplier: Multiplier | None = None
    left_wheel_radius_multiplier: Multiplier | None = None
    right_wheel_radius_multiplier: Multiplier | None = None
    publish_rate: Annotated[float, Meta(ge=0, le=50, extra={"unit": "Hz"})] | None = None
    enable_odom_tf: bool | None = None


class ModelList(Message, frozen=True, kw_only=True):
    """All models in the world."""

    ROS_TYPE: ClassVar[str] = "elea_msgs/ModelList"
    models: tuple[ModelState, ...] = ()


class Steps(Message, frozen=True, kw_only=True):
    """A number of physics steps to run while paused."""

    ROS_TYPE: ClassVar[str] = "elea_msgs/Steps"
    count: Annotated[int, Meta(ge=1, le=1_000_000)] = 1


class SimTime(Message, frozen=True, kw_only=True):
    """Where the simulation stands, in ns and in physics steps since the last reset."""

    ROS_TYPE: ClassVar[str] = "elea_msgs/SimTime"
    time: Count = 0
    tick: Count = 0
    epoch: Count = 0


SPAWN = Request("/sim/spawn", SpawnModel, ModelState, "put a model into the world")
DELETE = Request("/sim/delete", Name, Done, "take a model out of the world")
LIST = Request("/sim/list", Empty, ModelList, "all models with their poses and twists")
GET_STATE = Request("/sim/get_state", Name, ModelState, "pose and twist of one model")
SET_STATE = Request("/sim/set_state", SetModelState, ModelState, "move a model")
SET_ODOMETRY = Request("/sim/set_odometry", SetOdometry, Done, "say where a robot's wheel odometry is from now on")
SET_DRIVE = Request("/sim/set_drive", DriveSettings, DriveSettings, "change a base's live parameters, all or none")
RESET = Request("/sim/reset", Empty, SimTime, "time to zero and all models to where they were spawned")
RESET_WORLD = Request("/sim/reset_world", Empty, SimTime, "all models to where they were spawned; time goes on")
PAUSE = Request("/sim/pause", Empty, SimTime, "stop simulation time")
RESUME = Request("/sim/resume", Empty, SimTime, "let simulation time go on")
STEP = Request("/sim/step", Steps, SimTime, "run some physics steps while paused")

SUPERVISOR_START = Request("/supervisor/start", Name, Done, "start a stopped process of the fleet")
SUPERVISOR_STOP = Request("/supervisor/stop", Name, Done, "stop a process of the fleet")
SUPERVISOR_RESTART = Request("/supervisor/restart", Name, Done, "stop and start a process of the fleet")

PARAMS_ANNOUNCE = Request("/params/announce", Announcement, ParameterValues, "say which parameters a node has")
PARAMS_LIST = Request("/params/list", Empty, ParameterSets, "all sets of parameters, described")
PARAMS_GET = Request("/params/get", ParameterSet, ParameterValues, "the effective values of a set")
PARAMS_SET = Request("/params/set", SetParameters, ParameterValues, "change parameters of a set, all or none")
PARAMS_RESET = Request("/params/reset", ResetParameters, ParameterValues, "forget what was set")
PARAMS_UNDO = Request("/params/undo", UndoParameters, ParameterValues, "take the newest change of a set back")
PARAMS_HISTORY = Request("/params/history", HistoryOf, ParameterHistory, "who changed what, and when")

REQUESTS: tuple[Request[Message, Message], ...] = (
    SPAWN,
    DELETE,
    LIST,
    GET_STATE,
    SET_STATE,
    SET_ODOMETRY,
    SET_DRIVE,
    RESET,
    RESET_WORLD,
    PAUSE,
    RESUME,
    STEP,
    SUPERVISOR_START,
    SUPERVISOR_STOP,
    SUPERVISOR_RESTART,
    PARAMS_ANNOUNCE,
    PARAMS_LIST,
    PARAMS_GET,
    PARAMS_SET,
    PARAMS_RESET,
    PARAMS_UNDO,
    PARAMS_HISTORY,
)
"""Every request of this project."""

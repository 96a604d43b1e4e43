"""Requests and replies: what a service may be asked, with typed arguments and results."""

from dataclasses import dataclass
from typing import ClassVar, Generic, TypeVar

from messages.base import Message, NameStr
from messages.elea import EmergencyStops, ModelState
from messages.gazebo import (
    ApplyEffort,
    ApplyWrench,
    JointName,
    LinkName,
    LinkProperties,
    LinkState,
    ModelProperties,
    SetConfiguration,
    WorldProperties,
)
from messages.joints import JointProperties
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
from messages.sensor import JointState
from messages.simulation import (
    DriveSettings,
    GetModelState,
    ModelList,
    ReleaseStop,
    SetModelState,
    SetOdometry,
    SimTime,
    SpawnModel,
    Steps,
)
from messages.std import Empty

Q_co = TypeVar("Q_co", bound=Message, covariant=True)
R_co = TypeVar("R_co", bound=Message, covariant=True)


MAX_REQUEST_BYTES = 1 << 16
"""Bytes that a request may have, unless it says otherwise."""


@dataclass(frozen=True)
class Request(Generic[Q_co, R_co]):
    """A named request: its ROS name (relative, absolute or private), the records asked and replied.

    A request of more than ``largest`` bytes is refused unread.
    """

    name: str
    request_type: type[Q_co]
    response_type: type[R_co]
    about: str
    largest: int = MAX_REQUEST_BYTES


class Name(Message, frozen=True, kw_only=True):
    """The name of a model or process."""

    ROS_TYPE: ClassVar[str] = "elea_msgs/Name"
    name: NameStr = ""


class Refusal(Message, frozen=True, kw_only=True):
    """The error reply to any request: why it was not carried out."""

    ROS_TYPE: ClassVar[str] = "elea_msgs/Refusal"
    reason: str = ""


class Done(Message, frozen=True, kw_only=True):
    """It is done; ``text`` says what."""

    ROS_TYPE: ClassVar[str] = "elea_msgs/Done"
    text: str = ""


SPAWN = Request("/sim/spawn", SpawnModel, ModelState, "put a model into the world", 1 << 20)
DELETE = Request("/sim/delete", Name, Done, "take a model out of the world")
LIST = Request("/sim/list", Empty, ModelList, "all models with their poses and twists")
GET_STATE = Request(
    "/sim/get_state", GetModelState, ModelState, "pose and twist of one model, in the world or relative"
)
SET_STATE = Request("/sim/set_state", SetModelState, ModelState, "move a model")
SET_ODOMETRY = Request("/sim/set_odometry", SetOdometry, Done, "say where a robot's wheel odometry is from now on")
SET_DRIVE = Request("/sim/set_drive", DriveSettings, DriveSettings, "change a base's live parameters, all or none")
RESET = Request("/sim/reset", Empty, SimTime, "time to zero and all models to where they were spawned")
RESET_WORLD = Request("/sim/reset_world", Empty, SimTime, "all models to where they were spawned; time goes on")
PAUSE = Request("/sim/pause", Empty, SimTime, "stop simulation time")
RESUME = Request("/sim/resume", Empty, SimTime, "let simulation time go on")
STEP = Request("/sim/step", Steps, SimTime, "run some physics steps while paused")
LIST_STOPS = Request("/sim/list_stops", Empty, EmergencyStops, "who holds which emergency stop")
RELEASE_STOP = Request("/sim/release_stop", ReleaseStop, Done, "release the emergency stops of holders that are gone")
APPLY_EFFORT = Request("/sim/apply_effort", ApplyEffort, Done, "put an effort on a joint, for a time")
CLEAR_EFFORT = Request("/sim/clear_effort", JointName, Done, "drop the efforts on a joint, waiting ones too")
JOINT_PROPERTIES = Request("/sim/joint_properties", JointName, JointProperties, "what a joint is and does")
SET_CONFIGURATION = Request("/sim/set_configuration", SetConfiguration, JointState, "put joints at positions")
APPLY_WRENCH = Request("/sim/apply_wrench", ApplyWrench, Done, "push and twist a link, for a time")
CLEAR_WRENCH = Request("/sim/clear_wrench", LinkName, Done, "drop the wrenches on a link")
LINK_STATE = Request("/sim/link_state", LinkName, LinkState, "pose and twist of one link")
LINK_PROPERTIES = Request("/sim/link_properties", LinkName, LinkProperties, "mass, inertia and friction of one link")
MODEL_PROPERTIES = Request("/sim/model_properties", Name, ModelProperties, "what a model is made of")
WORLD_PROPERTIES = Request("/sim/world_properties", Empty, WorldProperties, "the world, its physics and its time")

SUPERVISOR_START = Request("/supervisor/start", Name, Done, "start a stopped process of the fleet")
SUPERVISOR_STOP = Request("/supervisor/stop", Name, Done, "stop a process of the fleet")
SUPERVISOR_RESTART = Request("/supervisor/restart", Name, Done, "stop and start a process of the fleet")

PARAMS_ANNOUNCE = Request("/params/announce", Announcement, ParameterValues, "say which parameters a node has", 1 << 20)
PARAMS_LIST = Request("/params/list", Empty, ParameterSets, "all sets of parameters, described")
PARAMS_GET = Request("/params/get", ParameterSet, ParameterValues, "the effective values of a set")
PARAMS_SET = Request("/params/set", SetParameters, ParameterValues, "change parameters of a set, all or none", 1 << 19)
PARAMS_RESET = Request("/params/reset", ResetParameters, ParameterValues, "forget what was set")
PARAMS_UNDO = Request("/params/undo", UndoParameters, ParameterValues, "take the newest change of a set back")
PARAMS_HISTORY = Request("/params/history", HistoryOf, ParameterHistory, "who changed what, and when")

SIM_REQUESTS: tuple[Request[Message, Message], ...] = (
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
    LIST_STOPS,
    RELEASE_STOP,
    APPLY_EFFORT,
    CLEAR_EFFORT,
    JOINT_PROPERTIES,
    SET_CONFIGURATION,
    APPLY_WRENCH,
    CLEAR_WRENCH,
    LINK_STATE,
    LINK_PROPERTIES,
    MODEL_PROPERTIES,
    WORLD_PROPERTIES,
)
"""What the simulation serves."""

SUPERVISOR_REQUESTS: tuple[Request[Message, Message], ...] = (
    SUPERVISOR_START,
    SUPERVISOR_STOP,
    SUPERVISOR_RESTART,
)
"""What the supervisor of a fleet serves."""

PARAMS_REQUESTS: tuple[Request[Message, Message], ...] = (
    PARAMS_ANNOUNCE,
    PARAMS_LIST,
    PARAMS_GET,
    PARAMS_SET,
    PARAMS_RESET,
    PARAMS_UNDO,
    PARAMS_HISTORY,
)
"""What the parameter service serves."""

REQUESTS: tuple[Request[Message, Message], ...] = (*SIM_REQUESTS, *SUPERVISOR_REQUESTS, *PARAMS_REQUESTS)
"""Every request of this project."""

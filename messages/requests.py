"""The services of this project, with their request and response types."""

from typing import ClassVar

from messages.base import Message, NameStr
from messages.controllers import ListControllersResponse, SwitchController, SwitchControllerResponse
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
from messages.gazebo_services import GAZEBO_REQUESTS
from messages.joints import JointProperties
from messages.nav import GetMap, GetMapResponse
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
from messages.request import MAX_REQUEST_BYTES as MAX_REQUEST_BYTES
from messages.request import Request as Request
from messages.rosparam import (
    MAX_TREE_BYTES,
    RosparamDelete,
    RosparamGet,
    RosparamKey,
    RosparamNames,
    RosparamSearch,
    RosparamSet,
    RosparamValue,
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
from messages.std import Bool, Empty
from messages.std_srvs import Empty as EmptyService
from messages.std_srvs import EmptyResponse
from messages.turtlesim import (
    Kill,
    KillResponse,
    SetPen,
    SetPenResponse,
    Spawn,
    SpawnResponse,
    TeleportAbsolute,
    TeleportAbsoluteResponse,
    TeleportRelative,
    TeleportRelativeResponse,
)


class Name(Message, frozen=True, kw_only=True):
    """The name of a model or process."""

    ROS_TYPE: ClassVar[str] = "elea_msgs/Name"
    name: NameStr = ""


class Refusal(Message, frozen=True, kw_only=True):
    """The error reply to a request; ``reason`` says why it was refused."""

    ROS_TYPE: ClassVar[str] = "elea_msgs/Refusal"
    reason: str = ""


class Done(Message, frozen=True, kw_only=True):
    """The reply to a successful request; ``text`` describes what was done."""

    ROS_TYPE: ClassVar[str] = "elea_msgs/Done"
    text: str = ""


SPAWN = Request("/sim/spawn", SpawnModel, ModelState, "spawn a model", 5 << 18)
DELETE = Request("/sim/delete", Name, Done, "delete a model")
LIST = Request("/sim/list", Empty, ModelList, "list all models with their poses and twists")
GET_STATE = Request(
    "/sim/get_state", GetModelState, ModelState, "get the pose and twist of a model, in the world or relative"
)
SET_STATE = Request("/sim/set_state", SetModelState, ModelState, "move a model")
SET_ODOMETRY = Request("/sim/set_odometry", SetOdometry, Done, "set the pose of a robot's wheel odometry")
SET_DRIVE = Request("/sim/set_drive", DriveSettings, DriveSettings, "set the live parameters of a base, all or none")
RESET = Request("/sim/reset", Empty, SimTime, "reset time to zero and all models to their spawn poses")
RESET_WORLD = Request("/sim/reset_world", Empty, SimTime, "reset all models to their spawn poses; time continues")
PAUSE = Request("/sim/pause", Empty, SimTime, "pause simulation time")
RESUME = Request("/sim/resume", Empty, SimTime, "resume simulation time")
STEP = Request("/sim/step", Steps, SimTime, "run physics steps while paused")
LIST_STOPS = Request("/sim/list_stops", Empty, EmergencyStops, "list the emergency stops and their holders")
RELEASE_STOP = Request("/sim/release_stop", ReleaseStop, Done, "release the emergency stops of holders that are gone")
APPLY_EFFORT = Request("/sim/apply_effort", ApplyEffort, Done, "apply an effort to a joint for some time")
CLEAR_EFFORT = Request(
    "/sim/clear_effort", JointName, Done, "clear the efforts on a joint, including those yet to start"
)
JOINT_PROPERTIES = Request(
    "/sim/joint_properties", JointName, JointProperties, "get the type, limits, state and effort of a joint"
)
SET_CONFIGURATION = Request("/sim/set_configuration", SetConfiguration, JointState, "set joint positions")
APPLY_WRENCH = Request("/sim/apply_wrench", ApplyWrench, Done, "apply a force and torque to a link for some time")
CLEAR_WRENCH = Request("/sim/clear_wrench", LinkName, Done, "clear the wrenches on a link")
LINK_STATE = Request("/sim/link_state", LinkName, LinkState, "get the pose and twist of a link")
LINK_PROPERTIES = Request(
    "/sim/link_properties", LinkName, LinkProperties, "get the mass, inertia and friction of a link"
)
MODEL_PROPERTIES = Request("/sim/model_properties", Name, ModelProperties, "get the properties of a model")
WORLD_PROPERTIES = Request(
    "/sim/world_properties", Empty, WorldProperties, "get the properties of the world, its physics and its time"
)

SUPERVISOR_START = Request("/supervisor/start", Name, Done, "start a stopped process of the fleet")
SUPERVISOR_STOP = Request("/supervisor/stop", Name, Done, "stop a process of the fleet")
SUPERVISOR_RESTART = Request("/supervisor/restart", Name, Done, "restart a process of the fleet")

PARAMS_ANNOUNCE = Request(
    "/params/announce", Announcement, ParameterValues, "announce the parameters of a node", 1 << 20
)
PARAMS_LIST = Request("/params/list", Empty, ParameterSets, "list all parameter sets with their descriptions")
PARAMS_GET = Request("/params/get", ParameterSet, ParameterValues, "get the effective values of a set")
PARAMS_SET = Request("/params/set", SetParameters, ParameterValues, "set parameters of a set, all or none", 1 << 19)
PARAMS_RESET = Request("/params/reset", ResetParameters, ParameterValues, "reset parameters")
PARAMS_UNDO = Request("/params/undo", UndoParameters, ParameterValues, "undo the last change of a set")
PARAMS_HISTORY = Request("/params/history", HistoryOf, ParameterHistory, "get the history of changes")

ROSPARAM_SET = Request(
    "/rosparam/set", RosparamSet, Done, "set a value or branch in the ROS 1 parameter tree", MAX_TREE_BYTES + 4096
)
ROSPARAM_GET = Request("/rosparam/get", RosparamGet, RosparamValue, "get a value or branch of the tree")
ROSPARAM_DELETE = Request("/rosparam/delete", RosparamDelete, Done, "delete a value or branch of the tree")
ROSPARAM_HAS = Request("/rosparam/has", RosparamKey, Bool, "whether the tree has a value or branch")
ROSPARAM_SEARCH = Request("/rosparam/search", RosparamSearch, RosparamKey, "search a name from a namespace upwards")
ROSPARAM_NAMES = Request("/rosparam/names", Empty, RosparamNames, "list the names of all values of the tree")

LIST_CONTROLLERS = Request(
    "~list_controllers", Empty, ListControllersResponse, "list the controllers of a controller manager"
)
SWITCH_CONTROLLER = Request(
    "~switch_controller", SwitchController, SwitchControllerResponse, "start and stop controllers of a manager"
)

STATIC_MAP = Request("static_map", GetMap, GetMapResponse, "get the map of a map server")

TURTLESIM_CLEAR = Request("clear", EmptyService, EmptyResponse, "wipe the turtles' trails, in the background's colour")
TURTLESIM_RESET = Request(
    "reset", EmptyService, EmptyResponse, "remove all turtles and trails, and restart with turtle1"
)
TURTLESIM_SPAWN = Request("spawn", Spawn, SpawnResponse, "add a turtle")
TURTLESIM_KILL = Request("kill", Kill, KillResponse, "remove a turtle")
SET_PEN = Request("set_pen", SetPen, SetPenResponse, "set colour and width of a turtle's pen, or lift it")
TELEPORT_ABSOLUTE = Request(
    "teleport_absolute", TeleportAbsolute, TeleportAbsoluteResponse, "move a turtle to a pose; its pen draws"
)
TELEPORT_RELATIVE = Request(
    "teleport_relative", TeleportRelative, TeleportRelativeResponse, "turn a turtle, then move it ahead; its pen draws"
)

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
"""The services of the simulation."""

SUPERVISOR_REQUESTS: tuple[Request[Message, Message], ...] = (
    SUPERVISOR_START,
    SUPERVISOR_STOP,
    SUPERVISOR_RESTART,
)
"""The services of a fleet's supervisor."""

PARAMS_REQUESTS: tuple[Request[Message, Message], ...] = (
    PARAMS_ANNOUNCE,
    PARAMS_LIST,
    PARAMS_GET,
    PARAMS_SET,
    PARAMS_RESET,
    PARAMS_UNDO,
    PARAMS_HISTORY,
    ROSPARAM_SET,
    ROSPARAM_GET,
    ROSPARAM_DELETE,
    ROSPARAM_HAS,
    ROSPARAM_SEARCH,
    ROSPARAM_NAMES,
)
"""The services of the parameter service."""

CONTROLLER_REQUESTS: tuple[Request[Message, Message], ...] = (LIST_CONTROLLERS, SWITCH_CONTROLLER)
"""The services of a controller manager, e.g. ``/NAMESPACE/controller_manager/list_controllers``."""

TURTLESIM_REQUESTS: tuple[Request[Message, Message], ...] = (
    TURTLESIM_CLEAR,
    TURTLESIM_RESET,
    TURTLESIM_SPAWN,
    TURTLESIM_KILL,
    SET_PEN,
    TELEPORT_ABSOLUTE,
    TELEPORT_RELATIVE,
)
"""The services of turtlesim; the last three exist for each turtle, e.g. ``/turtle1/set_pen``."""

REQUESTS: tuple[Request[Message, Message], ...] = (
    *SIM_REQUESTS,
    *SUPERVISOR_REQUESTS,
    *PARAMS_REQUESTS,
    *CONTROLLER_REQUESTS,
    STATIC_MAP,
    *TURTLESIM_REQUESTS,
    *GAZEBO_REQUESTS,
)
"""Every service of this project."""

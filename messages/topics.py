"""The topics: name, record, promised rate and quality of service, and the table of all topics."""

from dataclasses import dataclass, replace
from enum import Enum
from typing import Generic, Self, TypeVar

from messages import gazebo_msgs
from messages.base import Message
from messages.control import JointControllerState
from messages.elea import (
    BaseStatus,
    Checks,
    EmergencyStops,
    FleetState,
    GoalStatus,
    Health,
    InterfaceDefinitions,
    LockstepState,
)
from messages.gazebo import LinkStates, ModelStates, WorldStates
from messages.geometry import PoseStamped, Twist, TwistStamped
from messages.joints import JointCommand, JointEffort
from messages.names import BadName
from messages.nav import MapMetaData, OccupancyGrid, Odometry, Path
from messages.parameters import ParameterSchema, ParameterValues, ScheduledChanges
from messages.rosgraph import Clock, Log
from messages.rosparam import MAX_TREE_BYTES, RosparamTree
from messages.sensor import CameraInfo, Image, Imu, JointState, LaserScan, PointCloud, Range
from messages.simulation import SimStatus
from messages.std import Bool, Float32, String
from messages.tf import TFMessage
from messages.turtlesim import Color
from messages.turtlesim import Pose as TurtlePose
from messages.visualization import MarkerArray

M_co = TypeVar("M_co", bound=Message, covariant=True)


class Quality(Enum):
    """The quality of service of a topic."""

    SENSOR = "newest wins, may drop"
    COMMAND = "newest wins, express, before all other traffic"
    EVENT = "reliable, publishers block; a subscriber drops its oldest unread messages beyond 8192 (64 MiB)"
    LATCHED = "reliable, publishers block; late subscribers get the last message of each publisher"
    VITAL = "newest wins, in a queue of its own that a flood of data cannot fill"


@dataclass(frozen=True, eq=False)
class Topic(Generic[M_co]):
    """A named stream of one record type; ``rate`` is the promised rate [Hz] in simulation time, 0 if event-driven.

    A name without a leading slash is resolved in the namespace of the node, as in ROS.
    """

    name: str
    record: type[M_co]
    rate: float
    quality: Quality
    about: str
    largest: int = 1 << 16
    """Maximum size [bytes]; larger payloads are refused without decoding. A subscriber's queue holds at most 64 MiB, so
    this limits its length.

    The limits allow a thousand robots for messages about a whole fleet, 500 models with twenty links for those of
    static frames and links, 20,000 goals for a plan.
    """
    only: str = ""
    """The only node that may publish it, if restricted: samples of others are refused."""
    unit: str = ""
    """The unit of a topic whose message is a single number."""

    def of(self, namespace: str) -> Self:
        """Return the topic in a namespace: ``ODOM.of("tb3_0")`` is ``/tb3_0/odom``, and a node's ``~name`` becomes
        ``/node/name``; raises BadName for an absolute topic name."""
        if self.name.startswith("/"):
            raise BadName(f"{self.name} is the same topic in every namespace")
        return self.named(f"/{namespace.strip('/')}/{self.name.removeprefix('~')}".replace("//", "/"))

    def named(self, name: str) -> Self:
        """Return the topic under another name."""
        return replace(self, name=name)


CLOCK = Topic("/clock", Clock, 50, Quality.SENSOR, "simulation time, step, epoch, pause")
CMD_VEL = Topic("cmd_vel", Twist, 25, Quality.COMMAND, "velocity command of a base")
CMD_VEL_STAMPED = Topic(CMD_VEL.name, TwistStamped, CMD_VEL.rate, CMD_VEL.quality, "velocity command with its time")
"""``CMD_VEL`` of a base that expects TwistStamped; not in ``TOPICS``, whose names are unique."""
CMD_VEL_OUT = Topic(
    "cmd_vel_out", TwistStamped, 50, Quality.SENSOR, "velocity command after limiting, if publish_cmd is set"
)
E_STOP = Topic("e_stop", Bool, 0, Quality.LATCHED, "true stops the robot until the same publisher sends false")
STOPS = Topic(
    "/sim/stops", EmergencyStops, 0, Quality.LATCHED, "emergency stops and their holders", 1 << 20, only="/sim"
)
ODOM = Topic("odom", Odometry, 25, Quality.SENSOR, "odometry of a base")
GROUND_TRUTH = Topic("ground_truth", Odometry, 25, Quality.SENSOR, "true pose in the world, true twist in the body")
JOINT_STATES = Topic("joint_states", JointState, 25, Quality.SENSOR, "positions and velocities of all moving joints")
IMU = Topic("imu", Imu, 100, Quality.SENSOR, "orientation, angular velocity and specific force")
SCAN = Topic("scan", LaserScan, 5, Quality.SENSOR, "laser scan")
SONAR = Topic("sonar", PointCloud, 10, Quality.SENSOR, "echoes of the sonars, one point per sonar, in order")
RANGE = Topic("sonar/range", Range, 160, Quality.SENSOR, "range of each sonar in turn, in the sonar's frame")
IMAGE = Topic("camera/image", Image, 10, Quality.SENSOR, "camera image, while there are subscribers", 1 << 23)
CAMERA_INFO = Topic("camera/camera_info", CameraInfo, 10, Quality.SENSOR, "calibration of the camera")
BASE_STATUS = Topic(
    "base_status",
    BaseStatus,
    5,
    Quality.EVENT,
    "state of a base: command source, refused commands, collisions",
    1 << 13,
)
GOAL_POSE = Topic("goal_pose", PoseStamped, 0, Quality.EVENT, "goal to drive to", 1 << 13)
PLAN = Topic("plan", Path, 0, Quality.LATCHED, "goals of a robot, in order", 1 << 22)
STATUS = Topic("status", GoalStatus, 0, Quality.LATCHED, "progress on the plan")
TF = Topic("/tf", TFMessage, 25, Quality.SENSOR, "transforms of moving frames")
TF_STATIC = Topic(
    "/tf_static", TFMessage, 0, Quality.LATCHED, "static transforms, all of a publisher's in one message", 1 << 21
)
MODEL_STATES = Topic(
    "/gazebo/model_states",
    ModelStates,
    25,
    Quality.SENSOR,
    "poses and twists of all models, while there are subscribers",
    1 << 18,
)
LINK_STATES = Topic(
    "/gazebo/link_states",
    LinkStates,
    25,
    Quality.SENSOR,
    "poses and twists of all links, while there are subscribers",
    1 << 22,
)
SET_MODEL_STATE = Topic(
    "/gazebo/set_model_state", gazebo_msgs.ModelState, 0, Quality.EVENT, "moves a model, as in Gazebo"
)
SET_LINK_STATE = Topic(
    "/gazebo/set_link_state", gazebo_msgs.LinkState, 0, Quality.EVENT, "moves a model by its root link, as in Gazebo"
)
WORLD_MARKERS = Topic(
    "/world/markers",
    MarkerArray,
    0,
    Quality.LATCHED,
    "the world's ground and bodies at their start poses",
    1 << 23,
    "/sim",
)
WORLD_STATES = Topic(
    "/world/states",
    WorldStates,
    10,
    Quality.SENSOR,
    "poses and twists of the world's movable and moving bodies, if it has any",
    1 << 21,
)
ROBOT_DESCRIPTION = Topic("robot_description", String, 0, Quality.LATCHED, "URDF of a robot", 5 << 18)
JOINT_EFFORT = Topic("joint_effort", JointEffort, 100, Quality.COMMAND, "effort to apply to a joint for some time")
JOINT_COMMAND = Topic(
    "joint_command", JointCommand, 100, Quality.COMMAND, "targets of joints, from a controller manager"
)
JOINT_FEEDBACK = Topic(
    "joint_feedback",
    JointState,
    200,
    Quality.SENSOR,
    "as joint_states, at each physics step, once a controller manager commands joints",
)
REFERENCE = Topic("/robot_control/reference", Float32, 50, Quality.SENSOR, "set-point of the arm, degrees", unit="deg")
CONTROL_SIGNAL = Topic(
    "/robot_control/control_signal", Float32, 100, Quality.SENSOR, "effort of the arm, N m", unit="N m"
)
JOINT_ANGLE = Topic("/robot_control/joint_angle", Float32, 100, Quality.SENSOR, "angle of the arm, degrees", unit="deg")
CONTROL_ERROR = Topic(
    "/robot_control/error", Float32, 100, Quality.SENSOR, "reference minus angle, degrees", unit="deg"
)
CONTROL_STATE = Topic(
    "/robot_control/state",
    JointControllerState,
    100,
    Quality.SENSOR,
    "the controller's inputs, gains and output, time-stamped",
)
MAP = Topic("map", OccupancyGrid, 0, Quality.LATCHED, "map of a map server: the occupancy of its cells", 8 << 20)
MAP_METADATA = Topic("map_metadata", MapMetaData, 0, Quality.LATCHED, "size, resolution and origin of the map")
TURTLE_STATES = Topic("~states", WorldStates, 50, Quality.SENSOR, "poses and twists of all turtles of a turtlesim")
MARKERS = Topic(
    "~markers",
    MarkerArray,
    0,
    Quality.EVENT,
    "shapes to draw, e.g. the turtles' trails: all of them for each new subscriber, then changes",
    1 << 18,
)
DESCRIPTIONS = Topic(
    "~parameter_descriptions",
    ParameterSchema,
    0,
    Quality.LATCHED,
    "parameters of a set: types, bounds and descriptions",
    1 << 20,
    "/params",
)
UPDATES = Topic(
    "~parameter_updates", ParameterValues, 0, Quality.LATCHED, "values of a set, after each change", 1 << 20, "/params"
)
SCHEDULE = Topic(
    "/params/schedule",
    ScheduledChanges,
    0,
    Quality.LATCHED,
    "scheduled parameter changes: those applied, and why others were refused",
    1 << 20,
)
ROSPARAM_TREE = Topic(
    "/rosparam/tree",
    RosparamTree,
    0,
    Quality.LATCHED,
    "the ROS 1 parameter tree, after each change",
    MAX_TREE_BYTES + (1 << 18),
    only="/params",
)
SIM_STATUS = Topic(
    "/sim/status", SimStatus, 0, Quality.LATCHED, "nodes missing when time started, and the lag behind the wall clock"
)
ROSOUT = Topic("/rosout", Log, 0, Quality.EVENT, "log messages of all nodes")
HEALTH = Topic("/health", Health, 0, Quality.VITAL, "heartbeat of each node, once per second of wall time")
LOCKSTEP = Topic(
    "/lockstep",
    LockstepState,
    0,
    Quality.LATCHED,
    "members that the simulation waits for, and those it lost",
    1 << 20,
    "/sim",
)
CHECKS = Topic("/checks", Checks, 0, Quality.LATCHED, "a service's own checks, for the report of the run", 1 << 17)
INTERFACES = Topic(
    "/interfaces",
    InterfaceDefinitions,
    0,
    Quality.LATCHED,
    "definitions of the message types of a script's own packages",
    1 << 20,
)
FLEET_STATE = Topic("/supervisor/state", FleetState, 0, Quality.LATCHED, "processes of the fleet", 1 << 20)

TURTLE_POSE = Topic("pose", TurtlePose, 0, Quality.SENSOR, "pose and velocity of a turtle, at 50 Hz")
COLOR_SENSOR = Topic("color_sensor", Color, 0, Quality.SENSOR, "colour below a turtle, at 50 Hz")

TOPICS: tuple[Topic[Message], ...] = (
    CLOCK,
    CMD_VEL,
    CMD_VEL_OUT,
    E_STOP,
    STOPS,
    ODOM,
    GROUND_TRUTH,
    JOINT_STATES,
    IMU,
    SCAN,
    SONAR,
    RANGE,
    IMAGE,
    CAMERA_INFO,
    BASE_STATUS,
    GOAL_POSE,
    PLAN,
    STATUS,
    TF,
    TF_STATIC,
    MODEL_STATES,
    LINK_STATES,
    SET_MODEL_STATE,
    SET_LINK_STATE,
    WORLD_MARKERS,
    WORLD_STATES,
    ROBOT_DESCRIPTION,
    JOINT_EFFORT,
    JOINT_COMMAND,
    JOINT_FEEDBACK,
    REFERENCE,
    CONTROL_SIGNAL,
    JOINT_ANGLE,
    CONTROL_ERROR,
    CONTROL_STATE,
    MAP,
    MAP_METADATA,
    TURTLE_STATES,
    MARKERS,
    DESCRIPTIONS,
    UPDATES,
    SCHEDULE,
    ROSPARAM_TREE,
    SIM_STATUS,
    ROSOUT,
    HEALTH,
    LOCKSTEP,
    CHECKS,
    INTERFACES,
    FLEET_STATE,
)
"""Every topic of this project except those of turtles."""


TURTLE_TOPICS: tuple[Topic[Message], ...] = (TURTLE_POSE, COLOR_SENSOR)
"""The topics of turtles: elsewhere, such names mean something else."""

LARGEST_FOREIGN = 1 << 20
"""Maximum size [bytes] of a message on a topic that is not in the table."""


def limit_of(name: str, ros_type: str) -> int | None:
    """Return the limit [bytes] of the table's topic with this absolute name and type; None if it has none."""
    typed = [each for each in TOPICS if ros_type == each.record.ROS_TYPE]
    here = [each.largest for each in typed if each.name == name] or [
        each.largest for each in typed if each.name[0] != "/" and name.endswith(f"/{each.name.removeprefix('~')}")
    ]
    return max(here, default=None)


def largest_of(name: str, ros_type: str) -> int:
    """Return the maximum size [bytes] of a message of a type on the topic with this absolute name.

    For a topic of the table, its own limit; for others LARGEST_FOREIGN, or more if the type needs it in any namespace.
    """
    if (limit := limit_of(name, ros_type)) is not None:
        return limit
    relative = [each.largest for each in TOPICS if ros_type == each.record.ROS_TYPE and each.name[0] != "/"]
    return max([LARGEST_FOREIGN, *relative])

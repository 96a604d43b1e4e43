"""The topics: name, record, promised rate and quality of service, and the table of all of them."""

from dataclasses import dataclass, replace
from enum import Enum
from typing import Generic, Self, TypeVar

from messages.base import Message
from messages.control import JointControllerState
from messages.elea import BaseStatus, Checks, EmergencyStops, FleetState, GoalStatus, Health, LockstepState
from messages.gazebo import LinkStates, ModelStates
from messages.geometry import PoseStamped, Twist, TwistStamped
from messages.joints import JointEffort
from messages.names import BadName
from messages.nav import Odometry, Path
from messages.parameters import ParameterSchema, ParameterValues, ScheduledChanges
from messages.rosgraph import Clock, Log
from messages.sensor import CameraInfo, Image, Imu, JointState, LaserScan, PointCloud, Range
from messages.simulation import SimStatus
from messages.std import Bool, Float32, String
from messages.tf import TFMessage

M_co = TypeVar("M_co", bound=Message, covariant=True)


class Quality(Enum):
    """How samples of a topic travel."""

    SENSOR = "newest wins, may drop"
    COMMAND = "newest wins, express, ahead of everything else"
    EVENT = "the sender waits, none is dropped on the way; a reader loses its oldest beyond 8192 (64 MiB) not yet taken"
    LATCHED = "the sender waits, none is dropped on the way; the last of each publisher reaches late joiners"
    VITAL = "newest wins, in a queue of its own that no flood of data fills"


@dataclass(frozen=True, eq=False)
class Topic(Generic[M_co]):
    """A named stream of one record; ``rate`` is the promised rate [Hz] of simulation time, 0 for "when it happens".

    A name without a leading slash is resolved in the namespace of the node, as in ROS.
    """

    name: str
    record: type[M_co]
    rate: float
    quality: Quality
    about: str
    largest: int = 1 << 16
    """Bytes; a larger payload is refused unread. A reader's ring holds 64 MiB at most, so it is the shorter for this.

    What tells of a whole fleet in one message has room for a thousand robots, the fixed frames and links of models with
    twenty links for 500.
    """
    only: str = ""
    """The node that alone may publish it, where there is one: samples of others are refused."""
    unit: str = ""
    """The unit of a topic that carries one bare number."""

    def of(self, namespace: str) -> Self:
        """The same topic in another namespace: ``ODOM.of("tb3_0")`` is ``/tb3_0/odom``, and that of a node's ``~name``
        is ``/node/name``; raises BadName for a topic whose name is absolute."""
        if self.name.startswith("/"):
            raise BadName(f"{self.name} is the same topic in every namespace")
        return self.named(f"/{namespace.strip('/')}/{self.name.removeprefix('~')}".replace("//", "/"))

    def named(self, name: str) -> Self:
        """The same topic under another name."""
        return replace(self, name=name)


CLOCK = Topic("/clock", Clock, 50, Quality.SENSOR, "simulation time, step, epoch, pause")
CMD_VEL = Topic("cmd_vel", Twist, 25, Quality.COMMAND, "velocity command of a base")
CMD_VEL_OUT = Topic("cmd_vel_out", TwistStamped, 50, Quality.SENSOR, "what a base makes of its commands, if asked for")
E_STOP = Topic("e_stop", Bool, 0, Quality.LATCHED, "true stops the robot until its sender resets it by false")
STOPS = Topic("/sim/stops", EmergencyStops, 0, Quality.LATCHED, "who holds which emergency stop", 1 << 20, only="/sim")
ODOM = Topic("odom", Odometry, 25, Quality.SENSOR, "odometry of a base")
GROUND_TRUTH = Topic("ground_truth", Odometry, 25, Quality.SENSOR, "true pose in the world, true twist in the body")
JOINT_STATES = Topic("joint_states", JointState, 25, Quality.SENSOR, "angles and speeds of all moving joints")
IMU = Topic("imu", Imu, 100, Quality.SENSOR, "orientation, turn rate and specific force")
SCAN = Topic("scan", LaserScan, 5, Quality.SENSOR, "ranges of the laser")
SONAR = Topic("sonar", PointCloud, 10, Quality.SENSOR, "where the sonars hear an echo, one point each, in their order")
RANGE = Topic(
    "sonar/range", Range, 160, Quality.SENSOR, "what each sonar hears, one after the other, each in its frame"
)
IMAGE = Topic("camera/image", Image, 10, Quality.SENSOR, "picture of the camera, while somebody looks", 1 << 23)
CAMERA_INFO = Topic("camera/camera_info", CameraInfo, 10, Quality.SENSOR, "calibration of the camera")
BASE_STATUS = Topic("base_status", BaseStatus, 5, Quality.EVENT, "what the base obeys, refuses and hits", 1 << 13)
GOAL_POSE = Topic("goal_pose", PoseStamped, 0, Quality.EVENT, "a goal to drive to", 1 << 13)
PLAN = Topic("plan", Path, 0, Quality.LATCHED, "the goals of a robot, in order")
STATUS = Topic("status", GoalStatus, 0, Quality.LATCHED, "progress on the plan")
TF = Topic("/tf", TFMessage, 25, Quality.SENSOR, "moving transforms of all robots")
TF_STATIC = Topic(
    "/tf_static", TFMessage, 0, Quality.LATCHED, "fixed transforms, all of a publisher's in one message", 1 << 21
)
MODEL_STATES = Topic(
    "/gazebo/model_states", ModelStates, 25, Quality.SENSOR, "where all models are, while somebody listens", 1 << 18
)
LINK_STATES = Topic(
    "/gazebo/link_states", LinkStates, 25, Quality.SENSOR, "where all links are, while somebody listens", 1 << 22
)
ROBOT_DESCRIPTION = Topic("robot_description", String, 0, Quality.LATCHED, "the URDF of a robot", 1 << 20)
JOINT_EFFORT = Topic("joint_effort", JointEffort, 100, Quality.COMMAND, "effort on a joint, for a time")
REFERENCE = Topic(
    "/robot_control/reference", Float32, 50, Quality.SENSOR, "where the arm should be, degrees", unit="deg"
)
CONTROL_SIGNAL = Topic(
    "/robot_control/control_signal", Float32, 100, Quality.SENSOR, "effort of the arm, N m", unit="N m"
)
JOINT_ANGLE = Topic("/robot_control/joint_angle", Float32, 100, Quality.SENSOR, "where the arm is, degrees", unit="deg")
CONTROL_ERROR = Topic("/robot_control/error", Float32, 100, Quality.SENSOR, "reference less angle, degrees", unit="deg")
CONTROL_STATE = Topic(
    "/robot_control/state", JointControllerState, 100, Quality.SENSOR, "all of these at one tick, with its time"
)
DESCRIPTIONS = Topic(
    "~parameter_descriptions",
    ParameterSchema,
    0,
    Quality.LATCHED,
    "a set's parameters, bounds and texts",
    1 << 20,
    "/params",
)
UPDATES = Topic(
    "~parameter_updates", ParameterValues, 0, Quality.LATCHED, "a set's values, after each change", 1 << 20, "/params"
)
SCHEDULE = Topic(
    "/params/schedule",
    ScheduledChanges,
    0,
    Quality.LATCHED,
    "which scheduled changes of parameters were made, and why others were not",
    1 << 20,
)
SIM_STATUS = Topic("/sim/status", SimStatus, 0, Quality.LATCHED, "who was missing when time began, and how it lags")
ROSOUT = Topic("/rosout", Log, 0, Quality.EVENT, "the log of every node")
HEALTH = Topic("/health", Health, 0, Quality.VITAL, "heartbeat of every node, once a second of wall time")
LOCKSTEP = Topic(
    "/lockstep",
    LockstepState,
    0,
    Quality.LATCHED,
    "whom the simulation waits for, and whom it lost",
    1 << 20,
    "/sim",
)
CHECKS = Topic("/checks", Checks, 0, Quality.LATCHED, "a service's own checks of the run, for its report", 1 << 17)
FLEET_STATE = Topic("/supervisor/state", FleetState, 0, Quality.LATCHED, "the processes of the fleet", 1 << 20)

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
    ROBOT_DESCRIPTION,
    JOINT_EFFORT,
    REFERENCE,
    CONTROL_SIGNAL,
    JOINT_ANGLE,
    CONTROL_ERROR,
    CONTROL_STATE,
    DESCRIPTIONS,
    UPDATES,
    SCHEDULE,
    SIM_STATUS,
    ROSOUT,
    HEALTH,
    LOCKSTEP,
    CHECKS,
    FLEET_STATE,
)
"""Every topic of this project."""

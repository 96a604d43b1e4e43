"""The content of a ros_control YAML file as typed records: the controllers of one robot."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, Literal, NamedTuple

import msgspec
from msgspec import Meta

from messages.joints import JointInterface
from models.urdf import SINGLE_DOF, JointLimits
from services.runtime.errors import BadInput, unknown_name

MAX_JOINTS = 64
"""Maximum number of joints of a controller."""
DEFAULT_RATE = 100.0
"""Update rate [Hz] if the file has no ``update_rate``; ROS 2's default."""

Number = Annotated[float, Meta(ge=-1e6, le=1e6)]
NonNegative = Annotated[float, Meta(ge=0, le=1e6)]
Rate = Annotated[float, Meta(ge=0, le=1000)]
JointName = Annotated[str, Meta(min_length=1, max_length=255)]
JointNames = Annotated[tuple[JointName, ...], Meta(min_length=1, max_length=MAX_JOINTS)]

Kind = Literal["joint", "group", "trajectory", "state"]
Quantity = Literal["position", "velocity", "effort"]


class ControllerType(NamedTuple):
    """The quantity that controllers of a type are commanded by (``commanded``), and by which they command joints
    (``interface``).

    If these differ, a PID converts one to the other.
    """

    kind: Kind
    interface: JointInterface
    commanded: Quantity

    @property
    def pid(self) -> bool:
        """Whether the controller needs PID gains."""
        return self.kind in ("joint", "group") and self.interface != self.commanded


TYPES: dict[str, ControllerType] = {
    "position_controllers/JointPositionController": ControllerType("joint", "position", "position"),
    "velocity_controllers/JointVelocityController": ControllerType("joint", "velocity", "velocity"),
    "velocity_controllers/JointPositionController": ControllerType("joint", "velocity", "position"),
    "effort_controllers/JointEffortController": ControllerType("joint", "effort", "effort"),
    "effort_controllers/JointPositionController": ControllerType("joint", "effort", "position"),
    "effort_controllers/JointVelocityController": ControllerType("joint", "effort", "velocity"),
    "position_controllers/JointGroupPositionController": ControllerType("group", "position", "position"),
    "velocity_controllers/JointGroupVelocityController": ControllerType("group", "velocity", "velocity"),
    "effort_controllers/JointGroupEffortController": ControllerType("group", "effort", "effort"),
    "effort_controllers/JointGroupPositionController": ControllerType("group", "effort", "position"),
    "position_controllers/JointTrajectoryController": ControllerType("trajectory", "position", "position"),
    "velocity_controllers/JointTrajectoryController": ControllerType("trajectory", "velocity", "position"),
    "effort_controllers/JointTrajectoryController": ControllerType("trajectory", "effort", "position"),
    "forward_command_controller/ForwardCommandController": ControllerType("group", "position", "position"),
    "joint_trajectory_controller/JointTrajectoryController": ControllerType("trajectory", "position", "position"),
    "joint_state_controller/JointStateController": ControllerType("state", "position", "position"),
    "joint_state_broadcaster/JointStateBroadcaster": ControllerType("state", "position", "position"),
}
"""The known types; for those of ROS 2, the file's ``interface_name`` or ``command_interfaces`` decide."""

ROS_2_TRAJECTORY = "joint_trajectory_controller/JointTrajectoryController"
FORWARD_COMMAND = "forward_command_controller/ForwardCommandController"

REPLACED_BY_SIMULATION = {
    "diff_drive_controller/DiffDriveController": "the simulation drives the base by cmd_vel itself",
    "imu_sensor_controller/ImuSensorController": "the simulation publishes imu itself",
    "imu_sensor_broadcaster/IMUSensorBroadcaster": "the simulation publishes imu itself",
}
"""Controller types in such files that the simulation itself replaces."""


class Table(msgspec.Struct, frozen=True, kw_only=True):
    """A table of the file; unknown keys are reported and ignored, as in ROS."""


class Gains(Table, frozen=True, kw_only=True):
    """The gains of one joint, with control_toolbox's names. ``ff_velocity_scale`` is the velocity feed-forward."""

    p: Number = 0.0
    i: Number = 0.0
    d: Number = 0.0
    i_clamp: NonNegative = 0.0
    i_clamp_min: Annotated[float, Meta(ge=-1e6, le=0)] | None = None
    i_clamp_max: NonNegative | None = None
    antiwindup: bool = False
    ff_velocity_scale: Number = 0.0

    @property
    def bounds(self) -> tuple[float, float]:
        """Lower and upper bound of the integral term."""
        low = -self.i_clamp if self.i_clamp_min is None else self.i_clamp_min
        return low, self.i_clamp if self.i_clamp_max is None else self.i_clamp_max


class Tolerance(Table, frozen=True, kw_only=True):
    """Maximum error of a joint along its path, and at its goal [rad or m]; 0 for no limit."""

    trajectory: NonNegative = 0.0
    goal: NonNegative = 0.0


@dataclass(frozen=True, kw_only=True)
class TrajectoryConfig:
    """Settings of a trajectory controller. Rates in Hz, times in s, velocities in rad/s or m/s.

    ``waits_for_goal`` is ROS 2's meaning of a ``goal_time`` of 0: no time limit.
    """

    constraints: Mapping[str, Tolerance]
    goal_time: float = 0.0
    stopped_velocity_tolerance: float = 0.01
    state_publish_rate: float = 50.0
    action_monitor_rate: float = 20.0
    allow_partial_joints_goal: bool = False
    allow_nonzero_velocity_at_trajectory_end: bool = True
    splines: bool = True
    waits_for_goal: bool = False


@dataclass(frozen=True, kw_only=True)
class ControllerConfig:
    """One controller; ``where`` is its file and line. ``gains`` are by joint, empty without a PID."""

    name: str
    type: str
    where: str
    kind: Kind
    interface: JointInterface
    commanded: Quantity
    joints: tuple[str, ...] = ()
    gains: Mapping[str, Gains] = field(default_factory=dict)
    trajectory: TrajectoryConfig | None = None

    def gain_set(self, joint: str) -> str:
        """Return the parameter set of a joint's gains, relative to the robot's namespace; named as in ROS."""
        match self.kind:
            case "trajectory":
                return f"{self.name}/gains/{joint}"
            case "group":
                return f"{self.name}/{joint}/pid"
        return f"{self.name}/pid"


@dataclass(frozen=True)
class ManagerConfig:
    """The controllers of a robot in the order of the file.

    ``hardware_gains`` are gazebo_ros_control's ``pid_gains``: with them, joints commanded by position or velocity are
    moved by effort. ``joint_state_rate`` [Hz] is that of a JointStateController, 0 without one. ``notes`` list what is
    ignored in the file.
    """

    controllers: tuple[ControllerConfig, ...]
    update_rate: float = DEFAULT_RATE
    hardware_gains: Mapping[str, Gains] = field(default_factory=dict)
    joint_state_rate: float = 0.0
    notes: tuple[str, ...] = ()

    @property
    def gain_sets(self) -> dict[str, Gains]:
        """The gains by parameter set, relative to the robot's namespace."""
        sets = {each.gain_set(joint): gains for each in self.controllers for joint, gains in each.gains.items()}
        return sets | {hardware_gain_set(joint): gains for joint, gains in self.hardware_gains.items()}

    @property
    def joints(self) -> dict[str, tuple[str, str]]:
        """Every commanded joint, with the first controller that commands it and its place in the file."""
        found: dict[str, tuple[str, str]] = {}
        for each in self.controllers:
            for joint in each.joints:
                found.setdefault(joint, (each.name, each.where))
        return found

    def check_joints(self, limits: Mapping[str, JointLimits]) -> None:
        """Raise BadInput, with the place in the file, for a joint that the robot lacks or that cannot move.

        Args:
            limits: The robot's joints.
        """
        known = [joint for joint, each in limits.items() if each.kind in SINGLE_DOF]
        for joint, (controller, where) in self.joints.items():
            if joint in limits and joint not in known:
                raise BadInput(f"{where}: {controller}: the joint {joint} is {limits[joint].kind}: it does not move")
            if joint not in known:
                raise unknown_name("joint", joint, known, f"{where}: {controller}")


def hardware_gain_set(joint: str) -> str:
    """Return the parameter set of a joint's ``hardware_gains``."""
    return f"gazebo_ros_control/pid_gains/{joint}"

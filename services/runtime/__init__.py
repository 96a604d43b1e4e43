"""The public API for controllers: ``from services.runtime import CMD_VEL, ODOM, Twist, main``."""

from typing import TYPE_CHECKING, Any

from messages.base import Message
from messages.elea import BaseStatus, GoalStatus
from messages.geometry import STOP, Point, Pose, PoseStamped, Quaternion, Twist, TwistStamped, Vector3
from messages.joints import JointEffort
from messages.nav import Odometry, Path
from messages.requests import Request
from messages.sensor import CameraInfo, Image, Imu, JointState, LaserScan, PointCloud, Range
from messages.std import Bool, Float32, Float64, Header, String, Time
from messages.topics import (
    BASE_STATUS,
    CAMERA_INFO,
    CMD_VEL,
    E_STOP,
    GOAL_POSE,
    GROUND_TRUTH,
    IMAGE,
    IMU,
    JOINT_EFFORT,
    JOINT_STATES,
    ODOM,
    PLAN,
    RANGE,
    SCAN,
    SONAR,
    STATUS,
    Quality,
    Topic,
)
from services.runtime.errors import BadInput, CallFailed, EleaError, NoAnswer, NoTransform, Stopped
from services.runtime.main import main
from services.runtime.parameters.base import Parameters, param
from services.runtime.service import Service

__all__ = [
    "BASE_STATUS",
    "CAMERA_INFO",
    "CMD_VEL",
    "E_STOP",
    "GOAL_POSE",
    "GROUND_TRUTH",
    "IMAGE",
    "IMU",
    "JOINT_EFFORT",
    "JOINT_STATES",
    "ODOM",
    "PLAN",
    "RANGE",
    "SCAN",
    "SONAR",
    "STATUS",
    "STOP",
    "BadInput",
    "BaseStatus",
    "Bool",
    "CallFailed",
    "CameraInfo",
    "Client",
    "Context",
    "EleaError",
    "Float32",
    "Float64",
    "GoalStatus",
    "Header",
    "Image",
    "Imu",
    "JointEffort",
    "JointState",
    "LaserScan",
    "Message",
    "NoAnswer",
    "NoTransform",
    "Odometry",
    "Parameters",
    "Path",
    "Point",
    "PointCloud",
    "Pose",
    "PoseStamped",
    "Quality",
    "Quaternion",
    "Range",
    "Request",
    "Service",
    "Stopped",
    "String",
    "Tick",
    "Time",
    "Topic",
    "Twist",
    "TwistStamped",
    "Vector3",
    "connect",
    "main",
    "param",
]

if TYPE_CHECKING:
    from services.runtime.client import Client, connect
    from services.runtime.context import Context, Tick
else:

    def __getattr__(name: str) -> Any:
        """Import the classes that need the network on first use: ``--help`` runs without them."""
        if name in ("Context", "Tick"):
            from services.runtime import context

            return getattr(context, name)
        if name in ("Client", "connect"):
            from services.runtime import client

            return getattr(client, name)
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")

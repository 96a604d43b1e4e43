"""The parameters of a robot: base and sensors, under the names of ROS's ``diff_drive_controller``, or joints."""

from __future__ import annotations

from typing import Annotated, Literal

import msgspec
from msgspec import Meta

from services.runtime.parameters.base import Parameters

MAX_RATE = 50.0
"""Hz; odometry is published at control ticks, so at most once per tick."""


_FIXED = {"live": False}
"""Marks what is fixed when a robot is spawned, in the world and on the network."""


_SPEED = {"unit": "m/s or rad/s"}
_RATE = {"unit": "m/s2 or rad/s2"}


def _rise(text: str) -> Meta:
    return Meta(gt=0, le=1e6, description=text, extra=_RATE)


def _fall(text: str) -> Meta:
    return Meta(ge=-1e6, lt=0, description=text, extra=_RATE)


def _either(text: str) -> Meta:
    return Meta(ge=-1e6, le=1e6, description=f"{text}; not 0.", extra=_RATE)


def _share(text: str) -> Meta:
    """A multiplier; the range is wide: skid-steered robots use 1.875 and 2.3 times the measured separation."""
    return Meta(ge=0.1, le=10, description=text)


def _length(text: str) -> Meta:
    return Meta(ge=0.001, le=10, description=text, extra={"unit": "m", "live": False})


def _gain(text: str) -> Meta:
    return Meta(ge=0, le=1e6, description=text)


def _name(text: str) -> Meta:
    """A frame or namespace, with or without a leading slash."""
    return Meta(pattern=r"^/?[A-Za-z][A-Za-z0-9_]*(/[A-Za-z0-9_]+)*\Z", max_length=255, description=text, extra=_FIXED)


_JERKS = tuple(f"{axis}.{end}_jerk" for axis in ("linear", "angular") for end in ("min", "max"))
"""Excluded by ``keep_curvature``: an axis that is slowed for the sake of the other cannot keep its own jerk limit."""

Diagonal = Annotated[
    tuple[Annotated[float, Meta(ge=0, le=1e12)], ...],
    Meta(min_length=6, max_length=6, description="Variances of x, y, z, roll, pitch, yaw."),
]


class AxisParameters(Parameters, frozen=True, kw_only=True):
    """The limits of one axis. An omitted limit is the model's, or none; an omitted ``min`` is minus the ``max``.

    ``min_acceleration`` limits every decrease of speed and ``max_acceleration`` every increase, as in ROS 1. ROS 2's
    four limits override them; their signs do not matter.
    """

    min_velocity: (
        Annotated[float, Meta(ge=-1000, le=0, description="Limit of the reverse speed.", extra=_SPEED)] | None
    ) = None
    max_velocity: (
        Annotated[float, Meta(ge=0, le=1000, description="Limit of the forward speed.", extra=_SPEED)] | None
    ) = None
    min_acceleration: Annotated[float, _fall("Limit of any decrease of the speed.")] | None = None
    max_acceleration: Annotated[float, _rise("Limit of any increase of the speed.")] | None = None
    max_deceleration: Annotated[float, _either("Limit of the deceleration when moving forwards")] | None = None
    max_acceleration_reverse: Annotated[float, _either("Limit of the acceleration in reverse")] | None = None
    max_deceleration_reverse: Annotated[float, _either("Limit of the deceleration in reverse")] | None = None
    min_jerk: Annotated[float, _fall("Limit of any decrease of the acceleration.")] | None = None
    max_jerk: Annotated[float, _rise("Limit of any increase of the acceleration.")] | None = None


class PidParameters(Parameters, frozen=True, kw_only=True):
    """Gains of a torque-driven wheel, with the semantics of ``pid_gains`` in ``gazebo_ros_control``."""

    p: Annotated[float, _gain("Proportional gain, in N m per rad/s.")]
    i: Annotated[float, _gain("Integral gain, in N m per rad.")] = 0.0
    d: Annotated[float, _gain("Derivative gain, in N m per rad/s2.")] = 0.0
    i_clamp: Annotated[float, _gain("Limit of the integral term, in N m; as in ROS, 0 disables the term.")] = 0.0
    i_clamp_min: (
        Annotated[
            float, Meta(ge=-1e6, le=0, description="Lower bound of the integral term, in N m; overrides minus i_clamp.")
        ]
        | None
    ) = None
    i_clamp_max: Annotated[float, _gain("Upper bound of the integral term, in N m; overrides i_clamp.")] | None = None
    antiwindup: Annotated[bool, Meta(description="Clamp the integral itself, not only its term.")] = False


class BaseParameters(Parameters, frozen=True, kw_only=True):
    """The parameters of one robot's base and sensors. None stands for the model's ``[drive]``, or else the default.

    The set of a robot ``a`` is ``/a/base``. All are live except those that are fixed when the robot is spawned; the
    gains of a wheel's PID are live, but it cannot be switched on or off.
    """

    cmd_vel_timeout: Annotated[
        float,
        Meta(ge=0, le=60, description="Ignore commands older than this; 0 disables the time-out.", extra={"unit": "s"}),
    ] = 0.25
    clamp: Annotated[bool, Meta(description="Limit commands to the hardware's maximum speeds.")] = True
    jump: Annotated[
        float,
        Meta(
            ge=0,
            le=1,
            description="Speed difference within which wheels jump to their target, as in Gazebo.",
            extra={"unit": "m/s"},
        ),
    ] = 0.0
    odometry: Annotated[
        Literal["model", "world", "encoder"],
        Meta(
            description="Source of odometry: the true pose, the wheel encoders, or the model's default.", extra=_FIXED
        ),
    ] = "model"
    odometry_origin: Annotated[
        Literal["model", "world", "start"],
        Meta(
            description="Where wheel odometry starts: at the true pose, at 0, or as the model's default.", extra=_FIXED
        ),
    ] = "model"
    odometry_error: Annotated[
        float,
        Meta(
            ge=0,
            le=10,
            description="Scale of the model's random errors of wheel radii and separation in odometry; 0: none.",
        ),
    ] = 1.0
    noise: Annotated[bool, Meta(description="Add the noise of the real sensors.")] = True

    left_wheel: Annotated[str, Meta(description="Joint of the left wheel.", extra=_FIXED)] | None = None
    right_wheel: Annotated[str, Meta(description="Joint of the right wheel.", extra=_FIXED)] | None = None
    allow_swapped_wheels: Annotated[
        bool, Meta(description="Allow left and right wheels to be exchanged.", extra=_FIXED)
    ] = False
    wheel_separation: Annotated[float, _length("Distance between the wheels.")] | None = None
    wheel_radius: Annotated[float, _length("Radius of both wheels.")] | None = None
    wheel_separation_multiplier: Annotated[float, _share("Multiplier for the wheel separation.")] | None = None
    wheel_radius_multiplier: (
        Annotated[float, _share("Multiplier for both wheel radii; overrides the next two.")] | None
    ) = None
    left_wheel_radius_multiplier: Annotated[float, _share("Multiplier for the left wheel radius.")] | None = None
    right_wheel_radius_multiplier: Annotated[float, _share("Multiplier for the right wheel radius.")] | None = None

    ramp: (
        Annotated[
            Literal["wheels", "base"],
            Meta(
                description="Apply acceleration and brake limits per wheel or to the base.",
                extra=_FIXED,
            ),
        ]
        | None
    ) = None
    linear: Annotated[AxisParameters, Meta(description="Limits of the linear velocity.")] | None = None
    angular: Annotated[AxisParameters, Meta(description="Limits of the angular velocity.")] | None = None
    jerk_rule: (
        Annotated[
            Literal["ros1", "ros2"],
            Meta(description="Jerk limiter to imitate; that of ROS 1 doubles the limits and overshoots."),
        ]
        | None
    ) = None
    keep_curvature: (
        Annotated[
            bool,
            Meta(
                description="Scale both axes together, so that limits do not change the path.",
                extra={"excludes": _JERKS},
            ),
        ]
        | None
    ) = None
    brake: (
        Annotated[
            float,
            Meta(
                gt=0, le=1e6, description="Deceleration after a time-out or an emergency stop.", extra={"unit": "m/s2"}
            ),
        ]
        | None
    ) = None
    brake_angular: (
        Annotated[
            float,
            Meta(
                gt=0,
                le=1e6,
                description="As brake, for turning; by default, brake over half the wheel separation.",
                extra={"unit": "rad/s2"},
            ),
        ]
        | None
    ) = None

    allow_multiple_cmd_vel_publishers: (
        Annotated[
            bool,
            Meta(
                description="Follow the newest command of several publishers; otherwise, brake while there are several."
            ),
        ]
        | None
    ) = None
    use_stamped_vel: Annotated[bool, Meta(description="Expect TwistStamped on cmd_vel.", extra=_FIXED)] | None = None
    publish_cmd: (
        Annotated[bool, Meta(description="Publish the limited command on cmd_vel_out.", extra=_FIXED)] | None
    ) = None

    open_loop: (
        Annotated[bool, Meta(description="Compute odometry from commands instead of wheel encoders.", extra=_FIXED)]
        | None
    ) = None
    velocity_rolling_window_size: (
        Annotated[
            int, Meta(ge=1, le=100, description="Number of control ticks over which odometry averages its speed.")
        ]
        | None
    ) = None
    pose_covariance_diagonal: Diagonal | None = None
    twist_covariance_diagonal: Diagonal | None = None
    publish_rate: (
        Annotated[
            float, Meta(ge=0, le=MAX_RATE, description="Rate of odometry; 0 publishes none.", extra={"unit": "Hz"})
        ]
        | None
    ) = None
    enable_odom_tf: Annotated[bool, Meta(description="Publish odometry on /tf.")] | None = None
    odom_frame_id: Annotated[str, _name("Parent frame of odometry, without the frame prefix.")] | None = None
    base_frame_id: (
        Annotated[str, _name("Child frame of odometry, without the frame prefix; the root link by default.")] | None
    ) = None
    controller: (
        Annotated[
            str,
            _name(
                "Name of the controller, as in ros_control: a sub-namespace with second command and odometry topics."
            ),
        ]
        | None
    ) = None
    enable_link_tf: (
        Annotated[
            bool,
            Meta(
                description="Publish link transforms on /tf; otherwise, leave them to the state service.", extra=_FIXED
            ),
        ]
        | None
    ) = None
    wheel_pid: (
        Annotated[PidParameters, Meta(description="Drive the wheels by torque, with this PID controller.")] | None
    ) = None


class JointParameters(Parameters, frozen=True, kw_only=True):
    """The parameters of one model's joints. None stands for the value in the URDF.

    The set of a robot ``a`` is ``/a/joints``. All are live except ``enable_link_tf``.
    """

    effort_mode: Annotated[
        Literal["replace", "sum"],
        Meta(description="Overlapping effort jobs: the newest replaces the others, or, as in Gazebo, all add up."),
    ] = "replace"
    effort_clamp: Annotated[
        Literal["total", "each"],
        Meta(description="Apply the URDF's effort limit to the total effort, or, as in Gazebo, to each job."),
    ] = "total"
    velocity_rule: Annotated[
        Literal["unspecified", "gazebo"],
        Meta(description="Treat a URDF velocity limit of 0 as unspecified, or, as in Gazebo, as a limit."),
    ] = "unspecified"
    damping: (
        Annotated[
            float, Meta(ge=0, le=1e6, description="Damping of every joint.", extra={"unit": "N m s/rad or N s/m"})
        ]
        | None
    ) = None
    friction: (
        Annotated[float, Meta(ge=0, le=1e6, description="Dry friction of every joint.", extra={"unit": "N m or N"})]
        | None
    ) = None
    noise: Annotated[bool, Meta(description="Add the noise of the real sensors.")] = True
    enable_link_tf: Annotated[
        bool,
        Meta(description="Publish link transforms; otherwise, leave them to the state service.", extra={"live": False}),
    ] = True


Coordinate = Annotated[float, Meta(ge=-1e4, le=1e4, extra={"unit": "m"})]


class RobotEntry(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A robot and its spawn pose.

    ``parameters`` apply to a model with a base, ``joint_parameters`` to one without. ``joints`` are initial positions,
    rad or m; 0 for joints not listed. Its topics are in ``namespace``: its name if that is empty, the root if it is
    ``/``. Its frames begin with ``frame_prefix``: its name and a slash if that is None. A ``joint_state_rate`` of 0
    stands for the model's.
    """

    name: str
    model: str
    x: Coordinate = 0.0
    y: Coordinate = 0.0
    z: Coordinate = 0.0
    yaw: float = 0.0
    namespace: str = ""
    frame_prefix: str | None = None
    parameters: BaseParameters = BaseParameters()
    joint_parameters: JointParameters = JointParameters()
    joint_state_rate: Annotated[float, Meta(ge=0, le=1000, extra={"unit": "Hz"})] = 0.0
    joints: dict[str, float] = {}

"""The parameters of a robot: its base and sensors, by the names of ROS's ``diff_drive_controller``, or its joints."""

from __future__ import annotations

from typing import Annotated, Literal

from msgspec import Meta

from services.runtime.parameters.base import Parameters

MAX_RATE = 50.0
"""Hz; odometry goes out with the control ticks, at most with each."""


_FIXED = {"live": False}
"""What a robot is built of in the world and on the network when it is spawned."""


_SPEED = {"unit": "m/s or rad/s"}
_RATE = {"unit": "m/s2 or rad/s2"}


def _rise(text: str) -> Meta:
    return Meta(gt=0, le=1e6, description=text, extra=_RATE)


def _fall(text: str) -> Meta:
    return Meta(ge=-1e6, lt=0, description=text, extra=_RATE)


def _either(text: str) -> Meta:
    return Meta(ge=-1e6, le=1e6, description=f"{text}, not 0", extra=_RATE)


def _share(text: str) -> Meta:
    """Skid-steered robots are configured with a separation of 1.875 and 2.3 times the measured one."""
    return Meta(ge=0.1, le=10, description=text)


def _length(text: str) -> Meta:
    return Meta(ge=0.001, le=10, description=text, extra={"unit": "m", "live": False})


def _gain(text: str) -> Meta:
    return Meta(ge=0, le=1e6, description=text)


_JERKS = tuple(f"{axis}.{end}_jerk" for axis in ("linear", "angular") for end in ("min", "max"))
"""An axis that is slowed for the other one cannot keep to a jerk of its own."""

Diagonal = Annotated[
    tuple[Annotated[float, Meta(ge=0, le=1e12)], ...],
    Meta(min_length=6, max_length=6, description="variances of x, y, z, roll, pitch, yaw"),
]


class AxisParameters(Parameters, frozen=True, kw_only=True):
    """The limits of one axis. What is left open is the model's, or no limit; a ``min`` left open is minus its ``max``.

    ROS 1 has ``min_acceleration`` for every decrease and ``max_acceleration`` for every increase. ROS 2's four win over
    them; their signs do not matter.
    """

    min_velocity: Annotated[float, Meta(ge=-1000, le=0, description="fastest backwards", extra=_SPEED)] | None = None
    max_velocity: Annotated[float, Meta(ge=0, le=1000, description="fastest forwards", extra=_SPEED)] | None = None
    min_acceleration: Annotated[float, _fall("of any decrease")] | None = None
    max_acceleration: Annotated[float, _rise("of any increase")] | None = None
    max_deceleration: Annotated[float, _either("slowing down forwards")] | None = None
    max_acceleration_reverse: Annotated[float, _either("speeding up backwards")] | None = None
    max_deceleration_reverse: Annotated[float, _either("slowing down backwards")] | None = None
    min_jerk: Annotated[float, _fall("of any decrease of acceleration")] | None = None
    max_jerk: Annotated[float, _rise("of any increase of acceleration")] | None = None


class PidParameters(Parameters, frozen=True, kw_only=True):
    """A wheel driven by torque instead of by speed, with the semantics of ``gazebo_ros_control``'s ``pid_gains``."""

    p: Annotated[float, _gain("N m per rad/s")]
    i: Annotated[float, _gain("N m per rad")] = 0.0
    d: Annotated[float, _gain("N m per rad/s2")] = 0.0
    i_clamp: Annotated[float, _gain("bound of the integral's share, N m; 0, as in ROS, switches it off")] = 0.0
    i_clamp_min: Annotated[float, Meta(ge=-1e6, le=0, description="instead of minus i_clamp")] | None = None
    i_clamp_max: Annotated[float, _gain("instead of i_clamp")] | None = None
    antiwindup: Annotated[bool, Meta(description="clamp the integral itself, not only its share")] = False


class BaseParameters(Parameters, frozen=True, kw_only=True):
    """How one robot's base and sensors behave. None: as the model's ``[drive]`` says, else as written there.

    The set of a robot ``a`` is ``/a/base``. All are live but what a robot is built of when it is spawned; a wheel's PID
    changes its gains live, and is not switched on or off.
    """

    cmd_vel_timeout: Annotated[
        float,
        Meta(ge=0, le=60, description="a command older than this is not obeyed; 0 disables it", extra={"unit": "s"}),
    ] = 0.25
    clamp: Annotated[bool, Meta(description="keep to the hardware's speeds; false obeys anything")] = True
    jump: Annotated[
        float, Meta(ge=0, le=1, description="Gazebo's rule: within this, wheels jump to speed", extra={"unit": "m/s"})
    ] = 0.0
    odometry: Annotated[
        Literal["model", "world", "encoder"],
        Meta(description="true pose, or what the wheels tell; the model's choice", extra=_FIXED),
    ] = "model"
    noise: Annotated[bool, Meta(description="sensors have the noise of the real ones")] = True

    left_wheel: Annotated[str, Meta(description="joint of the left wheel; the model's", extra=_FIXED)] | None = None
    right_wheel: Annotated[str, Meta(description="joint of the right wheel; the model's", extra=_FIXED)] | None = None
    allow_swapped_wheels: Annotated[bool, Meta(description="drive with left and right exchanged", extra=_FIXED)] = False
    wheel_separation: Annotated[float, _length("between the wheels; the model's")] | None = None
    wheel_radius: Annotated[float, _length("of both wheels; the model's")] | None = None
    wheel_separation_multiplier: Annotated[float, _share("of what is configured; 1")] | None = None
    wheel_radius_multiplier: Annotated[float, _share("of both wheels, instead of the next two")] | None = None
    left_wheel_radius_multiplier: Annotated[float, _share("of what is configured; 1")] | None = None
    right_wheel_radius_multiplier: Annotated[float, _share("of what is configured; 1")] | None = None

    ramp: (
        Annotated[
            Literal["wheels", "base"],
            Meta(
                description="whose the model's acceleration and brake are: each wheel's rim's, or the base's axes'",
                extra=_FIXED,
            ),
        ]
        | None
    ) = None
    linear: Annotated[AxisParameters, Meta(description="limits of the speed")] | None = None
    angular: Annotated[AxisParameters, Meta(description="limits of the turn rate")] | None = None
    jerk_rule: Annotated[Literal["ros1", "ros2"], Meta(description="ros1 doubles jerk limits and swings")] | None = None
    keep_curvature: (
        Annotated[bool, Meta(description="limit both axes together; off", extra={"excludes": _JERKS})] | None
    ) = None
    brake: (
        Annotated[
            float,
            Meta(gt=0, le=1e6, description="after a time-out or e-stop; the model's", extra={"unit": "m/s2"}),
        ]
        | None
    ) = None
    brake_angular: (
        Annotated[
            float,
            Meta(gt=0, le=1e6, description="as brake, turning; that of a rim on the spot", extra={"unit": "rad/s2"}),
        ]
        | None
    ) = None

    allow_multiple_cmd_vel_publishers: (
        Annotated[bool, Meta(description="false: brakes while several publish; true")] | None
    ) = None
    use_stamped_vel: Annotated[bool, Meta(description="cmd_vel is a TwistStamped; off", extra=_FIXED)] | None = None
    publish_cmd: (
        Annotated[bool, Meta(description="publish cmd_vel_out, the command after limiting; off", extra=_FIXED)] | None
    ) = None

    open_loop: (
        Annotated[bool, Meta(description="odometry from commands instead of wheels; off", extra=_FIXED)] | None
    ) = None
    velocity_rolling_window_size: (
        Annotated[int, Meta(ge=1, le=100, description="control ticks that odometry's speed is the mean of; 2")] | None
    ) = None
    pose_covariance_diagonal: Diagonal | None = None
    twist_covariance_diagonal: Diagonal | None = None
    publish_rate: (
        Annotated[float, Meta(ge=0, le=MAX_RATE, description="of odometry; the model's", extra={"unit": "Hz"})] | None
    ) = None
    enable_odom_tf: Annotated[bool, Meta(description="odometry on /tf; on")] | None = None
    enable_link_tf: (
        Annotated[bool, Meta(description="links on /tf; false leaves them to the service state; on", extra=_FIXED)]
        | None
    ) = None
    wheel_pid: Annotated[PidParameters, Meta(description="drive the wheels by torque; off")] | None = None


class JointParameters(Parameters, frozen=True, kw_only=True):
    """How the joints of one model behave. None: as the model's URDF says.

    The set of a robot ``a`` is ``/a/joints``. All are live but who tells its links.
    """

    effort_mode: Annotated[
        Literal["replace", "sum"],
        Meta(description="the job that began last acts, or, as in Gazebo, all that overlap add up"),
    ] = "replace"
    effort_clamp: Annotated[
        Literal["total", "each"],
        Meta(description="the URDF's effort limit holds for what acts, or, as in Gazebo, for each job by itself"),
    ] = "total"
    velocity_rule: Annotated[
        Literal["unspecified", "gazebo"],
        Meta(description="a URDF velocity of 0 is none, or, as in Gazebo, a limit: no effort along the motion"),
    ] = "unspecified"
    damping: (
        Annotated[
            float, Meta(ge=0, le=1e6, description="of every joint; the URDF's", extra={"unit": "N m s/rad or N s/m"})
        ]
        | None
    ) = None
    friction: (
        Annotated[float, Meta(ge=0, le=1e6, description="dry, of every joint; the URDF's", extra={"unit": "N m or N"})]
        | None
    ) = None
    noise: Annotated[bool, Meta(description="sensors have the noise of the real ones")] = True
    enable_link_tf: Annotated[
        bool,
        Meta(description="links on /tf and /tf_static; false leaves them to the service state", extra={"live": False}),
    ] = True

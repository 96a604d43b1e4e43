"""elea_msgs of the simulation: models that come and go, their states and bases, and time."""

from typing import Annotated, ClassVar

from msgspec import Meta

from messages.base import MOST_ITEMS, Count, Finite, Message, Metres, NameStr, Radians, ScopedName
from messages.elea import ModelState, Seconds
from messages.geometry import Pose, Twist
from messages.parameters import Assignment


class SimStatus(Message, frozen=True, kw_only=True):
    """The state of simulation time.

    ``absent`` are the nodes of the fleet that were not ready when time began. In real time, ``lags`` counts how often
    the simulation fell behind the wall clock and gave up catching up, and ``lag`` [s] is the wall time lost by that.
    """

    ROS_TYPE: ClassVar[str] = "elea_msgs/SimStatus"
    begun: bool = False
    absent: tuple[str, ...] = ()
    lags: Count = 0
    lag: Seconds = 0.0


class SpawnModel(Message, frozen=True, kw_only=True):
    """Put a robot into the world as ``name``.

    ``model`` is one of ``models/``, or the path of a URDF in the folders of the fleet; or ``urdf`` is the URDF itself
    (or an SDF), and ``model``, if there is any, its name for people. Its topics are in ``namespace``: the name when
    empty, the root for ``/``. Its frames begin with ``frame_prefix``: the name and a slash when that is None, nothing
    when it is empty.

    ``pose`` is in ``reference_frame``: the world when that is empty, ``world`` or ``map``, else an entity (``model`` or
    ``model::link``). ``joint_names`` start at ``joint_positions`` (rad or m), all others at 0. ``parameters`` are those
    of its base or of its joints, as a fleet file has them.
    """

    ROS_TYPE: ClassVar[str] = "elea_msgs/SpawnModel"
    name: NameStr = ""
    model: NameStr = ""
    pose: Pose = Pose()
    namespace: NameStr = ""
    reference_frame: ScopedName = ""
    joint_names: Annotated[tuple[NameStr, ...], Meta(max_length=MOST_ITEMS)] = ()
    joint_positions: Annotated[tuple[Finite, ...], Meta(max_length=MOST_ITEMS)] = ()
    parameters: Annotated[tuple[Assignment, ...], Meta(max_length=MOST_ITEMS)] = ()
    frame_prefix: NameStr | None = None
    urdf: Annotated[str, Meta(max_length=1 << 20)] = ""


class SetModelState(Message, frozen=True, kw_only=True):
    """Move a model; joint angles keep their values.

    Without a ``reference_frame`` the pose is in the world and the twist in the model's own axes, as in odometry;
    with one (``world``, ``model`` or ``model::link``), both are in its axes, as in Gazebo.
    """

    ROS_TYPE: ClassVar[str] = "elea_msgs/SetModelState"
    name: NameStr = ""
    pose: Pose = Pose()
    twist: Twist = Twist()
    reference_frame: ScopedName = ""


class SetOdometry(Message, frozen=True, kw_only=True):
    """From now on, the wheel odometry of the robot ``name`` counts from here: ROS 2's ``set_odometry``."""

    ROS_TYPE: ClassVar[str] = "elea_msgs/SetOdometry"
    name: NameStr = ""
    x: Metres = 0.0
    y: Metres = 0.0
    yaw: Radians = 0.0


Multiplier = Annotated[float, Meta(ge=0.1, le=10)]


class DriveSettings(Message, frozen=True, kw_only=True):
    """The live parameters of the base of the robot ``name``; asked, None leaves one as it is.

    They are replaced together between two physics steps, or, when one is out of bounds, not at all.
    """

    ROS_TYPE: ClassVar[str] = "elea_msgs/DriveSettings"
    name: NameStr = ""
    wheel_separation_multiplier: Multiplier | None = None
    left_wheel_radius_multiplier: Multiplier | None = None
    right_wheel_radius_multiplier: Multiplier | None = None
    publish_rate: Annotated[float, Meta(ge=0, le=50, extra={"unit": "Hz"})] | None = None
    enable_odom_tf: bool | None = None


class ReleaseStop(Message, frozen=True, kw_only=True):
    """Release emergency stops of other holders: of the robot ``name``, or, if that is empty, the stop of all robots.

    ``holder`` is the node, or its ``id``, whose stop is released; when it is empty, that of every holder is.
    """

    ROS_TYPE: ClassVar[str] = "elea_msgs/ReleaseStop"
    name: Annotated[str, Meta(max_length=255)] = ""
    holder: Annotated[str, Meta(max_length=255)] = ""


class ModelList(Message, frozen=True, kw_only=True):
    """All models in the world."""

    ROS_TYPE: ClassVar[str] = "elea_msgs/ModelList"
    models: tuple[ModelState, ...] = ()


class Steps(Message, frozen=True, kw_only=True):
    """A number of physics steps to run while paused."""

    ROS_TYPE: ClassVar[str] = "elea_msgs/Steps"
    count: Annotated[int, Meta(ge=1, le=1_000_000)] = 1


class SimTime(Message, frozen=True, kw_only=True):
    """Simulation time, in ns and in physics steps since the last reset."""

    ROS_TYPE: ClassVar[str] = "elea_msgs/SimTime"
    time: Count = 0
    tick: Count = 0
    epoch: Count = 0


class GetModelState(Message, frozen=True, kw_only=True):
    """Pose and twist of the model ``name``.

    Without a ``relative_entity`` the pose is in the world and the twist in the model's own axes; with one (``world``,
    ``model`` or ``model::link``), both are as seen from it, in its axes, as in Gazebo: the twist is the difference.
    """

    ROS_TYPE: ClassVar[str] = "elea_msgs/GetModelState"
    name: NameStr = ""
    relative_entity: ScopedName = ""

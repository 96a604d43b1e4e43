"""elea_msgs of the simulation: spawning and moving models, their states and bases, and simulation time."""

from typing import Annotated, ClassVar

from msgspec import Meta

from messages.base import MOST_ITEMS, Count, Finite, Message, Metres, NameStr, Radians, ScopedName
from messages.elea import ModelState, Seconds
from messages.geometry import Pose, Twist
from messages.parameters import Assignment


class SimStatus(Message, frozen=True, kw_only=True):
    """The state of simulation time.

    ``absent`` are the nodes of the fleet that were not ready when time started. In real time, ``lags`` counts how often
    the simulation fell behind the wall clock and stopped catching up, and ``lag`` [s] is the wall time lost thereby.
    """

    ROS_TYPE: ClassVar[str] = "elea_msgs/SimStatus"
    begun: bool = False
    absent: tuple[str, ...] = ()
    lags: Count = 0
    lag: Seconds = 0.0


class SpawnModel(Message, frozen=True, kw_only=True):
    """Spawn a robot as ``name``.

    ``model`` is one of ``models/``, or the path of a URDF in the folders of the fleet; alternatively ``urdf`` is the
    text of a URDF or SDF, and ``model`` an optional display name. Its topics are in ``namespace``: by default in one
    with its name, for ``/`` in the root. Its frames begin with ``frame_prefix``: by default its name and a slash; an
    empty text adds no prefix.

    ``pose`` is in ``reference_frame``: the world if it is empty, ``world`` or ``map``, else an entity (``model`` or
    ``model::link``). ``joint_names`` start at ``joint_positions`` [rad or m], all other joints at 0. ``parameters`` are
    those of its base or its joints, as in a fleet file.
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
    """Move a model; its joint positions are kept.

    Without a ``reference_frame``, the pose is in the world and the twist in the model's own axes, as in odometry; with
    one (``world``, ``model`` or ``model::link``), both are in its axes, as in Gazebo.
    """

    ROS_TYPE: ClassVar[str] = "elea_msgs/SetModelState"
    name: NameStr = ""
    pose: Pose = Pose()
    twist: Twist = Twist()
    reference_frame: ScopedName = ""


class SetOdometry(Message, frozen=True, kw_only=True):
    """Set the pose of the wheel odometry of the robot ``name``, as ROS 2's ``set_odometry``."""

    ROS_TYPE: ClassVar[str] = "elea_msgs/SetOdometry"
    name: NameStr = ""
    x: Metres = 0.0
    y: Metres = 0.0
    yaw: Radians = 0.0


Multiplier = Annotated[float, Meta(ge=0.1, le=10)]


class DriveSettings(Message, frozen=True, kw_only=True):
    """The live parameters of the base of the robot ``name``; in a request, None keeps the current value.

    All are applied together between two physics steps, or, if one is out of bounds, none.
    """

    ROS_TYPE: ClassVar[str] = "elea_msgs/DriveSettings"
    name: NameStr = ""
    wheel_separation_multiplier: Multiplier | None = None
    left_wheel_radius_multiplier: Multiplier | None = None
    right_wheel_radius_multiplier: Multiplier | None = None
    publish_rate: Annotated[float, Meta(ge=0, le=50, extra={"unit": "Hz"})] | None = None
    enable_odom_tf: bool | None = None


class ReleaseStop(Message, frozen=True, kw_only=True):
    """Release emergency stops of other holders: of the robot ``name``, or, if it is empty, the stop of all robots.

    ``holder`` is the node, or its ``id``, whose stop is released; if it is empty, the stops of all holders are.
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
    """Get the pose and twist of the model ``name``.

    Without a ``relative_entity``, the pose is in the world and the twist in the model's own axes; with one (``world``,
    ``model`` or ``model::link``), both are relative to it, in its axes, as in Gazebo: the twist is the difference.
    """

    ROS_TYPE: ClassVar[str] = "elea_msgs/GetModelState"
    name: NameStr = ""
    relative_entity: ScopedName = ""

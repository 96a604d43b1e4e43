"""Gazebo's world services as elea_msgs: efforts, wrenches, joints, links and properties, scoped by model; its topics.

A joint or link is given by its bare name if only one model has it, else as ``model::name`` or ``model/name``.
"""

from typing import Annotated, ClassVar, Literal

from msgspec import Meta

from messages.base import MOST_ITEMS, Count, Finite, Message, Metres, NameStr, ScopedName
from messages.geometry import Point, Pose, Twist, Vector3, Wrench
from messages.joints import JointEffort
from messages.std import Header, Time

Duration = Annotated[float, Meta(ge=-1, le=1e9, extra={"unit": "s"})]


class ApplyEffort(Message, frozen=True, kw_only=True):
    """Apply an effort to a joint of ``model``, which may be empty if the joint's name includes it."""

    ROS_TYPE: ClassVar[str] = "elea_msgs/ApplyEffort"
    model: NameStr = ""
    job: JointEffort = JointEffort()


class JointName(Message, frozen=True, kw_only=True):
    """A joint; ``model`` may be empty if the joint's name includes it."""

    ROS_TYPE: ClassVar[str] = "elea_msgs/JointName"
    model: NameStr = ""
    joint_name: NameStr = ""


class SetConfiguration(Message, frozen=True, kw_only=True):
    """Set joint positions of a model [rad or m], at rest; unnamed joints keep theirs."""

    ROS_TYPE: ClassVar[str] = "elea_msgs/SetConfiguration"
    model: NameStr = ""
    joint_names: Annotated[tuple[NameStr, ...], Meta(max_length=MOST_ITEMS)] = ()
    joint_positions: Annotated[tuple[Finite, ...], Meta(max_length=MOST_ITEMS)] = ()


class ApplyWrench(Message, frozen=True, kw_only=True):
    """Apply a force [N] and torque [N m] to a link, from ``start_time`` (now, if past) for ``duration`` seconds.

    Both are in the axes of ``reference_frame``: the world's if it is empty, ``world`` or ``map``, else an entity's,
    which they follow as it turns. The force acts at ``reference_point`` [m], in the link's own frame. All wrenches
    acting on a link add up. Times are as in JointEffort.
    """

    ROS_TYPE: ClassVar[str] = "elea_msgs/ApplyWrench"
    body_name: ScopedName = ""
    reference_frame: ScopedName = ""
    reference_point: Point = Point()
    wrench: Wrench = Wrench()
    start_time: Time = Time()
    duration: Duration = 0.0


class LinkName(Message, frozen=True, kw_only=True):
    """A link (``model::link``), or a model for its root; ``reference_frame`` as in GetModelState."""

    ROS_TYPE: ClassVar[str] = "elea_msgs/LinkName"
    link_name: ScopedName = ""
    reference_frame: ScopedName = ""


class LinkState(Message, frozen=True, kw_only=True):
    """Pose and twist of a link's frame relative to ``reference_frame``, in its axes."""

    ROS_TYPE: ClassVar[str] = "elea_msgs/LinkState"
    link_name: str = ""
    pose: Pose = Pose()
    twist: Twist = Twist()
    reference_frame: str = ""


class LinkProperties(Message, frozen=True, kw_only=True):
    """Properties of a link: mass [kg; 0 if fixed to the world], centre of mass in its own frame, principal moments [kg
    m2] about the axes of ``com``, friction, and the number of pending and active wrenches."""

    ROS_TYPE: ClassVar[str] = "elea_msgs/LinkProperties"
    link_name: str = ""
    com: Pose = Pose()
    mass: Finite = 0.0
    inertia: Vector3 = Vector3()
    friction: Finite = 0.0
    wrenches: Count = 0


class ModelProperties(Message, frozen=True, kw_only=True):
    """The parts of a model. ``is_static``: its root is fixed to the world; ``mass`` [kg]: of the moving links."""

    ROS_TYPE: ClassVar[str] = "elea_msgs/ModelProperties"
    name: str = ""
    model: str = ""
    about: str = ""
    namespace: str = ""
    base_frame: str = ""
    links: tuple[str, ...] = ()
    joints: tuple[str, ...] = ()
    mass: Finite = 0.0
    radius: Metres = 0.0
    is_static: bool = False
    driven: bool = False


class WorldProperties(Message, frozen=True, kw_only=True):
    """The world and its physics, which are fixed during a run: step [s], gravity [m/s2], solver iterations."""

    ROS_TYPE: ClassVar[str] = "elea_msgs/WorldProperties"
    world: str = ""
    sim_time: Time = Time()
    tick: Count = 0
    epoch: Count = 0
    mode: Literal["lockstep", "real"] = "real"
    factor: Finite = 1.0
    pause: bool = False
    time_step: Finite = 0.0
    gravity: Vector3 = Vector3()
    iterations: Count = 0
    ground_friction: Finite = 0.0
    obstacles: tuple[str, ...] = ()
    model_names: tuple[str, ...] = ()


class ModelStates(Message, frozen=True, kw_only=True):
    """Poses and twists of all models, in the world frame; the three lists are in the same order."""

    ROS_TYPE: ClassVar[str] = "gazebo_msgs/ModelStates"
    name: tuple[str, ...] = ()
    pose: tuple[Pose, ...] = ()
    twist: tuple[Twist, ...] = ()


class LinkStates(Message, frozen=True, kw_only=True):
    """Poses and twists of all links, in the world frame, each named ``model::link``."""

    ROS_TYPE: ClassVar[str] = "gazebo_msgs/LinkStates"
    name: tuple[str, ...] = ()
    pose: tuple[Pose, ...] = ()
    twist: tuple[Twist, ...] = ()


class WorldStates(Message, frozen=True, kw_only=True):
    """Poses and twists of bodies in the world at the header's time; Gazebo's ModelStates have no time."""

    ROS_TYPE: ClassVar[str] = "elea_msgs/WorldStates"
    header: Header = Header()
    name: tuple[str, ...] = ()
    pose: tuple[Pose, ...] = ()
    twist: tuple[Twist, ...] = ()

"""gazebo_msgs: the services and commands of Gazebo, under their own names and fields.

If a request fails, ``success`` is false in its response and ``status_message`` has the reason.
"""

from typing import Annotated, ClassVar

from msgspec import Meta

from messages.base import MOST_ITEMS, Finite, Message, NameStr, ScopedName
from messages.geometry import Point, Pose, Twist, Vector3, Wrench
from messages.std import Duration, Header, Time

Names = Annotated[tuple[NameStr, ...], Meta(max_length=MOST_ITEMS)]
Numbers = Annotated[tuple[Finite, ...], Meta(max_length=MOST_ITEMS)]
Unsigned = Annotated[int, Meta(ge=0, lt=2**32)]

REVOLUTE, CONTINUOUS, PRISMATIC, FIXED, BALL, UNIVERSAL = range(6)
"""Joint types in GetJointPropertiesResponse."""


class ModelState(Message, frozen=True, kw_only=True):
    """The pose and twist to set for a model, in the axes of ``reference_frame``; the world's if it is empty."""

    ROS_TYPE: ClassVar[str] = "gazebo_msgs/ModelState"
    model_name: NameStr = ""
    pose: Pose = Pose()
    twist: Twist = Twist()
    reference_frame: ScopedName = ""


class LinkState(Message, frozen=True, kw_only=True):
    """Pose and twist of a link, in the axes of ``reference_frame``; the world's if it is empty."""

    ROS_TYPE: ClassVar[str] = "gazebo_msgs/LinkState"
    link_name: ScopedName = ""
    pose: Pose = Pose()
    twist: Twist = Twist()
    reference_frame: ScopedName = ""


class ODEPhysics(Message, frozen=True, kw_only=True):
    """Settings of the ODE engine; only the number of solver iterations has a counterpart here."""

    ROS_TYPE: ClassVar[str] = "gazebo_msgs/ODEPhysics"
    auto_disable_bodies: bool = False
    sor_pgs_precon_iters: Unsigned = 0
    sor_pgs_iters: Unsigned = 0
    sor_pgs_w: Finite = 0.0
    sor_pgs_rms_error_tol: Finite = 0.0
    contact_surface_layer: Finite = 0.0
    contact_max_correcting_vel: Finite = 0.0
    cfm: Finite = 0.0
    erp: Finite = 0.0
    max_contacts: Unsigned = 0


class GetModelState(Message, frozen=True, kw_only=True):
    """Get the pose and twist of a model relative to an entity; the world if it is empty."""

    ROS_TYPE: ClassVar[str] = "gazebo_msgs/GetModelState"
    model_name: NameStr = ""
    relative_entity_name: ScopedName = ""


class GetModelStateResponse(Message, frozen=True, kw_only=True):
    """Pose and twist in the axes of the reference entity."""

    ROS_TYPE: ClassVar[str] = "gazebo_msgs/GetModelStateResponse"
    header: Header = Header()
    pose: Pose = Pose()
    twist: Twist = Twist()
    success: bool = False
    status_message: str = ""


class SetModelState(Message, frozen=True, kw_only=True):
    """Move a model."""

    ROS_TYPE: ClassVar[str] = "gazebo_msgs/SetModelState"
    model_state: ModelState = ModelState()


class SetModelStateResponse(Message, frozen=True, kw_only=True):
    """Whether the model was moved."""

    ROS_TYPE: ClassVar[str] = "gazebo_msgs/SetModelStateResponse"
    success: bool = False
    status_message: str = ""


class GetLinkState(Message, frozen=True, kw_only=True):
    """Get the pose and twist of a link (``model::link``) relative to an entity; the world if it is empty."""

    ROS_TYPE: ClassVar[str] = "gazebo_msgs/GetLinkState"
    link_name: ScopedName = ""
    reference_frame: ScopedName = ""


class GetLinkStateResponse(Message, frozen=True, kw_only=True):
    """The state of the link."""

    ROS_TYPE: ClassVar[str] = "gazebo_msgs/GetLinkStateResponse"
    link_state: LinkState = LinkState()
    success: bool = False
    status_message: str = ""


class SetLinkState(Message, frozen=True, kw_only=True):
    """Move a model by its root link."""

    ROS_TYPE: ClassVar[str] = "gazebo_msgs/SetLinkState"
    link_state: LinkState = LinkState()


class SetLinkStateResponse(Message, frozen=True, kw_only=True):
    """Whether the link was moved."""

    ROS_TYPE: ClassVar[str] = "gazebo_msgs/SetLinkStateResponse"
    success: bool = False
    status_message: str = ""


class GetModelProperties(Message, frozen=True, kw_only=True):
    """Get the links and joints of a model."""

    ROS_TYPE: ClassVar[str] = "gazebo_msgs/GetModelProperties"
    model_name: NameStr = ""


class GetModelPropertiesResponse(Message, frozen=True, kw_only=True):
    """The parts of a model: ``body_names`` are its links; geometries have no names here."""

    ROS_TYPE: ClassVar[str] = "gazebo_msgs/GetModelPropertiesResponse"
    parent_model_name: str = ""
    canonical_body_name: str = ""
    body_names: tuple[str, ...] = ()
    geom_names: tuple[str, ...] = ()
    joint_names: tuple[str, ...] = ()
    child_model_names: tuple[str, ...] = ()
    is_static: bool = False
    success: bool = False
    status_message: str = ""


class GetWorldProperties(Message, frozen=True, kw_only=True):
    """Get the names of all models."""

    ROS_TYPE: ClassVar[str] = "gazebo_msgs/GetWorldProperties"


class GetWorldPropertiesResponse(Message, frozen=True, kw_only=True):
    """Simulation time [s], and the models: the ground, the world's bodies, the robots."""

    ROS_TYPE: ClassVar[str] = "gazebo_msgs/GetWorldPropertiesResponse"
    sim_time: Finite = 0.0
    model_names: tuple[str, ...] = ()
    rendering_enabled: bool = True
    success: bool = False
    status_message: str = ""


class GetJointProperties(Message, frozen=True, kw_only=True):
    """Get the state of a joint: its bare name if only one model has it, or ``model::joint``."""

    ROS_TYPE: ClassVar[str] = "gazebo_msgs/GetJointProperties"
    joint_name: ScopedName = ""


class GetJointPropertiesResponse(Message, frozen=True, kw_only=True):
    """Type (0 revolute, 1 continuous, 2 prismatic), damping, position [rad or m] and rate of the one axis."""

    ROS_TYPE: ClassVar[str] = "gazebo_msgs/GetJointPropertiesResponse"
    type: Annotated[int, Meta(ge=0, le=255)] = 0
    damping: Numbers = ()
    position: Numbers = ()
    rate: Numbers = ()
    success: bool = False
    status_message: str = ""


class GetLinkProperties(Message, frozen=True, kw_only=True):
    """Get the mass and inertia of a link."""

    ROS_TYPE: ClassVar[str] = "gazebo_msgs/GetLinkProperties"
    link_name: ScopedName = ""


class GetLinkPropertiesResponse(Message, frozen=True, kw_only=True):
    """Centre of mass in the link's frame, mass [kg], and inertia [kg m2] about it, in the link's axes."""

    ROS_TYPE: ClassVar[str] = "gazebo_msgs/GetLinkPropertiesResponse"
    com: Pose = Pose()
    gravity_mode: bool = True
    mass: Finite = 0.0
    ixx: Finite = 0.0
    ixy: Finite = 0.0
    ixz: Finite = 0.0
    iyy: Finite = 0.0
    iyz: Finite = 0.0
    izz: Finite = 0.0
    success: bool = False
    status_message: str = ""


class ApplyJointEffort(Message, frozen=True, kw_only=True):
    """Apply an effort [N m or N] to a joint from ``start_time`` (now, if past); a negative duration is unlimited."""

    ROS_TYPE: ClassVar[str] = "gazebo_msgs/ApplyJointEffort"
    joint_name: ScopedName = ""
    effort: Finite = 0.0
    start_time: Time = Time()
    duration: Duration = Duration()


class ApplyJointEffortResponse(Message, frozen=True, kw_only=True):
    """Whether the effort was accepted."""

    ROS_TYPE: ClassVar[str] = "gazebo_msgs/ApplyJointEffortResponse"
    success: bool = False
    status_message: str = ""


class JointRequest(Message, frozen=True, kw_only=True):
    """Clear all efforts on a joint."""

    ROS_TYPE: ClassVar[str] = "gazebo_msgs/JointRequest"
    joint_name: ScopedName = ""


class JointRequestResponse(Message, frozen=True, kw_only=True):
    """An empty response."""

    ROS_TYPE: ClassVar[str] = "gazebo_msgs/JointRequestResponse"


class ApplyBodyWrench(Message, frozen=True, kw_only=True):
    """Apply a force [N] and torque [N m] to a link, in the axes of ``reference_frame``: the world's if it is empty.

    The force acts at ``reference_point`` of that frame; in the world frame, (0, 0, 0) means the centre of mass.
    """

    ROS_TYPE: ClassVar[str] = "gazebo_msgs/ApplyBodyWrench"
    body_name: ScopedName = ""
    reference_frame: ScopedName = ""
    reference_point: Point = Point()
    wrench: Wrench = Wrench()
    start_time: Time = Time()
    duration: Duration = Duration()


class ApplyBodyWrenchResponse(Message, frozen=True, kw_only=True):
    """Whether the wrench was accepted."""

    ROS_TYPE: ClassVar[str] = "gazebo_msgs/ApplyBodyWrenchResponse"
    success: bool = False
    status_message: str = ""


class BodyRequest(Message, frozen=True, kw_only=True):
    """Clear all wrenches on a link."""

    ROS_TYPE: ClassVar[str] = "gazebo_msgs/BodyRequest"
    body_name: ScopedName = ""


class BodyRequestResponse(Message, frozen=True, kw_only=True):
    """An empty response."""

    ROS_TYPE: ClassVar[str] = "gazebo_msgs/BodyRequestResponse"


class SetModelConfiguration(Message, frozen=True, kw_only=True):
    """Set joint positions of a model [rad or m]."""

    ROS_TYPE: ClassVar[str] = "gazebo_msgs/SetModelConfiguration"
    model_name: NameStr = ""
    urdf_param_name: NameStr = ""
    joint_names: Names = ()
    joint_positions: Numbers = ()


class SetModelConfigurationResponse(Message, frozen=True, kw_only=True):
    """Whether the positions were set."""

    ROS_TYPE: ClassVar[str] = "gazebo_msgs/SetModelConfigurationResponse"
    success: bool = False
    status_message: str = ""


class SpawnModel(Message, frozen=True, kw_only=True):
    """Spawn a model: its name, its URDF or SDF, its namespace and its pose."""

    ROS_TYPE: ClassVar[str] = "gazebo_msgs/SpawnModel"
    model_name: NameStr = ""
    model_xml: Annotated[str, Meta(max_length=1 << 20)] = ""
    robot_namespace: NameStr = ""
    initial_pose: Pose = Pose()
    reference_frame: ScopedName = ""


class SpawnModelResponse(Message, frozen=True, kw_only=True):
    """Whether the model was spawned."""

    ROS_TYPE: ClassVar[str] = "gazebo_msgs/SpawnModelResponse"
    success: bool = False
    status_message: str = ""


class DeleteModel(Message, frozen=True, kw_only=True):
    """Delete a model."""

    ROS_TYPE: ClassVar[str] = "gazebo_msgs/DeleteModel"
    model_name: NameStr = ""


class DeleteModelResponse(Message, frozen=True, kw_only=True):
    """Whether the model was deleted."""

    ROS_TYPE: ClassVar[str] = "gazebo_msgs/DeleteModelResponse"
    success: bool = False
    status_message: str = ""


class GetPhysicsProperties(Message, frozen=True, kw_only=True):
    """Get the properties of the physics."""

    ROS_TYPE: ClassVar[str] = "gazebo_msgs/GetPhysicsProperties"


class GetPhysicsPropertiesResponse(Message, frozen=True, kw_only=True):
    """Step [s], maximum steps per second of wall time (0 in lockstep: unlimited), gravity [m/s2]."""

    ROS_TYPE: ClassVar[str] = "gazebo_msgs/GetPhysicsPropertiesResponse"
    time_step: Finite = 0.0
    pause: bool = False
    max_update_rate: Finite = 0.0
    gravity: Vector3 = Vector3()
    ode_config: ODEPhysics = ODEPhysics()
    success: bool = False
    status_message: str = ""


class SetPhysicsProperties(Message, frozen=True, kw_only=True):
    """Set properties of the physics; they cannot change during a run."""

    ROS_TYPE: ClassVar[str] = "gazebo_msgs/SetPhysicsProperties"
    time_step: Finite = 0.0
    max_update_rate: Finite = 0.0
    gravity: Vector3 = Vector3()
    ode_config: ODEPhysics = ODEPhysics()


class SetPhysicsPropertiesResponse(Message, frozen=True, kw_only=True):
    """Whether the physics already has these properties."""

    ROS_TYPE: ClassVar[str] = "gazebo_msgs/SetPhysicsPropertiesResponse"
    success: bool = False
    status_message: str = ""

"""The services of Gazebo under their own names, served by the simulation for programs written for Gazebo."""

from messages.base import Message
from messages.gazebo_msgs import (
    ApplyBodyWrench,
    ApplyBodyWrenchResponse,
    ApplyJointEffort,
    ApplyJointEffortResponse,
    BodyRequest,
    BodyRequestResponse,
    DeleteModel,
    DeleteModelResponse,
    GetJointProperties,
    GetJointPropertiesResponse,
    GetLinkProperties,
    GetLinkPropertiesResponse,
    GetLinkState,
    GetLinkStateResponse,
    GetModelProperties,
    GetModelPropertiesResponse,
    GetModelState,
    GetModelStateResponse,
    GetPhysicsProperties,
    GetPhysicsPropertiesResponse,
    GetWorldProperties,
    GetWorldPropertiesResponse,
    JointRequest,
    JointRequestResponse,
    SetLinkState,
    SetLinkStateResponse,
    SetModelConfiguration,
    SetModelConfigurationResponse,
    SetModelState,
    SetModelStateResponse,
    SetPhysicsProperties,
    SetPhysicsPropertiesResponse,
    SpawnModel,
    SpawnModelResponse,
)
from messages.request import Request
from messages.std_srvs import Empty, EmptyResponse

MAX_SPAWN_BYTES = 5 << 18
"""Maximum size of a request with the text of a model."""

GET_MODEL_STATE = Request(
    "/gazebo/get_model_state", GetModelState, GetModelStateResponse, "Gazebo: get pose and twist of a model"
)
SET_MODEL_STATE = Request("/gazebo/set_model_state", SetModelState, SetModelStateResponse, "Gazebo: move a model")
GET_LINK_STATE = Request(
    "/gazebo/get_link_state", GetLinkState, GetLinkStateResponse, "Gazebo: get pose and twist of a link"
)
SET_LINK_STATE = Request(
    "/gazebo/set_link_state", SetLinkState, SetLinkStateResponse, "Gazebo: move a model by its root link"
)
GET_MODEL_PROPERTIES = Request(
    "/gazebo/get_model_properties",
    GetModelProperties,
    GetModelPropertiesResponse,
    "Gazebo: get links and joints of a model",
)
GET_WORLD_PROPERTIES = Request(
    "/gazebo/get_world_properties",
    GetWorldProperties,
    GetWorldPropertiesResponse,
    "Gazebo: get the names of all models",
)
GET_JOINT_PROPERTIES = Request(
    "/gazebo/get_joint_properties",
    GetJointProperties,
    GetJointPropertiesResponse,
    "Gazebo: get position and rate of a joint",
)
GET_LINK_PROPERTIES = Request(
    "/gazebo/get_link_properties",
    GetLinkProperties,
    GetLinkPropertiesResponse,
    "Gazebo: get mass and inertia of a link",
)
APPLY_JOINT_EFFORT = Request(
    "/gazebo/apply_joint_effort",
    ApplyJointEffort,
    ApplyJointEffortResponse,
    "Gazebo: apply an effort to a joint for some time",
)
CLEAR_JOINT_FORCES = Request(
    "/gazebo/clear_joint_forces", JointRequest, JointRequestResponse, "Gazebo: clear the efforts on a joint"
)
APPLY_BODY_WRENCH = Request(
    "/gazebo/apply_body_wrench",
    ApplyBodyWrench,
    ApplyBodyWrenchResponse,
    "Gazebo: apply a wrench to a link for some time",
)
CLEAR_BODY_WRENCHES = Request(
    "/gazebo/clear_body_wrenches", BodyRequest, BodyRequestResponse, "Gazebo: clear the wrenches on a link"
)
SET_MODEL_CONFIGURATION = Request(
    "/gazebo/set_model_configuration",
    SetModelConfiguration,
    SetModelConfigurationResponse,
    "Gazebo: set joint positions",
)
SPAWN_URDF_MODEL = Request(
    "/gazebo/spawn_urdf_model",
    SpawnModel,
    SpawnModelResponse,
    "Gazebo: spawn a model from the text of a URDF",
    MAX_SPAWN_BYTES,
)
SPAWN_SDF_MODEL = Request(
    "/gazebo/spawn_sdf_model",
    SpawnModel,
    SpawnModelResponse,
    "Gazebo: spawn a model from the text of an SDF",
    MAX_SPAWN_BYTES,
)
DELETE_MODEL = Request("/gazebo/delete_model", DeleteModel, DeleteModelResponse, "Gazebo: delete a model")
GET_PHYSICS_PROPERTIES = Request(
    "/gazebo/get_physics_properties",
    GetPhysicsProperties,
    GetPhysicsPropertiesResponse,
    "Gazebo: get the properties of the physics",
)
SET_PHYSICS_PROPERTIES = Request(
    "/gazebo/set_physics_properties",
    SetPhysicsProperties,
    SetPhysicsPropertiesResponse,
    "Gazebo: set the properties of the physics, which a run refuses",
)
PAUSE_PHYSICS = Request("/gazebo/pause_physics", Empty, EmptyResponse, "Gazebo: pause simulation time")
UNPAUSE_PHYSICS = Request("/gazebo/unpause_physics", Empty, EmptyResponse, "Gazebo: resume simulation time")
RESET_WORLD = Request("/gazebo/reset_world", Empty, EmptyResponse, "Gazebo: reset all models; time continues")
RESET_SIMULATION = Request(
    "/gazebo/reset_simulation", Empty, EmptyResponse, "Gazebo: reset all models, and time to zero"
)

GAZEBO_REQUESTS: tuple[Request[Message, Message], ...] = (
    GET_MODEL_STATE,
    SET_MODEL_STATE,
    GET_LINK_STATE,
    SET_LINK_STATE,
    GET_MODEL_PROPERTIES,
    GET_WORLD_PROPERTIES,
    GET_JOINT_PROPERTIES,
    GET_LINK_PROPERTIES,
    APPLY_JOINT_EFFORT,
    CLEAR_JOINT_FORCES,
    APPLY_BODY_WRENCH,
    CLEAR_BODY_WRENCHES,
    SET_MODEL_CONFIGURATION,
    SPAWN_URDF_MODEL,
    SPAWN_SDF_MODEL,
    DELETE_MODEL,
    GET_PHYSICS_PROPERTIES,
    SET_PHYSICS_PROPERTIES,
    PAUSE_PHYSICS,
    UNPAUSE_PHYSICS,
    RESET_WORLD,
    RESET_SIMULATION,
)
"""The services of Gazebo."""

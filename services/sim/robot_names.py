"""The namespace, frame prefix and frames of a robot, and checks that no two robots share them."""

from __future__ import annotations

from collections.abc import Iterable
from functools import cache
from typing import Protocol

from msgspec.structs import replace

from messages.names import BadName, absolute_namespace, validate
from messages.topics import CMD_VEL, CMD_VEL_OUT, ODOM
from models.model import RobotModel, read_model
from models.urdf import read_joints
from services.runtime.errors import BadInput
from services.sim.parameters import BaseParameters

ROOT_NAMESPACE = "/"
"""The namespace of a robot whose topics have no prefix: ``/cmd_vel`` and so on."""

WORLD_FRAME = "world"
"""The common root frame of all robots."""


class NamedRobot(Protocol):
    """A robot's names, as in a fleet file, a spawn request or the simulation."""

    @property
    def name(self) -> str:
        """Its name in requests and in the report."""
        ...

    @property
    def model(self) -> str:
        """Its model."""
        ...

    @property
    def namespace(self) -> str:
        """Namespace of its topics; its name if empty."""
        ...

    @property
    def frame_prefix(self) -> str | None:
        """Prefix of its frames; its name and a slash if None."""
        ...


def robot_namespace(robot: NamedRobot) -> str:
    """Return the absolute namespace of a robot's topics, ``/`` or ``/tb3_0``; raises BadName."""
    return absolute_namespace(robot.namespace or robot.name)


def robot_frame_prefix(robot: NamedRobot) -> str:
    """Return the prefix of a robot's frames: ``tb3_0/`` or nothing."""
    return f"{robot.name.strip('/')}/" if robot.frame_prefix is None else robot.frame_prefix


def robot_frames(robot: NamedRobot) -> frozenset[str]:
    """Return all frames of a robot; raises ``models.UnknownModel``."""
    return _prefixed(robot, _model_frames(robot.model))


def _model_frames(name: str) -> frozenset[str]:
    model, links = read_model(name), robot_links(name)
    return links if model.fixed_base else links | {model.odom_frame}


def _prefixed(robot: NamedRobot, frames: Iterable[str]) -> frozenset[str]:
    prefix = robot_frame_prefix(robot)
    return frozenset(f"{prefix}{frame}" for frame in frames)


def robot_links(model: str) -> frozenset[str]:
    """Return the links of a model: its root, and all links connected to it."""
    joints = ((joint.parent, joint.child) for joint in read_joints(model))
    return frozenset((read_model(model).base_frame, *(link for ends in joints for link in ends)))


def named_model(model: RobotModel, parameters: BaseParameters, prefix: str) -> RobotModel:
    """Return the model with the odometry frame and the topic names that the parameters state.

    Args:
        model: The robot's model.
        parameters: The parameters of its base.
        prefix: Its frame prefix, which a stated frame may already have.
    """
    if parameters.odom_frame_id is not None:
        model = replace(model, odom_frame=_bare(parameters.odom_frame_id, prefix))
    if parameters.controller is not None:
        inside = parameters.controller.strip("/")
        names = {each.name: f"{inside}/{each.name}" for each in (CMD_VEL, CMD_VEL_OUT, ODOM)}
        model = replace(model, topics={**model.topics, **names})
    return model


def odometry_child(model: RobotModel, parameters: BaseParameters, prefix: str) -> str:
    """Return the child frame of odometry, without the frame prefix."""
    stated = parameters.base_frame_id
    return model.base_frame if stated is None else _bare(stated, prefix)


def _bare(frame: str, prefix: str) -> str:
    return frame.removeprefix("/").removeprefix(prefix)


def stands_by_link(robot: NamedRobot) -> bool:
    """Return whether a robot's root link is itself the frame ``world``, as in arms made for Gazebo."""
    model = read_model(robot.model)
    return model.fixed_base and robot_frame_prefix(robot) + model.base_frame == WORLD_FRAME


def check_robot_names(robot: NamedRobot, others: Iterable[NamedRobot]) -> None:
    """Check a robot's names, alone and against those of other robots.

    Raises:
        BadInput: A name is illegal, or the robot would share its name, namespace or frames with another.
        UnknownModel: From ``models``; its model is unknown.
    """
    try:
        validate(robot.name)
        namespace = robot_namespace(robot)
        _check_prefix(robot_frame_prefix(robot))
    except BadName as error:
        raise BadInput(f"a robot cannot have this name: {error}") from None
    model_frames = cache(_model_frames)  # among hundreds of robots, each model's files are looked at once
    frames = _prefixed(robot, model_frames(robot.model))
    if WORLD_FRAME in frames and not stands_by_link(robot):
        raise BadInput(
            f"{robot.name}: its link {WORLD_FRAME!r} would be the frame of the world: give it a frame_prefix, "
            f'such as "{robot.name}/"'
        )
    for other in others:
        if other.name == robot.name:
            raise BadInput(f"there is already a robot {robot.name!r}: names must be unique")
        if robot_namespace(other) == namespace:
            raise BadInput(
                f"{robot.name}: the namespace {namespace} is that of {other.name} already, and both would publish "
                f"{namespace.rstrip('/')}/odom: give one of them another namespace"
            )
        if shared := (frames & _prefixed(other, model_frames(other.model))) - {WORLD_FRAME}:
            raise BadInput(
                f"{robot.name}: {other.name} has the frame {min(shared)} already: give one of them another "
                f'frame_prefix, such as "{robot.name}/"'
            )


def _check_prefix(prefix: str) -> None:
    """Raise BadName for a prefix with which ``odom`` is not a legal frame name."""
    if prefix[:1] in ("/", "~"):
        raise BadName(f"the frame_prefix {prefix[:255]!r} begins with {prefix[0]!r}: a frame has no leading slash")
    validate(f"{prefix}odom")

"""The loop of the state service: reads URDFs and joint states, publishes transforms and merged joint states."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

from messages.names import BadName, absolute_namespace
from messages.tf import TFMessage, split
from messages.topics import TF, TF_STATIC
from models.robot_source import resolve_robot
from models.urdf import BadUrdf
from models.urdf import read_urdf as read_urdf_file
from services.runtime.context import Context
from services.runtime.errors import BadInput, list_names
from services.runtime.transport.wire import SampleInfo
from services.state import StateParameters
from services.state.robot_state_publisher import RobotStatePublisher

MAX_OTHER_PUBLISHERS = 256
"""Maximum number of other publishers; beyond it, the oldest is dropped."""


class OtherPublishers:
    """The static frames of other publishers.

    Only /tf_static is checked: subscribing to /tf would make the simulation compute it, at 25 Hz for all robots.
    """

    def __init__(self, own: bytes) -> None:
        self._own = own
        self._frames: dict[bytes, frozenset[str]] = {}
        self._reported: set[str] = set()

    def update(self, batch: Iterable[tuple[TFMessage, SampleInfo | None]]) -> None:
        """Process messages on /tf_static."""
        for message, origin in batch:
            sender = origin.publisher if origin is not None else b""
            if sender != self._own:
                self._frames[sender] = frozenset(each.child_frame_id for each in message.transforms)
                if len(self._frames) > MAX_OTHER_PUBLISHERS:
                    del self._frames[next(iter(self._frames))]

    def new_conflicts(self, frames: frozenset[str]) -> list[str]:
        """Return those of our frames that another publisher publishes, each once."""
        found = sorted({name for others in self._frames.values() for name in frames & others} - self._reported)
        self._reported.update(found)
        return found


def run(ctx: Context[StateParameters]) -> None:
    """Publish link transforms until asked to stop."""
    robots = make_robots(ctx)
    if not ctx.params.publish_transforms:
        _merge_only(ctx, robots)
        return
    moving, fixed = ctx.advertise(TF), ctx.advertise(TF_STATIC)
    static_transforms, other_publishers = ctx.node.subscribe(TF_STATIC), OtherPublishers(fixed.publisher)
    stale = any(robot.links for robot in robots)
    for tick in ctx.ticks():
        for robot in robots:
            if tick.reset:
                robot.reset()
            stale = robot.update_description() or stale
        if stale or tick.reset:
            fixed.publish(
                TFMessage(
                    transforms=tuple(
                        each for robot in robots if robot.links for each in robot.links.fixed_transforms(tick.time)
                    )
                )
            )
            stale = False
        transforms = [each for robot in robots for each in robot.transforms(tick.time)]
        for message in split(transforms):
            moving.publish(message)
        other_publishers.update(static_transforms.messages)
        for robot in robots:
            if conflicts := other_publishers.new_conflicts(robot.links.frames if robot.links else frozenset()):
                ctx.log.error(
                    f"{robot.label}: frames {list_names(conflicts, 5)} are published by another node, too; a frame has "
                    "one publisher: for a robot of the simulation, set enable_link_tf = false among its parameters, "
                    "or end this service"
                )
        ctx.node.heartbeat.detail = heartbeat_detail(robots)


def _merge_only(ctx: Context[StateParameters], robots: Sequence[RobotStatePublisher]) -> None:
    """Publish merged joint states until asked to stop; the transforms are left to another node."""
    for tick in ctx.ticks():
        for robot in robots:
            if tick.reset:
                robot.reset()
            robot.update_description()
            for _ in robot.transforms(tick.time):
                pass
        ctx.node.heartbeat.detail = heartbeat_detail(robots)


def make_robots(ctx: Context[StateParameters]) -> list[RobotStatePublisher]:
    """Return the robots of the parameters; raises BadInput for a bad name, model or URDF."""
    p = ctx.params
    if not (p.publish_transforms or p.source_list or p.publish_default_positions):
        raise BadInput("state: nothing to publish: set publish_transforms, source_list or publish_default_positions")
    if p.model and p.urdf:
        raise BadInput(f"state: both model {p.model!r} and urdf {p.urdf!r} are given: one of them describes the robot")
    try:
        namespaces = [absolute_namespace(each) for each in p.robots or (ctx.namespace,)]
        if len(set(namespaces)) < len(namespaces):
            raise BadInput(f"state: robots {', '.join(p.robots)}: a name is given twice")
        if p.frame_prefix is not None and len(namespaces) > 1:
            raise BadInput(
                "state: frame_prefix is for a single robot; with several, each one's namespace is its prefix"
            )
        urdf = read_urdf(p.model, p.urdf)
        return [RobotStatePublisher(ctx, each, urdf) for each in namespaces]
    except (BadName, BadUrdf) as error:
        where = p.urdf or p.model
        raise BadInput(f"state{f', {where}' if where else ''}: {error}") from None


def read_urdf(model: str, urdf: str) -> str:
    """Return the URDF of the model or in the file, which may be a xacro; empty if neither is given. Raises BadInput."""
    if not model and not urdf:
        return ""
    try:
        if model or urdf.endswith(".xacro"):
            return resolve_robot(model or urdf, Path.cwd()).urdf.read_text(encoding="utf-8")
        return read_urdf_file(Path(urdf))
    except BadInput as error:
        raise BadInput(f"state: {error}") from None


def heartbeat_detail(robots: Sequence[RobotStatePublisher]) -> str:
    """Return the detail text of the heartbeat."""
    waiting = [robot.label for robot in robots if robot.links is None]
    refused = sum(robot.rejected for robot in robots)
    parts = [f"no description of {', '.join(waiting)}"] if waiting else []
    parts += [f"{refused} messages refused"] if refused else []
    return "; ".join(parts)

"""Descriptions of robots that fit the frames in the bag: their links carry the robot's prefix, as on ``/tf``.

On the bus a description is that of its model, and a reader adds the prefix, as ROS 2's robot_state_publisher has it in
``frame_prefix``. A viewer that opens the bag has nobody to tell it the prefix. rerun 0.41 takes the names of links for
frames and the name of the robot for the place of its shapes: of four robots of one model it keeps one, and a single
link whose frame nobody tells of leaves its whole view empty.
"""

from __future__ import annotations

from collections.abc import Iterable
from xml.etree import ElementTree

from messages.base import Message
from messages.cdr.sidecar import StringExtra
from messages.std import String
from messages.tf import TFMessage
from messages.topics import ROBOT_DESCRIPTION
from models.robot_description import BadUrdf, parse_urdf, parse_xml


class UrdfPrefixer:
    """Knows the frames that have been heard."""

    def __init__(self) -> None:
        self._frames: set[str] = set()

    def add_frames(self, messages: Iterable[TFMessage]) -> None:
        """Frames that are told of."""
        for message in messages:
            self._frames.update(each.child_frame_id.removeprefix("/") for each in message.transforms)

    def apply(self, topic: str, message: Message) -> tuple[Message, Message | None]:
        """A message of the absolute name ``topic`` as it is to be recorded, and its own text if that differs.

        What is no description of a robot, or fits as it is, stays as it is.
        """
        namespace, _, name = topic.rpartition("/")
        if name != ROBOT_DESCRIPTION.name or not isinstance(message, String):
            return message, None
        try:
            links = [each.frame.child for each in parse_urdf(message.data).joints]
        except BadUrdf:
            return message, None
        prefix = self._prefix(namespace.strip("/"), links)
        if not prefix:
            return message, None
        return String(data=prefix_links(message.data, prefix)), StringExtra(data=message.data)

    def _prefix(self, namespace: str, links: list[str]) -> str:
        """What the frames of a robot's links begin with: its namespace unless the frames tell of something else."""
        wanted = f"{namespace}/" if namespace else ""
        if any(link.startswith(wanted) for link in links if wanted):
            return ""
        for each in (wanted, f"{namespace.rpartition('/')[2]}/", ""):
            if any(f"{each}{link}" in self._frames for link in links):
                return each
        found = {frame.removesuffix(link) for link in links for frame in self._frames if frame.endswith(f"/{link}")}
        return found.pop() if len(found) == 1 else wanted


def prefix_links(urdf: str, prefix: str) -> str:
    """A URDF with ``prefix`` before the names of its links, and for its name; joints keep theirs, as in joint states.

    ``urdf`` is one that ``models.robot_description.describe`` takes.
    """
    robot = parse_xml(urdf)
    robot.set("name", prefix.strip("/"))
    links = {link.get("name") for link in robot.findall("link")}
    for link in robot.findall("link"):
        link.set("name", f"{prefix}{link.get('name')}")
    for element in robot.iter():
        for attribute in ("link", "reference"):
            if (name := element.get(attribute)) in links:
                element.set(attribute, f"{prefix}{name}")
    return ElementTree.tostring(robot, encoding="unicode")

"""Adds a robot's frame prefix to the links of its recorded description, as on ``/tf``.

On the bus, a description is that of the model, and subscribers add the prefix (robot_state_publisher's ``frame_prefix``
in ROS 2). A viewer that opens the bag cannot know it. rerun 0.41 uses link names as frames and the robot's name as the
path of its shapes: it shows one of four robots of the same model, and a link without a transform empties its view.
"""

from __future__ import annotations

from collections.abc import Iterable
from xml.etree import ElementTree

from messages.base import Message
from messages.cdr.sidecar import StringExtra
from messages.std import String
from messages.tf import TFMessage
from messages.topics import ROBOT_DESCRIPTION
from models.urdf import BadUrdf, parse_urdf, parse_xml


class UrdfPrefixer:
    """Finds each robot's prefix from the frames in transforms."""

    def __init__(self) -> None:
        self._frames: set[str] = set()

    def add_frames(self, messages: Iterable[TFMessage]) -> None:
        """Add the child frames of transforms."""
        for message in messages:
            self._frames.update(each.child_frame_id.removeprefix("/") for each in message.transforms)

    def apply(self, topic: str, message: Message) -> tuple[Message, Message | None]:
        """Return a message on the absolute ``topic`` as it should be recorded, and a sidecar with its text if changed.

        Messages other than robot descriptions are returned unchanged.
        """
        namespace, _, name = topic.rpartition("/")
        if name != ROBOT_DESCRIPTION.name or not isinstance(message, String):
            return message, None
        try:
            links = [each.child for each in parse_urdf(message.data).joints]
        except BadUrdf:
            return message, None
        prefix = self._prefix(namespace.strip("/"), links)
        if not prefix:
            return message, None
        return String(data=prefix_links(message.data, prefix)), StringExtra(data=message.data)

    def _prefix(self, namespace: str, links: list[str]) -> str:
        """Return the prefix of a robot's frames: its namespace, unless the known frames have another one."""
        default = f"{namespace}/" if namespace else ""
        if any(link.startswith(default) for link in links if default):
            return ""
        for each in (default, f"{namespace.rpartition('/')[2]}/", ""):
            if any(f"{each}{link}" in self._frames for link in links):
                return each
        found = {frame.removesuffix(link) for link in links for frame in self._frames if frame.endswith(f"/{link}")}
        return found.pop() if len(found) == 1 else default


def prefix_links(urdf: str, prefix: str) -> str:
    """Add ``prefix`` to the link names of a URDF and name the robot after it; joints keep their names.

    ``urdf`` must be one that ``models.urdf.parse_urdf`` accepts.
    """
    robot = parse_xml(urdf)
    robot.set("name", prefix.strip("/_"))
    links = {link.get("name") for link in robot.findall("link")}
    for link in robot.findall("link"):
        link.set("name", f"{prefix}{link.get('name')}")
    for element in robot.iter():
        for attribute in ("link", "reference"):
            if (name := element.get(attribute)) in links:
                element.set(attribute, f"{prefix}{name}")
    return ElementTree.tostring(robot, encoding="unicode")

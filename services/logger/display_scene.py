"""Displays published messages in a recording: markers, paths, poses, maps, foreign scans, images and turtles."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import rerun as rr

from messages.base import Message
from messages.errors import BadInput
from messages.nav import OccupancyGrid
from messages.se3 import Pose3
from messages.sensor import Image, LaserScan
from messages.std import Header
from messages.turtlesim import Pose as TurtlePose
from messages.visualization import Marker
from models.palette import Palette
from services.logger import entity_paths
from services.logger.marker_shapes import marker_shape
from services.markers.displays import DISPLAYED, MarkerSet, markers_of

Log = Callable[..., None]
"""``log(entity, time_ns, *shapes)``; static without a time."""
FrameLookup = Callable[[Header], Pose3]
"""Returns the pose of a header's frame in the world."""

PERIODS_NS = {
    LaserScan.ROS_TYPE: 200_000_000,
    TurtlePose.ROS_TYPE: 40_000_000,
    Image.ROS_TYPE: 200_000_000,
    OccupancyGrid.ROS_TYPE: 2_000_000_000,
}
"""Minimum simulated time [ns] between two displayed messages of a topic, for frequent or expensive types."""
SHOWN = frozenset((*DISPLAYED, TurtlePose.ROS_TYPE, Image.ROS_TYPE))
"""The displayed message types."""
MAX_TURTLES = 256
GREEN = (93, 138, 60)
_FORMATS = {
    "rgb8": rr.ColorModel.RGB,
    "bgr8": rr.ColorModel.BGR,
    "mono8": rr.ColorModel.L,
    "rgba8": rr.ColorModel.RGBA,
    "bgra8": rr.ColorModel.BGRA,
}


class DisplayScene:
    """Displays messages of any topic as they arrive; what cannot be displayed is reported to ``warn``.

    ``images`` maps the image topics so far to their entities.
    """

    def __init__(self, log: Log, frame: FrameLookup, warn: Callable[[str], None]) -> None:
        self.images: dict[str, str] = {}
        self._log, self._frame, self._warn = log, frame, warn
        self._sets: dict[str, MarkerSet] = {}
        self._turtles: dict[str, TurtlePose] = {}
        self._palette = Palette()
        self._due: dict[str, int] = {}
        self._held: dict[str, Message] = {}
        """The newest message of each topic that is not due yet."""
        self._warned: set[str] = set()
        self._placed: set[str] = set()

    def restart(self) -> None:
        """Redraw the current content on a new timeline."""
        self._due, self._held = {}, {}
        for topic, shown in self._sets.items():
            shown.restart()
            for _, marker in shown.shown.values():
                self._draw(topic, marker, 0)
        turtles, self._turtles = self._turtles, {}
        for topic, pose in turtles.items():
            self._add_turtle(topic, pose, 0)

    def add(self, topic: str, message: Message, now: int) -> None:
        """Display a message received at ``now`` [ns], or keep it until it is due."""
        if now < self._due.get(topic, now):
            self._held[topic] = message
            return
        self._held.pop(topic, None)
        self._due[topic] = now + PERIODS_NS.get(message.ROS_TYPE, 0)
        self._show(topic, message, now)

    def update(self, now: int, final: bool = False) -> None:
        """Display kept messages that are due, with ``final`` all of them; remove markers whose lifetime has expired."""
        for topic, shown in self._sets.items():
            self._expire(topic, shown, now)
        for topic in [each for each in self._held if final or now >= self._due[each]]:
            del self._due[topic]
            self.add(topic, self._held.pop(topic), now)

    def _show(self, topic: str, message: Message, now: int) -> None:
        match message:
            case TurtlePose():
                self._add_turtle(topic, message, now)
            case Image():
                self._add_image(topic, message, now)
            case _:
                self._add_markers(topic, message, now)

    def _add_markers(self, topic: str, message: Message, now: int) -> None:
        shown = self._sets.setdefault(topic, MarkerSet())
        try:
            markers = markers_of(message)
        except BadInput as error:
            self._report(topic, str(error))
            return
        self._expire(topic, shown, now)
        shown.add(markers, now, now)
        current = {id(marker) for _, marker in shown.shown.values()}
        for place in shown.gone:
            self._log(_entity(topic, *place), now, rr.Clear(recursive=False))
        shown.gone.clear()
        for marker in markers:
            if id(marker) in current:
                self._draw(topic, marker, now)

    def _expire(self, topic: str, shown: MarkerSet, now: int) -> None:
        for place, end in shown.expire(now).items():
            self._log(_entity(topic, *place), end, rr.Clear(recursive=False))

    def _draw(self, topic: str, marker: Marker, now: int) -> None:
        entity = _entity(topic, marker.ns, marker.id)
        try:
            shape = marker_shape(marker, self._frame(marker.header) @ Pose3.from_msg(marker.pose))
        except BadInput as error:
            if entity in self._placed:  # the marker that this one replaces
                self._log(entity, now, rr.Clear(recursive=False))
            self._report(topic, str(error))
            return
        if entity not in self._placed:
            self._placed.add(entity)
            self._log(entity, None, rr.CoordinateFrame("world"))  # static: outlives a deletion of the marker
        self._log(entity, now, shape)

    def _add_turtle(self, topic: str, pose: TurtlePose, now: int) -> None:
        name = _turtle_name(topic)
        entity, frame = entity_paths.turtle(name), f"turtle/{name}"
        if topic not in self._turtles:
            if len(self._turtles) >= MAX_TURTLES:
                return
            self._draw_turtle(entity, frame, name, now)
        self._turtles[topic] = pose
        place = Pose3.planar(pose.x, pose.y, pose.theta)
        transform = rr.Transform3D(
            translation=place.position,
            quaternion=rr.Quaternion(xyzw=place.orientation),
            parent_frame="world",
            child_frame=frame,
        )
        self._log(f"{entity}/pose", now, transform)

    def remove(self, topic: str, now: int) -> None:
        """Remove the turtle of a topic whose publisher is gone; markers stay, as in RViz."""
        if self._turtles.pop(topic, None) is not None:
            self._held.pop(topic, None)
            entity = entity_paths.turtle(_turtle_name(topic))
            for each in (entity, f"{entity}/name"):  # but not its pose, without which its frame would be undefined
                self._log(each, now, rr.Clear(recursive=False))

    def _draw_turtle(self, entity: str, frame: str, name: str, now: int) -> None:
        """Draw a shell in the turtle's colour, head, legs and tail, and its name."""
        for each in (entity, f"{entity}/name"):
            self._log(each, None, rr.CoordinateFrame(frame))
        legs = [(0.25, 0.25), (0.25, -0.25), (-0.25, 0.25), (-0.25, -0.25)]
        centres = [(0.0, 0.0, 0.08), (0.42, 0.0, 0.08), *((x, y, 0.05) for x, y in legs), (-0.4, 0.0, 0.05)]
        halves = [(0.35, 0.3, 0.14), (0.13, 0.1, 0.09), *[(0.12, 0.09, 0.05)] * 4, (0.1, 0.03, 0.03)]
        colours = [self._palette.colour(name), *[GREEN] * 6]
        body = rr.Ellipsoids3D(half_sizes=halves, centers=centres, colors=colours, fill_mode="solid")
        self._log(entity, now, body)
        label = rr.Points3D([(0.0, 0.0, 0.4)], radii=[0.0], colors=[colours[0]], labels=[name], show_labels=True)
        self._log(f"{entity}/name", now, label)

    def _add_image(self, topic: str, image: Image, now: int) -> None:
        model = _FORMATS.get(image.encoding)
        if model is None:
            self._report(
                topic, f"images with encoding {image.encoding[:40]!r} are not supported (known: {', '.join(_FORMATS)})"
            )
            return
        channels = len(model.name)
        if not image.width or image.step < image.width * channels:
            self._report(
                topic, f"rows of {image.step} bytes are too short for {image.width} pixels in {image.encoding}"
            )
            return
        rows = np.frombuffer(image.data, np.uint8).reshape(image.height, image.step)[:, : image.width * channels]
        pixels = rows.reshape(image.height, image.width, channels)
        entity = entity_paths.image(topic)
        self.images[topic] = entity
        self._log(entity, now, rr.Image(pixels, color_model=model))

    def _report(self, topic: str, text: str) -> None:
        """Report once per topic why part of it is not displayed."""
        if topic not in self._warned:
            self._warned.add(topic)
            self._warn(f"{topic} is not displayed completely: {text}")


def _entity(topic: str, ns: str, number: int) -> str:
    return entity_paths.display(topic, ns, number)


def _turtle_name(topic: str) -> str:
    return topic.rpartition("/")[0].strip("/")

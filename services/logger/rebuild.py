"""Builds a recording for the viewer from the messages of a bag."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from types import TracebackType
from typing import Self

from messages.base import Message
from messages.control import JointControllerState
from messages.elea import GoalStatus
from messages.gazebo import WorldStates
from messages.geometry import Twist
from messages.nav import Odometry
from messages.nav import Path as Plan
from messages.rosgraph import Clock, Log
from messages.sensor import JointState, LaserScan
from messages.tf import TFMessage
from messages.topics import (
    CMD_VEL,
    GOAL_POSE,
    GROUND_TRUTH,
    IMAGE,
    JOINT_STATES,
    ODOM,
    PLAN,
    SCAN,
    STATUS,
    TF,
    TF_STATIC,
    WORLD_MARKERS,
)
from messages.visualization import MarkerArray
from models.model import read_model
from services.logger.blueprint import Extent
from services.logger.columns import RobotColumns
from services.logger.display_scene import SHOWN, DisplayScene
from services.logger.recording import Recording
from services.runtime.tf.buffer import TransformBuffer, pose_in_world

OWN_TOPICS = frozenset(
    each.name for each in (GROUND_TRUTH, ODOM, CMD_VEL, JOINT_STATES, SCAN, PLAN, STATUS, GOAL_POSE, IMAGE)
)
"""Topics of robots; they are displayed as such or not at all."""
BATCH_NS = 1_000_000_000
"""Simulated time of one batch [ns]."""


class RecordingBuilder:
    """Writes ``file`` as the logger would have; ``with`` opens and closes it.

    ``robots`` are (namespace, model). A joint controller's state does not name its robot; it is assigned to the arm if
    there is only one. ``with`` raises BadInput for a file that cannot be written.
    """

    def __init__(
        self, file: Path, robots: Sequence[tuple[str, str]], extent: Extent, warn: Callable[[str], None]
    ) -> None:
        self._names = {namespace: recorded_name(namespace, model) for namespace, model in robots}
        names = [(self._names[namespace], model) for namespace, model in robots]
        self._recording = Recording(file, names, extent, warn)
        self._frames = TransformBuffer()
        self._display_frames = TransformBuffer()
        """The moving frames as well, in which displays are drawn."""
        self._columns = {namespace: RobotColumns(frames=self._frames) for namespace, _ in robots}
        arms = [namespace for namespace, model in robots if not read_model(model).has_base]
        self._arm = self._columns[arms[0]] if len(arms) == 1 else None
        self._displays = DisplayScene(self._recording.log_at, partial(pose_in_world, self._display_frames), warn)
        self._lines: list[Log] = []
        self._world_states: list[WorldStates] = []
        self._due, self._epoch, self._last = 0, -1, 0

    def __enter__(self) -> Self:
        self._recording.__enter__()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._flush(last=True)
        self._displays.update(self._last, final=True)
        self._recording.__exit__(kind, error, trace)

    def add(self, topic: str, message: Message, time_ns: int) -> None:
        """Add a message of the absolute ``topic`` at a simulated time [ns]; unsupported messages are ignored."""
        self._last = time_ns
        if isinstance(message, Clock):
            self._on_clock(message)
        elif isinstance(message, Log):
            self._lines.append(message)
        elif isinstance(message, MarkerArray):
            if topic == WORLD_MARKERS.name:
                self._recording.set_world(message)
            else:
                self._displays.add(topic, message, time_ns)
        elif isinstance(message, WorldStates):
            self._world_states.append(message)
        elif isinstance(message, TFMessage):
            if topic == TF_STATIC.name:
                self._frames.add_static(message.transforms, b"")
                self._display_frames.add_static(message.transforms, b"")
            elif topic == TF.name:
                self._display_frames.add(message.transforms, b"")
        elif isinstance(message, JointControllerState):
            if self._arm is not None:
                self._arm.add_control([message])
        else:
            namespace, _, name = topic.rpartition("/")
            columns = self._columns.get(namespace)
            if columns is not None and name in OWN_TOPICS:
                _add(columns, name, message, time_ns)
            elif message.ROS_TYPE in SHOWN:
                self._displays.add(topic, message, time_ns)
                self._recording.show_images(self._displays.images)
        self._displays.update(time_ns)
        if time_ns >= self._due:
            self._flush()
            self._due = time_ns + BATCH_NS

    def _on_clock(self, clock: Clock) -> None:
        """Start a new timeline after a reset."""
        if self._epoch not in (-1, clock.epoch):
            self._flush(last=True)
            self._recording.restart()
            self._display_frames.clear()
            self._displays.restart()
            self._due = 0
            for columns in self._columns.values():
                columns.clear()
        self._epoch = clock.epoch

    def _flush(self, last: bool = False) -> None:
        self._recording.write_log(self._lines)
        self._recording.write_world(self._world_states)
        self._lines, self._world_states = [], []
        self._recording.write({self._names[namespace]: each.flush() for namespace, each in self._columns.items()}, last)


def _add(columns: RobotColumns, name: str, message: Message, time_ns: int) -> None:
    match message:
        case Odometry() if name == GROUND_TRUTH.name:
            columns.add_truth([message])
        case Odometry() if name == ODOM.name:
            columns.add_odometry([message])
        case Twist() if name == CMD_VEL.name:
            columns.add_commands([message], time_ns, 0.0)
        case JointState() if name == JOINT_STATES.name:
            columns.add_joints([message])
        case LaserScan() if name == SCAN.name:
            columns.add_scans([message])
        case Plan() if name == PLAN.name:
            columns.add_plan(message)
        case GoalStatus() if name == STATUS.name:
            columns.add_status(message)


def recorded_name(namespace: str, model: str) -> str:
    """Return a robot's name in the recording, one part of an entity path; in the root namespace, its model's name."""
    return namespace.strip("/").replace("/", "_") or model

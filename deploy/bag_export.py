"""Exports bags: CSV tables, a recording for the viewer, or a repaired rosbag2 folder."""

from __future__ import annotations

import math
from pathlib import Path
from typing import NamedTuple

from messages.base import WrongPayload
from messages.nav import Odometry
from messages.std import String
from messages.topics import GROUND_TRUTH, ROBOT_DESCRIPTION
from messages.turtlesim import Pose as TurtlePose
from models import MODELS, display_name, urdf_path
from models.model import read_model
from models.packages import FileAccess
from models.robot_source import resolve_urdf_text
from services.bag.csv_export import export_csv
from services.bag.reader import Bag, MessageDecoder, is_sidecar, open_bag, unreadable_reason
from services.bag.writer import BagWriter
from services.runtime.errors import BadInput, unknown_name

_MARGIN = 0.5
"""Margin [m] around the robots' paths in the first picture."""


class BagRobots(NamedTuple):
    """Namespace and model of each robot, and opposite corners (x, y, x, y) of the ground area [m]."""

    robots: list[tuple[str, str]]
    extent: tuple[float, float, float, float]


def find_robots(bag: Bag) -> BagRobots:
    """Return the simulated robots, identified by their descriptions; those whose meshes are gone are left out."""
    descriptions: dict[str, str] = {}
    simulated: set[str] = set()
    low, high = [math.inf, math.inf], [-math.inf, -math.inf]
    typed = MessageDecoder()
    for entry in bag.entries():
        namespace, _, name = entry.channel.name.rpartition("/")
        relevant = name in (GROUND_TRUTH.name, ROBOT_DESCRIPTION.name) or is_sidecar(entry.channel)
        if not relevant or unreadable_reason(entry.channel):
            continue
        try:
            message = typed.decode(entry)
        except WrongPayload:
            continue
        if isinstance(message, String):
            # Next to a description whose links were prefixed for viewers, the original text is recorded.
            if is_sidecar(entry.channel) or namespace not in descriptions:
                descriptions[namespace] = message.data
        elif isinstance(message, Odometry):
            simulated.add(namespace)
            at = message.pose.pose.position
            low, high = [min(low[0], at.x), min(low[1], at.y)], [max(high[0], at.x), max(high[1], at.y)]
    if not math.isfinite(low[0]):
        low, high = [-1.0, -1.0], [1.0, 1.0]
    extent = (low[0] - _MARGIN, low[1] - _MARGIN, high[0] + _MARGIN, high[1] + _MARGIN)
    found = {namespace: _model_of(descriptions[namespace]) for namespace in descriptions if namespace in simulated}
    robots = [(namespace, model) for namespace, model in found.items() if model is not None]
    return BagRobots(sorted(robots, key=_rank), extent)


def _model_of(description: str) -> str | None:
    """Return the model that a bag describes, None if it can no longer be read."""
    for name in MODELS:
        if urdf_path(name).read_text(encoding="utf-8") == description:
            return name
    try:
        return resolve_urdf_text(description, access=FileAccess(run_xacro=False)).model
    except BadInput:
        return None


def _rank(robot: tuple[str, str]) -> tuple[bool, str]:
    """Sort key that puts arms last: they leave no trail and need no distinct colour."""
    namespace, model = robot
    return not read_model(model).has_base, namespace


TURTLES_EXTENT = (0.0, 0.0, 11.1, 11.1)
"""The plane of turtlesim [m]."""


class ExportResult(NamedTuple):
    """The result of an export, and what it lacks."""

    output: Path
    text: str
    problems: list[str]


def export_bag(path: Path, form: str, output: str = "", topics: tuple[str, ...] = ()) -> ExportResult:
    """Export the bag at ``path`` as ``csv``, ``rrd`` or ``rosbag2``; raises BadInput."""
    bag = open_bag(path)
    names = _select_topics(bag, topics)
    stem = path.resolve().with_suffix("") if path.is_file() else path.resolve()
    match form:
        case "csv":
            return _export_csv(bag, Path(output or f"{stem}_csv").absolute(), names)
        case "rrd":
            return export_rrd(bag, Path(output or f"{stem}.rrd").absolute(), names)
        case _:
            return _export_rosbag2(bag, Path(output or f"{stem}_whole").absolute(), names)


def export_rrd(bag: Bag, output: Path, names: frozenset[str]) -> ExportResult:
    """Export a recording as the logger would have written it; a bag without simulated robots as the viewer reads it
    itself.
    """
    from services.logger.rebuild import RecordingBuilder
    from services.logger.viewer import convert_bag

    found = find_robots(bag)
    if not found.robots and not any(each.type == TurtlePose.ROS_TYPE for each in bag.channels()):
        if bag.problems:
            raise BadInput(f"{bag.problems[0]}: repair it first, with --to rosbag2")
        convert_bag(bag.files, output)
        return ExportResult(output, f"{output}: converted by the viewer itself, since the bag has no robot of Elea", [])
    problems: list[str] = []
    typed, unread = MessageDecoder(), 0
    readable: dict[object, bool] = {}
    extent = found.extent if found.robots else TURTLES_EXTENT
    with RecordingBuilder(output, found.robots, extent, problems.append) as rebuild:
        for entry in bag.entries():
            channel = entry.channel
            if channel not in readable:
                readable[channel] = channel.encoding == "cdr" and not unreadable_reason(channel)
            if not readable[channel] or not (channel.name in names or is_sidecar(channel)):
                continue
            try:
                message = typed.decode(entry)
            except WrongPayload:
                unread += 1
                continue
            if message is not None:
                rebuild.add(channel.name, message, entry.publish_time)
    problems += bag.problems + ([f"{unread} messages were not of their type"] if unread else [])
    robots = ", ".join(f"{namespace or '/'} ({display_name(model)})" for namespace, model in found.robots)
    return ExportResult(output, f"{output}: {robots or 'turtles'}", problems)


def _export_csv(bag: Bag, output: Path, names: frozenset[str]) -> ExportResult:
    exported = export_csv(bag, output, lambda topic: topic in names)
    lines = [f"{each.rows:8} rows  {each.file}" for each in exported if each.file is not None]
    problems = bag.problems + [f"{each.topic}: {each.reason}" for each in exported if each.reason]
    return ExportResult(output, "\n".join(lines) or "nothing was exported", problems)


def _export_rosbag2(bag: Bag, output: Path, names: frozenset[str]) -> ExportResult:
    """Export every readable message to a folder that ROS 2's tools open."""
    with BagWriter(output) as folder:
        try:
            for entry in bag.entries():
                if entry.channel.name in names or is_sidecar(entry.channel):
                    folder.write(*entry)
            folder.metadata.update(bag.metadata)
            folder.close()
        except OSError as error:
            raise BadInput(f"{output} cannot be written: {error.strerror}") from None
    damaged = [each for each in bag.problems if " is truncated " not in each]
    return ExportResult(output, "\n".join([f"{output}: {folder.count} messages", *bag.problems]), damaged)


def _select_topics(bag: Bag, topics: tuple[str, ...]) -> frozenset[str]:
    """Return the topics to export; raises BadInput for a topic that is not in the bag, and for a
    bag without messages.
    """
    known = {channel.name for channel in bag.channels() if not is_sidecar(channel)}
    if not known:
        raise BadInput("; ".join([f"{bag.path} holds no messages", *bag.problems]))
    names = frozenset(topic if topic.startswith("/") else f"/{topic}" for topic in topics)
    for topic in sorted(names - known):
        raise unknown_name("topic", topic, known, str(bag.path))
    return names or frozenset(known)

"""A bag in other forms: tables, a recording for the viewer, or a bag that is whole again."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

from deploy.bag_robots import robots_in
from messages.base import WrongPayload
from services.bag.csv_export import export_csv
from services.bag.folder import BagFolder
from services.bag.reading import Bag, open_bag
from services.bag.typed import Typed, beside, why_not
from services.runtime.errors import BadInput, unknown


class Told(NamedTuple):
    """What came of an export, and what is missing from it."""

    output: Path
    text: str
    troubles: list[str]


def export_bag(path: Path, form: str, output: str = "", topics: tuple[str, ...] = ()) -> Told:
    """Export the bag at ``path`` as ``csv``, ``rrd`` or ``rosbag2``; raises BadInput."""
    bag = open_bag(path)
    names = _chosen(bag, topics)
    stem = path.resolve().with_suffix("") if path.is_file() else path.resolve()
    match form:
        case "csv":
            return _csv(bag, Path(output or f"{stem}_csv").absolute(), names)
        case "rrd":
            return export_rrd(bag, Path(output or f"{stem}.rrd").absolute(), names)
        case _:
            return _whole(bag, Path(output or f"{stem}_whole").absolute(), names)


def export_rrd(bag: Bag, output: Path, names: frozenset[str]) -> Told:
    """As the logger would have recorded it; a bag without robots of ours as the viewer itself reads it."""
    from services.logger.convert import convert
    from services.logger.rebuild import Rebuild

    found = robots_in(bag)
    if not found.robots:
        if bag.troubles:
            raise BadInput(f"{bag.troubles[0]}: mend it first, with --to rosbag2")
        convert(bag.files, output)
        return Told(output, f"{output}: as the viewer reads it, since it holds no robot of this project", [])
    troubles: list[str] = []
    typed, unread = Typed(), 0
    readable: dict[object, bool] = {}
    with Rebuild(output, found.robots, found.extent, troubles.append) as rebuild:
        for entry in bag.entries():
            channel = entry.channel
            if channel not in readable:
                readable[channel] = channel.encoding == "cdr" and not why_not(channel)
            if not readable[channel] or not (channel.name in names or beside(channel)):
                continue
            try:
                message = typed.message(entry)
            except WrongPayload:
                unread += 1
                continue
            if message is not None:
                rebuild.take(channel.name, message, entry.publish_time)
    troubles += bag.troubles + ([f"{unread} messages were not of their type"] if unread else [])
    robots = ", ".join(f"{namespace.strip('/')} ({model})" for namespace, model in found.robots)
    return Told(output, f"{output}: {robots}", troubles)


def _csv(bag: Bag, output: Path, names: frozenset[str]) -> Told:
    exported = export_csv(bag, output, lambda topic: topic in names)
    lines = [f"{each.rows:8} rows  {each.file}" for each in exported if each.file is not None]
    troubles = bag.troubles + [f"{each.topic}: {each.reason}" for each in exported if each.reason]
    return Told(output, "\n".join(lines) or "nothing was exported", troubles)


def _whole(bag: Bag, output: Path, names: frozenset[str]) -> Told:
    """Every message that can be read, in a folder that ROS 2's tools open."""
    with BagFolder(output) as folder:
        try:
            for entry in bag.entries():
                if entry.channel.name in names or beside(entry.channel):
                    folder.add(*entry)
            folder.notes.update(bag.notes)
            folder.close()
        except OSError as error:
            raise BadInput(f"{output} cannot be written: {error.strerror}") from None
    damaged = [each for each in bag.troubles if "torn" not in each]
    return Told(output, "\n".join([f"{output}: {folder.count} messages", *bag.troubles]), damaged)


def _chosen(bag: Bag, topics: tuple[str, ...]) -> frozenset[str]:
    """The topics to export; raises BadInput for one that is not in the bag, and for a bag without messages."""
    known = {channel.name for channel in bag.channels() if not beside(channel)}
    if not known:
        raise BadInput("; ".join([f"{bag.path} holds no messages", *bag.troubles]))
    names = frozenset(topic if topic.startswith("/") else f"/{topic}" for topic in topics)
    for topic in sorted(names - known):
        raise unknown("topic", topic, known, str(bag.path))
    return names or frozenset(known)

"""Reads bags of Elea and of other programs: messages in order, their timeline in simulation time, their records."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import msgspec

from messages.base import Count, Message, WrongPayload, saturating_add
from messages.cdr.definitions import parse
from messages.cdr.read import plain_reader, record_reader
from messages.cdr.sidecar import EXTRAS, ROS_RECORDS, join
from messages.interfaces.definition import BadDefinition, Definitions
from messages.interfaces.records import generate_record
from messages.names import BadName, validate
from messages.records import RECORDS
from services.bag.channel import CDR, RAW, SENDER_SIDECAR, SIDECAR, Channel, Sender
from services.bag.mcap_reader import McapScanner
from services.bag.mcap_writer import MAGIC
from services.bag.metadata import METADATA_FILE, read_file_list
from services.bag.writer import file_number
from services.runtime.errors import BadInput

JUMP_NS = 1_000_000_000
"""A larger step back in time [ns] begins a new segment; a smaller one is a late message."""
GAP_NS = 24 * 3600 * 1_000_000_000
"""A larger step forward [ns] begins a new segment too: after a message without a time, or at a damaged time."""


class BagTime(NamedTuple):
    """``position`` [ns] from the start of the bag; simulation ``time`` [ns]; ``segment`` counts the resets before."""

    position: int
    segment: int
    time: int


class Timeline:
    """Assigns bag times to messages in the order of their recording; positions never decrease."""

    def __init__(self) -> None:
        self._last: int | None = None
        self._position = self._segment = 0
        self._epoch: int | None = None

    def locate(self, time: int, epoch: int | None = None) -> BagTime:
        """Return the bag time of a message at simulation ``time`` [ns]; only clock messages have an ``epoch``."""
        if self._last is None:
            self._last = time
        if not self._last - JUMP_NS <= time <= self._last + GAP_NS:
            self._new_segment(time)
            self._epoch = None
        elif epoch is not None and self._epoch is not None and epoch != self._epoch:
            self._new_segment(time)
        elif time > self._last:
            self._position += time - self._last
            self._last = time
        self._epoch = epoch if epoch is not None else self._epoch
        return BagTime(self._position, self._segment, self._last)

    def _new_segment(self, time: int) -> None:
        self._segment += 1
        self._last = time


class Entry(NamedTuple):
    """One recorded message; times in ns. In bags written by Elea, ``publish_time`` is simulation time."""

    channel: Channel
    sequence: int
    log_time: int
    publish_time: int
    data: bytes


@dataclass
class Bag:
    """The files of a bag, in order.

    ``problems`` lists what could not be read so far, ``known_problems`` what is missing according to metadata.yaml.
    ``from_elea`` is true as long as everything read so far was written by Elea's recorder.
    """

    path: Path
    files: list[Path]
    known_problems: tuple[str, ...] = ()
    problems: list[str] = field(default_factory=list)
    metadata: dict[str, str] = field(default_factory=dict)
    from_elea: bool = False

    @property
    def size(self) -> int:
        """Bytes of all files."""
        return sum(each.stat().st_size for each in self.files)

    def entries(self) -> Iterator[Entry]:
        """Yield every message in the order of recording; raises BadInput if a file cannot be opened."""
        self.problems, self.metadata, self.from_elea = [*self.known_problems], {}, True
        for file in self.files:
            yield from self._read_file(file)

    def channels(self) -> list[Channel]:
        """Return every topic that has a message, sorted by name."""
        return sorted({entry.channel for entry in self.entries()}, key=lambda channel: channel.topic)

    def _read_file(self, file: Path) -> Iterator[Entry]:
        try:
            stream = file.open("rb")
        except OSError as error:
            raise BadInput(f"the bag {file} cannot be read: {error.strerror}") from None
        with stream:
            scan = McapScanner(stream, file)
            for message in scan.messages():
                self.from_elea = self.from_elea and scan.from_elea
                yield Entry(scan.channels[message.channel], *message[1:])
            self.problems += scan.problems
            self.metadata = _merged(self.metadata, scan.metadata)


def metadata_count(notes: Mapping[str, str], name: str) -> int:
    """Return a number in a bag's metadata; 0 without a valid one."""
    text = notes.get(name, "")
    return int(text) if text.isascii() and text.isdigit() and len(text) < 20 else 0


def metadata_counts(notes: Mapping[str, str], name: str) -> dict[str, int]:
    """Return the counts by topic in a bag's metadata; none without valid ones."""
    try:
        return msgspec.convert(json.loads(notes.get(name, "{}")), dict[str, Count])
    except (ValueError, RecursionError):
        return {}


def _merged(known: dict[str, str], more: dict[str, str]) -> dict[str, str]:
    """Return the metadata of several files: a recording that was resumed has counts in the last file of each session,
    which are added; of everything else the last one counts."""
    made = known | more
    for name in known.keys() & more.keys() & {"lost", "unfit"}:
        counts = metadata_counts(known, name)
        for topic, count in metadata_counts(more, name).items():
            counts[topic] = saturating_add(counts.get(topic, 0), count)
        made[name] = json.dumps(counts)
    if "unwritten" in known and "unwritten" in more:
        made["unwritten"] = str(saturating_add(metadata_count(known, "unwritten"), metadata_count(more, "unwritten")))
    return made


def open_bag(path: Path) -> Bag:
    """Open the bag at ``path``, an MCAP file or a folder of them; raises BadInput if it is something else."""
    if path.is_dir():
        return Bag(path, *_list_files(path))
    if not path.exists():
        raise BadInput(f"there is no bag {path}")
    if not path.is_file():
        raise BadInput(f"{path} is not a bag: it is neither a file nor a folder")
    _check_magic(path)
    return Bag(path, [path])


def _list_files(folder: Path) -> tuple[list[Path], tuple[str, ...]]:
    """Return the files of a bag in order, and the problems shown by its metadata.yaml; raises BadInput."""
    present = sorted(
        (each for each in folder.glob("*.mcap") if each.is_file()), key=lambda file: (file_number(file), file.name)
    )
    listed = read_file_list(folder)
    if not present:
        others = sorted(each.name for each in folder.glob("*.db3"))
        if others:
            raise BadInput(f"{folder} holds {others[0]}, a bag in SQLite: convert it to MCAP with 'ros2 bag convert'")
        if packed := sorted(each.name for each in folder.glob("*.mcap.zstd")):
            raise BadInput(f"{folder} holds {packed[0]}, compressed as a whole: unpack it first, with 'zstd -d'")
        what = "it has a metadata.yaml, but no .mcap file" if (folder / METADATA_FILE).exists() else "no .mcap file"
        raise BadInput(f"{folder} is not a bag: {what}")
    for file in present:
        _check_magic(file)
    named = [_unpacked(folder / name, present) for name in listed.names or ()]
    missing = [listed.problem] if listed.problem else []
    missing += [
        f"{each} is compressed as a whole: unpack it first, with 'zstd -d'"
        if each.suffix == ".zstd" and each.is_file()
        else f"{each} is missing, though {METADATA_FILE} names it: was the bag copied completely?"
        for each in named
        if each not in present
    ]
    in_order = [each for each in named if each in present]
    return in_order if set(present) <= set(named) else present, tuple(missing)


def _unpacked(named: Path, present: list[Path]) -> Path:
    """Return the uncompressed file of ``named`` if it is present, else ``named``."""
    return named.with_suffix("") if named.suffix == ".zstd" and named.with_suffix("") in present else named


def _check_magic(path: Path) -> None:
    try:
        with path.open("rb") as stream:
            head = stream.read(len(MAGIC))
    except OSError as error:
        raise BadInput(f"the bag {path} cannot be read: {error.strerror}") from None
    if not head:
        raise BadInput(f"{path} is empty: its recorder was killed before it wrote anything, or the disk was full")
    if head != MAGIC:
        kind = (
            "a bag of ROS 1: convert it with 'rosbags-convert'" if head.startswith(b"#ROSBAG") else "not an MCAP file"
        )
        raise BadInput(f"{path} is not a bag: it is {kind}")


_SIDECAR_RECORDS = {each.ROS_TYPE: each for each in EXTRAS.values()} | {Sender.ROS_TYPE: Sender}
_RECORDS_BY_ROS_TYPE = {ros.ROS_TYPE: ours for ours, ros in ROS_RECORDS.items()}

Decoder = Callable[[bytes], Any]


def record_type(channel: Channel) -> type[Message] | None:
    """Return the record of a channel's messages, created from its schema if Elea has none; None without either."""
    known = _RECORDS_BY_ROS_TYPE.get(channel.type) or RECORDS.get(channel.type)
    if known is not None or channel.encoding != CDR:
        return known
    try:
        return _schema_record(channel)
    except BadDefinition:
        return None


def is_sidecar(channel: Channel) -> bool:
    """Return whether a channel contains additions to the messages of another one."""
    ending = SENDER_SIDECAR if channel.type == Sender.ROS_TYPE else SIDECAR
    return channel.topic.endswith(ending) and channel.type in _SIDECAR_RECORDS


def unplayable_reason(channel: Channel) -> str:
    """Return why a channel cannot be played; empty if it can."""
    try:
        validate(channel.name)
    except BadName as error:
        return str(error)
    return unreadable_reason(channel)


def unreadable_reason(channel: Channel) -> str:
    """Return why the messages of a channel cannot be decoded; empty if they can."""
    if channel.encoding == RAW and channel.type:
        return ""
    if channel.encoding != CDR:
        return f"the encoding of its messages is {channel.encoding or 'unnamed'}, not cdr"
    try:
        _definitions(channel)
    except BadDefinition as error:
        return f"its schema cannot be read: {error}"
    if not is_sidecar(channel) and record_type(channel) is None:
        return f"its type {channel.type or '(unnamed)'} is not known to Elea"
    return ""


class MessageDecoder:
    """Decodes entries in order, and merges the content of a sidecar channel into the message that follows."""

    def __init__(self) -> None:
        self._decoders: dict[Channel, Decoder] = {}
        self._sidecars: dict[str, tuple[int, int, Message]] = {}
        self._senders: dict[str, tuple[int, int, bytes]] = {}

    def decode(self, entry: Entry) -> Message | None:
        """Decode an entry; returns None for one that belongs to the message that follows. Raises WrongPayload.

        ``unreadable_reason`` of its channel must be empty.
        """
        channel = entry.channel
        read = self._decoders.get(channel)
        if read is None:
            read = self._decoders[channel] = _record_decoder(channel)
        found: Message = read(entry.data)
        if isinstance(found, Sender):
            self._senders[channel.topic.removesuffix(SENDER_SIDECAR)] = (entry.sequence, entry.log_time, found.node)
            return None
        if is_sidecar(channel):
            self._sidecars[channel.topic.removesuffix(SIDECAR)] = (entry.sequence, entry.log_time, found)
            return None
        extra = self._sidecars.pop(channel.topic, None)
        belongs = extra is not None and extra[:2] == (entry.sequence, entry.log_time)
        return join(found, extra[2] if extra is not None and belongs else None)

    def sender(self, entry: Entry) -> bytes:
        """Return which of several nodes on a latched topic sent this message; empty for the first one."""
        noted = self._senders.pop(entry.channel.topic, None)
        return noted[2] if noted is not None and noted[:2] == (entry.sequence, entry.log_time) else b""


def plain_decoder(channel: Channel) -> Decoder:
    """Return a decoder of a channel of any type into plain values; raises WrongPayload, as does the decoder."""
    if channel.encoding != CDR or channel.schema_encoding != "ros2msg":
        raise WrongPayload(f"{channel.topic}: only CDR with a ros2msg schema can be read, not {channel.encoding}")
    try:
        return plain_reader(channel.type, _definitions(channel))
    except BadDefinition as error:
        raise WrongPayload(f"{channel.topic}: its schema cannot be read: {error}") from None


def _record_decoder(channel: Channel) -> Decoder:
    target = _SIDECAR_RECORDS[channel.type] if is_sidecar(channel) else record_type(channel)
    assert target is not None
    return record_reader(ROS_RECORDS.get(target, target), _definitions(channel))


def _definitions(channel: Channel) -> Definitions:
    """Return the definitions in the file itself, which may be of another version of ROS or Elea."""
    if channel.schema_encoding != "ros2msg":
        raise BadDefinition(f"its encoding is {channel.schema_encoding or 'unnamed'}, not ros2msg")
    return _parsed(channel.type, channel.schema)


@lru_cache(maxsize=256)
def _schema_record(channel: Channel) -> type[Message]:
    return generate_record(channel.type, _definitions(channel))


_parsed = lru_cache(maxsize=256)(parse)

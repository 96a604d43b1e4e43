"""Reading bags: ours and those of others, whole or torn, one message after the other."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

from services.bag.channel import Channel
from services.bag.folder import number_of
from services.bag.mcap_records import MAGIC
from services.bag.metadata import METADATA_FILE, listed_files
from services.bag.scan import Scan
from services.runtime.errors import BadInput


class Entry(NamedTuple):
    """One message as it is recorded; times in ns. In bags of ours, ``publish_time`` is simulated time."""

    channel: Channel
    sequence: int
    log_time: int
    publish_time: int
    data: bytes


@dataclass
class Bag:
    """The files of a bag, in order.

    ``troubles`` tells what could not be read, once ``entries`` has come upon it; ``ours``, whether our recorder wrote
    all that it has come upon. ``missing`` is what is known to be missing without reading: it is among the troubles.
    """

    path: Path
    files: list[Path]
    missing: tuple[str, ...] = ()
    troubles: list[str] = field(default_factory=list)
    notes: dict[str, str] = field(default_factory=dict)
    ours: bool = False

    @property
    def size(self) -> int:
        """Bytes of all files."""
        return sum(each.stat().st_size for each in self.files)

    def entries(self) -> Iterator[Entry]:
        """Every message in the order of its recording; raises BadInput when nothing at all can be read."""
        self.troubles, self.notes, self.ours = [*self.missing], {}, True
        for file in self.files:
            yield from self._of(file)

    def channels(self) -> list[Channel]:
        """Every topic that has a message, in the order of their names."""
        return sorted({entry.channel for entry in self.entries()}, key=lambda channel: channel.topic)

    def _of(self, file: Path) -> Iterator[Entry]:
        try:
            stream = file.open("rb")
        except OSError as error:
            raise BadInput(f"the bag {file} cannot be read: {error.strerror}") from None
        with stream:
            scan = Scan(stream, file)
            for message in scan.messages():
                self.ours = self.ours and scan.ours
                yield Entry(scan.channels[message.channel], *message[1:])
            self.troubles += scan.troubles
            self.notes |= scan.notes


def open_bag(path: Path) -> Bag:
    """The bag at ``path``, an MCAP file or a folder of them; raises BadInput that says what it is instead."""
    if path.is_dir():
        return Bag(path, *_files_of(path))
    if not path.exists():
        raise BadInput(f"there is no bag {path}")
    if not path.is_file():
        raise BadInput(f"{path} is not a bag: it is no file and no folder")
    _check(path)
    return Bag(path, [path])


def _files_of(folder: Path) -> tuple[list[Path], tuple[str, ...]]:
    """The files of a bag in their order, and what of it is missing by its metadata.yaml."""
    present = sorted(
        (each for each in folder.glob("*.mcap") if each.is_file()), key=lambda file: (number_of(file), file.name)
    )
    listed = listed_files(folder)
    if not present:
        others = sorted(each.name for each in folder.glob("*.db3"))
        if others:
            raise BadInput(f"{folder} holds {others[0]}, a bag in SQLite: convert it to MCAP with 'ros2 bag convert'")
        if packed := sorted(each.name for each in folder.glob("*.mcap.zstd")):
            raise BadInput(f"{folder} holds {packed[0]}, compressed as a whole: unpack it first, with 'zstd -d'")
        what = "it has a metadata.yaml, but no .mcap file" if (folder / METADATA_FILE).exists() else "no .mcap file"
        raise BadInput(f"{folder} is not a bag: {what}")
    for file in present:
        _check(file)
    named = [folder / name for name in listed.names or ()]
    missing = [listed.trouble] if listed.trouble else []
    missing += [
        f"{each} is missing, though {METADATA_FILE} names it: was the bag copied whole?"
        for each in named
        if each not in present
    ]
    in_order = [each for each in named if each in present]
    return in_order if set(present) <= set(named) else present, tuple(missing)


def _check(path: Path) -> None:
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

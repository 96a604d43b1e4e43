"""A bag in the making: a rosbag2 folder with one MCAP file after the other, and its metadata.yaml."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Self

from services.bag.channel import Channel
from services.bag.contents import facts_of
from services.bag.mcap_file import CHUNK, McapFile
from services.bag.metadata import METADATA_FILE, FileFacts, metadata_text
from services.runtime.errors import BadInput

SMALLEST = 1 << 16
"""Bytes; no file is split below this."""
_SHARE = 8
"""Chunks are so many times smaller than a file may be, at least."""


@dataclass
class Tally:
    """The first and last of a topic's simulated times [ns]."""

    first: int = 0
    last: int = 0


class BagFolder:
    """Writes ``folder``, files ``NAME_0.mcap``, ``NAME_1.mcap``, … ; ``with`` opens and closes it.

    A new file begins when one has ``max_size`` [bytes] or spans ``max_duration`` [s of log time]; 0 is no limit.
    What the disk does not take is told by OSError of ``add`` and ``flush``, and counted in ``unwritten``; what comes
    later is tried again. With ``resume`` the folder may be there: its files are kept and the numbers of files go on.
    """

    def __init__(self, folder: Path, max_size: int = 0, max_duration: float = 0.0, resume: bool = False) -> None:
        self.folder, self._resume = folder, resume
        self._max_size, self._max_ns = max_size, round(max_duration * 1e9)
        self.topics: dict[Channel, Tally] = {}
        self.notes: dict[str, str] = {}
        self._before: list[FileFacts] = []
        self._past: list[FileFacts] = []
        self._dropped = 0
        self._file: McapFile | None = None
        self._numbers: dict[Channel, int] = {}
        self._since: int | None = None

    def __enter__(self) -> Self:
        """Raises BadInput when the folder cannot be made, or is there already."""
        try:
            self.folder.mkdir(parents=True, exist_ok=self._resume)
            there = sorted(self.folder.glob("*.mcap"), key=lambda file: (number_of(file), file.name))
            self._before = [facts for each in there if (facts := facts_of(each)) is not None]
            self._next = max(map(number_of, there), default=-1) + 1
            self._begin()
        except FileExistsError:
            raise BadInput(f"{self.folder} is there already: choose another folder for the bag") from None
        except OSError as error:
            raise BadInput(f"the bag {self.folder} cannot be written: {error.strerror}") from None
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    @property
    def unwritten(self) -> int:
        """Messages that the disk did not take."""
        return self._dropped + (self._file.unwritten if self._file is not None else 0)

    @property
    def files(self) -> int:
        """Files so far."""
        return len(self._facts())

    @property
    def size(self) -> int:
        """Bytes written so far."""
        return sum(each.size for each in self._facts())

    @property
    def count(self) -> int:
        """Messages written so far."""
        return sum(each.messages for each in self._facts())

    def add(self, channel: Channel, sequence: int, log_time: int, publish_time: int, data: bytes) -> None:
        """Add a message; times in ns. Raises OSError, after which the bag can be used further."""
        file = self._file
        if file is None:
            try:
                file = self._begin()
            except OSError:
                self._dropped += 1
                raise
        if (tally := self.topics.get(channel)) is None:
            tally = self.topics[channel] = Tally(publish_time)
        tally.last = publish_time
        number = self._numbers.get(channel)
        if number is None:
            number = self._numbers[channel] = file.declare(channel)
        if self._since is None:
            self._since = log_time
        file.add(number, sequence, log_time, publish_time, data)
        if file.due:
            file.flush()
        full = self._max_size and file.size + self._chunk > self._max_size
        if full or file.full or (self._max_ns and log_time - self._since >= self._max_ns):
            self._end()

    def flush_due(self) -> None:
        """Write what has come, if it is time to; raises OSError."""
        if self._file is not None and self._file.due:
            self.flush()

    def flush(self) -> None:
        """Write what has come; raises OSError."""
        if self._file is not None:
            self._file.flush()

    def close(self) -> None:
        """Write what is left; raises OSError."""
        self._end()

    def _begin(self) -> McapFile:
        self._chunk = min(CHUNK, max(self._max_size, SMALLEST) // _SHARE) if self._max_size else CHUNK
        file = McapFile(self.folder / f"{self.folder.name}_{self._next}.mcap", self._chunk)
        file.__enter__()
        self._file, self._numbers, self._since = file, {}, None
        self._next += 1
        return file

    def _end(self) -> None:
        """Close the file, and describe the bag as it is then."""
        if self._file is None:
            return
        spans = {each.topic: [tally.first, tally.last] for each, tally in self.topics.items()}
        try:
            self._file.close({**self.notes, "simulated": json.dumps(spans)})
        finally:
            self._past, self._dropped = self._facts(), self.unwritten
            self._file = None
            self._describe()

    def _facts(self) -> list[FileFacts]:
        if (file := self._file) is None:
            return self._past
        now = FileFacts(file.path.name, file.size, file.count, file.start, file.end, file.channel_counts)
        return [*self._past, now]

    def _describe(self) -> None:
        """Write metadata.yaml, whole or not at all; raises OSError."""
        text = metadata_text([*self._before, *self._past])
        beside = self.folder / f".{METADATA_FILE}"
        try:
            beside.write_text(text)
            beside.replace(self.folder / METADATA_FILE)
        except OSError:
            beside.unlink(missing_ok=True)
            raise


def number_of(file: Path) -> int:
    """The number that ends a file's name; -1 without one."""
    tail = file.stem.rpartition("_")[2]
    return int(tail) if tail.isascii() and tail.isdigit() else -1

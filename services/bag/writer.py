"""Writes a bag: a rosbag2 folder of consecutive MCAP files, and its metadata.yaml."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Self

from services.bag.channel import Channel
from services.bag.mcap_reader import read_stats
from services.bag.mcap_writer import CHUNK_SIZE, McapWriter
from services.bag.metadata import METADATA_FILE, FileStats, metadata_text
from services.runtime.atomic_file import write_atomic
from services.runtime.errors import BadInput

MIN_FILE_SIZE = 1 << 16
"""Minimum bytes of a file before it is split."""
_MIN_CHUNKS_PER_FILE = 8
"""Minimum ratio of a file's maximum size to the size of its chunks."""


@dataclass
class TimeSpan:
    """The first and last simulation time [ns] of a topic."""

    first: int = 0
    last: int = 0


class BagWriter:
    """Writes ``folder`` with files ``NAME_0.mcap``, ``NAME_1.mcap``, …; ``with`` opens and closes it.

    If messages cannot be written to the disk, ``write`` and ``flush`` raise OSError and ``unwritten`` counts them; the
    bag remains usable.

    Args:
        folder: must not exist, unless ``resume`` is set.
        max_size: bytes after which a new file begins; 0 is no limit.
        max_duration: log time [s] after which a new file begins; 0 is no limit.
        resume: keep the files of an existing folder and continue their numbers.
    """

    def __init__(self, folder: Path, max_size: int = 0, max_duration: float = 0.0, resume: bool = False) -> None:
        self.folder, self._resume = folder, resume
        self._max_size, self._max_ns = max_size, round(max_duration * 1e9)
        self.time_spans: dict[Channel, TimeSpan] = {}
        self.metadata: dict[str, str] = {}
        self._resumed_files: list[FileStats] = []
        self._closed_files: list[FileStats] = []
        self._dropped = 0
        self._file: McapWriter | None = None
        self._channel_ids: dict[Channel, int] = {}
        self._file_start: int | None = None

    def __enter__(self) -> Self:
        """Create the folder and the first file; raises BadInput if the folder exists or cannot be created."""
        try:
            self.folder.mkdir(parents=True, exist_ok=self._resume)
            existing = sorted(self.folder.glob("*.mcap"), key=lambda file: (file_number(file), file.name))
            self._resumed_files = [stats for each in existing if (stats := read_stats(each)) is not None]
            self._next = max(map(file_number, existing), default=-1) + 1
            self._open_file()
        except FileExistsError:
            raise BadInput(f"{self.folder} exists already: choose another folder for the bag") from None
        except OSError as error:
            raise BadInput(f"the bag {self.folder} cannot be written: {error.strerror}") from None
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    @property
    def unwritten(self) -> int:
        """Number of messages that could not be written to the disk."""
        return self._dropped + (self._file.unwritten if self._file is not None else 0)

    @property
    def files(self) -> int:
        """Number of files so far."""
        return len(self._file_stats())

    @property
    def size(self) -> int:
        """Bytes written so far."""
        return sum(each.size for each in self._file_stats())

    @property
    def count(self) -> int:
        """Messages written so far."""
        return sum(each.messages for each in self._file_stats())

    def write(self, channel: Channel, sequence: int, log_time: int, publish_time: int, data: bytes) -> None:
        """Add a message; times in ns. Raises OSError, after which the bag remains usable."""
        file = self._file
        if file is None:
            try:
                file = self._open_file()
            except OSError:
                self._dropped += 1
                raise
        if (span := self.time_spans.get(channel)) is None:
            span = self.time_spans[channel] = TimeSpan(publish_time)
        span.last = publish_time
        number = self._channel_ids.get(channel)
        if number is None:
            number = self._channel_ids[channel] = file.register_channel(channel)
        if self._file_start is None:
            self._file_start = log_time
        file.add_message(number, sequence, log_time, publish_time, data)
        if file.due:
            file.flush()
        full = self._max_size and file.size + self._chunk > self._max_size
        if full or file.full or (self._max_ns and log_time - self._file_start >= self._max_ns):
            self._close_file()

    def flush_due(self) -> None:
        """Write pending messages if they are due; raises OSError."""
        if self._file is not None and self._file.due:
            self.flush()

    def flush(self) -> None:
        """Write pending messages; raises OSError."""
        if self._file is not None:
            self._file.flush()

    def close(self) -> None:
        """Write pending messages and the summary; raises OSError."""
        self._close_file()

    def _open_file(self) -> McapWriter:
        self._chunk = (
            min(CHUNK_SIZE, max(self._max_size, MIN_FILE_SIZE) // _MIN_CHUNKS_PER_FILE)
            if self._max_size
            else CHUNK_SIZE
        )
        file = McapWriter(self.folder / f"{self.folder.name}_{self._next}.mcap", self._chunk)
        file.__enter__()
        self._file, self._channel_ids, self._file_start = file, {}, None
        self._next += 1
        return file

    def _close_file(self) -> None:
        """Close the file and update metadata.yaml; raises OSError."""
        if self._file is None:
            return
        spans = {each.topic: [span.first, span.last] for each, span in self.time_spans.items()}
        try:
            self._file.close({**self.metadata, "simulated": json.dumps(spans)})
        finally:
            self._closed_files, self._dropped = self._file_stats(), self.unwritten
            self._file = None
            self._write_metadata()

    def _file_stats(self) -> list[FileStats]:
        if (file := self._file) is None:
            return self._closed_files
        return [*self._closed_files, file.stats]

    def _write_metadata(self) -> None:
        """Write metadata.yaml atomically; raises OSError."""
        text = metadata_text([*self._resumed_files, *self._closed_files])
        write_atomic(self.folder / METADATA_FILE, text.encode())


def file_number(file: Path) -> int:
    """Return the number at the end of a file's name; -1 without one."""
    tail = file.stem.rpartition("_")[2]
    return int(tail) if tail.isascii() and tail.isdigit() else -1

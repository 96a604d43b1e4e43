"""One MCAP file in the making: chunks that are whole on the disk, or not there at all."""

from __future__ import annotations

import errno
import os
import struct
import time
import zlib
from dataclasses import dataclass, field
from pathlib import Path
from types import TracebackType
from typing import Self

import zstandard
from mcap.records import Chunk, ChunkIndex, Header, MessageIndex

from messages.cdr.write import writer
from services.bag.channel import RAW, Channel, Raw
from services.bag.mcap_records import LIBRARY, MAGIC, Declared, encoded, ending

CHUNK = 1 << 20
"""Bytes of messages in a chunk, at most, unless a single one is larger."""
FLUSH_S = 0.7
"""Wall time after which what has come is written, so that a killed process loses a second at most."""
LEVEL = 1
"""Of zstd: three times as fast as its default of 3, and a tenth larger."""
MOST_CHUNKS = 1 << 15
"""After so many, some six hours, a file is ``full``: their index is kept in memory, and written at its end."""
RESERVE = 64 << 20
"""Bytes of the disk, or a fiftieth of a small one, that are left to logs, to parameters, and to the file's own end."""

_MESSAGE = struct.Struct("<BQHIQQ")


@dataclass
class _Pending:
    """The chunk that is being filled."""

    data: bytearray = field(default_factory=bytearray)
    index: dict[int, list[tuple[int, int]]] = field(default_factory=dict)
    count: int = 0
    first: int = 0
    last: int = 0
    since: float = 0.0


class McapFile:
    """Writes ``path``, which must not exist; ``with`` opens and closes it.

    ``flush`` and ``close`` raise OSError when the disk does not take what they write: the file then ends with its last
    whole chunk, and ``unwritten`` counts the messages that are lost. Later chunks may fit again.
    """

    def __init__(self, path: Path, chunk: int = CHUNK) -> None:
        self.path, self.size, self.closed = path, 0, True
        self.unwritten = 0
        self.counts: dict[int, int] = {}
        self.start, self.end = 0, 0
        self._chunk = chunk
        self._declared = Declared()
        self._channels: dict[int, Channel] = {}
        self._written: set[int] = set()
        self._pending = _Pending()
        self._chunks = bytearray()
        self._chunk_count = 0
        self._compressor = zstandard.ZstdCompressor(level=LEVEL)

    def __enter__(self) -> Self:
        self._file = os.open(self.path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o644)
        try:
            self._append(MAGIC + encoded(Header(profile="ros2", library=LIBRARY)))
        except OSError:
            os.close(self._file)
            self.path.unlink()
            raise
        self.closed = False
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def declare(self, channel: Channel) -> int:
        """The number of a new channel."""
        number = self._declared.add(channel)
        self._channels[number] = channel
        self.counts[number] = 0
        return number

    def add(self, number: int, sequence: int, log_time: int, publish_time: int, data: bytes) -> None:
        """Add a message to the chunk in the making; times in ns."""
        pending = self._pending
        if (channel := self._channels[number]).encoding == RAW:
            data = writer(Raw)(Raw(type=channel.type, data=data))
        if not pending.count:
            pending.first = pending.last = log_time
            pending.since = time.monotonic()
        pending.index.setdefault(number, []).append((log_time, len(pending.data)))
        pending.data += _message(number, sequence, log_time, publish_time, len(data))
        pending.data += data
        pending.count += 1
        pending.first, pending.last = min(pending.first, log_time), max(pending.last, log_time)

    @property
    def full(self) -> bool:
        """Whether another file should begin."""
        return self._chunk_count >= MOST_CHUNKS

    @property
    def due(self) -> bool:
        """Whether it is time to ``flush``."""
        pending = self._pending
        return len(pending.data) >= self._chunk or (pending.count > 0 and time.monotonic() - pending.since >= FLUSH_S)

    def flush(self) -> None:
        """Write the chunk; raises OSError."""
        pending, self._pending = self._pending, _Pending()
        if not pending.count:
            return
        new = sorted(set(pending.index) - self._written)
        head = self._declared.records(new, self._written)
        records = head + pending.data
        packed = self._compressor.compress(records)
        chunk = Chunk(
            compression="zstd",
            data=packed,
            message_start_time=pending.first,
            message_end_time=pending.last,
            uncompressed_crc=zlib.crc32(records),
            uncompressed_size=len(records),
        )
        body, indexes, offsets = encoded(chunk), b"", {}
        for number, entries in pending.index.items():
            offsets[number] = self.size + len(body) + len(indexes)
            indexes += encoded(MessageIndex(number, [(at, offset + len(head)) for at, offset in entries]))
        index = ChunkIndex(
            chunk_start_offset=self.size,
            chunk_length=len(body),
            message_index_offsets=offsets,
            message_index_length=len(indexes),
            compression="zstd",
            compressed_size=len(packed),
            uncompressed_size=len(records),
            message_start_time=pending.first,
            message_end_time=pending.last,
        )
        try:
            self._check_room(len(body) + len(indexes))
            self._append(body + indexes)
        except OSError:
            self.unwritten += pending.count
            raise
        self._written |= set(new)
        self._chunks += encoded(index)
        self._chunk_count += 1
        self.start = min(self.start, pending.first) if self.count else pending.first
        self.end = max(self.end, pending.last)
        for number, entries in pending.index.items():
            self.counts[number] += len(entries)

    @property
    def channel_counts(self) -> dict[Channel, int]:
        """The messages of each topic that are in the file."""
        return {self._channels[number]: count for number, count in self.counts.items() if count}

    @property
    def count(self) -> int:
        """Messages that are in the file."""
        return sum(self.counts.values())

    def close(self, notes: dict[str, str] | None = None) -> None:
        """Write what is left, ``notes`` and the table of contents, and wait for the disk; raises OSError."""
        if self.closed:
            return
        self.closed = True
        try:
            try:
                self.flush()
            finally:
                held = {number: self.counts[number] for number in sorted(self._written)}
                chunks = self._chunk_count, bytes(self._chunks)
                self._append(ending(self.size, self._declared, held, chunks, (self.start, self.end), notes or {}))
                os.fsync(self._file)
        finally:
            os.close(self._file)

    def _check_room(self, size: int) -> None:
        """Raise OSError when less than the RESERVE would be left on the disk."""
        free, reserve = room(self._file)
        if free - size < reserve:
            raise OSError(errno.ENOSPC, f"less than {reserve / 1e6:.0f} MB are left on it, which are kept for others")

    def _append(self, data: bytes) -> None:
        """All of ``data``, or nothing of it."""
        view, done = memoryview(data), 0
        try:
            while done < len(data):
                done += os.write(self._file, view[done:])
        except OSError:
            os.ftruncate(self._file, self.size)
            os.lseek(self._file, self.size, os.SEEK_SET)
            raise
        self.size += len(data)


def room(place: int | Path) -> tuple[int, int]:
    """The bytes that are free on the disk of an open file or a folder, and those of them that a bag leaves free."""
    told = os.statvfs(place)
    return told.f_bavail * told.f_frsize, min(RESERVE, told.f_blocks * told.f_frsize // 50)


def _message(number: int, sequence: int, log_time: int, publish_time: int, size: int) -> bytes:
    return _MESSAGE.pack(5, 22 + size, number, sequence & 0xFFFFFFFF, log_time, publish_time)

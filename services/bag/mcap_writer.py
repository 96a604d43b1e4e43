"""Writes one MCAP file: chunks that reach the disk whole or not at all, and the summary at its end."""

from __future__ import annotations

import errno
import os
import struct
import time
import zlib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from operator import methodcaller
from pathlib import Path
from types import TracebackType
from typing import Self

import zstandard
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import Channel as ChannelRecord
from mcap.records import (
    Chunk,
    ChunkIndex,
    DataEnd,
    Footer,
    Header,
    McapRecord,
    MessageIndex,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)

from messages.cdr.write import writer
from services.bag.channel import RAW, Channel, Raw

MAGIC = b"\x89MCAP0\r\n"
LIBRARY = "elea"
"""Who wrote the file, and the name of its notes."""

_end = methodcaller("end")  # the library leaves it without a type


class ChannelTable:
    """The channels of a file, numbered from 1, and the schemas that they share."""

    def __init__(self) -> None:
        self._channels: list[Channel] = []
        self._schemas: dict[tuple[str, str, str], int] = {}

    def add(self, channel: Channel) -> int:
        """The number of a new channel."""
        self._schemas.setdefault(_schema_of(channel), len(self._schemas) + 1)
        self._channels.append(channel)
        return len(self._channels)

    def declaration_records(self, numbers: Iterable[int], known: Iterable[int] = ()) -> bytes:
        """What declares these channels, with the schemas that the ``known`` ones have not brought."""
        schemas = {self._schema(number) for number in numbers} - {self._schema(number) for number in known}
        return self.schema_records(sorted(schemas)) + b"".join(self.channel_record(number) for number in numbers)

    def schema_records(self, numbers: Iterable[int]) -> bytes:
        """The records of schemas."""
        texts = {number: key for key, number in self._schemas.items()}
        made = b""
        for number in numbers:
            name, form, text = texts[number]
            made += encode_record(Schema(id=number, name=name, encoding=form, data=text.encode()))
        return made

    def schema_ids(self, channels: Iterable[int]) -> list[int]:
        """The schemas that channels use."""
        return sorted({self._schema(number) for number in channels})

    def channel_record(self, number: int) -> bytes:
        """The record of a channel."""
        channel = self._channels[number - 1]
        return encode_record(
            ChannelRecord(
                id=number,
                topic=channel.topic,
                message_encoding=channel.stored.encoding,
                metadata=channel.metadata,
                schema_id=self._schema(number),
            )
        )

    def _schema(self, number: int) -> int:
        return self._schemas[_schema_of(self._channels[number - 1])]


def _schema_of(channel: Channel) -> tuple[str, str, str]:
    stored = channel.stored
    return stored.ros_type, stored.schema_encoding, stored.schema


def end_section(
    at: int,
    declared: ChannelTable,
    counts: Mapping[int, int],
    chunks: tuple[int, bytes],
    span: tuple[int, int],
    notes: dict[str, str],
) -> bytes:
    """All that follows the last chunk, which ends ``at``: notes, the end of the data, the summary and the footer.

    ``counts`` are the messages of each channel, ``chunks`` how many there are and the records that tell where they lie,
    ``span`` the first and last of their log times [ns].
    """
    note = encode_record(Metadata(name=LIBRARY, metadata=notes)) if notes else b""
    head = note + encode_record(DataEnd(data_section_crc=0))
    schemas = declared.schema_ids(counts)
    statistics = Statistics(
        message_count=sum(counts.values()),
        schema_count=len(schemas),
        channel_count=len(counts),
        attachment_count=0,
        metadata_count=1 if notes else 0,
        chunk_count=chunks[0],
        message_start_time=span[0],
        message_end_time=span[1],
        channel_message_counts=dict(counts),
    )
    groups = (
        (Opcode.SCHEMA, declared.schema_records(schemas)),
        (Opcode.CHANNEL, b"".join(declared.channel_record(number) for number in counts)),
        (Opcode.STATISTICS, encode_record(statistics)),
        (Opcode.CHUNK_INDEX, chunks[1]),
        (
            Opcode.METADATA_INDEX,
            encode_record(MetadataIndex(offset=at, length=len(note), name=LIBRARY)) if notes else b"",
        ),
    )
    return head + _summary_section(at + len(head), groups) + MAGIC


def encode_record(record: McapRecord) -> bytes:
    """A record as it stands in the file."""
    builder = RecordBuilder()
    record.write(builder)
    data: bytes = _end(builder)
    return data


def _summary_section(start: int, groups: Iterable[tuple[Opcode, bytes]]) -> bytes:
    """Summary, where its groups lie, and footer."""
    summary, offsets = b"", b""
    for opcode, group in groups:
        if group:
            where = SummaryOffset(group_opcode=opcode, group_start=start + len(summary), group_length=len(group))
            offsets += encode_record(where)
        summary += group
    middle = start + len(summary)
    crc = zlib.crc32(summary + offsets + struct.pack("<BQQQ", Opcode.FOOTER, 20, start, middle))
    footer = Footer(summary_start=start, summary_offset_start=middle, summary_crc=crc)
    return summary + offsets + encode_record(footer)


CHUNK_SIZE = 1 << 20
"""Bytes of messages in a chunk, at most, unless a single one is larger."""
FLUSH_PERIOD_S = 0.7
"""Wall time after which what has come is written, so that a killed process loses a second at most."""
ZSTD_LEVEL = 1
"""Of zstd: three times as fast as its default of 3, and a tenth larger."""
MAX_CHUNKS = 1 << 15
"""After so many, some six hours, a file is ``full``: their index is kept in memory, and written at its end."""
DISK_RESERVE = 64 << 20
"""Bytes of the disk, or a fiftieth of a small one, that are left to logs, to parameters, and to the file's own end."""

_MESSAGE = struct.Struct("<BQHIQQ")


@dataclass
class _Chunk:
    """The chunk that is being filled."""

    data: bytearray = field(default_factory=bytearray)
    index: dict[int, list[tuple[int, int]]] = field(default_factory=dict)
    count: int = 0
    first: int = 0
    last: int = 0
    since: float = 0.0


class McapWriter:
    """Writes ``path``, which must not exist; ``with`` opens and closes it.

    ``flush`` and ``close`` raise OSError when the disk does not take what they write: the file then ends with its last
    whole chunk, and ``unwritten`` counts the messages that are lost. Later chunks may fit again.
    """

    def __init__(self, path: Path, chunk: int = CHUNK_SIZE) -> None:
        self.path, self.size, self.closed = path, 0, True
        self.unwritten = 0
        self.counts: dict[int, int] = {}
        self.start, self.end = 0, 0
        self._chunk = chunk
        self._channel_table = ChannelTable()
        self._channels: dict[int, Channel] = {}
        self._written_channels: set[int] = set()
        self._pending = _Chunk()
        self._chunk_indexes = bytearray()
        self._chunk_count = 0
        self._compressor = zstandard.ZstdCompressor(level=ZSTD_LEVEL)

    def __enter__(self) -> Self:
        self._file = os.open(self.path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o644)
        try:
            self._append(MAGIC + encode_record(Header(profile="ros2", library=LIBRARY)))
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

    def register_channel(self, channel: Channel) -> int:
        """The number of a new channel."""
        number = self._channel_table.add(channel)
        self._channels[number] = channel
        self.counts[number] = 0
        return number

    def add_message(self, number: int, sequence: int, log_time: int, publish_time: int, data: bytes) -> None:
        """Add a message to the chunk in the making; times in ns."""
        pending = self._pending
        if (channel := self._channels[number]).encoding == RAW:
            data = writer(Raw)(Raw(type=channel.type, data=data))
        if not pending.count:
            pending.first = pending.last = log_time
            pending.since = time.monotonic()
        pending.index.setdefault(number, []).append((log_time, len(pending.data)))
        pending.data += _message_head(number, sequence, log_time, publish_time, len(data))
        pending.data += data
        pending.count += 1
        pending.first, pending.last = min(pending.first, log_time), max(pending.last, log_time)

    @property
    def full(self) -> bool:
        """Whether another file should begin."""
        return self._chunk_count >= MAX_CHUNKS

    @property
    def due(self) -> bool:
        """Whether it is time to ``flush``."""
        pending = self._pending
        return len(pending.data) >= self._chunk or (
            pending.count > 0 and time.monotonic() - pending.since >= FLUSH_PERIOD_S
        )

    def flush(self) -> None:
        """Write the chunk; raises OSError."""
        pending, self._pending = self._pending, _Chunk()
        if not pending.count:
            return
        new = sorted(set(pending.index) - self._written_channels)
        head = self._channel_table.declaration_records(new, self._written_channels)
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
        body, indexes, offsets = encode_record(chunk), b"", {}
        for number, entries in pending.index.items():
            offsets[number] = self.size + len(body) + len(indexes)
            indexes += encode_record(MessageIndex(number, [(at, offset + len(head)) for at, offset in entries]))
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
        self._written_channels |= set(new)
        self._chunk_indexes += encode_record(index)
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
                held = {number: self.counts[number] for number in sorted(self._written_channels)}
                chunks = self._chunk_count, bytes(self._chunk_indexes)
                self._append(
                    end_section(self.size, self._channel_table, held, chunks, (self.start, self.end), notes or {})
                )
                os.fsync(self._file)
        finally:
            os.close(self._file)

    def _check_room(self, size: int) -> None:
        """Raise OSError when less than the DISK_RESERVE would be left on the disk."""
        free, reserve = disk_space(self._file)
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


def disk_space(place: int | Path) -> tuple[int, int]:
    """The bytes that are free on the disk of an open file or a folder, and those of them that a bag leaves free."""
    told = os.statvfs(place)
    return told.f_bavail * told.f_frsize, min(DISK_RESERVE, told.f_blocks * told.f_frsize // 50)


def _message_head(number: int, sequence: int, log_time: int, publish_time: int, size: int) -> bytes:
    return _MESSAGE.pack(5, 22 + size, number, sequence & 0xFFFFFFFF, log_time, publish_time)

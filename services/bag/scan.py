"""The records of one MCAP file from its beginning on; a torn or damaged file is read as far as it goes."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from io import SEEK_END, BytesIO
from pathlib import Path
from typing import BinaryIO, NamedTuple

import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel as ChannelRecord
from mcap.records import Chunk, Header, Metadata, Schema
from mcap.stream_reader import get_chunk_data_stream

from messages.cdr.definition import short
from messages.cdr.derive import definitions
from messages.cdr.read import record_reader
from services.bag.channel import RAW, Channel, Raw, quality_of, raw_channel
from services.bag.mcap_records import LIBRARY, MAGIC

LARGEST = 1 << 30
"""Bytes of a chunk, unpacked; whatever claims more is not unpacked."""

_HEAD = struct.Struct("<BQ")
_MESSAGE = struct.Struct("<HIQQ")
_unwrap = record_reader(Raw, definitions(Raw))
_FAULTS = (McapError, struct.error, ValueError, zstandard.ZstdError, RuntimeError, EOFError, MemoryError)


class Line(NamedTuple):
    """A message; ``channel`` is its number in the file."""

    channel: int
    sequence: int
    log_time: int
    publish_time: int
    data: bytes


class Scan:
    """Reads ``stream``. ``channels``, ``troubles`` and ``notes`` grow as ``messages`` goes on."""

    def __init__(self, stream: BinaryIO, path: Path) -> None:
        self.channels: dict[int, Channel] = {}
        self.troubles: list[str] = []
        self.notes: dict[str, str] = {}
        self.ours = False
        self._schemas: dict[int, Schema] = {}
        self._stream, self._path = stream, path
        self._size = path.stat().st_size

    def messages(self) -> Iterator[Line]:
        """Every message, in the order of the file; those of a chunk by log time when the file is not ours."""
        self._stream.seek(len(MAGIC))
        at = len(MAGIC)
        while True:
            head = self._stream.read(_HEAD.size)
            if len(head) < _HEAD.size:
                self._torn(at)
                return
            opcode, length = _HEAD.unpack(head)
            if length > self._size - at - _HEAD.size:
                self._torn(at)
                return
            data = self._stream.read(length)
            try:
                yield from self._record(opcode, data)
            except _FAULTS as error:
                self.troubles.append(f"{self._path}: damaged at byte {at}: {error}")
            if opcode in (Opcode.DATA_END, Opcode.FOOTER):
                self._check_end()
                return
            at += _HEAD.size + length

    def _torn(self, at: int) -> None:
        self.troubles.append(
            f"{self._path} is torn at byte {at} of {self._size}: its recorder was killed, the disk was full, or the "
            "file is cut; it is read up to there"
        )

    def _check_end(self) -> None:
        self._stream.seek(-len(MAGIC), SEEK_END)
        if self._stream.read() != MAGIC:
            self.troubles.append(
                f"{self._path} is torn in its table of contents: all messages are there, other tools may refuse it"
            )

    def _record(self, opcode: int, data: bytes) -> Iterator[Line]:
        match opcode:
            case Opcode.CHUNK:
                yield from self._chunk(data)
            case Opcode.MESSAGE:
                yield self._message(data)
            case _:
                self._note(opcode, data)

    def _note(self, opcode: int, data: bytes) -> None:
        stream = ReadDataStream(BytesIO(data))
        match opcode:
            case Opcode.HEADER:
                self.ours = Header.read(stream).library == LIBRARY
            case Opcode.SCHEMA:
                schema = Schema.read(stream)
                self._schemas[schema.id] = schema
            case Opcode.CHANNEL:
                record = ChannelRecord.read(stream)
                self.channels.setdefault(record.id, channel_from(record, self._schemas.get(record.schema_id)))
            case Opcode.METADATA:
                notes = Metadata.read(stream)
                if notes.name == LIBRARY:
                    self.notes |= notes.metadata

    def _chunk(self, data: bytes) -> Iterator[Line]:
        records = _unpacked(Chunk.read(ReadDataStream(BytesIO(data))))
        found = []
        at = 0
        while at < len(records):
            opcode, length = _HEAD.unpack_from(records, at)
            at += _HEAD.size
            if length > len(records) - at:
                raise ValueError("a record reaches beyond its chunk")
            part = records[at : at + length]
            if opcode == Opcode.MESSAGE:
                found.append(self._message(part))
            else:
                self._note(opcode, part)
            at += length
        if not self.ours:
            found.sort(key=lambda message: message.log_time)
        yield from found

    def _message(self, data: bytes) -> Line:
        number, sequence, log_time, publish_time = _MESSAGE.unpack_from(data)
        if number not in self.channels:
            raise ValueError(f"a message of channel {number}, which is not declared")
        payload = data[_MESSAGE.size :]
        if self.channels[number].encoding == RAW and self.ours:
            payload = _unwrap(payload).data
        return Line(number, sequence, log_time, publish_time, payload)


def channel_from(record: ChannelRecord, schema: Schema | None) -> Channel:
    """The channel that two records of a file describe."""
    if (kept := record.metadata.get("elea_type")) is not None:
        return raw_channel(record.topic, kept, quality_of(record.metadata))
    return Channel(
        topic=record.topic,
        type=short(schema.name) if schema is not None else "",
        encoding=record.message_encoding,
        schema=schema.data.decode() if schema is not None else "",
        form=schema.encoding if schema is not None else "",
        quality=quality_of(record.metadata),
    )


def _unpacked(chunk: Chunk) -> bytes:
    if chunk.uncompressed_size > LARGEST:
        raise ValueError(f"a chunk of {chunk.uncompressed_size} bytes, the limit is {LARGEST}")
    if chunk.compression not in ("", "zstd", "lz4"):
        raise ValueError(f"a chunk compressed by {chunk.compression[:20]!r}; zstd and lz4 are known")
    stream, size = get_chunk_data_stream(chunk, validate_crc=True)
    return stream.read(size)

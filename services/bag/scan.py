"""The records of one MCAP file from its beginning on; a torn or damaged file is read as far as it goes."""

from __future__ import annotations

import struct
import zlib
from array import array
from collections.abc import Iterator
from io import SEEK_CUR, SEEK_END, BytesIO
from pathlib import Path
from typing import BinaryIO, NamedTuple

import lz4.frame  # type: ignore[import-untyped]
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel as ChannelRecord
from mcap.records import Chunk, Header, Metadata, Schema, Statistics

from messages.cdr.definition import short
from messages.cdr.derive import definitions
from messages.cdr.read import record_reader
from services.bag.channel import RAW, Channel, Raw, quality_of, raw_channel
from services.bag.mcap_records import LIBRARY, MAGIC

LARGEST = 1 << 28
"""Bytes of a chunk, unpacked, and of any record; whatever is larger is not read. Recorders make chunks of 1 to 4 MB."""
LARGEST_TEXT = 1 << 22
"""Bytes of a schema, or of what is noted beside a channel or the file."""
LARGEST_TEXTS = 1 << 26
"""Bytes of all schemas and notes of a file."""
MOST_TROUBLES = 20
"""Damaged places that are told one by one."""

_HEAD = struct.Struct("<BQ")
_MESSAGE = struct.Struct("<HIQQ")
_READ = (Opcode.HEADER, Opcode.SCHEMA, Opcode.CHANNEL, Opcode.METADATA, Opcode.MESSAGE, Opcode.CHUNK, Opcode.STATISTICS)
_unwrap = record_reader(Raw, definitions(Raw))
FAULTS = (McapError, struct.error, ValueError, OverflowError, zstandard.ZstdError, RuntimeError, EOFError, MemoryError)
"""What the libraries raise for bytes that are no records."""


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
        self._texts = self._count = self._damaged = 0
        self._told: int | None = None

    def messages(self) -> Iterator[Line]:
        """Every message, in the order of the file; those of a chunk by log time when the file is not ours."""
        self._stream.seek(len(MAGIC))
        at, ended = len(MAGIC), False
        while True:
            head = self._stream.read(_HEAD.size)
            if len(head) < _HEAD.size:
                self._torn(at, ended)
                break
            opcode, length = _HEAD.unpack(head)
            if opcode == Opcode.FOOTER:
                self._check_end()
                break
            if not opcode or length > self._size - at - _HEAD.size:
                self._torn(at, ended)
                break
            if opcode not in _READ:
                self._stream.seek(length, SEEK_CUR)
            elif length > LARGEST:
                self._stream.seek(length, SEEK_CUR)
                self._complain(at, f"a record of {length} bytes, the limit is {LARGEST}")
            else:
                yield from self._record(opcode, self._stream.read(length), at)
            ended = ended or opcode == Opcode.DATA_END
            at += _HEAD.size + length
        self._account()

    def _torn(self, at: int, ended: bool) -> None:
        """The file ends too early: in its data, or when they had ``ended``."""
        if ended:
            self._tell_end()
            return
        self.troubles.append(
            f"{self._path} is torn at byte {at} of {self._size}: its recorder was killed, the disk was full, or the "
            "file is cut; it is read up to there"
        )

    def _check_end(self) -> None:
        self._stream.seek(-len(MAGIC), SEEK_END)
        if self._stream.read() != MAGIC:
            self._tell_end()

    def _tell_end(self) -> None:
        self.troubles.append(
            f"{self._path} is torn in its table of contents: all messages are there, other tools may refuse it"
        )

    def _account(self) -> None:
        """Tell how much is damaged, and what the table of contents has that was not found."""
        if self._damaged > MOST_TROUBLES:
            self.troubles.append(f"{self._path}: damaged in {self._damaged - MOST_TROUBLES} more places")
        if self._told is not None and self._told != self._count:
            self.troubles.append(
                f"{self._path} is damaged: its table of contents counts {self._told} messages, "
                f"{self._count} can be read"
            )

    def _complain(self, at: int, reason: object) -> None:
        self._damaged += 1
        if self._damaged <= MOST_TROUBLES:
            self.troubles.append(f"{self._path}: damaged at byte {at}: {reason}")

    def _record(self, opcode: int, data: bytes, at: int) -> Iterator[Line]:
        """The messages of the record at a byte of the file, if it has some; what cannot be read is told instead."""
        try:
            match opcode:
                case Opcode.CHUNK:
                    yield from self._chunk(_unpacked(Chunk.read(ReadDataStream(BytesIO(data)))), at)
                case Opcode.MESSAGE:
                    yield self._message(data)
                case _:
                    self._note(opcode, data)
        except FAULTS as error:
            self._complain(at, error)

    def _note(self, opcode: int, data: bytes) -> None:
        if opcode not in _READ:
            return
        if len(data) > LARGEST_TEXT:
            raise ValueError(f"a schema, channel or note of {len(data)} bytes, the limit is {LARGEST_TEXT}")
        stream = ReadDataStream(BytesIO(data))
        match opcode:
            case Opcode.HEADER:
                self.ours = Header.read(stream).library == LIBRARY
            case Opcode.SCHEMA:
                schema = Schema.read(stream)
                if schema.id not in self._schemas:
                    self._weigh(data)
                    self._schemas[schema.id] = schema
            case Opcode.CHANNEL:
                record = ChannelRecord.read(stream)
                if record.id not in self.channels:
                    self._weigh(data)
                    self.channels[record.id] = channel_from(record, self._schemas.get(record.schema_id))
            case Opcode.METADATA:
                notes = Metadata.read(stream)
                if notes.name == LIBRARY:
                    self._weigh(data)
                    self.notes |= notes.metadata
            case Opcode.STATISTICS:
                self._told = Statistics.read(stream).message_count

    def _weigh(self, data: bytes) -> None:
        self._texts += len(data)
        if self._texts > LARGEST_TEXTS:
            raise ValueError(f"schemas, channels and notes of more than {LARGEST_TEXTS} bytes in all")

    def _chunk(self, records: bytes, place: int) -> Iterator[Line]:
        """The messages of a chunk that lies at a byte of the file; its other records count before all of them."""
        starts, times = array("Q"), array("Q")
        at = 0
        while at < len(records):
            opcode, length = _HEAD.unpack_from(records, at)
            at += _HEAD.size
            if length > len(records) - at:
                self._complain(place, "a record reaches beyond its chunk")
                break
            try:
                if opcode == Opcode.MESSAGE:
                    starts.append(at)
                    times.append(_MESSAGE.unpack_from(records, at)[2] if length >= _MESSAGE.size else 0)
                else:
                    self._note(opcode, records[at : at + length])
            except FAULTS as error:
                self._complain(place, error)
            at += length
        order: range | list[int] = range(len(starts))
        if not self.ours and any(times[n] < times[n - 1] for n in order[1:]):
            order = sorted(order, key=times.__getitem__)
        for n in order:
            length = _HEAD.unpack_from(records, starts[n] - _HEAD.size)[1]
            try:
                line = self._message(records[starts[n] : starts[n] + length])
            except FAULTS as error:
                self._complain(place, error)
            else:
                yield line

    def _message(self, data: bytes) -> Line:
        number, sequence, log_time, publish_time = _MESSAGE.unpack_from(data)
        if number not in self.channels:
            raise ValueError(f"a message of channel {number}, which is not declared")
        payload = data[_MESSAGE.size :]
        if self.channels[number].encoding == RAW and self.ours:
            payload = _unwrap(payload).data
        self._count += 1
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
    """The records of a chunk: as many bytes as it says, and no more, however well the data is packed."""
    size = chunk.uncompressed_size
    if size > LARGEST:
        raise ValueError(f"a chunk of {size} bytes, the limit is {LARGEST}")
    match chunk.compression:
        case "":
            records = chunk.data
        case "zstd":
            told = zstandard.get_frame_parameters(chunk.data).content_size
            if told not in (size, zstandard.CONTENTSIZE_UNKNOWN):
                raise ValueError(f"a chunk whose data has {told} bytes, unpacked, instead of {size}")
            with zstandard.ZstdDecompressor().stream_reader(BytesIO(chunk.data), read_across_frames=True) as stream:
                records = stream.read(size + 1)
        case "lz4":
            records = lz4.frame.LZ4FrameDecompressor().decompress(chunk.data, max_length=size + 1)
        case other:
            raise ValueError(f"a chunk compressed by {other[:20]!r}; zstd and lz4 are known")
    if len(records) != size:
        raise ValueError(f"a chunk of {size} bytes whose data unpacks to {'more' if len(records) > size else 'less'}")
    if chunk.uncompressed_crc and zlib.crc32(records) != chunk.uncompressed_crc:
        raise ValueError("a chunk whose data does not have its checksum")
    return records

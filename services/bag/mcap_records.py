"""The records of an MCAP file beside its chunks: schemas, channels, and the table of contents at its end."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterable, Mapping
from operator import methodcaller

from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import Channel as ChannelRecord
from mcap.records import (
    DataEnd,
    Footer,
    McapRecord,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)

from services.bag.channel import Channel

MAGIC = b"\x89MCAP0\r\n"
LIBRARY = "elea"
"""Who wrote the file, and the name of its notes."""

_end = methodcaller("end")  # the library leaves it without a type


class Declared:
    """The channels of a file, numbered from 1, and the schemas that they share."""

    def __init__(self) -> None:
        self._channels: list[Channel] = []
        self._schemas: dict[tuple[str, str, str], int] = {}

    def add(self, channel: Channel) -> int:
        """The number of a new channel."""
        self._schemas.setdefault(_schema_of(channel), len(self._schemas) + 1)
        self._channels.append(channel)
        return len(self._channels)

    def records(self, numbers: Iterable[int], known: Iterable[int] = ()) -> bytes:
        """What declares these channels, with the schemas that the ``known`` ones have not brought."""
        schemas = {self._schema(number) for number in numbers} - {self._schema(number) for number in known}
        return self.schemas(sorted(schemas)) + b"".join(self.channel(number) for number in numbers)

    def schemas(self, numbers: Iterable[int]) -> bytes:
        """The records of schemas."""
        texts = {number: key for key, number in self._schemas.items()}
        made = b""
        for number in numbers:
            name, form, text = texts[number]
            made += encoded(Schema(id=number, name=name, encoding=form, data=text.encode()))
        return made

    def schemas_of(self, channels: Iterable[int]) -> list[int]:
        """The schemas that channels use."""
        return sorted({self._schema(number) for number in channels})

    def channel(self, number: int) -> bytes:
        """The record of a channel."""
        channel = self._channels[number - 1]
        return encoded(
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
    return stored.ros_type, stored.form, stored.schema


def ending(
    at: int,
    declared: Declared,
    counts: Mapping[int, int],
    chunks: tuple[int, bytes],
    span: tuple[int, int],
    notes: dict[str, str],
) -> bytes:
    """All that follows the last chunk, which ends ``at``: notes, the end of the data, the summary and the footer.

    ``counts`` are the messages of each channel, ``chunks`` how many there are and the records that tell where they lie,
    ``span`` the first and last of their log times [ns].
    """
    note = encoded(Metadata(name=LIBRARY, metadata=notes)) if notes else b""
    head = note + encoded(DataEnd(data_section_crc=0))
    schemas = declared.schemas_of(counts)
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
        (Opcode.SCHEMA, declared.schemas(schemas)),
        (Opcode.CHANNEL, b"".join(declared.channel(number) for number in counts)),
        (Opcode.STATISTICS, encoded(statistics)),
        (Opcode.CHUNK_INDEX, chunks[1]),
        (Opcode.METADATA_INDEX, encoded(MetadataIndex(offset=at, length=len(note), name=LIBRARY)) if notes else b""),
    )
    return head + _summary(at + len(head), groups) + MAGIC


def encoded(record: McapRecord) -> bytes:
    """A record as it stands in the file."""
    builder = RecordBuilder()
    record.write(builder)
    data: bytes = _end(builder)
    return data


def _summary(start: int, groups: Iterable[tuple[Opcode, bytes]]) -> bytes:
    """Summary, where its groups lie, and footer."""
    summary, offsets = b"", b""
    for opcode, group in groups:
        if group:
            where = SummaryOffset(group_opcode=opcode, group_start=start + len(summary), group_length=len(group))
            offsets += encoded(where)
        summary += group
    middle = start + len(summary)
    crc = zlib.crc32(summary + offsets + struct.pack("<BQQQ", Opcode.FOOTER, 20, start, middle))
    footer = Footer(summary_start=start, summary_offset_start=middle, summary_crc=crc)
    return summary + offsets + encoded(footer)

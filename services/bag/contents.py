"""What a whole MCAP file holds, by the table of contents at its end: nothing else of it is read."""

from __future__ import annotations

from pathlib import Path

from mcap.reader import make_reader

from services.bag.metadata import FileFacts
from services.bag.scan import FAULTS, channel_from


def facts_of(file: Path) -> FileFacts | None:
    """The file as metadata.yaml tells of it; None for one that is torn, which ROS 2's tools do not open."""
    try:
        with file.open("rb") as stream:
            summary = make_reader(stream).get_summary()
        if summary is None or (told := summary.statistics) is None:
            return None
        topics = {
            channel_from(record, summary.schemas.get(record.schema_id)): told.channel_message_counts.get(number, 0)
            for number, record in summary.channels.items()
        }
    except (OSError, *FAULTS):
        return None
    span = told.message_start_time, told.message_end_time
    return FileFacts(file.name, file.stat().st_size, told.message_count, *span, topics)

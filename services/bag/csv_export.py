"""Exports bags as CSV: one file for each topic, one column for each field, one row for each message."""

from __future__ import annotations

import csv
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack
from itertools import count, islice
from pathlib import Path
from typing import Any, NamedTuple

from messages.base import WrongPayload
from services.bag.channel import Channel
from services.bag.reader import Bag, plain_decoder
from services.runtime.errors import BadInput
from services.runtime.field_path import leaves

MAX_LIST_COLUMNS = 1024
"""Maximum columns for one list; of longer ones, such as images, only the length is written."""
MAX_COLUMNS = 16_384
"""Maximum columns of a table, as in spreadsheets; further ones are left out and reported."""


class ExportResult(NamedTuple):
    """The result for one topic: its file and rows, or the reason why it has none."""

    topic: str
    file: Path | None
    rows: int
    reason: str = ""


class _Table:
    """The table of one topic: decodes its messages and collects the columns that they need."""

    def __init__(self, channel: Channel) -> None:
        self.rows = self.undecodable = 0
        self.truncated = False
        self.columns: dict[str, None] = {}
        self._read: Callable[[bytes], Any] = plain_decoder(channel)

    def row(self, data: bytes) -> dict[str, Any] | None:
        """Return the values by column; None for data that is not of the topic's type."""
        try:
            found = dict(islice(flatten(self._read(data)), MAX_COLUMNS + 1))
        except WrongPayload:
            return None
        self.truncated = self.truncated or len(found) > MAX_COLUMNS
        return found

    def widen(self, row: Iterable[str]) -> None:
        """Add the columns that a row needs, up to MAX_COLUMNS."""
        for name in row:
            if name not in self.columns:
                if len(self.columns) >= MAX_COLUMNS:
                    self.truncated = True
                    return
                self.columns[name] = None


def export_csv(bag: Bag, folder: Path, is_selected: Callable[[str], bool]) -> list[ExportResult]:
    """Write ``folder``/TOPIC.csv for every topic for which ``is_selected``; raises BadInput if it cannot be written.

    The columns ``time`` and ``log_time`` [s] are simulation and wall time; field names are joined by dots. The bag is
    read twice, since lists may grow, so the columns are only known at its end.
    """
    tables, rejected = _read_tables(bag, is_selected)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        names = _file_names(tables)
        _write(bag, {channel: folder / name for channel, name in names.items()}, tables)
    except (OSError, ValueError) as error:
        raise BadInput(f"the tables cannot be written to {folder}: {error}") from None
    results = list(rejected.values())
    for channel, table in tables.items():
        reasons = [f"{table.undecodable} messages are not of their type"] if table.undecodable else []
        reasons += [f"columns beyond {MAX_COLUMNS} are left out"] if table.truncated else []
        results.append(ExportResult(channel.topic, folder / names[channel], table.rows, "; ".join(reasons)))
    return sorted(results, key=lambda each: (each.topic, str(each.file)))


def _read_tables(
    bag: Bag, is_selected: Callable[[str], bool]
) -> tuple[dict[Channel, _Table], dict[Channel, ExportResult]]:
    """Read the bag and return the topics with their columns, and those that cannot be exported."""
    tables: dict[Channel, _Table] = {}
    rejected: dict[Channel, ExportResult] = {}
    for entry in bag.entries():
        channel = entry.channel
        if not is_selected(channel.name) or channel in rejected:
            continue
        try:
            table = tables.get(channel) or tables.setdefault(channel, _Table(channel))
        except WrongPayload as error:
            rejected[channel] = ExportResult(channel.topic, None, 0, str(error))
            continue
        if (row := table.row(entry.data)) is None:
            table.undecodable += 1
        else:
            table.widen(row)
    return tables, rejected


def _write(bag: Bag, files: dict[Channel, Path], tables: dict[Channel, _Table]) -> None:
    with ExitStack() as stack:
        writers = {}
        for channel, table in tables.items():
            stream = stack.enter_context(files[channel].open("w", newline="", encoding="utf-8"))
            writers[channel] = csv.writer(stream)
            writers[channel].writerow(["time", "log_time", *table.columns])
        for entry in bag.entries():
            if (each := tables.get(entry.channel)) is not None and (row := each.row(entry.data)) is not None:
                times = [f"{time // 10**9}.{time % 10**9:09}" for time in (entry.publish_time, entry.log_time)]
                writers[entry.channel].writerow(times + [row.get(name, "") for name in each.columns])
                each.rows += 1


def _file_names(channels: Iterable[Channel]) -> dict[Channel, str]:
    """Return a file name for each channel, from its topic, numbered if several would be equal."""
    names: dict[Channel, str] = {}
    for channel in channels:
        stem = channel.topic.strip("/").replace("/", "__")
        tries = (f"{stem}{f'_{number}' if number else ''}.csv" for number in count())
        names[channel] = next(each for each in tries if each not in names.values())
    return names


def flatten(value: Any) -> Iterator[tuple[str, Any]]:
    """Yield the leaves of a message with their paths; for a list too long for columns, only its length."""
    return leaves(value, max_elements=MAX_LIST_COLUMNS, lengths=True)

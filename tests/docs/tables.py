"""Generates the tables of docs/ that list parts of the code.

``./elea python -m tests.docs.tables`` writes them into the pages.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable

from deploy.commands.cli import COMMANDS
from deploy.fleet_file import find_fleet, fleet_names, read_fleet
from messages.base import Message
from messages.requests import REQUESTS, Request
from messages.topics import TOPICS, Quality, Topic
from services.catalog import load_service, service_kinds
from tests.docs.readme import DOCS


def capitalised(text: str) -> str:
    """Return the text with a capital first letter and without a full stop."""
    return (text[:1].upper() + text[1:]).rstrip(".")


def topic_row(topic: Topic[Message]) -> tuple[str, ...]:
    rate = f"{topic.rate:g}" if topic.rate else "-"
    return f"`{topic.name}`", f"`{topic.record.ROS_TYPE}`", rate, topic.quality.name.lower(), topic.about


def request_row(request: Request[Message, Message]) -> tuple[str, ...]:
    types = request.request_type.ROS_TYPE, request.response_type.ROS_TYPE
    return f"`{request.name}`", f"`{types[0]}`", f"`{types[1]}`", request.about


def fleet_row(name: str) -> tuple[str, ...]:
    return f"`{name}`", read_fleet(find_fleet(name)).description


TABLES: dict[tuple[str, str], Callable[[], Iterable[tuple[str, ...]]]] = {
    ("commands.md", "| command |"): lambda: ((f"`./elea {verb}`", each.about) for verb, each in COMMANDS.items()),
    ("fleets.md", "| fleet |"): lambda: map(fleet_row, fleet_names()),
    ("services.md", "| service |"): lambda: (
        (f"`{kind}`", capitalised(load_service(kind).about)) for kind in service_kinds()
    ),
    ("services.md", "| request |"): lambda: map(request_row, REQUESTS),
    ("topics.md", "| topic |"): lambda: map(topic_row, TOPICS),
    ("topics.md", "| quality |"): lambda: ((f"`{each.name.lower()}`", each.value) for each in Quality),
}
"""The rows of each table, by its page and the start of its first line."""


def with_table(text: str, head: str, rows: Iterable[tuple[str, ...]]) -> str:
    """Return a page with the rows of the table that starts with ``head`` replaced."""
    lines = text.split("\n")
    [first] = [number for number, line in enumerate(lines) if line.startswith(head)]
    end = first + 2
    while lines[end].startswith("|"):
        end += 1
    made = [f"| {' | '.join(row)} |" for row in rows]
    return "\n".join([*lines[: first + 2], *made, *lines[end:]])


def main() -> None:
    """Write all tables into their pages."""
    for (page, head), rows in TABLES.items():
        path = DOCS / page
        path.write_text(with_table(path.read_text(), head, rows()))


if __name__ == "__main__":
    main()

"""The tables of the pages match the code: topics, qualities, requests, commands, fleets and services."""

from __future__ import annotations

import pytest

from messages import gazebo_services, requests, topics
from messages.requests import REQUESTS, Request
from messages.topics import TOPICS, TURTLE_TOPICS, Topic
from tests.docs.readme import DOCS
from tests.docs.tables import TABLES, with_table

MAKE = "./elea python -m tests.docs.tables"


def test_the_tables_are_those_of_the_code() -> None:
    stale = []
    for (page, head), rows in TABLES.items():
        text = (DOCS / page).read_text()
        if with_table(text, head, rows()) != text:
            stale.append(f"docs/{page}: the table {head!r}; write it with: {MAKE}")
    assert stale == []


def test_a_missing_and_a_stale_row_are_found() -> None:
    rows = list(TABLES["topics.md", "| topic |"]())
    text = (DOCS / "topics.md").read_text()
    assert len(rows) == len(TOPICS)
    assert with_table(text, "| topic |", rows[:-1]) != text
    stale = text.replace("| 25 | command |", "| 24 | command |", 1)
    assert stale != text
    assert with_table(stale, "| topic |", rows) == text


@pytest.mark.parametrize("head", ["| nowhere |", "|"])
def test_a_table_that_is_not_there_or_not_alone_is_an_error(head: str) -> None:
    with pytest.raises(ValueError, match="values to unpack"):
        with_table((DOCS / "topics.md").read_text(), head, [])


def test_every_request_and_topic_is_listed() -> None:
    assert {
        each for each in (*vars(requests).values(), *vars(gazebo_services).values()) if isinstance(each, Request)
    } == set(REQUESTS)
    assert {each for each in vars(topics).values() if isinstance(each, Topic)} == {
        *TOPICS,
        *TURTLE_TOPICS,
        topics.CMD_VEL_STAMPED,
    }

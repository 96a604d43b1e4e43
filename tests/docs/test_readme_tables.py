"""What README.md lists is what the code has: topics, verbs, fleets and services."""

from __future__ import annotations

from deploy.commands.cli import COMMANDS
from deploy.fleet_file import fleet_names
from deploy.service_catalog import load_service
from messages.base import Message
from messages.requests import SIM_REQUESTS
from messages.topics import TOPICS, Quality, Topic
from services.catalog import service_kinds
from tests.docs.readme import section, table


def row(topic: Topic[Message]) -> list[str]:
    """A topic as the table shows it."""
    rate = f"{topic.rate:g}" if topic.rate else "-"
    return [topic.name, topic.record.ROS_TYPE, rate, topic.quality.name.lower(), topic.about]


def test_the_table_of_topics_is_that_of_the_code() -> None:
    assert table(section("Topics")) == [row(topic) for topic in TOPICS]


def test_the_qualities_are_explained() -> None:
    text = section("Topics")
    for quality in Quality:
        assert f"- `{quality.name.lower()}`: {quality.value}\n" in text


def test_every_request_of_the_simulation_is_named() -> None:
    assert [each.name for each in SIM_REQUESTS if f"`{each.name}`" not in section("Topics")] == []


def test_the_verbs_are_those_of_the_command_line() -> None:
    assert [[cells[0].split()[1], cells[1]] for cells in table(section("Commands"))] == [
        [verb, about.about] for verb, about in COMMANDS.items()
    ]


def test_the_services_are_those_that_exist() -> None:
    told = [[cells[0], cells[1].lower()] for cells in table(section("Services"))]
    assert told == [[kind, load_service(kind).about.rstrip(".").lower()] for kind in service_kinds()]


def test_every_fleet_is_named() -> None:
    text = section("Commands") + section("Fleets")
    assert [name for name in fleet_names() if f"`{name}`" not in text] == []

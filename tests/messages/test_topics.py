"""The tables of topics and requests are consistent."""

import pytest

from messages import gazebo_services, requests, topics
from messages.names import BadName, key, resolve
from messages.records import RECORDS
from messages.requests import REQUESTS, Request
from messages.topics import TOPICS, TURTLE_TOPICS, Quality, Topic


def test_topics_have_legal_names_each_its_own() -> None:
    resolved = [resolve(topic.name, "/tb3_0", "driver") for topic in TOPICS]
    assert len(set(resolved)) == len(resolved)
    assert all(key(name) for name in resolved)


def test_topics_carry_known_records_at_a_promised_rate() -> None:
    for topic in TOPICS:
        assert RECORDS[topic.record.ROS_TYPE] is topic.record
        assert topic.rate >= 0
        assert topic.about
        assert topic.largest >= 1 << 13


def test_a_latched_topic_promises_no_rate() -> None:
    assert not [topic.name for topic in TOPICS if topic.quality is Quality.LATCHED and topic.rate]


def test_requests_have_legal_names_each_its_own_and_known_records() -> None:
    names = [resolve(request.name, "/tb3_0", "driver") for request in REQUESTS]
    assert len(set(names)) == len(names)
    for request in REQUESTS:
        assert RECORDS[request.request_type.ROS_TYPE] is request.request_type
        assert RECORDS[request.response_type.ROS_TYPE] is request.response_type
        assert request.about


def test_the_tables_have_all_that_is_declared() -> None:
    declared = [each for each in vars(topics).values() if isinstance(each, Topic)]
    declared.remove(topics.CMD_VEL_STAMPED)  # of the same name as CMD_VEL
    assert declared == [*TOPICS, *TURTLE_TOPICS]
    assert [
        each for each in (*vars(requests).values(), *vars(gazebo_services).values()) if isinstance(each, Request)
    ] == list(REQUESTS)


def test_a_topic_of_another_namespace() -> None:
    assert topics.ODOM.of("tb3_0").name == topics.ODOM.of("/tb3_0/").name == "/tb3_0/odom"
    assert topics.ODOM.of("/").name == "/odom"
    assert topics.UPDATES.of("/tb3_0/driver").name == "/tb3_0/driver/parameter_updates"
    other = topics.STOPS.named("/elsewhere")
    assert (other.record, other.quality, other.only, other.largest) == (
        topics.STOPS.record,
        topics.STOPS.quality,
        topics.STOPS.only,
        topics.STOPS.largest,
    )
    with pytest.raises(BadName, match="/clock is the same topic in every namespace"):
        topics.CLOCK.of("tb3_0")

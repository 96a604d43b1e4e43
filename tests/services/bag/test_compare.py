"""Comparison of two bags: the first message that differs, leaving out what depends on the wall clock or the folder."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
from msgspec.structs import replace

from messages.elea import EmergencyStop, EmergencyStops, Health
from messages.geometry import Twist
from messages.nav import Odometry
from messages.parameters import Parameter, ParameterValues
from messages.rosgraph import Clock
from messages.std import Float32, String, Time
from services.bag.compare import MessageDifference, compare_bags
from services.bag.reader import open_bag
from services.bag.writer import BagWriter
from tests.services.bag.sample_bags import START, STEP, BagMessage, drive_messages, make_bag, write_messages

CHANGED = 30
"""Number of the command, from 1, in which a difference is planted."""


@pytest.fixture
def left_bag(tmp_path: Path) -> Path:
    return make_bag(tmp_path / "left")


def difference(left_bag: Path, messages: list[BagMessage], begin: int = START) -> MessageDifference | None:
    """Compare the left bag with a bag of these messages and return the first difference."""
    other = left_bag.with_name("right")
    with BagWriter(other) as bag:
        write_messages(bag, messages, begin)
    return compare_bags(open_bag(left_bag), open_bag(other)).difference


def commands(messages: list[BagMessage]) -> list[int]:
    """Return the indices of the commands in a list of messages."""
    return [index for index, (topic, _, _) in enumerate(messages) if topic == "/r/cmd_vel"]


def test_equal_bags_are_the_same_whenever_they_were_recorded(left_bag: Path) -> None:
    assert difference(left_bag, list(drive_messages(2.0)), begin=START + 10**15) is None
    found = compare_bags(open_bag(left_bag), open_bag(left_bag))
    assert (found.topics, found.end_s) == (5, 2.0)
    assert found.messages == 1 + 4 * 100  # the clock has a sidecar; the bags end with the last tick


def test_a_changed_field_is_named_with_its_topic_time_and_values(left_bag: Path) -> None:
    messages = list(drive_messages(2.0))
    at = commands(messages)[CHANGED - 1]
    topic, _, now = messages[at]
    messages[at] = topic, Twist.planar(0.125, 0.0), now
    assert difference(left_bag, messages) == MessageDifference(
        topic="/r/cmd_vel",
        time_s=(CHANGED - 1) * STEP / 1e9,
        number=CHANGED,
        field="linear.x",
        left=(CHANGED - 1) / 100,
        right=0.125,
    )


def test_the_earliest_of_several_differences_is_reported_and_its_company(left_bag: Path) -> None:
    messages = [
        (
            topic,
            replace(message, child_frame_id="other") if isinstance(message, Odometry) and now >= STEP * 10 else message,
            now,
        )
        for topic, message, now in drive_messages(2.0)
    ]
    messages = [
        (topic, Twist.planar(9.0, 0.0) if topic == "/r/cmd_vel" and now >= STEP * 10 else message, now)
        for topic, message, now in messages
    ]
    found = difference(left_bag, messages)
    assert found is not None
    assert (found.topic, found.time_s, found.also) == ("/r/cmd_vel", 0.2, ("/r/odom",))


def test_a_missing_and_a_late_message_are_found(left_bag: Path) -> None:
    messages = list(drive_messages(2.0))
    at = commands(messages)[CHANGED - 1]
    found = difference(left_bag, [*messages[:at], *messages[at + 1 :]])
    assert found is not None
    assert (found.topic, found.number, found.field, found.right) == ("/r/cmd_vel", CHANGED, "", None)
    assert found.left["linear"]["x"] == (CHANGED - 1) / 100


def test_bags_of_other_times_differ_from_their_first_message_on(left_bag: Path) -> None:
    found = difference(left_bag, [(topic, message, now + STEP) for topic, message, now in drive_messages(2.0)])
    assert found is not None
    assert (found.topic, found.number, found.field) == ("/clock", 1, "publish_time")
    assert (found.left, found.right) == (0.0, STEP / 1e9)
    assert found.also == ("/r/cmd_vel", "/r/odom", "/r/robot_description")


def test_a_topic_that_one_bag_lacks_is_found(left_bag: Path) -> None:
    messages = list(drive_messages(2.0))
    found = difference(left_bag, [messages[0], ("/r/extra", String(data="more"), 0), *messages[1:]])
    assert found is not None
    assert (found.topic, found.time_s, found.left, found.right) == ("/r/extra", 0.0, None, {"data": "more"})


def test_a_bag_that_ends_earlier_is_compared_as_far_as_it_goes(left_bag: Path) -> None:
    assert difference(left_bag, list(drive_messages(1.0))) is None


def test_what_the_wall_clock_or_the_place_decides_is_left_out(tmp_path: Path) -> None:
    def bag(name: str, wall: int, place: str, speed: float) -> Path:
        stop = EmergencyStop(robot="r", holder="/panel", since=wall)
        values = (Parameter(name="output", value=place), Parameter(name="speed", value=speed))
        with BagWriter(tmp_path / name) as written:
            write_messages(
                written,
                [
                    ("/clock", Clock(), 0),
                    ("/health", Health(node="/sim", pid=wall), 0),
                    ("/sim/stops", EmergencyStops(stops=(stop,)), 0),
                    ("/r/nan", Float32(data=math.nan), 0),
                    ("/grader/parameter_updates", ParameterValues(set="/grader", revision=wall, values=values), 0),
                    ("/clock", Clock(clock=Time.of(STEP)), STEP),
                ],
            )
        return tmp_path / name

    one, same, other = bag("one", 1, "/a", 0.5), bag("same", 2, "/b", 0.5), bag("other", 1, "/a", 0.25)
    assert compare_bags(open_bag(one), open_bag(same)).difference is None
    found = compare_bags(open_bag(one), open_bag(other)).difference
    assert found is not None
    assert (found.topic, found.field) == ("/grader/parameter_updates", "values.speed.value")
    assert (found.left, found.right) == ("0.5", "0.25")


def test_a_given_end_bounds_the_comparison(left_bag: Path) -> None:
    messages = list(drive_messages(2.0))
    at = commands(messages)[CHANGED - 1]
    messages[at] = "/r/cmd_vel", Twist.planar(5.0, 0.0), messages[at][2]
    assert difference(left_bag, messages) is not None
    bags = open_bag(left_bag), open_bag(left_bag.with_name("right"))
    assert compare_bags(*bags, end=messages[at][2]).difference is None
    assert compare_bags(*bags, end=messages[at][2] + 1).difference is not None

"""Text on a command line becomes a message, or an error that names the field."""

from __future__ import annotations

import pytest

from deploy.live.message_builder import MessageBuilder
from messages.base import Message
from messages.geometry import PoseStamped, Twist, Vector3
from messages.sensor import Image, JointState, LaserScan
from messages.std import Bool, Empty, Float32, Header, String, Time
from messages.tf import TFMessage
from models.yaml_reader import read_yaml
from services.runtime.errors import BadInput

NOW = 1_500_000_000
STAMP = Time(sec=1, nanosec=500_000_000)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        (["{linear: {x: 1e-3}}"], Twist(linear=Vector3(x=0.001))),
        (['{"linear": {"x": 1}}'], Twist(linear=Vector3(x=1.0))),
        (["[0.1, 0, 0]", "[0, 0, 1]"], Twist(linear=Vector3(x=0.1), angular=Vector3(z=1.0))),
        (["{linear: [0.1, 0, 0]}"], Twist(linear=Vector3(x=0.1))),
        ([], Twist()),
        (["{}"], Twist()),
        ([""], Twist()),
        (["true"], Bool(data=True)),
        (["{data: false}"], Bool()),
        (["3"], Float32(data=3.0)),
        (["hello"], String(data="hello")),
        (["'12'"], String(data="12")),
        (["{}"], Empty()),
        (["{name: [a], position: [1]}"], JointState(header=Header(stamp=STAMP), name=("a",), position=(1.0,))),
        (["{height: 1, step: 3, data: [1, 2, 3]}"], None),
        (["{height: 1, step: 3, data: !!binary AQID}"], None),
    ],
)
def test_values(values: list[str], message: Message | None) -> None:
    if message is None:
        image = MessageBuilder(Image, values).build(NOW)
        assert isinstance(image, Image)
        assert image.data == b"\x01\x02\x03"
    else:
        assert MessageBuilder(type(message), values).build(NOW) == message


@pytest.mark.parametrize(
    ("record", "values", "said"),
    [
        (Twist, ["{linaer: {x: 1}}"], "unknown field 'linaer'; did you mean 'linear'"),
        (Twist, ["{linear: {q: 1}}"], "linear: unknown field 'q'"),
        (Twist, ["{linear: {x: fast}}"], "geometry_msgs/Twist at linear.x: Expected `float`, got `str`"),
        (Twist, ["{linear: {x: .nan}}"], "at linear.x: Expected `float` >="),
        (Twist, ["{linear: {x: 1e30}}"], "at linear.x: Expected `float` <= 1000000000000.0"),
        (Twist, ["{linear: 3}"], "linear: geometry_msgs/Vector3 has the fields x, y, z, got 1 value"),
        (Twist, ["[1, 2]"], "linear: geometry_msgs/Vector3 has the fields x, y, z, got 2 values"),
        (Twist, ["1", "2", "3"], "has the fields linear, angular, got 3 values"),
        (Twist, ["{linear: ["], "is not YAML"),
        (Twist, ["!!python/object/apply:os.system [ls]"], "is not YAML"),
        (String, ["&a [*a]"], "nested too deeply"),
        (String, ["12"], "Expected `str`, got `int`; text that looks like something else needs quotes"),
        (Bool, ["1"], "at data: Expected `bool`, got `int`"),
        (JointState, ["{name: [a], position: [1, 2]}"], "position has 2 values for 1 joint names"),
        (LaserScan, ["{ranges: [a]}"], "ranges"),
        (Image, ["{data: [300]}"], "data: bytes must be in range"),
    ],
)
def test_bad_values(record: type[Message], values: list[str], said: str) -> None:
    with pytest.raises(BadInput) as caught:
        MessageBuilder(record, values)
    assert said in str(caught.value)


@pytest.mark.parametrize(
    "text", ["", "{header: auto}", "{header: {stamp: now}}", "{header: {stamp: {sec: 1, nanosec: 500000000}}}"]
)
def test_headers_are_stamped_when_the_message_is_sent(text: str) -> None:
    draft = MessageBuilder(PoseStamped, [text])
    made = draft.build(NOW)
    assert isinstance(made, PoseStamped)
    assert made.header.stamp == STAMP
    later = draft.build(2 * NOW)
    assert isinstance(later, PoseStamped)
    assert later.header.stamp.ns == (2 * NOW if draft.needs_clock else NOW)


def test_headers_in_lists_and_headers_that_stay_at_zero() -> None:
    frames = MessageBuilder(TFMessage, ["{transforms: [{child_frame_id: a}, {header: {frame_id: world}}]}"]).build(NOW)
    assert isinstance(frames, TFMessage)
    assert [each.header.stamp for each in frames.transforms] == [STAMP, STAMP]
    assert frames.transforms[1].header.frame_id == "world"
    zero = MessageBuilder(PoseStamped, ["{pose: {position: {x: 1}}}"], stamped=False)
    assert not zero.needs_clock
    assert zero.build(NOW) == PoseStamped(pose=zero.build(0).pose)  # type: ignore[attr-defined]


@pytest.mark.parametrize(
    ("text", "value"), [("1e-3", 0.001), ("-2E5", -2e5), ("1e3", 1000.0), ("1.5", 1.5), ("e3", "e3")]
)
def test_numbers_are_those_of_json(text: str, value: object) -> None:
    assert read_yaml(text) == value

"""What comes in is checked, counted and, in lockstep, held back until its tick is over."""

from __future__ import annotations

import threading

import pytest

from messages.base import encode
from messages.geometry import Twist
from messages.std import String
from messages.topics import CMD_VEL, Quality
from services.runtime.inputs import Input
from services.runtime.lockstep.marks import Marks
from services.runtime.network.memory_transport import MemoryBus, MemoryTransport
from services.runtime.network.wire import attach, encoding, publisher_id

KEY = "tb3_0/cmd_vel"
TWIST = encoding(Twist.ROS_TYPE)


class Sender:
    """Puts raw samples, numbered or not."""

    def __init__(self, bus: MemoryBus, node: str = "/a", kind: str = TWIST) -> None:
        transport = MemoryTransport(bus)
        self.id = publisher_id(node, transport.session, KEY)
        self._outlet = transport.publish(KEY, kind, Quality.COMMAND)

    def put(self, payload: bytes, number: int | None) -> None:
        self._outlet.put(payload, attachment=b"" if number is None else attach(number, self.id))

    def twist(self, v: float, number: int | None) -> None:
        self.put(encode(Twist.planar(v, 0.0)), number)


@pytest.fixture
def bus() -> MemoryBus:
    return MemoryBus()


@pytest.fixture
def source(bus: MemoryBus) -> Input[Twist]:
    return Input(CMD_VEL, "/tb3_0/cmd_vel", KEY, MemoryTransport(bus))


def _speeds(source: Input[Twist]) -> list[float]:
    return [message.linear.x for message, _ in source.batch]


def test_gaps_are_lost_and_repeats_are_ignored(bus: MemoryBus, source: Input[Twist]) -> None:
    sender = Sender(bus)
    for number in (4, 5, 5, 8, 3):
        sender.twist(number, number)
    source.admit()
    assert _speeds(source) == [4.0, 5.0, 8.0]
    assert (source.received, source.lost) == (3, 2)


def test_each_publisher_is_numbered_by_itself(bus: MemoryBus, source: Input[Twist]) -> None:
    one, other = Sender(bus), Sender(bus)
    one.twist(1, 1)
    other.twist(2, 7)
    one.twist(3, 2)
    other.twist(4, 8)
    source.admit()
    assert source.lost == 0
    assert sorted(_speeds(source)) == [1.0, 2.0, 3.0, 4.0]


BAD = (
    b"",
    encode(Twist.planar(1, 0))[:-1],
    encode({"linear": {"x": float("nan")}}),
    encode({"linear": {"x": 1e308}}),
    encode({"linear": {"x": "fast"}}),
    b"\xc1" * 50,
    b"x" * 70_000,
)


@pytest.mark.parametrize("payload", BAD)
def test_bad_payloads_are_counted_and_the_next_good_one_works(
    bus: MemoryBus, source: Input[Twist], payload: bytes
) -> None:
    sender = Sender(bus)
    sender.put(payload, 1)
    sender.put(payload, None)
    sender.twist(0.1, 2)
    source.admit()
    assert _speeds(source) == [0.1]
    assert source.refused == 2
    assert source.reason
    assert source.health().refused == 2


def test_another_type_is_refused_even_if_it_would_decode(bus: MemoryBus, source: Input[Twist]) -> None:
    Sender(bus, kind=encoding(String.ROS_TYPE)).put(encode(String(data="x")), 1)
    source.admit()
    assert source.batch == []
    assert "std_msgs/String" in source.reason


def test_a_foreign_sample_is_taken_and_shown(bus: MemoryBus, source: Input[Twist]) -> None:
    Sender(bus, kind="").twist(0.2, None)
    source.admit()
    assert (_speeds(source), source.foreign, source.refused) == ([0.2], 1, 0)


def test_lockstep_holds_back_what_was_sent_in_this_tick(bus: MemoryBus, source: Input[Twist]) -> None:
    member, stranger = Sender(bus, "/member"), Sender(bus, "/stranger")
    marks = Marks()
    marks.members = {member.id[:10]}
    member.twist(1, 1)
    member.twist(2, 2)
    stranger.twist(9, 1)
    marks.advance({KEY: {member.id: 1}})
    source.admit(marks)
    assert sorted(_speeds(source)) == [1.0, 9.0]
    source.admit(marks)
    assert _speeds(source) == []
    marks.advance({KEY: {member.id: 2}})
    source.admit(marks)
    assert _speeds(source) == [2.0]


def test_lockstep_waits_for_what_was_sent(bus: MemoryBus, source: Input[Twist]) -> None:
    member = Sender(bus, "/member")
    marks = Marks()
    marks.members = {member.id[:10]}
    marks.advance({KEY: {member.id: 1}})
    threading.Timer(0.05, member.twist, (1.0, 1)).start()
    source.admit(marks)
    assert (_speeds(source), source.lost) == ([1.0], 0)


def test_lockstep_counts_what_never_comes_as_lost(
    bus: MemoryBus, source: Input[Twist], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("services.runtime.inputs.PATIENCE_S", 0.02)
    member = Sender(bus, "/member")
    marks = Marks()
    marks.members = {member.id[:10]}
    member.twist(1, 1)
    marks.advance({KEY: {member.id: 3}})
    source.admit(marks)
    marks.settle()
    assert (_speeds(source), source.lost) == ([1.0], 2)


def test_members_come_in_the_order_of_their_names_whoever_was_faster() -> None:
    orders = []
    for first, second in (("/a", "/b"), ("/b", "/a")):
        bus = MemoryBus()
        source: Input[Twist] = Input(CMD_VEL, "/tb3_0/cmd_vel", KEY, MemoryTransport(bus))
        senders = {name: Sender(bus, name) for name in ("/a", "/b")}
        marks = Marks()
        marks.members = {each.id[:10] for each in senders.values()}
        for name in (first, second):
            senders[name].twist(1.0 if name == "/a" else 2.0, 1)
        marks.advance({KEY: {each.id: 1 for each in senders.values()}})
        source.admit(marks)
        orders.append(_speeds(source))
    assert orders[0] == orders[1]

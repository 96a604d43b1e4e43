"""What comes in is checked, counted and, in lockstep, held back until its tick is over."""

from __future__ import annotations

import threading
import time

import pytest

from messages.base import encode
from messages.geometry import Twist
from messages.std import String
from messages.topics import CMD_VEL, HEALTH, Quality
from services.runtime.inputs import CAPACITY, Input
from services.runtime.lockstep.marks import Marks
from services.runtime.network.memory_transport import MemoryBus, MemoryTransport
from services.runtime.network.wire import Origin, attach, encoding, publisher_id
from tests.runtime.bench import node

KEY = "tb3_0/cmd_vel"
TWIST = encoding(Twist.ROS_TYPE)


class Sender:
    """Puts raw samples, numbered or not; one with a number that it has sent already is the same one again."""

    def __init__(self, bus: MemoryBus, node: str = "/a", kind: str = TWIST) -> None:
        transport = MemoryTransport(bus)
        self.id = publisher_id(node, transport.session, KEY)
        self._outlet = transport.publish(KEY, kind, Quality.COMMAND)
        self._attachments: dict[int | None, bytes] = {None: b""}

    def put(self, payload: bytes, number: int | None) -> None:
        if number is not None and number not in self._attachments:
            self._attachments[number] = attach(number, self.id)
        self._outlet.put(payload, attachment=self._attachments[number])

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
    for number in (4, 5, 5, 8, 4):
        sender.twist(number, number)
    source.admit()
    assert _speeds(source) == [4.0, 5.0, 8.0]
    assert (source.received, source.lost, source.repeated) == (3, 2, 2)


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


def test_what_no_member_told_of_is_held_within_bounds_and_never_blocks_its_true_numbers(
    bus: MemoryBus, source: Input[Twist]
) -> None:
    member = Sender(bus, "/member")
    marks = Marks()
    marks.members = {member.id[:10]}
    for number in range(2, 5 * CAPACITY, 2):
        member.twist(9, number)
        source.admit(marks)
    assert _speeds(source) == []
    assert sum(map(len, source._held.values())) <= CAPACITY
    assert source.received + source.refused == 5 * CAPACITY // 2 - 1
    assert "told of 0" in source.reason
    other = MemoryTransport(bus).publish(KEY, TWIST, Quality.COMMAND)
    other.put(encode(Twist.planar(9, 0)), attachment=attach(1, member.id[:10] + b"forged"))
    refused = source.refused
    source.admit(marks)
    assert (source.refused, "does not publish this topic" in source.reason) == (refused + 1, True)
    marks.renewed = True
    source.admit(marks)
    marks.settle()
    assert source._held == {}, "time began anew, and its numbers were not told before"
    assert source.received == 0
    member.twist(1, 5 * CAPACITY)
    marks.advance({KEY: {member.id: 5 * CAPACITY}})
    source.admit(marks)
    assert _speeds(source) == [1.0]


def test_numbers_that_fall_back_take_the_place_of_those_held(source: Input[Twist]) -> None:
    """A publisher whose numbers were forged may be followed again at lower ones."""
    id_ = publisher_id("/member", "0", KEY)
    marks = Marks()
    marks.members = {id_[:10]}
    for number in (900, 901, 5, 6):
        source._hold(Twist.planar(number, 0), Origin(number, 0, 16, id_), 4)
    assert source.refused == 2
    marks.advance({}, {KEY: {id_: 5}})
    source.admit(marks)
    assert _speeds(source) == [5.0]
    marks.advance({}, {KEY: {id_: 6}})
    source.admit(marks)
    assert _speeds(source) == [6.0]


def test_all_inputs_of_a_tick_share_one_patience_and_the_heart_beats_meanwhile(
    bus: MemoryBus, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("services.runtime.inputs.PATIENCE_S", 1.2)
    with node(bus, "reader") as made, node(bus, "witness") as witness:
        beats = witness.read(HEALTH)
        sources = [made.read(CMD_VEL, f"/r{number}/cmd_vel") for number in range(10)]
        member = publisher_id("/member", "0", "any")
        marks = Marks()
        marks.members = {member[:10]}
        for each in sources:
            marks.advance({each.key: {member: 2**40}})
        made.turn()
        witness.admit()
        made.outbox.hold()
        begun = time.monotonic()
        made.admit(marks)
        waited = time.monotonic() - begun
        witness.admit()
        assert [message.node for message, _ in beats.batch] == ["/reader"] * (len(beats.batch) or 1)
        # Ten times the patience would be 12 s; how much more than once it takes is up to the machine.
        assert waited < 6 * 1.2
        assert [each.lost for each in sources] == [1] * 10, "of what was never heard, one is missing for certain"
        assert made.outbox.held is not None, "the burst of the step goes on"
        late = MemoryTransport(bus).publish(sources[0].key, TWIST, Quality.COMMAND)
        late.put(encode(Twist.planar(1, 0)), attachment=attach(1, publisher_id("/other", "0", sources[0].key)))
        made.admit(marks)
        assert _speeds(sources[0]) == [1.0]

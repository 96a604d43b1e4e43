"""Incoming messages are checked, counted and, in lockstep, held back until their tick is over."""

from __future__ import annotations

import threading

import pytest

from messages.base import encode
from messages.elea import Health
from messages.geometry import Twist
from messages.std import String
from messages.topics import CMD_VEL, HEALTH, Quality
from services.runtime.lockstep.watermarks import Watermarks
from services.runtime.subscriber import QUEUE_SIZE, Subscriber, UntypedSubscriber
from services.runtime.transport.memory import MemoryBus, MemoryTransport
from services.runtime.transport.wire import SampleInfo, encoding, pack_attachment, publisher_id
from tests.harness.memory_node import memory_node

KEY = "tb3_0/cmd_vel"
TWIST = encoding(Twist.ROS_TYPE)


class Sender:
    """Publishes raw samples, with or without a sequence number; a repeated number repeats the sample."""

    def __init__(self, bus: MemoryBus, node: str = "/a", kind: str = TWIST, key: str = KEY) -> None:
        transport = MemoryTransport(bus)
        self.id = publisher_id(node, transport.session, key)
        self._outlet = transport.advertise(key, kind, Quality.COMMAND)
        self._attachments: dict[int | None, bytes] = {None: b""}

    def put(self, payload: bytes, number: int | None) -> None:
        if number is not None and number not in self._attachments:
            self._attachments[number] = pack_attachment(number, self.id)
        self._outlet.put(payload, attachment=self._attachments[number])

    def twist(self, v: float, number: int | None) -> None:
        self.put(encode(Twist.planar(v, 0.0)), number)


@pytest.fixture
def bus() -> MemoryBus:
    return MemoryBus()


@pytest.fixture
def source(bus: MemoryBus) -> Subscriber[Twist]:
    return Subscriber(CMD_VEL, "/tb3_0/cmd_vel", KEY, MemoryTransport(bus))


def _speeds(source: Subscriber[Twist]) -> list[float]:
    return [message.linear.x for message, _ in source.messages]


def test_gaps_are_lost_and_repeats_are_ignored(bus: MemoryBus, source: Subscriber[Twist]) -> None:
    sender = Sender(bus)
    for number in (4, 5, 5, 8, 4):
        sender.twist(number, number)
    source.update()
    assert _speeds(source) == [4.0, 5.0, 8.0]
    assert (source.received, source.lost, source.repeated) == (3, 2, 2)


def test_each_publisher_is_numbered_by_itself(bus: MemoryBus, source: Subscriber[Twist]) -> None:
    one, other = Sender(bus), Sender(bus)
    one.twist(1, 1)
    other.twist(2, 7)
    one.twist(3, 2)
    other.twist(4, 8)
    source.update()
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
    bus: MemoryBus, source: Subscriber[Twist], payload: bytes
) -> None:
    sender = Sender(bus)
    sender.put(payload, 1)
    sender.put(payload, None)
    sender.twist(0.1, 2)
    source.update()
    assert _speeds(source) == [0.1]
    assert source.refused == 2
    assert source.reason
    assert source.health().refused == 2


def test_another_type_is_refused_even_if_it_would_decode(bus: MemoryBus, source: Subscriber[Twist]) -> None:
    Sender(bus, kind=encoding(String.ROS_TYPE)).put(encode(String(data="x")), 1)
    source.update()
    assert source.messages == []
    assert "std_msgs/String" in source.reason


def test_a_foreign_sample_is_taken_and_shown(bus: MemoryBus, source: Subscriber[Twist]) -> None:
    Sender(bus, kind="").twist(0.2, None)
    source.update()
    assert (_speeds(source), source.foreign, source.refused) == ([0.2], 1, 0)


def test_lockstep_holds_back_what_was_sent_in_this_tick(bus: MemoryBus, source: Subscriber[Twist]) -> None:
    member, stranger = Sender(bus, "/member"), Sender(bus, "/stranger")
    marks = Watermarks()
    marks.members = {member.id[:10]}
    member.twist(1, 1)
    member.twist(2, 2)
    stranger.twist(9, 1)
    marks.advance({KEY: {member.id: 1}})
    source.update(marks)
    assert sorted(_speeds(source)) == [1.0, 9.0]
    source.update(marks)
    assert _speeds(source) == []
    marks.advance({KEY: {member.id: 2}})
    source.update(marks)
    assert _speeds(source) == [2.0]


def test_lockstep_waits_for_what_was_sent(bus: MemoryBus, source: Subscriber[Twist]) -> None:
    member = Sender(bus, "/member")
    marks = Watermarks()
    marks.members = {member.id[:10]}
    marks.advance({KEY: {member.id: 1}})
    threading.Timer(0.05, member.twist, (1.0, 1)).start()
    source.update(marks)
    assert (_speeds(source), source.lost) == ([1.0], 0)


def test_lockstep_counts_what_never_comes_as_lost(
    bus: MemoryBus, source: Subscriber[Twist], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("services.runtime.subscriber.WAIT_BUDGET_S", 0.02)
    member = Sender(bus, "/member")
    marks = Watermarks()
    marks.members = {member.id[:10]}
    member.twist(1, 1)
    marks.advance({KEY: {member.id: 3}})
    source.update(marks)
    marks.clear_required()
    assert (_speeds(source), source.lost) == ([1.0], 2)


def test_lockstep_does_not_wait_for_what_came_and_was_refused(
    bus: MemoryBus, source: Subscriber[Twist], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("services.runtime.subscriber.WAIT_BUDGET_S", -1.0)
    member = Sender(bus, "/member")
    marks = Watermarks()
    marks.members = {member.id[:10]}
    for number, payload in enumerate((b"x" * 70_000, b"\xc1" * 50, encode(Twist.planar(1.0, 0.0))), start=1):
        member.put(payload, number)
        marks.advance({KEY: {member.id: number}})
        source.update(marks)
        marks.clear_required()
        assert (source.lost, source.refused) == (0, min(number, 2))
    assert _speeds(source) == [1.0]


def test_lockstep_takes_heartbeats_as_they_come(bus: MemoryBus) -> None:
    source: Subscriber[Health] = Subscriber(HEALTH, HEALTH.name, KEY, MemoryTransport(bus))
    member = Sender(bus, "/member", kind=encoding(Health.ROS_TYPE))
    marks = Watermarks()
    marks.members = {member.id[:10]}
    for beat in range(1, 4):
        member.put(encode(Health(node="/member", beat=beat)), beat)
        source.update(marks)
        assert [each.beat for each, _ in source.messages] == [beat]


def test_members_come_in_the_order_of_their_names_whoever_was_faster() -> None:
    orders = []
    for first, second in (("/a", "/b"), ("/b", "/a")):
        bus = MemoryBus()
        source: Subscriber[Twist] = Subscriber(CMD_VEL, "/tb3_0/cmd_vel", KEY, MemoryTransport(bus))
        senders = {name: Sender(bus, name) for name in ("/a", "/b")}
        marks = Watermarks()
        marks.members = {each.id[:10] for each in senders.values()}
        for name in (first, second):
            senders[name].twist(1.0 if name == "/a" else 2.0, 1)
        marks.advance({KEY: {each.id: 1 for each in senders.values()}})
        source.update(marks)
        orders.append(_speeds(source))
    assert orders[0] == orders[1]


def test_what_no_member_told_of_is_held_within_bounds_and_never_blocks_its_true_numbers(
    bus: MemoryBus, source: Subscriber[Twist]
) -> None:
    member = Sender(bus, "/member")
    marks = Watermarks()
    marks.members = {member.id[:10]}
    for number in range(2, 5 * QUEUE_SIZE, 2):
        member.twist(9, number)
        source.update(marks)
    assert _speeds(source) == []
    assert sum(map(len, source._deferred.values())) <= QUEUE_SIZE
    assert source.received + source.refused == 5 * QUEUE_SIZE // 2 - 1
    assert "has reported 0" in source.reason
    other = MemoryTransport(bus).advertise(KEY, TWIST, Quality.COMMAND)
    for number in (1, 2, 10**6) * 3:  # each time later than before, as if the publisher had restarted
        other.put(encode(Twist.planar(9, 0)), attachment=pack_attachment(number, member.id[:10] + b"forged"))
    refused, lost = source.refused, source.lost
    source.update(marks)
    assert (source.refused, source.lost, "does not publish this topic" in source.reason) == (refused + 9, lost, True)
    marks.epoch_changed = True
    source.update(marks)
    marks.clear_required()
    assert source._deferred == {}, "time began anew, and its numbers were not told before"
    assert source.received == 0
    member.twist(1, 5 * QUEUE_SIZE)
    marks.advance({KEY: {member.id: 5 * QUEUE_SIZE}})
    source.update(marks)
    assert _speeds(source) == [1.0]


def test_numbers_that_fall_back_take_the_place_of_those_held(source: Subscriber[Twist]) -> None:
    """After forged numbers, a publisher may be followed again at lower ones."""
    id_ = publisher_id("/member", "0", KEY)
    marks = Watermarks()
    marks.members = {id_[:10]}
    for number in (900, 901, 5, 6):
        source._defer(Twist.planar(number, 0), SampleInfo(number, 0, 16, id_), 4)
    assert source.refused == 2
    marks.advance({}, {KEY: {id_: 5}})
    source.update(marks)
    assert _speeds(source) == [5.0]
    marks.advance({}, {KEY: {id_: 6}})
    source.update(marks)
    assert _speeds(source) == [6.0]


def test_what_a_forged_number_left_out_is_not_lost(bus: MemoryBus, source: Subscriber[Twist]) -> None:
    member = Sender(bus, "/member")
    marks = Watermarks()
    marks.members = {member.id[:10]}
    member.twist(1, 1)
    marks.advance({KEY: {member.id: 1}})
    source.update(marks)
    forger = MemoryTransport(bus).advertise(KEY, TWIST, Quality.COMMAND)
    forger.put(encode(Twist.planar(9, 0)), attachment=pack_attachment(5, member.id))
    source.update(marks)
    member.twist(2, 2)
    marks.advance({KEY: {member.id: 2}})
    source.update(marks)
    assert (_speeds(source), source.received, source.refused, source.lost) == ([2.0], 2, 1, 0)


def test_all_inputs_of_a_tick_share_one_patience_and_the_heart_beats_meanwhile(
    bus: MemoryBus, monkeypatch: pytest.MonkeyPatch
) -> None:
    """On a fake clock, which only the wait moves on."""
    now = [1000.0]

    class Clock:
        @staticmethod
        def monotonic() -> float:
            return now[0]

        @staticmethod
        def sleep(seconds: float) -> None:
            now[0] += 0.01

    for module in ("subscriber", "heartbeat"):
        monkeypatch.setattr(f"services.runtime.{module}.time", Clock)
    monkeypatch.setattr("services.runtime.subscriber.WAIT_BUDGET_S", 1.2)
    with memory_node(bus, "reader") as made, memory_node(bus, "witness") as witness:
        beats = witness.subscribe(HEALTH)
        sources = [made.subscribe(CMD_VEL, f"/r{number}/cmd_vel") for number in range(10)]
        member = publisher_id("/member", "0", "any")
        marks = Watermarks()
        marks.members = {member[:10]}
        for each in sources:
            marks.advance({each.key: {member: 2**40}})
        made.spin_once()
        witness.update_subscribers()
        made.send_buffer.begin()
        begun = now[0]
        made.update_subscribers(marks)
        assert now[0] - begun == pytest.approx(1.2, abs=0.02), "ten times the time limit would be 12 s"
        witness.update_subscribers()
        assert [message.node for message, _ in beats.messages] == ["/reader"]
        assert [each.lost for each in sources] == [1] * 10, "of what was never heard, one is missing for certain"
        assert made.send_buffer.held is not None, "the burst of the step goes on"
        late = MemoryTransport(bus).advertise(sources[0].key, TWIST, Quality.COMMAND)
        late.put(encode(Twist.planar(1, 0)), attachment=pack_attachment(1, publisher_id("/other", "0", sources[0].key)))
        made.update_subscribers(marks)
        assert _speeds(sources[0]) == [1.0]


def test_a_rare_topic_gives_the_same_at_each_tick(bus: MemoryBus) -> None:
    with memory_node(bus, "usual") as usual, memory_node(bus, "rare") as rare:
        sources = [made.subscribe(CMD_VEL, "/tb3_0/cmd_vel", rare=made is rare) for made in (usual, rare)]
        key = sources[0].key
        member, stranger = Sender(bus, "/member", key=key), Sender(bus, "/stranger", key=key)
        marks = {made: Watermarks() for made in (usual, rare)}
        for each in marks.values():
            each.members = {member.id[:10]}

        def speeds(reached: int | None) -> list[float]:
            for made, its in marks.items():
                if reached is not None:
                    its.advance({key: {member.id: reached}})
                made.update_subscribers(its)
            one, other = map(_speeds, sources)
            assert one == other
            return one

        assert speeds(None) == speeds(None) == []
        member.twist(1, 1)
        member.twist(2, 2)
        stranger.twist(9, 1)
        assert sorted(speeds(1)) == [1.0, 9.0]
        assert speeds(None) == [], "the second is deferred"
        assert speeds(2) == [2.0]
        assert speeds(None) == speeds(None) == []
        assert not sources[1].pending, "nothing is looked at until something comes"
        threading.Timer(0.05, member.twist, (3.0, 3)).start()
        assert speeds(3) == [3.0], "what is required is waited for"
        for made in marks:
            made.update_subscribers()
        assert [_speeds(each) for each in sources] == [[], []]
        stranger.twist(8, 2)
        for made in marks:
            made.update_subscribers()
        assert [_speeds(each) for each in sources] == [[8.0], [8.0]]


def test_an_untyped_subscription_counts_as_others_do_and_shows_each_senders_type(bus: MemoryBus) -> None:
    source = UntypedSubscriber(MemoryTransport(bus), "/tb3_0/cmd_vel")
    one, other = Sender(bus), Sender(bus, "/b", "application/msgpack;my_msgs/Thing")
    foreign = Sender(bus, "/c", "text/plain")
    for number in (1, 2, 2, 5):
        one.put(b"not MessagePack", number)
    other.put(b"x", 7)
    foreign.put(b"y", None)
    heard = [(each.payload[:1], each.type, each.lost, each.origin is None) for each in source.drain()]
    twist = Twist.ROS_TYPE
    assert heard == [
        (b"n", twist, 0, False),
        (b"n", twist, 0, False),
        (b"n", twist, 2, False),
        (b"x", "my_msgs/Thing", 0, False),
        (b"y", "", 0, True),
    ]
    assert (source.received, source.lost, source.repeated, source.foreign) == (5, 2, 1, 1)

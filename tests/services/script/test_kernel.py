"""A script's kernel in real time, on an in-memory network."""

import time

import pytest

from services.runtime.errors import BadInput
from services.runtime.graph import Entity
from services.runtime.transport.memory import MemoryBus, MemoryTransport
from services.script.api import Origin, ServiceRefused, ServiceUnavailable
from tests.harness.memory_kernel import memory_kernel

WITHIN_S = 60.0


def test_two_scripts_exchange_messages_and_calls() -> None:
    bus, got = MemoryBus(), list[tuple[bytes, Origin]]()
    with memory_kernel(bus) as talker, memory_kernel(bus, install=False) as listener:
        out = talker.advertise("/chatter", "std_msgs/String")
        listener.subscribe("/chatter", "std_msgs/String", lambda payload, origin: got.append((payload, origin)))
        talker.start("/talker", "/", "script")
        listener.start("/ns/listener", "/ns", "script")
        assert talker.wait_until(lambda: out.subscribers() == ["/ns/listener"], WITHIN_S)
        for number in range(3):
            out.publish(b"%d" % number)
        assert listener.wait_until(lambda: len(got) == 3, WITHIN_S)
        assert got == [(b"%d" % number, Origin("/talker", False)) for number in range(3)]

        def handle(payload: bytes) -> bytes:
            if payload == b"no":
                raise ServiceRefused("not today")
            return payload + b"!"

        server = listener.serve("/add", "rospy_tutorials/AddTwoInts", handle)
        assert talker.wait_until(lambda: talker.service_type("/add") == "rospy_tutorials/AddTwoInts", WITHIN_S)
        assert talker.call("/add", "rospy_tutorials/AddTwoInts", b"hi") == b"hi!"
        with pytest.raises(ServiceRefused, match="not today"):
            talker.call("/add", "rospy_tutorials/AddTwoInts", b"no")
        with pytest.raises(ServiceUnavailable):
            talker.call("/missing", "std_srvs/Empty", b"")
        server.close()
        assert talker.wait_until(lambda: talker.service_type("/add") is None, WITHIN_S)
        with pytest.raises(ServiceUnavailable, match=r"unavailable$"):  # at once, not when its time is over
            talker.call("/add", "rospy_tutorials/AddTwoInts", b"hi", timeout=1.0)
        listener.serve("/add", "rospy_tutorials/AddTwoInts", lambda payload: payload + b"?")
        assert talker.wait_until(lambda: talker.service_type("/add") is not None, WITHIN_S)
        assert talker.call("/add", "rospy_tutorials/AddTwoInts", b"hi") == b"hi?"
        assert {"/talker", "/ns/listener"} <= set(talker.nodes())


def test_what_a_script_declares_is_known_at_once() -> None:
    """As a ROS master knows it when the constructor returns; the node's thread has not run yet."""
    with memory_kernel() as kernel:
        kernel.start("/serving", "/", "script")
        with kernel.lock_node:
            kernel.serve("/add", "rospy_tutorials/AddTwoInts", lambda payload: payload)
            assert kernel.service_type("/add") == "rospy_tutorials/AddTwoInts"
            kernel.advertise("/chatter", "std_msgs/String")
            assert {"/add", "/chatter"} <= {each.name for each in kernel.graph()}


def test_asking_for_an_unknown_publisher_leaves_changes_to_the_node_s_thread() -> None:
    """That thread wakes those who wait for a change, and warns of conflicting types."""
    with memory_kernel() as kernel:
        kernel.start("/asking", "/", "script")
        with kernel.lock_node:
            kernel.network.update()
            kernel.advertise("/chatter", "std_msgs/String")
            assert kernel.origin(b"unknown") == Origin("", False)
            assert kernel.network.update()


def test_a_call_ends_with_the_answer_of_its_server() -> None:
    """The network queries each process that may serve the name, and one of them may never reply."""
    bus = MemoryBus()
    with memory_kernel(bus) as asking, memory_kernel(bus, install=False) as serving, MemoryTransport(bus) as silent:
        silent.serve("add")
        serving.start("/serving", "/", "script")

        def handle(payload: bytes) -> bytes:
            if payload == b"no":
                raise ServiceRefused("not today")
            return payload + b"!"

        serving.serve("/add", "rospy_tutorials/AddTwoInts", handle)
        assert asking.wait_until(lambda: asking.service_type("/add") is not None, WITHIN_S)
        assert asking.call("/add", "rospy_tutorials/AddTwoInts", b"hi") == b"hi!"
        with pytest.raises(ServiceRefused, match="not today"):
            asking.call("/add", "rospy_tutorials/AddTwoInts", b"no")


def test_a_reader_counts_once_the_way_to_it_is_known() -> None:
    """Its token may arrive before; a message published then, such as an action goal, would be lost."""
    bus, joined = MemoryBus(), list[str]()
    with memory_kernel(bus) as talker, MemoryTransport(bus) as reader:
        plain = talker.advertise("/plain", "std_msgs/String")
        watched = talker.advertise("/watched", "std_msgs/String", joined=lambda node: joined.append(node))
        talker.start("/talker", "/", "script")
        for name in ("/plain", "/watched"):
            reader.declare_token(Entity(reader.session, "sub", "/reader", name, "std_msgs/String", "EVENT").key)
        assert talker.wait_until(lambda: talker.endpoint_nodes("sub", "/watched") == ["/reader"], WITHIN_S)
        assert (plain.subscribers(), watched.subscribers(), joined) == ([], [], [])
        for name in ("plain", "watched"):
            reader.subscribe(name, 4)
        assert talker.wait_until(lambda: joined == ["/reader"], WITHIN_S)
        assert (plain.subscribers(), watched.subscribers()) == (["/reader"], ["/reader"])


def test_a_closed_publication_no_longer_follows_its_subscribers() -> None:
    with memory_kernel() as kernel:
        kernel.start("/talker", "/", "script")
        old = kernel.advertise("/watched", "std_msgs/String", joined=lambda _: None)
        new = kernel.advertise("/watched", "std_msgs/String", joined=lambda _: None)
        old.close()
        assert kernel.followers["/watched"].output is new
        new.close()
        assert not kernel.followers


def test_a_program_is_asked_to_end_by_another(capfd: pytest.CaptureFixture[str]) -> None:
    bus, ended = MemoryBus(), list[str]()
    with memory_kernel(bus) as asking, memory_kernel(bus, install=False) as worker:
        worker.start("/worker", "/", "script")
        worker.on_shutdown(lambda: ended.append("hook"))
        assert asking.wait_until(lambda: "/worker" in asking.nodes(), WITHIN_S)
        assert not asking.end_node("/other", "user request")
        assert asking.end_node("/worker", "user request")
        assert not worker.wait_until(lambda: False)  # the end of the process ends the wait
        assert (ended, worker.shutting_down) == (["hook"], True)
    assert "shutdown request: user request" in capfd.readouterr().out


def test_a_call_waits_for_time_to_begin() -> None:
    bus, answers = MemoryBus(), list[bytes]()
    with memory_kernel(bus, simulated=True) as early, memory_kernel(bus, install=False) as server:
        server.start("/server", "/", "script")
        early.start("/early", "/", "script")
        server.serve("/trigger", "std_srvs/Empty", lambda payload: payload)
        assert early.wait_until(lambda: early.service_type("/trigger") is not None, WITHIN_S)
        calling = early.spawn(lambda: answers.append(early.call("/trigger", "std_srvs/Empty", b"x")), "calls")
        calling.join(0.2)
        assert not answers
        early.clock.set(1)
        calling.join(WITHIN_S)
        assert answers == [b"x"]


def test_a_call_is_answered_while_the_handler_waits_in_another() -> None:
    with memory_kernel() as kernel:
        kernel.start("/server", "/", "script")
        on, answers = list[bool](), list[bytes]()

        def handle(payload: bytes) -> bytes:
            if payload == b"drive":
                on.append(True)
                kernel.wake()
                return payload if kernel.wait_until(lambda: not on, WITHIN_S) else b"late"
            on.clear()
            kernel.wake()
            return payload

        kernel.serve("/switch", "std_srvs/SetBool", handle)
        assert kernel.wait_until(lambda: kernel.service_type("/switch") is not None, WITHIN_S)

        def drive() -> None:
            answers.append(kernel.call("/switch", "std_srvs/SetBool", b"drive", WITHIN_S))

        driving = kernel.spawn(drive, "drive")
        assert kernel.wait_until(lambda: bool(on), WITHIN_S)
        answers.append(kernel.call("/switch", "std_srvs/SetBool", b"stop", WITHIN_S))
        driving.join()
        assert sorted(answers) == [b"drive", b"stop"]


def test_a_service_goes_on_after_a_handler_that_exits_and_refuses_calls_that_wait_when_it_is_closed() -> None:
    def handle(payload: bytes) -> bytes:
        if payload == b"exit":
            raise SystemExit(1)
        return payload

    with memory_kernel() as kernel:
        kernel.start("/server", "/", "script")
        server = kernel.serve("/quit", "std_srvs/Empty", handle)
        assert kernel.wait_until(lambda: kernel.service_type("/quit") is not None, WITHIN_S)
        with pytest.raises(ServiceRefused, match="SystemExit"):
            kernel.call("/quit", "std_srvs/Empty", b"exit", WITHIN_S)
        assert kernel.call("/quit", "std_srvs/Empty", b"on", WITHIN_S) == b"on"
        server.close()
        refused = list[bytes]()
        server.put(b"late", refused.append, refused.append)
        assert b"has been shut down" in refused[0]


def test_latched_messages_reach_every_new_receiver() -> None:
    bus, got = MemoryBus(), list[tuple[str, bytes, bool]]()
    with memory_kernel(bus) as talker, memory_kernel(bus, install=False) as listener:
        talker.start("/talker", "/", "script")
        listener.start("/listener", "/", "script")
        talker.advertise("/map", "nav_msgs/MapMetaData", latched=True).publish(b"map")
        for name in ("first", "second"):
            listener.subscribe(
                "/map",
                "nav_msgs/MapMetaData",
                lambda payload, origin, name=name: got.append((name, payload, origin.latched)),  # type: ignore[misc]
            )
            assert listener.wait_until(lambda name=name: any(each[0] == name for each in got), WITHIN_S)  # type: ignore[misc]
        assert got == [("first", b"map", True), ("second", b"map", True)]


def test_latched_messages_of_a_node_that_has_ended_reach_no_new_receiver() -> None:
    bus, got = MemoryBus(), list[tuple[str, bytes]]()
    with memory_kernel(bus) as listener:
        listener.start("/listener", "/", "script")

        def subscribe(name: str) -> None:
            listener.subscribe("/map", "nav_msgs/MapMetaData", lambda payload, _: got.append((name, payload)))

        with memory_kernel(bus, install=False) as talker:
            talker.start("/talker", "/", "script")
            talker.advertise("/map", "nav_msgs/MapMetaData", latched=True).publish(b"old")
            subscribe("first")
            assert listener.wait_until(lambda: got == [("first", b"old")], WITHIN_S)
        assert listener.wait_until(lambda: not listener.endpoint_nodes("pub", "/map"), WITHIN_S)
        subscribe("second")
        with memory_kernel(bus, install=False) as talker:
            talker.start("/talker", "/", "script")
            talker.advertise("/map", "nav_msgs/MapMetaData", latched=True).publish(b"new")
            assert listener.wait_until(lambda: len(got) >= 3, WITHIN_S)
            subscribe("third")
            assert listener.wait_until(lambda: ("third", b"new") in got, WITHIN_S)
    assert got == [("first", b"old"), ("first", b"new"), ("second", b"new"), ("third", b"new")]


def test_hooks_publish_before_what_waits_is_ended() -> None:
    bus, got = MemoryBus(), list[bytes]()
    with memory_kernel(bus) as talker, memory_kernel(bus, install=False) as listener:
        listener.start("/listener", "/", "script")
        listener.subscribe("/cmd_vel", "geometry_msgs/Twist", lambda payload, _: got.append(payload))
        out = talker.advertise("/cmd_vel", "geometry_msgs/Twist")
        talker.start("/talker", "/", "script")
        seen = list[bool]()

        def stop() -> None:
            seen.append(talker.shutting_down)
            talker.sleep_until(talker.now() + 10_000_000)
            out.publish(b"stop")

        talker.on_shutdown(stop)
        talker.shut_down("test")
        assert (seen, talker.shutting_down) == ([False], True)
        assert listener.wait_until(lambda: got == [b"stop"], WITHIN_S)
        assert talker.wait_until(lambda: False) is False


def test_a_name_of_another_type_is_refused_to_its_own_node() -> None:
    with memory_kernel() as kernel:
        kernel.start("/talker", "/", "script")
        kernel.advertise("/chatter", "std_msgs/String")
        with pytest.raises(BadInput, match="this node already publishes std_msgs/String on /chatter"):
            kernel.advertise("/chatter", "std_msgs/Int32")
        with pytest.raises(BadInput, match="is the node /talker already"):
            kernel.start("/other", "/", "script")


def test_a_loop_without_waits_is_slowed_down() -> None:
    with memory_kernel() as kernel:
        kernel.start("/busy", "/", "script")
        began, used = time.monotonic(), time.thread_time()
        while time.monotonic() - began < 0.5:
            kernel.point()
        assert (time.thread_time() - used) / (time.monotonic() - began) < 0.6

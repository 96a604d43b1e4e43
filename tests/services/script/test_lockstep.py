"""Scripts in lockstep: the same run whatever the timing, with subscriptions, calls and threads made at run time."""

from __future__ import annotations

import random
import threading
import time

import pytest

from messages.base import decoder
from messages.std import Float64
from services.script.api import ServiceRefused, ServiceUnavailable, TimeMovedBackwards
from services.script.kernel import ScriptKernel
from services.script.lockstep_threading import queue_module, thread_module, threading_module
from tests.services.script.lockstep_scripts import Body, number, run_scripts

MS = 1_000_000
read = decoder(Float64)
END = 400 * MS


def talker(kernel: ScriptKernel, written: list[str]) -> None:
    """Publish received messages and its progress, from a callback, a timer's thread and its own loop."""
    out = kernel.advertise("/chatter", "std_msgs/Float64")
    latched = kernel.advertise("/latched", "std_msgs/Float64", latched=True)
    kernel.subscribe("/truth", "std_msgs/Float64", lambda payload, _: out.publish(payload))

    def beat() -> None:
        while not kernel.shutting_down:
            kernel.sleep_until(kernel.now() + 70 * MS)
            latched.publish(number(kernel.now() / MS))

    kernel.spawn(beat, "beat")
    while kernel.now() < END:
        out.publish(number(-kernel.now() / MS))
        kernel.sleep_until(kernel.now() + 30 * MS)


def hear(kernel: ScriptKernel, topic: str) -> str:
    """Return the publishers of a topic and up to two of its messages."""
    got: list[float] = []
    late = kernel.subscribe(topic, "std_msgs/Float64", lambda payload, _: got.append(read(payload).data))
    kernel.wait_until(lambda: len(got) > 1, 0.05)
    publishers = late.publishers()
    late.close()
    return f"{publishers} {got}"


def listener(kernel: ScriptKernel, written: list[str]) -> None:
    """Subscribe repeatedly, and provide a service."""

    def handle(payload: bytes) -> bytes:
        written.append(f"{kernel.now() // MS} asked {payload!r}")
        if payload == b"3":
            raise ServiceRefused("not three")
        kernel.sleep_until(kernel.now() + 20 * MS)
        return payload * 2

    kernel.serve("/double", "std_srvs/Trigger", handle)
    while kernel.now() < END:
        for topic in ("/truth", "/chatter", "/latched"):
            got: list[float] = []
            late = kernel.subscribe(
                topic, "std_msgs/Float64", lambda payload, _, got=got: got.append(read(payload).data)
            )  # type: ignore[misc]
            kernel.wait_until(lambda got=got: len(got) > 1, 0.05)  # type: ignore[misc]
            written.append(f"{kernel.now() // MS} {topic} {late.publishers()} {got}")
            late.close()


def caller(kernel: ScriptKernel, written: list[str]) -> None:
    """Call a service, use up the budget, and wait for declarations of others."""
    kernel.wait_until(lambda: kernel.service_type("/double") is not None)
    for count in range(6):
        try:
            written.append(f"{kernel.now() // MS} {kernel.call('/double', 'std_srvs/Trigger', b'%d' % count)!r}")
        except ServiceRefused as error:
            written.append(f"{kernel.now() // MS} {error}")
        for _ in range(1300):
            kernel.point()
    try:
        kernel.call("/nobody", "std_srvs/Trigger", b"")
    except ServiceUnavailable as error:
        written.append(str(error))


@pytest.mark.slow
def test_a_run_is_the_same_whatever_the_timing() -> None:
    bodies: dict[str, Body] = {"talker": talker, "listener": listener, "caller": caller}
    first = run_scripts(bodies, 120, seed=1)
    assert first == run_scripts(bodies, 120, seed=2)
    assert first["caller"][:3] == ["0 b'00'", "60 b'11'", "120 b'22'"]
    assert first["caller"][3].endswith("not three")
    assert first["caller"][-1] == "service [/nobody] unavailable"
    topics = [line.split(" ", 1)[1] for line in first["listener"] if "/truth" in line]
    assert topics[0].startswith("/truth ['/sim'] [")
    latched = [line for line in first["listener"] if "/latched" in line]
    assert latched[1] == "220 /latched ['/talker'] [140.0, 210.0]", "subscribed at 170: the last message comes at once"


@pytest.mark.slow
def test_what_several_scripts_ask_of_the_simulation_in_one_step_has_an_order() -> None:
    """The simulation serves all first requests, then all second ones, each time in the order of the scripts' names."""

    def asker(pauses: tuple[int, ...]) -> Body:
        def ask(kernel: ScriptKernel, written: list[str]) -> None:
            for pause in pauses:
                before = read(kernel.call("/count", "std_srvs/Trigger", number(0))).data
                written.append(f"{kernel.now() // MS} {before}")
                for _ in range(2):
                    time.sleep(0.002 * random.random())
                    if pause:
                        kernel.sleep_until(kernel.now() + pause * MS)

        return ask

    pauses = {"/a": (0, 0, 10, 10, 0), "/b": (0, 10, 0, 10), "/c": (0, 10, 10)}
    bodies = {name[1:]: asker(each) for name, each in pauses.items()}
    bodies["d"] = lambda kernel, _: kernel.sleep_until(60 * MS)
    first = run_scripts(bodies, 40, seed=1)
    assert first == run_scripts(bodies, 40, seed=2)
    assert [first[name][:3] for name in "abc"] == [
        ["0 0.0", "0 3.0", "0 6.0"],
        ["0 1.0", "0 4.0", "20 8.0"],
        ["0 2.0", "0 5.0", "20 9.0"],
    ]


def test_turns_end_at_waits_and_when_the_budget_is_spent() -> None:
    def busy(kernel: ScriptKernel, written: list[str]) -> None:
        seen: dict[int, int] = {}
        while kernel.now() < 50 * MS:
            kernel.point()
            seen[kernel.now() // MS] = seen.get(kernel.now() // MS, 0) + 1
        written.append(str(sorted(set(list(seen.values())[1:-1]))))

    assert run_scripts({"busy": busy}, 20)["busy"] == ["[500]"]


def test_a_thread_that_computes_for_ever_keeps_its_script_from_nothing_when_it_is_asked_to_end() -> None:
    def body(kernel: ScriptKernel, written: list[str]) -> None:
        def compute() -> None:
            while True:
                kernel.point()

        kernel.spawn(compute, "compute")
        kernel.sleep_until(20 * MS)
        threading.Thread(target=kernel.shut_down, args=("it is asked to",)).start()
        kernel.wait_until(lambda: False)
        written.append("main ends")

    assert run_scripts({"body": body}, 20) == {"body": ["main ends"]}


def test_what_a_script_tells_itself_comes_at_the_next_tick_while_all_its_threads_sleep() -> None:
    def body(kernel: ScriptKernel, written: list[str]) -> None:
        def heard(topic: str) -> None:
            kernel.subscribe(topic, "std_msgs/Float64", lambda *_: written.append(f"{topic} {kernel.now() // MS}"))

        latched = kernel.advertise("/kept", "std_msgs/Float64", latched=True)
        out = kernel.advertise("/own", "std_msgs/Float64")
        heard("/own")
        latched.publish(number(1.0))
        kernel.sleep_until(50 * MS)
        out.publish(number(2.0))
        kernel.sleep_until(95 * MS)
        heard("/kept")
        kernel.sleep_until(150 * MS)

    assert run_scripts({"alone": body}, 40) == {"alone": ["/own 60", "/kept 110"]}


def test_sleepers_wake_by_deadline_and_then_by_order() -> None:
    def sleepers(kernel: ScriptKernel, written: list[str]) -> None:
        def sleep(name: str, until: int) -> None:
            kernel.sleep_until(until)
            written.append(name)

        for name, until in (("late", 40), ("first", 21), ("second", 22), ("third", 22), ("now", 0)):
            kernel.spawn(lambda name=name, until=until: sleep(name, until * MS), name)  # type: ignore[misc]
        kernel.sleep_until(100 * MS)

    assert run_scripts({"sleepers": sleepers}, 40)["sleepers"] == ["now", "first", "second", "third", "late"]


def test_a_reset_wakes_sleepers_with_an_error() -> None:
    def body(kernel: ScriptKernel, written: list[str]) -> None:
        for until in (1000, 50):
            try:
                kernel.sleep_until(until * MS)
                written.append(f"slept until {kernel.now() // MS}")
            except TimeMovedBackwards:
                written.append(f"reset at {kernel.now() // MS}")

    assert run_scripts({"body": body}, 60, resets=(20,))["body"] == ["reset at 0", "slept until 50"]


@pytest.mark.slow
def test_threads_and_queues_of_a_script_take_turns() -> None:
    def body(kernel: ScriptKernel, written: list[str]) -> None:
        assert kernel.turns is not None
        threading = threading_module(kernel.turns)
        import time

        queue = queue_module(threading, time, __import__)
        full, lock, done = queue.Queue(2), threading.Lock(), threading.Event()
        condition, allowed = threading.Condition(), threading.Semaphore(0)

        def produce() -> None:
            for item in range(5):
                full.put(item)
                with lock:
                    kernel.sleep_until(kernel.now() + 10 * MS)
            done.set()
            allowed.release()
            with condition:
                condition.notify_all()

        def wait() -> None:
            with condition:
                condition.wait(5)
            allowed.acquire()
            written.append(f"notified at {kernel.now() // MS}")

        producer = threading.Thread(target=produce)
        waiter = threading.Thread(target=wait, daemon=True)
        producer.start()
        waiter.start()
        threading.Timer(0.025, lambda: written.append(f"timer at {kernel.now() // MS}")).start()
        for _ in range(5):
            item = full.get(timeout=1)
            with lock:
                written.append(f"{kernel.now() // MS} {item}")
        assert done.wait(1)
        producer.join()
        waiter.join(1)
        assert not producer.is_alive()
        assert not waiter.is_alive()
        try:
            full.get(timeout=0.05)
        except queue.Empty:
            written.append("empty")

    first = run_scripts({"body": body}, 60, seed=3)["body"]
    assert first == run_scripts({"body": body}, 60, seed=4)["body"]
    assert [line for line in first if line[-1].isdigit() and "at" not in line] == [
        line for line in first if line.endswith((" 0", " 1", " 2", " 3", " 4"))
    ]
    assert first[-1] == "empty"
    assert any(line.startswith("timer at 30") for line in first)
    assert any(line.startswith("notified at") for line in first)


def test_threads_of_a_script_meet_at_a_barrier_and_start_once() -> None:
    def body(kernel: ScriptKernel, written: list[str]) -> None:
        assert kernel.turns is not None
        threading = threading_module(kernel.turns)
        barrier = threading.Barrier(3)

        def meet(pause: int) -> None:
            kernel.sleep_until(kernel.now() + pause * MS)
            barrier.wait()
            written.append(f"met at {kernel.now() // MS}")

        threads = [threading.Thread(target=meet, args=(pause,)) for pause in (10, 30)]
        for each in threads:
            each.start()
        with pytest.raises(RuntimeError, match="threads can only be started once"):
            threads[0].start()
        barrier.wait()
        for each in threads:
            each.join()

    assert run_scripts({"body": body}, 30)["body"] == ["met at 30"] * 2


def test_threads_of_the_module_thread_take_turns() -> None:
    def body(kernel: ScriptKernel, written: list[str]) -> None:
        assert kernel.turns is not None
        low = thread_module(threading_module(kernel.turns))
        lock = low.allocate_lock()

        def drive(name: str, period: int = 10) -> None:
            for _ in range(3):
                with lock:
                    written.append(f"{name} at {kernel.now() // MS}")
                kernel.sleep_until(kernel.now() + period * MS)
            low.exit()

        first = low.start_new_thread(drive, ("a",))
        assert first != low.start_new_thread(drive, ("b",), {"period": 20})
        kernel.sleep_until(kernel.now() + 100 * MS)
        assert not lock.locked()

    found = run_scripts({"body": body}, 60, seed=3)["body"]
    assert found == run_scripts({"body": body}, 60, seed=4)["body"]
    assert sorted(found) == ["a at 0", "a at 10", "a at 20", "b at 0", "b at 20", "b at 40"]


def test_others_go_on_while_a_thread_waits_for_something_outside() -> None:
    def body(kernel: ScriptKernel, written: list[str]) -> None:
        import threading

        pressed = threading.Event()

        def other() -> None:
            kernel.sleep_until(kernel.now() + 50 * MS)
            written.append(f"other at {kernel.now() // MS}")
            pressed.set()

        kernel.spawn(other, "other")
        with kernel.outside("standard input"):
            assert pressed.wait(30)
        written.append("key")
        assert kernel.node is not None
        assert "/checks" in [each.name for each in kernel.node.publishers]

    assert run_scripts({"body": body}, 40)["body"][1:] == ["key"]


def test_a_service_may_shut_itself_down_in_its_handler() -> None:
    def serve(kernel: ScriptKernel, written: list[str]) -> None:
        def handle(payload: bytes) -> bytes:
            server.close()
            kernel.sleep_until(kernel.now() + 20 * MS)
            return payload * 2

        server = kernel.serve("/once", "std_srvs/Trigger", handle)
        kernel.sleep_until(200 * MS)

    def call(kernel: ScriptKernel, written: list[str]) -> None:
        kernel.wait_until(lambda: kernel.service_type("/once") is not None)
        for payload in (b"1", b"2"):
            try:
                written.append(repr(kernel.call("/once", "std_srvs/Trigger", payload)))
            except ServiceUnavailable as error:
                written.append(str(error))
            kernel.sleep_until(kernel.now() + 20 * MS)

    written = run_scripts({"server": serve, "caller": call}, 60)
    assert written["caller"] == ["b'11'", "service [/once] unavailable"]


def test_calls_are_answered_while_a_handler_waits_in_others() -> None:
    """Also one that arrives in the same tick, and those of the server's own script."""

    def serve(kernel: ScriptKernel, written: list[str]) -> None:
        on: list[bytes] = []

        def handle(payload: bytes) -> bytes:
            written.append(f"{kernel.now() // MS} {payload!r}")
            if payload.startswith(b"start"):
                on.append(payload[-1:])
                kernel.wait_until(lambda: payload[-1:] not in on)
            else:
                on.remove(payload[-1:])
            return payload

        def call(payload: bytes) -> None:
            written.append(f"{kernel.now() // MS} {kernel.call('/switch', 'std_srvs/SetBool', payload)!r}")

        kernel.serve("/switch", "std_srvs/SetBool", handle)
        kernel.sleep_until(120 * MS)
        kernel.spawn(lambda: call(b"start 3"), "start")
        kernel.sleep_until(150 * MS)
        call(b"stop 3")
        kernel.sleep_until(200 * MS)

    def caller(*calls: tuple[int, bytes]) -> Body:
        def call(kernel: ScriptKernel, written: list[str]) -> None:
            kernel.wait_until(lambda: kernel.service_type("/switch") is not None)
            for at, payload in calls:
                kernel.sleep_until(at * MS)
                answer = kernel.call("/switch", "std_srvs/SetBool", payload)
                written.append(f"{kernel.now() // MS} {answer!r}")

        return call

    bodies: dict[str, Body] = {"a": caller((20, b"start 1")), "b": caller((20, b"start 2")), "server": serve}
    bodies["c"] = caller((60, b"stop 2"), (90, b"stop 1"))
    first = run_scripts(bodies, 60, seed=1)
    assert first == run_scripts(bodies, 60, seed=2)
    assert [first[each] for each in "abc"] == [
        ["110 b'start 1'"],
        ["80 b'start 2'"],
        ["80 b'stop 2'", "110 b'stop 1'"],
    ]
    assert first["server"][2:] == [
        "70 b'stop 2'",
        "100 b'stop 1'",
        "120 b'start 3'",
        "150 b'stop 3'",
        "150 b'stop 3'",
        "120 b'start 3'",
    ]

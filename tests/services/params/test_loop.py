"""The loop on simulation time: scheduled changes, resets, and latched messages to late subscribers."""

from __future__ import annotations

import io
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import pytest

from messages.parameters import ParameterSet
from messages.requests import PARAMS_ANNOUNCE, PARAMS_GET
from messages.topics import DESCRIPTIONS, UPDATES
from services.params import ParamsParameters, Scheduled
from services.params.loop import run
from services.params.schedule import Schedule
from services.runtime.context import Context
from services.runtime.errors import BadInput, Stopped
from services.runtime.node import Node
from services.runtime.transport.memory import MemoryBus
from tests.harness.memory_node import ManualClock, loop_has_begun, memory_node
from tests.harness.waiting import wait_until
from tests.services.params.parameter_client import arm_announcement, assignments, value_dict

SET = "/robot_control"
SCHEDULE = (
    Scheduled(at=2.0, set=SET, values={"ref_angle": 12}),
    Scheduled(at=1.0, set=SET, values={"reference_type": "sine", "ss_Kp": 5}),
    Scheduled(at=2.0, set=SET, values={"ref_angle": 99}),
    Scheduled(at=2.0, set="/late", values={"ref_angle": 7}),
)


class LoopHarness:
    """The service in a thread, a manual clock, and a node that subscribes to a set."""

    def __init__(self, bus: MemoryBus, clock: ManualClock, beside: Node, out: io.StringIO) -> None:
        self.bus, self.beside, self.out = bus, beside, out
        self._clock = clock
        self.updates = beside.subscribe(UPDATES, f"{SET}/parameter_updates")

    def announce(self, name: str = SET, **more: Any) -> dict[str, Any]:
        return value_dict(self.beside.call(PARAMS_ANNOUNCE, arm_announcement(name, **more), timeout=60.0))

    def get(self, name: str = SET) -> dict[str, Any]:
        return value_dict(self.beside.call(PARAMS_GET, ParameterSet(set=name), timeout=60.0))

    def tell(self, seconds: float, epoch: int = 0) -> None:
        self._clock.publish(round(seconds * 1e9), epoch)

    def until(self, **expected: Any) -> None:
        wait_until(lambda: expected.items() <= self.get().items(), 5.0, f"{expected}, not {self.get()}")


@contextmanager
def running_service(
    bus: MemoryBus, clock: ManualClock, schedule: tuple[Scheduled, ...] = SCHEDULE, progress: str = ""
) -> Iterator[LoopHarness]:
    service, out = memory_node(bus, "params"), io.StringIO()
    service.log._out = out
    with service, memory_node(bus, "tester") as beside:
        context = Context(service, ParamsParameters(schedule=schedule, schedule_file=progress), 10.0)

        def work() -> None:
            with suppress(Stopped):
                run(context)

        thread = threading.Thread(target=work)
        thread.start()
        try:
            wait_until(lambda: loop_has_begun(service), what="the service")
            yield LoopHarness(bus, clock, beside, out)
        finally:
            service.stopping = True
            service.transport.wake()
            thread.join(60)
            assert not thread.is_alive()
            service.transport.close()
            beside.transport.close()


def test_changes_come_at_their_time_and_again_after_a_reset(bus: MemoryBus, clock: ManualClock) -> None:
    with running_service(bus, clock) as at:
        at.announce()
        at.tell(0.9)
        at.tell(1.05)
        at.until(ss_Kp=5.0, reference_type="sine", ref_angle=30.0)
        at.tell(2.0)
        at.until(ref_angle=12.0)
        assert "scheduled at 2 s was not made: ref_angle = 99.0 is out of bounds" in at.out.getvalue()
        at.announce("/late")
        at.tell(2.1)
        wait_until(lambda: at.get("/late")["ref_angle"] == 7.0, what="the change of a set that was late")
        at.tell(0.0, epoch=1)
        at.until(ref_angle=30.0, ss_Kp=37.5, reference_type="step")
        at.tell(1.0, epoch=1)
        at.until(ss_Kp=5.0, ref_angle=30.0)
        at.updates.update()
        told = [
            (each.revision, value_dict(each)["ref_angle"], value_dict(each)["ss_Kp"]) for each, _ in at.updates.messages
        ]
    assert told == [(1, 30.0, 37.5), (2, 30.0, 5.0), (3, 12.0, 5.0), (4, 30.0, 37.5), (5, 30.0, 5.0)]


def test_a_service_that_is_restarted_in_a_run_goes_on_with_the_schedule(
    bus: MemoryBus, clock: ManualClock, tmp_path: Path
) -> None:
    schedule = (*SCHEDULE[:2], Scheduled(at=4.0, set=SET, values={"window": 4}))
    file = str(tmp_path / "schedule.json")
    with running_service(bus, clock, schedule, file) as at:
        at.announce()
        at.tell(2.0)
        at.until(ref_angle=12.0, ss_Kp=5.0)
        wait_until(lambda: "as scheduled" in at.out.getvalue())
    with running_service(bus, clock, schedule, file) as at:
        answer = at.announce(run=assignments(ref_angle=25.0, ss_Kp=5.0))
        assert (answer["ref_angle"], answer["reference_type"]) == (25.0, "step")
        at.tell(4.5)
        at.until(ref_angle=25.0, window=4, reference_type="step")
    with running_service(bus, clock, schedule, file) as at:
        at.announce()
        at.tell(2.5, epoch=1)
        at.until(ref_angle=12.0, ss_Kp=5.0, window=2)
    for content in (None, b"{", b"[1]"):
        Path(file).unlink()
        if content:
            Path(file).write_bytes(content)
        with running_service(bus, clock, schedule, file) as at:
            at.announce()
            at.tell(2.5, epoch=1)
            at.until(ref_angle=12.0, ss_Kp=5.0, window=2)
        assert ("cannot be read" in at.out.getvalue()) == (content is not None)


def test_a_set_that_never_comes_is_said(bus: MemoryBus, clock: ManualClock) -> None:
    with running_service(bus, clock) as at:
        at.tell(13.0)
        wait_until(lambda: "which no service has announced" in at.out.getvalue(), what="a warning")
        assert "/late, /robot_control" in at.out.getvalue()


def test_who_comes_late_hears_the_schema_and_the_values(bus: MemoryBus, clock: ManualClock) -> None:
    with running_service(bus, clock, ()) as at:
        at.announce()
        with memory_node(bus, "late") as late:
            schema = late.subscribe(DESCRIPTIONS, f"{SET}/parameter_descriptions")
            news = late.subscribe(UPDATES, f"{SET}/parameter_updates")
            own = late.subscribe(DESCRIPTIONS, "/params/parameter_descriptions")
            late.update_subscribers()
            assert [each.name for each in schema.messages[0][0].parameters][:2] == ["reference_type", "ref_angle"]
            assert value_dict(news.messages[0][0]) == at.get()
            assert own.messages[0][0].parameters[0].name == "file"
    assert "values are kept for this run only" in at.out.getvalue()


def test_due_changes_come_in_the_order_of_time_and_file() -> None:
    schedule = Schedule(SCHEDULE)
    assert schedule.pop_due(10**10, ()) == {}
    assert [each.at for each in schedule.pop_due(10**10, {SET}).values()] == [1.0, 2.0, 2.0]
    assert schedule.pop_due(10**10, {SET}) == {}
    assert [each.set for each in schedule.overdue(12 * 10**9, 10**10)] == ["/late"]
    schedule.start()
    assert [each.at for each in schedule.pop_due(1_000_000_000, {SET, "/late"}).values()] == [1.0]
    assert schedule.pop_due(1_999_999_999, {SET}) == {}


@pytest.mark.parametrize(
    ("wrong", "says"),
    [
        (Scheduled(at=1, set="arm", values={"a": 1}), "the set needs its absolute name"),
        (Scheduled(at=1, set="/arm", values={}), "no values"),
    ],
)
def test_a_schedule_that_means_nothing_is_refused(bus: MemoryBus, wrong: Scheduled, says: str) -> None:
    with memory_node(bus, "params") as service, pytest.raises(BadInput, match=says):
        run(Context(service, ParamsParameters(schedule=(wrong,)), 10.0))

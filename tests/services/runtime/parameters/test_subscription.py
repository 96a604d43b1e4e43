"""A node's subscription to its parameter set: at start, from tick to tick, and rejected changes."""

from __future__ import annotations

import threading
from typing import Any

import pytest

from messages.base import encode
from messages.parameters import ParameterValues
from messages.topics import UPDATES, Quality
from services.runtime.context import Context
from services.runtime.errors import BadInput
from services.runtime.parameters.schema import ALL_LEVELS
from services.runtime.transport.memory import MemoryBus, MemoryTransport
from services.runtime.transport.wire import encoding
from tests.harness.fake_parameter_service import FakeParameterService, parameter_values
from tests.harness.memory_node import ManualClock, loop_has_begun, memory_node
from tests.harness.waiting import wait_until
from tests.services.runtime.parameters.parameter_node import (
    SET,
    Gains,
    check_damping,
    log_of,
    parameter_node,
    rejected_updates,
    spin_once,
)

MS = 1_000_000


def test_a_node_starts_on_what_the_parameter_service_says(bus: MemoryBus) -> None:
    with FakeParameterService(
        bus, lambda asked: parameter_values(asked.set, {"p": 2, "law": "pid", "file": "b", "stranger": 1})
    ) as params:
        given = {"fleet": {"d": 0.2}, "command_line": {"file": "a"}}
        with parameter_node(bus, params=Gains(d=0.2), **given) as (made, followed):
            followed.start()
            assert followed.params == Gains(p=2.0, law="pid", d=0.2, file="a")
            assert followed.origins["p"] == "saved"
            assert f"parameters {SET}: p = 2.0 (saved), law = pid (saved)" in log_of(made)
    (asked,) = params.announcements
    assert (asked.set, asked.node) == (SET, "/tb3_0/pilot")
    assert [each.name for each in asked.parameters] == ["p", "d", "law", "points", "file"]
    assert [(each.name, each.value) for each in asked.fleet] == [("d", 0.2)]
    assert [(each.name, each.value) for each in asked.command_line] == [("file", "a")]


def test_a_change_counts_whole_with_the_levels_of_what_changed(bus: MemoryBus) -> None:
    with FakeParameterService(bus) as params, parameter_node(bus) as (made, followed):
        followed.start()
        assert spin_once(made, followed) == 0
        params.publish(SET, {"p": 3.0, "d": 0.1, "law": "pid", "points": ((1, 2), (3, 4)), "file": "b"})
        assert spin_once(made, followed) == 1 | 2
        assert followed.params == Gains(p=3.0, law="pid", points=((1.0, 2.0), (3.0, 4.0)))
        params.publish(SET, {"p": 3.0, "d": 0.5})
        assert spin_once(made, followed) == 4
        assert spin_once(made, followed) == 0


@pytest.mark.parametrize(
    "values",
    [
        {"p": 9.0, "d": 1.0},
        {"p": "much", "d": 1.0},
        {"law": "bang", "d": 1.0},
        {"points": ((1.0, 2.0, 3.0),), "d": 1.0},
        {"p": None, "d": 1.0},
    ],
)
def test_a_change_that_does_not_fit_is_refused_whole_and_taken_back(bus: MemoryBus, values: dict[str, Any]) -> None:
    with FakeParameterService(bus) as params, parameter_node(bus) as (made, followed):
        followed.start()
        params.publish(SET, values)
        assert spin_once(made, followed) == 0
        assert followed.params == Gains()
        assert rejected_updates(made) == 1
        assert f"a change of the parameters {SET} is refused" in log_of(made)
        wait_until(lambda: params.undo_requests)
        assert params.undo_requests[0].set == SET
        assert "/tb3_0/pilot" in params.undo_requests[0].who
        params.publish(SET, {"d": 1.0})
        assert spin_once(made, followed) == 4


def test_values_that_contradict_each_other_are_refused(bus: MemoryBus) -> None:
    with FakeParameterService(bus) as params, parameter_node(bus, validate=check_damping) as (made, followed):
        followed.start()
        params.publish(SET, {"p": 0.5, "d": 1.0})
        assert spin_once(made, followed) == 0
        params.publish(SET, {"p": 0.4, "d": 1.0})
        assert spin_once(made, followed) == 0
        wait_until(lambda: params.undo_requests)
        assert "rings" in params.undo_requests[0].who
        # One undo is enough until a change fits again; it names its revision, as others may have arrived since.
        assert [each.revision for each in params.undo_requests] == [2]
        with pytest.raises(BadInput, match="rings"):
            followed.change({"d": 2.0})


def test_saved_values_that_contradict_each_other_are_left_for_a_person_to_mend(
    bus: MemoryBus,
) -> None:
    bad = {"p": 0.1, "d": 1.0}
    with (
        FakeParameterService(bus, lambda asked: parameter_values(asked.set, bad)) as params,
        parameter_node(bus, validate=check_damping) as (made, followed),
    ):
        followed.start()
        params.publish(SET, bad)
        assert spin_once(made, followed) == 0
        assert followed.params == Gains()
        assert f"./elea param reset {SET} forgets the saved ones" in log_of(made)
        for _ in range(5):
            made.spin_once()
        assert params.undo_requests == []


def test_only_the_parameter_service_changes_parameters(bus: MemoryBus) -> None:
    with (
        FakeParameterService(bus) as params,
        parameter_node(bus) as (made, followed),
        memory_node(bus, "stranger") as stranger,
    ):
        followed.start()
        stranger.advertise(UPDATES, f"{SET}/parameter_updates").publish(parameter_values(SET, {"p": 2.0}))
        bare = MemoryTransport(bus).advertise(
            SET[1:] + "/parameter_updates", encoding(ParameterValues.ROS_TYPE), Quality.LATCHED
        )
        bare.put(encode(parameter_values(SET, {"p": 2.5})), attachment=b"")
        assert spin_once(made, followed) == 0
        assert (followed.params, rejected_updates(made), params.undo_requests) == (Gains(), 2, [])
        (updates,) = (each for each in made.subscribers if each.topic is UPDATES)
        assert updates.health().reason == "not from the node /params, which alone may publish it"


def test_a_loop_sees_the_record_of_its_tick(bus: MemoryBus, clock: ManualClock) -> None:
    seen: list[tuple[int, float, int]] = []
    with FakeParameterService(bus) as params, parameter_node(bus) as (made, followed):
        followed.start()
        ctx: Context[Gains] = Context(made, followed.params, 25, subscription=followed)
        ticks = ctx.ticks()

        def step() -> None:
            seen.append((next(ticks).time, ctx.params.p, ctx.params_changed))

        first = threading.Thread(target=step)
        first.start()
        wait_until(lambda: loop_has_begun(made))
        for time_ns in (0, 40 * MS, 80 * MS, 120 * MS):
            clock.publish(time_ns)
            if time_ns:
                step()
            first.join(60)
            if time_ns == 40 * MS:
                params.publish(SET, {"p": 2.0})
                assert ctx.params.p == 1.0
    assert seen == [(0, 1.0, ALL_LEVELS), (40 * MS, 1.0, 0), (80 * MS, 2.0, 1), (120 * MS, 2.0, 0)]


def test_a_loop_without_ticks_follows_too(bus: MemoryBus) -> None:
    with FakeParameterService(bus) as params, parameter_node(bus) as (made, followed):
        followed.start()
        ctx: Context[Gains] = Context(made, followed.params, None, subscription=followed)
        params.publish(SET, {"p": 2.0})
        wait_until(lambda: ctx.idle() or ctx.params.p == 2.0)
        params.publish(SET, {"p": 2.5, "d": 2.0})
        assert ctx.update_params() == 1 | 4
        assert ctx.params == Gains(p=2.5, d=2.0)

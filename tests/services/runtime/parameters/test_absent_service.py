"""A node with a parameter service that joins late, leaves, is silent or rejects; a node that changes its own set."""

from __future__ import annotations

import threading
import time
from contextlib import ExitStack
from typing import Any

import pytest

from messages.parameters import ParameterValues
from messages.requests import PARAMS_ANNOUNCE
from services.runtime.errors import BadInput, CallFailed
from services.runtime.graph import Entity
from services.runtime.parameters.client import ParameterClient
from services.runtime.parameters.subscription import ParameterSubscription
from services.runtime.transport.memory import MemoryBus, MemoryTransport
from tests.harness.fake_parameter_service import FakeParameterService, parameter_values
from tests.harness.memory_node import memory_node
from tests.harness.waiting import wait_until
from tests.services.runtime.parameters.conftest import ANSWER_S
from tests.services.runtime.parameters.parameter_node import SET, Gains, log_of, parameter_node, spin_once


def test_without_a_parameter_service_a_node_says_so_once_and_follows_it_when_it_comes(
    bus: MemoryBus, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("DISCOVERY_S", "AWAIT_S"):
        monkeypatch.setattr(f"services.runtime.parameters.client.{name}", ANSWER_S)
    with parameter_node(bus, params=Gains(p=1.5), fleet={"p": 1.5}) as (made, followed):
        began = time.monotonic()
        followed.start()
        assert time.monotonic() - began < ANSWER_S, "it does not wait for an answer"
        for _ in range(20):
            spin_once(made, followed)
        assert log_of(made).count("no parameter service is visible") == 1
        assert followed.params == Gains(p=1.5)
        with FakeParameterService(bus, lambda asked: parameter_values(asked.set, {"p": 4.0})) as params:
            wait_until(lambda: spin_once(made, followed))
            assert followed.params == Gains(p=4.0)
            assert [(each.name, each.value) for each in params.announcements[0].fleet] == [("p", 1.5)]
            params.publish(SET, {"p": 4.5, "d": 3.0}, "run")
            assert spin_once(made, followed)
        wait_until(lambda: made.spin_once() or "the parameter service is gone" in log_of(made))
        assert followed.params == Gains(p=4.5, d=3.0)
        with FakeParameterService(bus, lambda asked: parameter_values(asked.set, {"p": 4.0, "d": 3.0})) as again:
            wait_until(lambda: spin_once(made, followed))
            assert followed.params == Gains(p=4.0, d=3.0)
            assert {each.name: each.value for each in again.announcements[0].run} == {"p": 4.5, "d": 3.0}


@pytest.mark.slow
def test_no_answer_a_bad_one_and_a_refusal_leave_a_node_on_its_own_values(
    bus: MemoryBus, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(_: Any) -> ParameterValues:
        raise BadInput("no more sets are taken")

    with FakeParameterService(bus, refuse), parameter_node(bus) as (made, followed):
        followed.start()
        assert "no more sets are taken" in log_of(made)
        assert followed.params == Gains()
    monkeypatch.setattr("services.runtime.parameters.client.START_S", 0.5)
    transport = MemoryTransport(bus)
    with memory_node(bus, "params", transport=transport) as mute, parameter_node(bus) as (made, followed):
        mute.serve(PARAMS_ANNOUNCE, lambda _: parameter_values(SET, {}))
        began = time.monotonic()
        followed.start()
        assert time.monotonic() - began >= 0.4
        assert len(mute.request_handlers[0].waiting) == 1, "it asks once"
        assert "did not answer" in log_of(made)
        made.spin_once()
        (query,) = (mute.request_handlers[0]._server.recv(),)
        query.reply(b"\xc1 nonsense")
        assert spin_once(made, followed) == 0
    assert followed.params == Gains()


def test_a_service_that_is_expected_is_asked_until_its_link_carries_a_question(bus: MemoryBus) -> None:
    """While links come up, its token may be visible before requests reach it."""
    with MemoryTransport(bus) as early, parameter_node(bus) as (made, followed), ExitStack() as late:
        early.declare_token(Entity(early.session, "srv", "/params", PARAMS_ANNOUNCE.name).key)
        ParameterClient.of(made).expected = True
        come = threading.Timer(
            0.2,
            lambda: late.enter_context(FakeParameterService(bus, lambda asked: parameter_values(asked.set, {"p": 2}))),
        )
        come.start()
        followed.start()
        come.join(60)
        assert followed.params == Gains(p=2.0)
        assert "own values of the parameters" not in log_of(made)


def test_a_node_changes_its_own_parameters_through_the_service_that_owns_them(bus: MemoryBus) -> None:
    with parameter_node(bus) as (made, followed):
        followed.start()
        followed.change({"p": 2.0})
        assert (followed.params.p, followed.origins["p"], followed.run_values) == (2.0, "run", {"p": 2.0})
        for bad, says in (({"p": 9.0}, "p = 9"), ({"q": 1.0}, "unknown parameter 'q'")):
            with pytest.raises(BadInput, match=says):
                followed.change(bad)
        with FakeParameterService(bus) as params:
            wait_until(lambda: made.spin_once() or params.announcements)
            followed.change({"p": 3.0})
            assert followed.params.p == 3.0
            assert (params.set_requests[0].run, params.set_requests[0].who) == (True, "/tb3_0/pilot")
            params.publish(SET, {"p": 3.5})
            assert spin_once(made, followed)
        assert followed.params.p == 3.5


def test_what_is_overtaken_does_not_count(bus: MemoryBus) -> None:
    with FakeParameterService(bus) as params, parameter_node(bus) as (made, followed):
        followed.start()
        params.publish(SET, {"p": 2.0})  # revision 2
        followed.change({"p": 3.0})  # revision 3, from its reply
        spin_once(made, followed)
        assert followed.params.p == 3.0


def test_an_answer_that_says_no_is_told_to_who_asked(bus: MemoryBus) -> None:
    with FakeParameterService(bus) as params, parameter_node(bus) as (made, followed):
        followed.start()
        wait_until(lambda: made.spin_once() or params.announcements)

        def refuse(_: Any) -> ParameterValues:
            raise BadInput("not today")

        next(each for each in params._node.request_handlers if each.request.name == "/params/set")._handler = refuse
        with pytest.raises(CallFailed, match="not today"):
            followed.change({"p": 3.0})
        assert followed.params == Gains()


def test_changes_of_two_sets_of_one_node_have_ids_of_their_own(bus: MemoryBus) -> None:
    """For example, the sets of two simulated robots, or of a robot spawned again under its name."""
    with FakeParameterService(bus) as params, parameter_node(bus) as (made, followed):
        other = ParameterSubscription(made, "/tb3_1/pilot", Gains())
        for each in (followed, other):
            each.start()
            each.change({"p": 2.0})
        other.close()
        again = ParameterSubscription(made, "/tb3_1/pilot", Gains())
        again.start()
        again.change({"p": 2.0})
        assert len({each.id for each in params.set_requests}) == 3


def test_who_follows_a_set_no_more_says_so(bus: MemoryBus) -> None:
    with FakeParameterService(bus) as params, parameter_node(bus) as (made, followed):
        followed.start()
        followed.close()
        wait_until(lambda: made.spin_once() or len(params.announcements) == 2)
        assert [(each.set, each.node, each.leaves) for each in params.announcements] == [
            (SET, "/tb3_0/pilot", False),
            (SET, "/tb3_0/pilot", True),
        ]

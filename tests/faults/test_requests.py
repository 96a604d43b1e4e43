"""Requests that would overload a service: too large, too many, too much work; and a second server for a name."""

from __future__ import annotations

from collections.abc import Iterator

import msgpack
import pytest
import zenoh

from deploy.doctor.network import requests
from messages.elea import ModelState
from messages.parameters import SetParameters
from messages.requests import GET_STATE, PARAMS_SET, SUPERVISOR_STOP, Name
from messages.simulation import GetModelState
from services.runtime.errors import CallFailed, SeveralServers
from services.runtime.graph import snapshot
from services.runtime.requests import servers
from services.runtime.transport.api import TIMEOUT
from services.runtime.transport.request_queue import MAX_BYTES, MAX_REASON_LENGTH, MAX_WAITING
from services.runtime.transport.zenoh_config import LARGEST_MESSAGE
from tests.faults.conftest import FleetSlot
from tests.faults.supervised_fleet import START_S, WITHIN_S, SupervisedFleet
from tests.harness.background_fleet import BURGER
from tests.harness.external_client import error_reason, external_client
from tests.harness.health import ask_health
from tests.harness.memory_node import spinning
from tests.services.params.parameter_client import assignments

FLEET = f'name = "asked"\n{BURGER}pose = {{ x = 0.0, y = 0.0, yaw = 0.0 }}\n'
NODES = "/sim", "/params", "/supervisor"
SET = "/tb3_0/base"
UNKNOWN = msgpack.packb({"set": SET, "values": [{"name": f"x{number:0250}", "value": 1} for number in range(1000)]})
"""As many unknown names as fit in one request: comparing one of them with all known names took 60 ms."""


@pytest.fixture(scope="module")
def asked_fleet(fleet_slot: FleetSlot, tmp_path_factory: pytest.TempPathFactory) -> Iterator[SupervisedFleet]:
    fleet_slot.stop()
    with SupervisedFleet(FLEET, 1, tmp_path_factory.mktemp("asked")) as fleet:
        fleet.wait_ready(within=START_S)
        fleet.wait(lambda: fleet.recorder.health.keys() >= set(NODES), "heartbeats", START_S)
        yield fleet


@pytest.fixture
def session(asked_fleet: SupervisedFleet) -> Iterator[zenoh.Session]:
    with external_client(asked_fleet.endpoint) as made:
        yield made


@pytest.fixture
def unharmed(asked_fleet: SupervisedFleet) -> Iterator[None]:
    """Assert after each test that every process is still running and that valid requests are answered."""
    before = {name: each.pid for name, each in asked_fleet.recorder.processes.items()}
    yield
    node = asked_fleet.recorder.node
    assert node.call(GET_STATE, GetModelState(name="tb3_0"), WITHIN_S).name == "tb3_0"
    rate = SetParameters(set=SET, values=assignments(publish_rate=20.0), run=True)
    assert node.call(PARAMS_SET, rate, WITHIN_S).set == SET
    with pytest.raises(CallFailed, match="unknown process 'rooter'; did you mean 'router'"):
        node.call(SUPERVISOR_STOP, Name(name="rooter"), WITHIN_S)
    asked_fleet.recorder.poll()
    assert {name: each.pid for name, each in asked_fleet.recorder.processes.items()} == before
    assert all(each.restarts == 0 for each in asked_fleet.recorder.processes.values())


@pytest.mark.usefixtures("unharmed")
def test_a_request_of_eight_megabytes_is_refused_unread(asked_fleet: SupervisedFleet, session: zenoh.Session) -> None:
    payload = bytes(LARGEST_MESSAGE - 4096)
    for request in (GET_STATE, PARAMS_SET, SUPERVISOR_STOP):
        said = error_reason(session, request.name[1:], payload)
        assert said == f"a request of {len(payload)} bytes, the limit is {request.largest}"
    transport = asked_fleet.recorder.node.transport
    told = {node: ask_health(transport, node) for node in NODES}
    assert all(each.refused_requests for each in told.values())
    assert "a request of" in told["/sim"].request_reason


@pytest.mark.usefixtures("unharmed")
def test_names_that_are_long_or_many_get_an_error_at_once(session: zenoh.Session) -> None:
    long = msgpack.packb({"name": "m" * 60_000})
    for request in (GET_STATE, SUPERVISOR_STOP):
        assert error_reason(session, request.name[1:], long) == "Expected `str` of length <= 255 - at `$.name`"
    said = error_reason(session, PARAMS_SET.name[1:], UNKNOWN)
    assert "990 more values were not checked; nothing was changed" in said
    assert len(said) <= MAX_REASON_LENGTH
    many = msgpack.packb({"set": SET, "values": [{}] * 200_000})
    assert "length <= 1000 - at `$.values`" in error_reason(session, PARAMS_SET.name[1:], many)


@pytest.mark.usefixtures("unharmed")
def test_a_flood_of_requests_stops_no_heart(asked_fleet: SupervisedFleet, session: zenoh.Session) -> None:
    """To each of three services at once: more requests than can queue, of the most expensive kind."""
    nobody = msgpack.packb({"name": "nobody" * 10})
    payloads = {GET_STATE: nobody, PARAMS_SET: UNKNOWN, SUPERVISOR_STOP: nobody}
    flood = [
        session.get(request.name[1:], payload=payload, timeout=60.0)
        for number in range(MAX_WAITING + 200)
        for request, payload in payloads.items()
        if number * len(payload) < 3 * MAX_BYTES
    ]
    said = [reply.err.payload.to_bytes() for each in flood for reply in each if reply.err is not None]
    assert len(said) == len(flood)
    assert TIMEOUT not in said
    # How many find the queue full depends on the machine: a fast one answers as they arrive.
    assert all(any(reason in each for reason in (b"nobody", b"unknown", b"busy")) for each in said)
    heard = asked_fleet.recorder.health
    asked_fleet.recorder.poll()
    beats = {node: heard[node][1].beat for node in NODES}
    asked_fleet.wait(lambda: all(heard[each][1].beat > beats[each] for each in NODES), "more heartbeats")


def test_two_servers_are_named_to_who_asks_in_the_log_and_by_doctor(asked_fleet: SupervisedFleet) -> None:
    with asked_fleet.node("asker") as asker:
        with asked_fleet.node("rogue") as rogue:
            rogue.serve(GET_STATE, lambda _: ModelState(name="tb3_0"))
            with spinning(rogue):
                asked_fleet.wait(lambda: len(servers(asker.transport, GET_STATE.name)) == 2, "both servers in sight")
                with pytest.raises(SeveralServers, match="2 processes serve /sim/get_state") as caught:
                    asker.call(GET_STATE, GetModelState(name="tb3_0"), WITHIN_S)
                assert "/sim (session" in str(caught.value)
                assert f"/rogue (session {rogue.transport.session[:8]})" in str(caught.value)
                (found,) = requests(snapshot(asker.transport))
                assert (found.state, found.why.partition(":")[0]) == ("fail", "2 processes serve /sim/get_state")
                assert "/rogue" in found.why
                asked_fleet.wait(
                    lambda: "/rogue (session" in asked_fleet.log("sim"), "a word in the log of the simulation"
                )
        asked_fleet.wait(lambda: len(servers(asker.transport, GET_STATE.name)) == 1, "one server alone")
        assert asker.call(GET_STATE, GetModelState(name="tb3_0"), WITHIN_S).name == "tb3_0"


def test_a_server_that_was_killed_and_returns_is_one_server(asked_fleet: SupervisedFleet) -> None:
    before = asked_fleet.process("sim")
    asked_fleet.kill("sim")
    with asked_fleet.node("asker") as asker:

        def answered() -> bool:
            try:
                return asker.call(GET_STATE, GetModelState(name="tb3_0"), timeout=1.0).name == "tb3_0"
            except SeveralServers:
                raise
            except CallFailed:
                return False

        asked_fleet.wait(answered, "an answer of the new simulation")
    asked_fleet.wait_restarted(before)

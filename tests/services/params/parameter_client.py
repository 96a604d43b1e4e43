"""A parameter set for tests, and a client of a parameter service in a process of its own."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from messages.parameters import (
    Announcement,
    Assignment,
    HistoryOf,
    ParameterChange,
    ParameterDescription,
    ParameterSet,
    ParameterValues,
    SetParameters,
)
from messages.requests import PARAMS_ANNOUNCE, PARAMS_GET, PARAMS_HISTORY, PARAMS_LIST, PARAMS_SET
from messages.std import Empty
from services.runtime.errors import CallFailed
from services.runtime.parameters.client import call_idempotent
from services.runtime.requests import call
from services.runtime.transport.api import Transport
from services.runtime.transport.zenoh import ZenohTransport
from services.runtime.transport.zenoh_config import configuration
from tests.harness.processes import Network, Process
from tests.harness.waiting import wait_until

ARM_PARAMETERS = (
    ParameterDescription(
        name="reference_type", type="str", default="step", choices=("step", "sine"), level=2, text="what to follow"
    ),
    ParameterDescription(name="ref_angle", default=30.0, low=-90, high=90, unit="deg", text="where to be"),
    ParameterDescription(name="ss_Kp", default=37.5, low=0, high=1000, level=4),
    ParameterDescription(name="tr_Kp", default=38.5, low=0, high=1000, level=4),
    ParameterDescription(name="window", type="int", default=2, low=0, above=True, level=8),
    ParameterDescription(name="feed_forward", type="bool", default=False, level=16),
    ParameterDescription(name="limits", type="float[]", default=(-1.0, 1.0), low=-10, high=10, level=32),
    ParameterDescription(name="offset", type="float", optional=True, level=64),
    ParameterDescription(name="file", type="str", default="", live=False),
)


def arm_announcement(name: str = "/robot_control", node: str = "/arm", **more: Any) -> Announcement:
    """Return an announcement as the arm makes it."""
    return Announcement(set=name, node=node, **{"parameters": ARM_PARAMETERS, **more})


def assignments(**given: Any) -> tuple[Assignment, ...]:
    """Return assignments from keyword arguments."""
    return tuple(Assignment(name=name, value=value) for name, value in given.items())


def value_dict(record: ParameterValues) -> dict[str, Any]:
    """Return the values by name."""
    return {each.name: each.value for each in record.values}


class ParameterTestClient:
    """A client for the requests of nodes and users; each is sent once, except by ``set_with_retry``."""

    def __init__(self, transport: Transport, timeout: float = 60.0) -> None:
        self.transport, self.timeout = transport, timeout

    def announce(self, announcement: Announcement) -> ParameterValues:
        return call(self.transport, PARAMS_ANNOUNCE, "params/announce", announcement, self.timeout)

    def set(self, name: str = "/robot_control", request: str = "", **given: Any) -> ParameterValues:
        asked = SetParameters(set=name, values=assignments(**given), id=request, who="tester")
        return call(self.transport, PARAMS_SET, "params/set", asked, self.timeout)

    def set_with_retry(self, request: str, **given: Any) -> ParameterValues:
        """Set values, retrying with the same id until there is a reply, as every node and tool does."""
        asked = SetParameters(set="/robot_control", values=assignments(**given), id=request, who="tester")
        return call_idempotent(self.transport, PARAMS_SET, asked, 60.0)

    def get(self, name: str = "/robot_control") -> ParameterValues:
        return call(self.transport, PARAMS_GET, "params/get", ParameterSet(set=name), self.timeout)

    def history(self, name: str = "/robot_control", limit: int = 10_000) -> tuple[ParameterChange, ...]:
        return call(
            self.transport, PARAMS_HISTORY, "params/history", HistoryOf(set=name, limit=limit), self.timeout
        ).changes

    def is_available(self) -> bool:
        try:
            call(self.transport, PARAMS_LIST, "params/list", Empty(), 0.5)
        except CallFailed:
            return False
        return True


@contextmanager
def connected_client(network: Network, domain: str = "") -> Iterator[ParameterTestClient]:
    """Yield a client connected to the network."""
    with ZenohTransport(configuration("star", (network.endpoint,), domain=domain)) as transport:
        yield ParameterTestClient(transport)


def start_service(network: Network, file: Path | str, *arguments: str) -> Process:
    """Start the parameter service on a file."""
    return network.start("params", "--param", f'file="{file}"', *arguments)


def start_and_wait(network: Network, asking: ParameterTestClient, file: Path | str, *arguments: str) -> Process:
    """Start the parameter service and wait until it answers."""
    process = start_service(network, file, *arguments)
    wait_until(lambda: asking.is_available() or process.status is not None, 20.0, "an answer of the parameter service")
    assert process.status is None, process.text
    return process

"""A set to play with, and a parameter service in a process of its own to ask."""

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
from services.runtime.calls import call
from services.runtime.errors import CallFailed
from services.runtime.network.transport import Transport
from services.runtime.network.zenoh_config import configuration
from services.runtime.network.zenoh_transport import ZenohTransport
from services.runtime.parameters.insist import insist
from tests.processes import Network, Process
from tests.waiting import until

ARM = (
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


def arm(name: str = "/robot_control", node: str = "/arm", **more: Any) -> Announcement:
    """What the arm would announce."""
    return Announcement(set=name, node=node, **{"parameters": ARM, **more})


def values(**given: Any) -> tuple[Assignment, ...]:
    """Assignments."""
    return tuple(Assignment(name=name, value=value) for name, value in given.items())


def plain(record: ParameterValues) -> dict[str, Any]:
    """The values by name."""
    return {each.name: each.value for each in record.values}


class Asking:
    """What a node and a person ask of the service, each question once unless it says otherwise."""

    def __init__(self, transport: Transport, timeout: float = 5.0) -> None:
        self.transport, self.timeout = transport, timeout

    def announce(self, announcement: Announcement) -> ParameterValues:
        return call(self.transport, PARAMS_ANNOUNCE, "params/announce", announcement, self.timeout)

    def set(self, name: str = "/robot_control", request: str = "", **given: Any) -> ParameterValues:
        asked = SetParameters(set=name, values=values(**given), id=request, who="tester")
        return call(self.transport, PARAMS_SET, "params/set", asked, self.timeout)

    def insist(self, request: str, **given: Any) -> ParameterValues:
        """Set, and ask again under the same id while no answer comes, as every node and tool does."""
        asked = SetParameters(set="/robot_control", values=values(**given), id=request, who="tester")
        return insist(self.transport, PARAMS_SET, asked)

    def get(self, name: str = "/robot_control") -> ParameterValues:
        return call(self.transport, PARAMS_GET, "params/get", ParameterSet(set=name), self.timeout)

    def history(self, name: str = "/robot_control", limit: int = 10_000) -> tuple[ParameterChange, ...]:
        return call(
            self.transport, PARAMS_HISTORY, "params/history", HistoryOf(set=name, limit=limit), self.timeout
        ).changes

    def there(self) -> bool:
        try:
            call(self.transport, PARAMS_LIST, "params/list", Empty(), 0.5)
        except CallFailed:
            return False
        return True


@contextmanager
def asking(network: Network, domain: str = "", timeout: float = 5.0) -> Iterator[Asking]:
    """A connection to ask through."""
    with ZenohTransport(configuration("star", (network.endpoint,), domain=domain)) as transport:
        yield Asking(transport, timeout)


def start(network: Network, file: Path | str, *arguments: str) -> Process:
    """The parameter service on a file."""
    return network.start("params", "--param", f'file="{file}"', *arguments)


def serving(network: Network, asking: Asking, file: Path | str, *arguments: str) -> Process:
    """The same, once it answers."""
    process = start(network, file, *arguments)
    until(lambda: asking.there() or process.status is not None, 20.0, "an answer of the parameter service")
    assert process.status is None, process.text
    return process

"""A script's copy of the parameter tree, against the service's implementation."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

import pytest

from messages.base import decoder, encode
from messages.requests import ROSPARAM_DELETE, ROSPARAM_GET, ROSPARAM_SET
from messages.rosparam import RosparamTree
from services.params.parameter_tree import ParameterTreeServer
from services.runtime.errors import BadInput
from services.runtime.parameters.tree import ParameterTree
from services.script.api import Input, Origin, ServiceRefused, ServiceUnavailable
from services.script.parameter_tree import SharedParameters


class Network:
    """A parameter service and its latched topic, which scripts read on request."""

    def __init__(self) -> None:
        self.server: ParameterTreeServer | None = None
        self.latched: bytes | None = None

    def begin(self, **values: Any) -> None:
        self.server = ParameterTreeServer(self._publish, ParameterTree(values))
        self.server.publish_changes()

    def _publish(self, tree: RosparamTree) -> None:
        self.latched = encode(tree)


class ScriptKernel:
    """The part of a kernel that the tree uses."""

    def __init__(self, network: Network, lockstep: bool = False) -> None:
        self.lockstep, self.time = lockstep, 0
        self._network = network
        self._receive: Callable[[bytes, Origin], None] | None = None

    def follow(self) -> None:
        """Receive the newest tree, as at a tick."""
        if self._network.latched is not None and self._receive is not None:
            self._receive(self._network.latched, Origin("/params", True))

    def subscribe(
        self, name: str, ros_type: str, receive: Callable[[bytes, Origin], None], queue_size: int | None = None
    ) -> Input:
        assert (name, ros_type) == ("/rosparam/tree", "elea_msgs/RosparamTree")
        self._receive = receive
        return None  # type: ignore[return-value]

    def call(self, name: str, ros_type: str, payload: bytes, timeout: float | None = None) -> bytes:
        if self._network.server is None:
            raise ServiceUnavailable(name)
        server = self._network.server
        for request, handler in (
            (ROSPARAM_SET, server.set),
            (ROSPARAM_GET, server.get),
            (ROSPARAM_DELETE, server.delete),
        ):
            if request.name == name:
                try:
                    return encode(handler(decoder(request.request_type)(payload)))  # type: ignore[operator]
                except BadInput as error:
                    raise ServiceRefused(str(error)) from None
        raise AssertionError(name)

    def service_type(self, name: str) -> str | None:
        return "elea_msgs/RosparamGet" if self._network.server is not None else None

    @property
    def time_has_begun(self) -> bool:
        return self.time > 0

    def now(self) -> int:
        return self.time

    def lock(self) -> Any:
        return threading.RLock()


def script(network: Network, name: str, lockstep: bool = False) -> tuple[ScriptKernel, SharedParameters]:
    kernel = ScriptKernel(network, lockstep)
    return kernel, SharedParameters(kernel, lambda: name)


def test_alone_a_script_has_a_tree_of_its_own() -> None:
    _, parameters = script(Network(), "/alone")
    parameters.set("/gains", {"P": 1, "I": 2.5})
    parameters.delete("/gains/P")
    assert parameters.get("/gains") == {"I": 2.5}
    assert parameters.has("/gains")
    assert parameters.search("/alone", "gains") == "/gains"
    assert parameters.names() == ["/gains/I"]
    for call in (lambda: parameters.get("/nope"), lambda: parameters.delete("/nope")):
        with pytest.raises(KeyError, match="/nope"):
            call()
    with pytest.raises(BadInput, match="None"):
        parameters.set("/n", None)


def test_two_scripts_share_one_tree() -> None:
    network = Network()
    network.begin(des_pos_x=1.0)
    (_, writer), (kernel, reader) = script(network, "/bug"), script(network, "/go_to_point")
    assert reader.get("/des_pos_x") == 1.0
    writer.set("/des_pos_x", 4.0)
    assert writer.get("/des_pos_x") == 4.0
    assert network.server is not None
    network.server.publish_changes()
    assert reader.get("/des_pos_x") == 1.0
    kernel.follow()
    assert reader.get("/des_pos_x") == 4.0
    reader.delete("/des_pos_x")
    assert not reader.has("/des_pos_x")
    assert not network.server.has(_key("/des_pos_x")).data


def test_own_changes_stay_on_a_tree_that_lacks_them() -> None:
    """In lockstep the service applies a change at its next tick; trees published before don't have it."""
    network = Network()
    network.begin(x=0, y=0)
    assert network.server is not None
    (kernel, one), (beside, other) = script(network, "/one", lockstep=True), script(network, "/other", lockstep=True)
    other.set("/y", 2)
    assert one.get("/y") == 0, "time has not begun"
    network.server.tick(0, reset=False)
    kernel.follow()
    assert one.get("/y") == 2
    kernel.time = beside.time = 20_000_000
    one.set("/x", 1)
    network.server.tick(20_000_000, reset=False)
    kernel.follow()
    assert (one.get("/x"), one.get("/y")) == (1, 2), "one's own change waits"
    network.server.tick(100_000_000, reset=False)
    kernel.follow()
    assert (one.get("/x"), one.get("/y")) == (1, 2)
    assert not one._pending
    other.set("/x", 9)
    network.server.tick(200_000_000, reset=False)
    kernel.follow()
    assert one.get("/x") == 9


def test_a_restarted_script_counts_on() -> None:
    network = Network()
    network.begin()
    _, first = script(network, "/n")
    first.set("/a", 1)
    kernel, second = script(network, "/n")
    second.set("/a", 2)
    assert network.server is not None
    network.server.publish_changes()
    kernel.follow()
    assert second.get("/a") == 2


def test_a_service_that_comes_late_or_again_gets_the_own_values() -> None:
    network = Network()
    kernel, parameters = script(network, "/n")
    parameters.set("/own", {"a": 1})
    network.begin(fleet=1)
    kernel.follow()
    assert parameters.get("/") == {"fleet": 1, "own": {"a": 1}}
    assert network.server is not None
    assert network.server.has(_key("/own/a")).data
    for number in range(5):
        parameters.set("/own/b", number)
    network.server.publish_changes()
    kernel.follow()
    network.begin(fleet=2)
    kernel.follow()
    assert parameters.get("/") == {"fleet": 2, "own": {"a": 1, "b": 4}}
    assert network.server.has(_key("/own/b")).data


def test_changes_without_a_service_are_kept_once_per_key() -> None:
    network = Network()
    kernel, alone = script(network, "/a")
    for number in range(50):
        alone.set("/count", number)
    assert (len(alone._pending), alone.get("/count")) == (0, 49)
    network.begin()
    kernel.follow()
    assert network.server is not None
    assert network.server.has(_key("/count")).data


def test_a_refused_change_is_taken_back() -> None:
    network = Network()
    network.begin(kept=1)
    _, parameters = script(network, "/n")
    for number in range(4):
        parameters.set(f"/big{number}", "x" * 1_000_000)
    with pytest.raises(BadInput, match="nothing was changed"):
        parameters.set("/kept", "x" * 1_000_000)
    assert parameters.get("/kept") == 1


def _key(key: str) -> Any:
    from messages.rosparam import RosparamKey

    return RosparamKey(key=key)

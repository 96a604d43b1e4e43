"""What a shutdown hook asks in the middle of the same question of the main thread, where a signal may run it."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

from services.runtime.transport.memory import MemoryBus, MemoryTransport
from services.runtime.transport.zenoh import LivelinessCache
from services.script.network import Network
from services.script.parameter_tree import SharedParameters
from tests.harness.cases import case
from tests.harness.ros1 import ros1_imports

WITHIN_S = 60.0


class Interrupted:
    """Stands for an object that is used with a lock held; its next use runs ``hook`` first."""

    def __init__(self, used: Any, hook: Callable[[], object]) -> None:
        self._used, self._hook = used, hook
        self.hooks_run = 0

    def __getattr__(self, name: str) -> Any:
        if not self.hooks_run:
            self.hooks_run = 1
            self._hook()
            self.hooks_run = 2
        return getattr(self._used, name)


def assert_a_hook_may_interrupt(owner: Any, attribute: str, ask: Callable[[], object]) -> None:
    """Assert that ``ask``, interrupted by itself where ``owner`` uses ``attribute``, ends."""
    interrupted = Interrupted(getattr(owner, attribute), ask)
    setattr(owner, attribute, interrupted)
    thread = threading.Thread(target=ask, daemon=True)
    thread.start()
    thread.join(WITHIN_S)
    assert not thread.is_alive()
    assert interrupted.hooks_run == 2


def test_a_hook_asks_what_the_main_thread_was_asking() -> None:
    network = Network(MemoryTransport(MemoryBus()))
    for attribute in ("_watch", "_entities"):
        with case("network", attribute):
            assert_a_hook_may_interrupt(network, attribute, network.nodes)
    with case("tokens"):
        tokens = LivelinessCache()
        tokens.news = NoNews()
        assert_a_hook_may_interrupt(tokens, "news", tokens.update)
    with ros1_imports() as kernel:
        import rospy
        import tf2_py

        rospy.init_node("asking", disable_signals=True)
        with case("parameters"):
            parameters = SharedParameters(kernel, lambda: "/asking")
            parameters.set("/here", True)
            assert_a_hook_may_interrupt(parameters, "_tree", lambda: parameters.has("/here"))
        with case("transforms"):
            buffer = tf2_py.BufferCore()
            assert_a_hook_may_interrupt(buffer, "_tf", buffer.clear)


class NoNews:
    def try_recv(self) -> None:
        pass

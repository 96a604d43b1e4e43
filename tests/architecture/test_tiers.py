"""Tests get the markers of the code that they use; a quick test that starts a process or opens a socket fails."""

from __future__ import annotations

import os
import socket
import subprocess
import sys
import threading
from collections.abc import Callable

import pytest

from services.runtime.transport.zenoh import ZenohTransport
from tests import tiers
from tests.harness.background_fleet import background_fleet
from tests.harness.processes import Network, start_service
from tests.services.panel import conftest as panel
from tests.tiers import QuickTestWatch, markers_of, watch_quick_test


class Rig:
    """Hides a network behind a property."""

    @property
    def network(self) -> type[Network]:
        return Network


def directly() -> None:
    subprocess.run(["true"], check=True)


def within_a_function() -> None:
    def later() -> None:
        start_service("sim")  # type: ignore[call-arg]

    later()


def by_a_class() -> Rig:
    return Rig()


def by_a_module() -> object:
    return panel.PanelFleet


def by_the_product() -> type[ZenohTransport]:
    return ZenohTransport


def by_an_import() -> None:
    import subprocess as hidden

    assert hidden


def arithmetic() -> int:
    return 1 + len(os.sep)


@pytest.mark.parametrize(
    ("function", "markers"),
    [
        (directly, {"process"}),
        (within_a_function, {"process"}),
        (by_a_class, {"process"}),
        (by_the_product, {"process"}),
        (by_an_import, {"process"}),
        (background_fleet, {"process", "fleet"}),
        (arithmetic, set()),
    ],
)
def test_markers_follow_from_what_is_reached(function: Callable[..., object], markers: set[str]) -> None:
    assert markers_of(function) == markers


def test_a_browser_and_its_fleet_are_seen_through_a_module() -> None:
    assert {"fleet", "process"} <= markers_of(by_a_module)
    assert "browser" in markers_of(panel.browser)


@pytest.mark.process
def test_a_process_or_a_socket_in_a_quick_test_is_noted() -> None:
    for act, event in (
        (lambda: subprocess.run([sys.executable, "-c", ""], check=True), "subprocess.Popen"),
        (lambda: socket.create_server(("127.0.0.1", 0)).close(), "socket.bind"),
        (lambda: in_a_thread(lambda: socket.create_server(("127.0.0.1", 0)).close()), "socket.bind"),
    ):
        with watch_quick_test() as watch:
            act()
        assert [each.partition("(")[0] for each in watch.seen] == [event]
        with pytest.raises(pytest.fail.Exception, match=f"a quick test must not: {event}"):
            watch.check()


def test_long_computing_is_noted() -> None:
    with pytest.MonkeyPatch.context() as patch, watch_quick_test() as watch:
        patch.setattr(tiers, "QUICK_LIMIT_S", 0.0)
        sum(range(100_000))
    assert len(watch.seen) == 1
    assert watch.seen[0].startswith("compute for 0.")


def test_what_keeps_to_the_rules_passes() -> None:
    with watch_quick_test() as watch:
        in_a_thread(arithmetic)
    assert watch.seen == []
    watch.check()
    QuickTestWatch().check()


def in_a_thread(act: Callable[[], object]) -> None:
    thread = threading.Thread(target=act)
    thread.start()
    thread.join()

"""Tests get the markers of the code that they use; a quick test that starts a process or opens a socket fails."""

from __future__ import annotations

import os
import socket
import subprocess
import sys
import threading
from collections.abc import Callable
from pathlib import Path

import pytest

from services.runtime.transport.zenoh import ZenohTransport
from tests import tiers
from tests.harness.background_fleet import background_fleet
from tests.harness.processes import Network, start_service
from tests.services.panel import conftest as panel
from tests.tiers import QuickTestWatch, browser_files, markers_of, watch_quick_test


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


def test_files_that_share_a_packages_fixture_with_a_browser_test_go_with_it(tmp_path: Path) -> None:
    for folder in ("pages", "other"):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "__init__.py").touch()
        fixture = 'import pytest\n\n\n@pytest.fixture(scope="package")\ndef fleet():\n    return 1\n'
        (tmp_path / folder / "conftest.py").write_text(fixture)
        (tmp_path / folder / "test_shares.py").write_text("def test_it(fleet): ...\n")
        (tmp_path / folder / "test_alone.py").write_text("def test_it(): ...\n")
    drives = "import pytest\n\n\n@pytest.mark.browser\ndef test_it(fleet): ...\n"
    (tmp_path / "pages" / "test_page.py").write_text(drives)
    found: list[Path] = []

    class Collected:
        def pytest_collection_modifyitems(self, items: list[pytest.Item]) -> None:
            found.extend(browser_files(items))

    options = ["--collect-only", "-q", "-p", "no:cacheprovider", "-p", "no:xdist", "-o", "addopts=", "-c", "/dev/null"]
    assert pytest.main([*options, "--rootdir", str(tmp_path), str(tmp_path)], plugins=[Collected()]) == 0
    assert found == [tmp_path / "pages" / name for name in ("test_page.py", "test_shares.py")]

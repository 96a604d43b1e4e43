"""For all tests: fleets that a developer runs stay out of sight, and in CI a skipped test is a failure."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator

import pytest


@pytest.fixture(scope="session", autouse=True)
def own_state(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """What commands note of the fleets that run, and their sockets, for the commands of this test run alone."""
    # Not below the folder of this test run: its path may be too long for a socket.
    with pytest.MonkeyPatch.context() as patch, tempfile.TemporaryDirectory(prefix="elea-test-") as runtime:
        patch.setenv("XDG_STATE_HOME", str(tmp_path_factory.mktemp("state")))
        patch.setenv("XDG_RUNTIME_DIR", runtime)
        yield


def pytest_sessionfinish(session: pytest.Session, exitstatus: int) -> None:
    reporter = session.config.pluginmanager.get_plugin("terminalreporter")
    if os.environ.get("CI") and reporter is not None and reporter.stats.get("skipped"):
        reporter.write_line("skipped tests fail a run in CI", red=True)
        session.exitstatus = exitstatus or pytest.ExitCode.TESTS_FAILED

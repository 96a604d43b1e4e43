"""A skipped test is a failure where nobody looks at the output: in CI."""

from __future__ import annotations

import os

import pytest


def pytest_sessionfinish(session: pytest.Session, exitstatus: int) -> None:
    reporter = session.config.pluginmanager.get_plugin("terminalreporter")
    if os.environ.get("CI") and reporter is not None and reporter.stats.get("skipped"):
        reporter.write_line("skipped tests fail a run in CI", red=True)
        session.exitstatus = exitstatus or pytest.ExitCode.TESTS_FAILED

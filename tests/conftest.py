"""For all tests: fleets that a developer runs stay out of sight, and in CI a skipped test is a failure."""

from __future__ import annotations

import gc
import json
import os
import signal
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import asdict

import pytest
from hypothesis import HealthCheck, settings

from deploy.bench.figures import FIGURE_PROPERTY, Figure
from tests.harness.orphans import no_orphans
from tests.tiers import pytest_collection_modifyitems as pytest_collection_modifyitems
from tests.tiers import pytest_configure as pytest_configure
from tests.tiers import pytest_make_collect_report as pytest_make_collect_report
from tests.tiers import pytest_runtest_call as pytest_runtest_call

settings.register_profile("elea", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("elea")  # a busy machine fails no property

if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    # A shell ignores it for what it starts in the background, and so would the processes that tests end by it.
    signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture(scope="session", autouse=True)
def own_state(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """What commands note of the fleets that run, their sockets and robots from outside, for the commands of this test
    run alone; what they start ends with it.
    """
    # Not below the folder of this test run: its path may be too long for a socket.
    with (
        pytest.MonkeyPatch.context() as patch,
        tempfile.TemporaryDirectory(prefix="elea-test-") as runtime,
        no_orphans(),
    ):
        patch.delenv("ELEA_HOME", raising=False)
        patch.setenv("XDG_STATE_HOME", str(tmp_path_factory.mktemp("state")))
        patch.setenv("XDG_CACHE_HOME", str(tmp_path_factory.mktemp("cache")))
        patch.setenv("XDG_RUNTIME_DIR", runtime)
        yield


@pytest.fixture
def keeps_bound(record_property: Callable[[str, object], None]) -> Callable[[Figure], None]:
    """Hands a measured figure to ``./elea bench``, and fails the test when it misses its bound."""

    def check(figure: Figure) -> None:
        record_property(FIGURE_PROPERTY, json.dumps(asdict(figure)))
        assert figure.ok, f"{figure.name}: {figure.median:.4g} {figure.unit}, the bound is {figure.bound}"

    return check


def pytest_collection_finish() -> None:
    """What the collection has made stays to the end: looking through it for garbage costs the tests a tenth of their
    processor time.
    """
    gc.collect()
    gc.freeze()


def pytest_sessionfinish(session: pytest.Session, exitstatus: int) -> None:
    reporter = session.config.pluginmanager.get_plugin("terminalreporter")
    if os.environ.get("CI") and reporter is not None and reporter.stats.get("skipped"):
        reporter.write_line("skipped tests fail a run in CI", red=True)
        session.exitstatus = exitstatus or pytest.ExitCode.TESTS_FAILED

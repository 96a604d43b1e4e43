"""Set-up of every test run: state folders of its own, no orphaned processes; in CI a skipped test is a failure."""

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
from tests.scheduling import pytest_configure_node as pytest_configure_node
from tests.scheduling import pytest_xdist_make_scheduler as pytest_xdist_make_scheduler
from tests.tiers import pytest_collection_modifyitems as pytest_collection_modifyitems
from tests.tiers import pytest_configure as pytest_configure
from tests.tiers import pytest_make_collect_report as pytest_make_collect_report
from tests.tiers import pytest_runtest_call as pytest_runtest_call

settings.register_profile("elea", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("elea")  # no deadline, so a busy machine fails no property test

if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    # A shell ignores SIGINT in background jobs; the processes that tests end with SIGINT would inherit that.
    signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture(scope="session", autouse=True)
def own_state(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Point the state, cache and runtime folders (running fleets, imported robots, sockets) at temporary ones for this
    test run, and kill every process that the run starts when it ends.
    """
    # Not below pytest's temporary folder: its path may be too long for a Unix socket.
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
    """Record a measured figure for ``./elea bench`` and fail the test if it misses its bound."""

    def check(figure: Figure) -> None:
        record_property(FIGURE_PROPERTY, json.dumps(asdict(figure)))
        assert figure.ok, f"{figure.name}: {figure.median:.4g} {figure.unit}, the bound is {figure.bound}"

    return check


def pytest_collection() -> None:
    """Collect the tests without garbage collection; nearly all the objects that this makes remain."""
    gc.disable()


def pytest_collection_finish() -> None:
    """Exempt the objects that collection made from garbage collection; scanning them costs a tenth of the tests'
    processor time.
    """
    gc.enable()
    gc.collect()
    gc.freeze()


def pytest_sessionfinish(session: pytest.Session, exitstatus: int) -> None:
    reporter = session.config.pluginmanager.get_plugin("terminalreporter")
    if os.environ.get("CI") and reporter is not None and reporter.stats.get("skipped"):
        reporter.write_line("skipped tests fail a run in CI", red=True)
        session.exitstatus = exitstatus or pytest.ExitCode.TESTS_FAILED

"""Sorts tests into tiers by the code they reach, and fails a quick test that starts a process or opens a socket.

A test is sorted when it is collected. The test code reachable from its function and fixtures is followed name by name;
code that starts a process, opens a socket, runs a fleet or drives a browser adds a marker. A test without a marker is
quick. Reading code can miss something, so quick tests are also watched at run time: an audit hook reports every process
and socket, and a quick test that makes one, or computes for too long, fails.
"""

from __future__ import annotations

import functools
import inspect
import sys
import threading
import time
import types
from collections.abc import Callable, Generator, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from services.sim.engines import PYBULLET_PACKAGES, has_engine
from tests.scheduling import report_file_kinds, yield_to_fleets

MARKERS = {
    "quick": "no process, no socket, at most a second or so; given to every test without another marker",
    "slow": "needs no process, but more than a second of computing",
    "process": "starts processes or opens sockets; given by what the test reaches",
    "fleet": "runs a fleet under the supervisor; given by what the test reaches",
    "browser": "drives a browser; given by what the test reaches",
    "bench": "measures speed against a bound: ./elea bench runs it, ./elea test does not",
}

_WAITS = "waits: the tests of this file wait for most of their time, for leases, clocks or keys; they run beside others"

_LONGEST_FIRST = ("fleet", "bench", "browser", "process", "slow", "quick")

QUICK_LIMIT_S = 10.0
"""Processor time limit of a quick test: ten times what one takes on an idle machine, so a slow machine fails none."""

_BY_MODULE = {
    "subprocess": "process",
    "multiprocessing": "process",
    "pty": "process",
    "socket": "process",
    "zenoh": "process",
    "services.runtime.transport.zenoh": "process",
    "services.panel.server": "process",
    "deploy.supervisor.spawner": "process",
    "deploy.run_fleet": "fleet",
    "tests.faults.supervised_fleet": "fleet",
    "tests.harness.background_fleet": "fleet",
    "playwright.sync_api": "browser",
}
"""The marker of a test that reaches anything in these modules."""
_BY_NAME = {"fork": "process", "forkpty": "process", "run_fleet": "fleet", "PanelFleet": "fleet"}
"""The marker of a test that uses a function or class with this name, from any module."""
_EVENTS = ("subprocess.Popen", "os.fork", "os.forkpty", "os.posix_spawn", "os.system", "socket.connect", "socket.bind")


@functools.cache
def markers_of(root: Any) -> frozenset[str]:
    """Return the markers of a test function, fixture or class, from all the test code that it reaches."""
    found: set[str] = set()
    first = inspect.unwrap(root)
    pending, seen = [first], {first}
    while pending:
        for code, names in _codes(pending.pop()):
            for name in code.co_names:
                found.update(marker for marker in (_BY_NAME.get(name), _BY_MODULE.get(name)) if marker)
                for value in _named(name, names, code.co_names):
                    module = value.__name__ if inspect.ismodule(value) else value.__module__
                    found.update([_BY_MODULE[module]] if module in _BY_MODULE else [])
                    if _is_of_tests(module) and not inspect.ismodule(value) and value not in seen:
                        seen.add(value)
                        pending.append(value)
    return frozenset(found)


def _named(name: str, names: dict[str, Any], attributes: tuple[str, ...]) -> Iterator[Any]:
    """Yield the functions, classes and modules (for an object, its class) that a name may refer to; for a test module,
    also the used attributes.
    """
    value = names.get(name)
    values = [value]
    if inspect.ismodule(value) and _is_of_tests(value.__name__):
        values += [vars(value)[each] for each in attributes if each in vars(value)]
    for each in values:
        plain = inspect.unwrap(each) if callable(each) else each
        if inspect.ismodule(plain) or isinstance(plain, (types.FunctionType, type)):
            yield plain
        elif _is_of_tests(type(plain).__module__):
            yield type(plain)


def _codes(value: Any) -> Iterator[tuple[types.CodeType, dict[str, Any]]]:
    """Yield the code of a function, or of all functions of a class and its bases, each with its global names."""
    if isinstance(value, type):
        for owner in value.__mro__:
            for member in vars(owner).values() if _is_of_tests(owner.__module__) else ():
                member = getattr(member, "fget", None) or getattr(member, "__func__", None) or member
                if isinstance(member, types.FunctionType):
                    yield from _codes(inspect.unwrap(member))
    elif isinstance(value, types.FunctionType):
        for code in _nested(value.__code__):
            yield code, value.__globals__


def _nested(code: types.CodeType) -> Iterator[types.CodeType]:
    yield code
    for each in code.co_consts:
        if isinstance(each, types.CodeType):
            yield from _nested(each)


def _is_of_tests(module: str) -> bool:
    return module.partition(".")[0] == "tests"


class QuickTestWatch:
    """Records the forbidden actions of a quick test."""

    def __init__(self) -> None:
        self.seen: list[str] = []

    def check(self) -> None:
        """Fail the test if any forbidden action was recorded."""
        if self.seen:
            pytest.fail(f"a quick test must not: {'; '.join(self.seen)}; give it one of these markers: {_OTHERS}")


_OTHERS = ", ".join(each for each in MARKERS if each != "quick")
_watching: list[tuple[QuickTestWatch, set[int]]] = []


def _audit(event: str, arguments: tuple[Any, ...]) -> None:
    if _watching and event in _EVENTS:
        watch, others = _watching[-1]
        if threading.get_ident() not in others:
            watch.seen.append(f"{event}{tuple(map(str, arguments))[:2]}")


@functools.cache
def _install_audit_hook() -> None:
    sys.addaudithook(_audit)


@contextmanager
def watch_quick_test() -> Iterator[QuickTestWatch]:
    """Record the processes and sockets that the block makes, and whether it computes for too long.

    Threads that already existed don't count: they belong to fixtures of other tests. Zenoh opens its sockets below
    Python, so calls of ``zenoh.open`` are recorded instead.
    """
    _install_audit_hook()
    watch = QuickTestWatch()
    main = threading.get_ident()
    _watching.append((watch, {each.ident or 0 for each in threading.enumerate()} - {main}))
    began = time.process_time()
    try:
        with pytest.MonkeyPatch.context() as patch:
            if "zenoh" in sys.modules:
                _note_zenoh(patch, watch)
            yield watch
    finally:
        _watching.pop()
    spent = time.process_time() - began
    if spent > QUICK_LIMIT_S:
        watch.seen.append(f"compute for {spent:.1f} s; the limit is {QUICK_LIMIT_S:g} s")


def _note_zenoh(patch: pytest.MonkeyPatch, watch: QuickTestWatch) -> None:
    zenoh: Any = sys.modules["zenoh"]
    opened: Callable[..., Any] = zenoh.open

    def note(*arguments: Any) -> Any:
        watch.seen.append("zenoh.open")
        return opened(*arguments)

    patch.setattr(zenoh, "open", note)


def pytest_configure(config: pytest.Config) -> None:
    """Register the markers."""
    for each in (*(f"{name}: {about}" for name, about in MARKERS.items()), _WAITS):
        config.addinivalue_line("markers", each)


@pytest.hookimpl(wrapper=True)
def pytest_make_collect_report(
    collector: pytest.Collector,
) -> Generator[None, pytest.CollectReport, pytest.CollectReport]:
    """Skip a test file that imports PyBullet on a platform that has no PyBullet package, with that reason."""
    report = yield
    if report.failed and not has_engine("pybullet") and "No module named 'pybullet'" in str(report.longrepr):
        report.outcome = "skipped"
        report.longrepr = (str(collector.path), 0, f"Skipped: it tests PyBullet itself, and {PYBULLET_PACKAGES}")
    return report


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Add every test's markers before ``-m`` selects among them, and sort files with long tests first, so that no
    worker is left alone with one at the end.
    """
    for item in items:
        assert isinstance(item, pytest.Function)
        fixtures = [each for defined in item._fixtureinfo.name2fixturedefs.values() for each in defined]
        for function in (item.function, *(each.func for each in fixtures if each.argname != "own_state")):
            for marker in sorted(markers_of(function)):
                item.add_marker(marker)
        if not any(item.get_closest_marker(each) for each in MARKERS):
            item.add_marker("quick")
    longest = dict[Path, int]()
    for item in items:
        rank = next(rank for rank, each in enumerate(_LONGEST_FIRST) if item.get_closest_marker(each))
        longest[item.path] = min(rank, longest.get(item.path, rank))
    items.sort(key=lambda item: longest[item.path])
    busy = {item.path for item in items if not item.get_closest_marker("waits")}
    slow, process = _LONGEST_FIRST.index("slow"), _LONGEST_FIRST.index("process")
    report_file_kinds(
        config,
        waiting=[path for path in longest if path not in busy],
        computing=[path for path in longest if longest[path] >= slow],
        process=[path for path in longest if longest[path] == process],
        browser=browser_files(items),
    )


def browser_files(items: list[pytest.Item]) -> list[Path]:
    """Return the files of which a test drives a browser, and those that share a package's fixture with them."""
    shared = {each: _package_fixtures(each) for each in items}
    theirs = {name for item, names in shared.items() if item.get_closest_marker("browser") for name in names}
    drive = [item for item, names in shared.items() if item.get_closest_marker("browser") or names & theirs]
    return list(dict.fromkeys(item.path for item in drive))


def _package_fixtures(item: pytest.Item) -> set[tuple[str, str]]:
    """Return folder and name of the fixtures of a test that are made once for the tests of a folder."""
    assert isinstance(item, pytest.Function)
    fixtures = [each for defined in item._fixtureinfo.name2fixturedefs.values() for each in defined]
    return {(each.baseid, each.argname) for each in fixtures if each.scope == "package"}


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call(item: pytest.Item) -> Iterator[None]:
    """Run a quick test under ``watch_quick_test``."""
    computes = item.get_closest_marker("quick") or item.get_closest_marker("slow")
    if computes and not item.get_closest_marker("waits"):
        yield_to_fleets(item.config)
    if item.get_closest_marker("quick") is None:
        yield
        return
    with watch_quick_test() as watch:
        yield
    watch.check()

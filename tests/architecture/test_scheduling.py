"""Processes in the background run only files that wait or compute; the others run the rest, and help at the end."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from tests.scheduling import BackgroundScheduling, pytest_xdist_make_scheduler

STARTING = ("fleet.py", "process.py")
WAITING, COMPUTING = ("waits.py",), ("slow.py", "quick.py")
TESTS = [f"{file}::test_{number}" for file in (*STARTING, *WAITING, *COMPUTING) for number in range(4)]
FILES = {"waiting": WAITING, "computing": COMPUTING, "process": ("process.py",), "browser": ()}
NO_FILES: dict[str, tuple[str, ...]] = dict.fromkeys(FILES, ())


class Worker:
    """Stands for a process of pytest: notes the tests that it is sent."""

    def __init__(self, folder: Path, name: str, files: dict[str, tuple[str, ...]] = FILES) -> None:
        report = folder / name
        report.write_text(json.dumps(files))
        self.workerinput = {"file_kinds": str(report)}
        self.gateway = SimpleNamespace(id=name)
        self.sent: list[int] = []
        self.shutting_down = False

    def send_runtest_some(self, indices: list[int]) -> None:
        assert not self.shutting_down
        self.sent += indices

    def shutdown(self) -> None:
        self.shutting_down = True

    @property
    def files(self) -> list[str]:
        return list(dict.fromkeys(TESTS[each].partition("::")[0] for each in self.sent))


def scheduling(*workers: Worker) -> Any:
    options = {
        "tx": [f"popen//id={each.gateway.id}" for each in workers],
        "dist": "loadfile",
        "loadscopereorder": False,
    }
    config: Any = SimpleNamespace(getvalue=options.get, option=SimpleNamespace(**options), hook=None)
    scheduler: Any = BackgroundScheduling(config)
    for each in workers:
        scheduler.add_node(each)
    for each in workers:
        scheduler.add_node_collection(each, TESTS)
    scheduler.schedule()
    return scheduler


def finish(scheduler: Any, worker: Worker) -> None:
    """Complete all tests of a worker, and those that it is sent meanwhile."""
    done = 0
    while done < len(worker.sent):
        scheduler.mark_test_complete(worker, worker.sent[done])
        done += 1


def test_each_process_in_the_background_runs_only_files_for_it_and_ends_after_them(tmp_path: Path) -> None:
    first, waiting, computing = (Worker(tmp_path, name) for name in ("gw0", "waiting1", "computing"))
    scheduler = scheduling(first, waiting, computing)
    assert first.files == ["fleet.py"]
    finish(scheduler, computing)
    assert computing.files == list(COMPUTING)
    finish(scheduler, waiting)
    assert waiting.files == [*WAITING, "process.py"]
    assert waiting.shutting_down
    assert computing.shutting_down
    finish(scheduler, first)
    assert first.files == ["fleet.py"]
    assert sorted(first.sent + waiting.sent + computing.sent) == list(range(len(TESTS)))
    assert scheduler.tests_finished


def test_two_processes_share_the_files_that_wait_and_then_those_without_fleets(tmp_path: Path) -> None:
    workers = [Worker(tmp_path, name) for name in ("gw0", "waiting1", "waiting2", "computing")]
    scheduler = scheduling(*workers)
    for each in reversed(workers):
        finish(scheduler, each)
    assert [each.files for each in workers] == [["fleet.py"], [*WAITING], ["process.py"], [*COMPUTING]]


def test_the_others_help_with_what_is_left(tmp_path: Path) -> None:
    first, waiting, computing = (Worker(tmp_path, name) for name in ("gw0", "waiting1", "computing"))
    scheduler = scheduling(first, waiting, computing)
    finish(scheduler, first)
    assert first.files == [*STARTING, *COMPUTING[1:]]
    finish(scheduler, waiting)
    finish(scheduler, computing)
    assert (waiting.files, computing.files) == ([*WAITING], [*COMPUTING[:1]])
    assert sorted(first.sent + waiting.sent + computing.sent) == list(range(len(TESTS)))


def test_files_that_drive_a_browser_run_in_one_process(tmp_path: Path) -> None:
    files = {**NO_FILES, "browser": ("process.py", "quick.py")}
    first, second = (Worker(tmp_path, name, files) for name in ("gw0", "gw1"))
    scheduler = scheduling(first, second)
    assert (first.files, second.files) == (["fleet.py"], ["process.py", "quick.py"])
    finish(scheduler, first)
    assert first.files == ["fleet.py", "waits.py", "slow.py"]
    finish(scheduler, second)
    assert scheduler.tests_finished


@pytest.mark.parametrize("name", ["waiting1", "waiting2", "computing"])
def test_without_such_files_a_process_in_the_background_ends_at_once(tmp_path: Path, name: str) -> None:
    first, background = Worker(tmp_path, "gw0", NO_FILES), Worker(tmp_path, name, NO_FILES)
    scheduler = scheduling(first, background)
    assert background.shutting_down
    assert background.sent == []
    finish(scheduler, first)
    assert len(first.sent) == len(TESTS)


@pytest.mark.parametrize(
    "options", [{"tx": ["popen"], "dist": "loadfile"}, {"tx": ["popen//id=waiting1"], "dist": "load"}]
)
def test_other_distributions_are_those_of_xdist(options: dict[str, Any]) -> None:
    config: Any = SimpleNamespace(getvalue=options.get)
    assert pytest_xdist_make_scheduler(config, None) is None  # type: ignore[arg-type]

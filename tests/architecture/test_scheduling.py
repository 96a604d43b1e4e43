"""The process in the background runs only files that wait or compute; the others run the rest, and help at the end."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from tests.scheduling import BackgroundScheduling, pytest_xdist_make_scheduler

STARTING = ("fleet.py", "process.py")
BACKGROUND = ("waits.py", "slow.py", "quick.py")
TESTS = [f"{file}::test_{number}" for file in (*STARTING, *BACKGROUND) for number in range(4)]


class Worker:
    """Stands for a process of pytest: notes the tests that it is sent."""

    def __init__(self, folder: Path, name: str, background: tuple[str, ...] = BACKGROUND) -> None:
        report = folder / name
        report.write_text(json.dumps(background))
        self.workerinput = {"background_files": str(report)}
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
    options = {"tx": ["popen", "popen//id=background"], "dist": "loadfile", "loadscopereorder": False}
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


def test_the_process_in_the_background_runs_only_files_for_it_and_ends_after_them(tmp_path: Path) -> None:
    first, background = Worker(tmp_path, "gw0"), Worker(tmp_path, "background")
    scheduler = scheduling(first, background)
    assert first.files == ["fleet.py"]
    finish(scheduler, background)
    assert background.files == list(BACKGROUND)
    assert background.shutting_down
    finish(scheduler, first)
    assert first.files == list(STARTING)
    assert sorted(first.sent + background.sent) == list(range(len(TESTS)))
    assert scheduler.tests_finished


def test_the_others_help_with_what_is_left(tmp_path: Path) -> None:
    first, background = Worker(tmp_path, "gw0"), Worker(tmp_path, "background")
    scheduler = scheduling(first, background)
    finish(scheduler, first)
    assert first.files == [*STARTING, *BACKGROUND[1:]]
    finish(scheduler, background)
    assert background.files == [BACKGROUND[0]]
    assert sorted(first.sent + background.sent) == list(range(len(TESTS)))


def test_without_such_files_the_process_in_the_background_ends_at_once(tmp_path: Path) -> None:
    first, background = Worker(tmp_path, "gw0", ()), Worker(tmp_path, "background", ())
    scheduler = scheduling(first, background)
    assert background.shutting_down
    assert background.sent == []
    finish(scheduler, first)
    assert len(first.sent) == len(TESTS)


@pytest.mark.parametrize(
    "options", [{"tx": ["popen"], "dist": "loadfile"}, {"tx": ["popen//id=background"], "dist": "load"}]
)
def test_other_distributions_are_those_of_xdist(options: dict[str, Any]) -> None:
    config: Any = SimpleNamespace(getvalue=options.get)
    assert pytest_xdist_make_scheduler(config, None) is None  # type: ignore[arg-type]

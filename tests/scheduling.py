"""Distributes the test files to pytest's processes: one for each processor, and one of low priority beside them.

Tests that start fleets wait a third of their time, for processes, leases and clocks. The process of low priority
computes meanwhile: it runs only files in which no test starts a process, so that never more fleets run at once than
there are processors, and it yields to them. ``./elea test`` asks for it with ``--tx popen//nice=5``.
"""

from __future__ import annotations

import json
import os
import tempfile
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest
from xdist.remote import Producer
from xdist.scheduler import LoadFileScheduling, Scheduling
from xdist.workermanage import WorkerController

_FILES = "files_without_processes"
"""The key under which a worker finds the path of the file for its report."""
_AUTOGROUP = Path("/proc/self/autogroup")
"""Linux shares the processors among sessions first; the priority of a process counts within its session."""


def report_files_without_processes(config: pytest.Config, files: Iterable[Path]) -> None:
    """Tell the scheduler, which collects nothing itself, the files in which no test starts a process."""
    given = getattr(config, "workerinput", {}).get(_FILES)
    if given:
        names = [file.relative_to(config.rootpath).as_posix() for file in files]
        Path(given).write_text(json.dumps(names))  # each worker has a file of its own


def lower_priority_of_session(config: pytest.Config) -> None:
    """In the worker of low priority, put it and what it starts behind all others of this machine."""
    if hasattr(config, "workerinput") and (nice := os.nice(0)) > 0:
        with suppress(OSError):
            os.setsid()
            _AUTOGROUP.write_text(str(nice))


@pytest.hookimpl(optionalhook=True)
def pytest_configure_node(node: WorkerController) -> None:
    """Name the file for the worker's report."""
    folder = node.config.stash.setdefault(_FOLDER, tempfile.TemporaryDirectory(prefix="elea-scheduling-"))
    node.workerinput[_FILES] = str(Path(folder.name) / node.gateway.id)


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Producer) -> Scheduling | None:
    """Replace the distribution by files where one process has a low priority."""
    has_background = any("nice=" in each for each in config.getvalue("tx"))
    return BackgroundScheduling(config, log) if has_background and config.getvalue("dist") == "loadfile" else None


_FOLDER = pytest.StashKey[tempfile.TemporaryDirectory[str]]()


class BackgroundScheduling(LoadFileScheduling):
    """Distributes by files; the process of low priority gets only files that ``report_files_without_processes`` named.

    The others take those last.
    """

    def add_node_collection(self, node: WorkerController, collection: Any) -> None:
        """Take a worker's collection and its report."""
        super().add_node_collection(node, collection)
        self._computing = set(json.loads(Path(node.workerinput[_FILES]).read_text()))

    def _assign_work_unit(self, node: WorkerController) -> None:
        file = self._next_file(node)
        if file is None:
            node.shutdown()
        else:
            self.workqueue.move_to_end(file, last=False)
            super()._assign_work_unit(node)

    def _reschedule(self, node: WorkerController) -> None:
        if not node.shutting_down and self._next_file(node) is None:
            node.shutdown()
        else:
            super()._reschedule(node)

    def _next_file(self, node: WorkerController) -> str | None:
        """Return the next file for a worker, None if there is no more."""
        in_background = node.gateway.spec.nice is not None
        fitting = (each for each in self.workqueue if (each in self._computing) == in_background)
        return next(fitting, None if in_background else next(iter(self.workqueue), None))

"""Distributes the test files to pytest's processes: one for each processor, and three in the background.

Tests that start fleets wait a third of their time, for processes, leases and clocks. The processes in the background
use that time. Two run files of which every test waits for nearly all of its time (marker ``waits``), and then others
without fleets; the third one runs, at low priority, files in which no test starts a process. So no more fleets compute
at once than there are processors. ``./elea test`` asks for them with ``--tx popen//id=waiting1``, ``waiting2`` and
``computing``.

The files that drive a browser run one after the other, in one process. Their fleets run in real time, and the browser
draws in software: two of each at once take more than two slow processors give, and then nothing happens in time.
"""

from __future__ import annotations

import functools
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

WAITING, COMPUTING = ("waiting1", "waiting2"), "computing"
"""The identifiers of the processes in the background."""
_NICE = 3
"""The priority of the computing one: half of what others get, so that no test reaches its time limit on a busy machine.
"""
_AUTOGROUP = Path("/proc/self/autogroup")
"""Linux shares the processors among sessions first; the priority of a process counts within its session."""
_BROWSER = "browser"
"""The name under which the files that drive a browser are distributed, as if they were one file."""
_REPORT = "file_kinds"
"""The key under which a worker finds the path of the file for its report."""


def report_file_kinds(config: pytest.Config, **files: Iterable[Path]) -> None:
    """Report the ``waiting`` and ``computing`` files and those with a ``process`` or ``browser``, in order, to the
    scheduler, whose process collects no tests.
    """
    if report := getattr(config, "workerinput", {}).get(_REPORT):
        found = {kind: [file.relative_to(config.rootpath).as_posix() for file in each] for kind, each in files.items()}
        Path(report).write_text(json.dumps(found))


def yield_to_fleets(config: pytest.Config) -> None:
    """Lower the priority of the computing process in the background; no effect in others."""
    if getattr(config, "workerinput", {}).get("workerid") == COMPUTING:
        _lower_priority()


@functools.cache
def _lower_priority() -> None:
    os.nice(_NICE)
    with suppress(OSError):  # a kernel without such groups
        os.setsid()
        _AUTOGROUP.write_text(str(_NICE))


@pytest.hookimpl(optionalhook=True)
def pytest_configure_node(node: WorkerController) -> None:
    """Name the file for the worker's report."""
    folder = node.config.stash.setdefault(_FOLDER, tempfile.TemporaryDirectory(prefix="elea-scheduling-"))
    node.workerinput[_REPORT] = str(Path(folder.name) / node.gateway.id)


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Producer) -> Scheduling | None:
    """Replace the distribution by files where there are processes in the background."""
    asked = any(each.partition("id=")[2] in (*WAITING, COMPUTING) for each in config.getvalue("tx"))
    return BackgroundScheduling(config, log) if asked and config.getvalue("dist") == "loadfile" else None


_FOLDER = pytest.StashKey[tempfile.TemporaryDirectory[str]]()


class BackgroundScheduling(LoadFileScheduling):
    """Distributes by files; the processes in the background get only those that ``report_file_kinds`` names for them.

    The others take the waiting and computing ones last.
    """

    def add_node_collection(self, node: WorkerController, collection: Any) -> None:
        """Take a worker's collection and its report."""
        super().add_node_collection(node, collection)
        files: dict[str, list[str]] = json.loads(Path(node.workerinput[_REPORT]).read_text())
        self._waiting, self._computing, self._process = files["waiting"], files["computing"], files["process"]
        self._browser = frozenset(files["browser"])

    def _split_scope(self, nodeid: str) -> str:
        file: str = super()._split_scope(nodeid)
        return _BROWSER if file in self._browser else file

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
        background = {*self._waiting, *self._computing}
        if node.gateway.id in WAITING:
            order = [*self._waiting, *reversed(self._process)]
        elif node.gateway.id == COMPUTING:
            order = self._computing
        else:
            order = [*(each for each in self.workqueue if each not in background), *self.workqueue]
        return next((each for each in order if each in self.workqueue), None)

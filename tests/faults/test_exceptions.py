"""Fault 9: an unhandled exception in the loop, a thread, a timer, or a request handler."""

from __future__ import annotations

import psutil
import pytest

from messages.requests import Name
from services.runtime.errors import CallFailed
from tests.faults.services.raise_in_answer import ASK
from tests.faults.supervised_fleet import WITHIN_S, SupervisedFleet


@pytest.mark.parametrize(("place", "status"), [("loop", 1), ("thread", 70), ("timer", 70)])
def test_the_process_ends_with_a_traceback_and_comes_back(broken: SupervisedFleet, place: str, status: int) -> None:
    name = f"raise_in_{place}"
    broken.wait_ready(name)
    before = broken.process(name)
    broken.trigger_fault(name)
    broken.wait_restarted(before)
    assert not psutil.pid_exists(before.pid), "neither a process nor a zombie"
    error = f"ZeroDivisionError: planted in the {place}"
    broken.wait(lambda: error in broken.log(name), "the error in the log")
    log = broken.log(name)
    assert "Traceback (most recent call last)" in log
    assert f"{name} backing off: exit status {status}; restarting in" in log
    broken.wait(lambda: len(broken.recorder.sessions[f"/{name}"]) == 1, "one node of the name")


def test_a_request_whose_handler_fails_is_answered_so_and_ends_nothing(broken: SupervisedFleet) -> None:
    """A request comes from outside and must not end the process that serves it."""
    name = "raise_in_answer"
    broken.wait_ready(name)
    before = broken.process(name)
    for _ in range(2):
        with pytest.raises(CallFailed, match="internal error: ZeroDivisionError: planted in the answer"):
            broken.recorder.node.call(ASK, Name(), WITHIN_S, f"/{name}/ask")
    broken.wait(lambda: "ZeroDivisionError: planted in the answer" in broken.log(name), "the traceback in the log")
    assert (broken.process(name).pid, broken.process(name).restarts) == (before.pid, 0)

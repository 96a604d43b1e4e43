"""Fault 9: an exception that nobody handles, in the loop, a thread, a timer, or while a request is answered."""

from __future__ import annotations

import psutil
import pytest

from messages.requests import Name
from services.runtime.errors import CallFailed
from tests.faults.fleet import Fleet
from tests.faults.services.raise_in_answer import ASK


@pytest.mark.parametrize(("place", "status"), [("loop", 1), ("thread", 70), ("timer", 70), ("answer", 1)])
def test_the_process_ends_with_a_traceback_and_comes_back(broken: Fleet, place: str, status: int) -> None:
    name = f"raise_in_{place}"
    broken.wait_ready(name)
    before = broken.process(name)
    if place == "answer":
        with pytest.raises(CallFailed, match="planted in the answer"):
            broken.observer.node.call(ASK, Name(), name=f"/{name}/ask")
    else:
        broken.fail(name)
    broken.wait_new_life(before)
    assert not psutil.pid_exists(before.pid), "neither a process nor a zombie"
    log = broken.log(name)
    assert "Traceback (most recent call last)" in log
    assert f"ZeroDivisionError: planted in the {place}" in log
    assert f"{name} backing off: exit status {status}; again in" in log
    broken.wait(lambda: len(broken.observer.sessions[f"/{name}"]) == 1, "one node of the name")

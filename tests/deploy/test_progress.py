"""The progress of a fleet, as printed while it starts."""

from __future__ import annotations

import re
from pathlib import Path

from deploy.progress import ProgressReporter
from deploy.supervisor.managed_process import ProcessStateName
from tests.deploy.supervisor.supervisor_harness import SupervisorHarness, faulty_process


def test_a_process_that_has_done_its_work_counts_as_started(tmp_path: Path) -> None:
    harness = SupervisorHarness(tmp_path)
    progress = ProgressReporter(harness, tmp_path)
    supervisor = harness.supervisor(faulty_process("good", "/brief"), faulty_process("good", "/lasting"))
    states: dict[str, ProcessStateName] = {"brief": "finished", "lasting": "ready"}
    for name, state in states.items():
        process = supervisor.processes[name]
        process.state = state
        progress.on_state_change(process, supervisor.state())
    harness.reaper.close()
    (line,) = harness.notes
    assert re.fullmatch(r"all 2 processes ready or finished after \d+\.\d s", line)

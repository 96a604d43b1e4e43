"""Time begins with the whole fleet, in both modes: late nodes, missing nodes, and refused changes."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import pytest

from tests.harness.command_line import CommandLine, CommandResult

LATE = """
import sys, time
from typing import Annotated
from msgspec import Meta
from services.runtime import Parameters, Service, main

class Late(Parameters):
    speed: Annotated[float, Meta(ge=0, le=1)] = 0.5

def run(ctx):
    for tick in ctx.ticks():
        if ctx.params_changed:
            ctx.log.info(f"tick at {tick.time / 1e9:.3f} s")

if __name__ == "__main__":
    if "--connect" in sys.argv:
        time.sleep(2)
    main(Service(name="late", about="Late.", run=run, rate=25, parameters=Late))
"""
STUCK = """
from services.runtime import Service, main

def run(ctx):
    while True:
        ctx.idle()

if __name__ == "__main__":
    main(Service(name="stuck", about="Never ready.", run=run, rate=25))
"""
FLEET = """
name = "begin"
[run]
mode = "{mode}"
ends = "duration"
factor = {factor}
duration = 0.8
[[robot]]
name = "r"
model = "burger"
services = [{service}]
[[service]]
kind = "sim"
parameters = {{ start_timeout = {timeout} }}
"""
CHANGES = """
[[change]]
at = 0
set = "/r/late"
values = { speed = 0.25 }
[[change]]
at = 0.5
set = "/r/base"
values = { keep_curvature = true, "linear.max_jerk" = 1.0 }
[[change]]
at = 60
set = "/r/late"
values = { speed = 0.75 }
"""


class Run:
    """A running fleet, in parallel with the others of this file."""

    def __init__(
        self, folder: Path, mode: str, service: str, timeout: float, *, more: str = "", factor: float = 1.0
    ) -> None:
        folder.mkdir()
        (folder / "late.py").write_text(LATE)
        (folder / "stuck.py").write_text(STUCK)
        fleet = folder / "fleet.toml"
        fleet.write_text(FLEET.format(mode=mode, service=service, timeout=timeout, factor=factor) + more)
        self._folder, self._terminal = folder, CommandLine(folder)
        self._up = self._terminal.start_fleet(fleet, folder / "run", "--no-saved")

    def kill(self) -> None:
        """Kill it if no test has waited for its end."""
        if self._up.poll() is None:
            self._up.kill()
            self._up.communicate()

    def end(self) -> tuple[CommandResult, dict[str, Any], str]:
        """Wait for its end; return its result, its report ({} if nothing was measured), and its processes' logs."""
        ended = self._terminal.finish(self._up)
        logs = "".join(each.read_text() for each in sorted((self._folder / "run" / "logs").glob("*.log")))
        report = self._folder / "run" / "report.json"
        return ended, json.loads(report.read_text()) if report.exists() else {}, logs


MODES = ("real", "lockstep")


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Mapping[str, Run]]:
    """All runs in parallel, as each mostly waits."""
    folder = tmp_path_factory.mktemp("start")
    late, stuck = '{ kind = "late.py" }', '{ kind = "stuck.py" }'
    required = '{ kind = "stuck.py", required = true }'
    begun = {
        **{f"stuck {mode}": Run(folder / f"stuck_{mode}", mode, stuck, 12) for mode in MODES},
        **{f"late {mode}": Run(folder / f"late_{mode}", mode, late, 60, more=CHANGES, factor=0.1) for mode in MODES},
        "required": Run(folder / "required", "real", required, 1),
    }
    yield begun
    for each in begun.values():
        each.kill()


def test_time_begins_when_the_last_node_is_ready_and_a_change_that_is_refused_fails_the_run(
    runs: Mapping[str, Run],
) -> None:
    for mode in MODES:
        ended, report, logs = runs[f"late {mode}"].end()
        first = float(logs.partition("/late: tick at ")[2].partition(" ")[0])
        # Real time doesn't wait for a node that a busy machine holds up; half a second is 5 s on its clock.
        assert first == 0 if mode == "lockstep" else first < 0.5, logs
        made, refused, later = report["changes"]
        assert (made["made"], made["reason"], made["values"]) == (True, "", {"speed": 0.25})
        assert made["made_at_s"] < 0.5, "the set was known when time began"
        assert refused["made"] is False
        assert "keep_curvature" in refused["reason"]
        assert (later["made"], later["made_at_s"]) == (None, None)
        assert ended.status == 1, "a change was not made"
        assert report["run"]["changes_missed"] == 1
        assert [each["name"] for each in report["checks"] if not each["ok"]] == ["changes_missed"]
        assert "the change of /r/base scheduled at 0.5 s was not made: " in ended.err
        assert "missed: changes_missed is 1, should be at most 0\n  the change of /r/base at 0.5 s" in ended.out
        assert refused["reason"] in ended.out
        assert "not reached before the end: the scheduled changes of /r/late at 60 s" in ended.out


def test_without_a_required_node_time_does_not_begin(runs: Mapping[str, Run]) -> None:
    ended, report, logs = runs["required"].end()
    assert ended.status == 1
    assert "the fleet ended: sim failed: exit status 2" in ended.err
    (why,) = (line for line in ended.err.splitlines() if "time does not start: " in line)
    assert "/r/stuck is not ready" in why
    # On a busy machine the simulation may give up before the grader has started; then there is no report.
    assert not report or report["run"]["sim_seconds"] == 0, logs


def test_without_another_node_it_begins_and_the_report_misses_it(runs: Mapping[str, Run]) -> None:
    for mode in MODES:
        ended, report, _ = runs[f"stuck {mode}"].end()
        assert ended.status == 1
        assert "time has not begun: waiting for /r/stuck for" in ended.err
        assert "time began without /r/stuck" in ended.err
        assert (report["run"]["absent"], report["run"]["nodes_absent"]) == (["/r/stuck"], 1)
        assert [each["name"] for each in report["checks"] if not each["ok"]] == ["nodes_absent"]
        assert "  time began without /r/stuck" in ended.out
        assert report["run"]["sim_seconds"] == 0.8, "it took place all the same"

"""Faulty ROS 1 programs: the mistake is reported with file and line, and the fleet continues."""

from __future__ import annotations

import json
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from tests.harness.background_fleet import background_fleet
from tests.harness.cases import case
from tests.harness.command_line import CommandLine
from tests.ros1.script_fleets import HERE

BAD = HERE / "scripts/bad"
TOLD = {
    "syntax": ('syntax.py", line 5', "expected ':'"),
    "unknown_import": ("unknown_import.py:3", "moveit_commander"),
    "unknown_package": ("unknown_package.py:3", "robot_we_do_not_have_msgs"),
    "unknown_message": ('unknown_message.py", line 3', "Twits"),
    "wrong_field": ('wrong_field.py", line', "field linear.x must be float type"),
    "free_threads": ("free_threads.py", "the main thread fails"),
}
SECONDS = {"lockstep": 6, "real": 12}
"""Simulation time by mode. The robot needs half of the shorter one; in real time it also has to wait for a controller
that waits for a processor.
"""
FLEET = """
name = "bad"
[run]
mode = "{mode}"
ends = "duration"
duration = {seconds}
[[robot]]
name = "tb3_0"
model = "burger"
services = [{{ kind = "waypoint", parameters = {{ goals = [[0.5, 0.0]] }} }}]
[[service]]
kind = "{bad}/endless_callback.py"
[[service]]
kind = "{bad}/free_threads.py"
restart = "never"
[[service]]
kind = "{bad}/exits.py"
restart = "never"
[[service]]
kind = "{bad}/chatty.py"
"""


def test_what_is_wrong_is_told_with_file_and_line_and_the_robot_goes_on(tmp_path: Path) -> None:
    with background_fleet(tmp_path) as fleet:
        started = {name: fleet.command_line.start("run", str(BAD / f"{name}.py")) for name in TOLD}
        for name, told in TOLD.items():
            with case(name):
                ended = fleet.command_line.finish(started[name])
                assert ended.status in (1, 2), ended
                for each in told:
                    assert each in ended.err
        assert fleet.run_json("topic", "echo", "/tb3_1/odom", "--once")["header"]["frame_id"] == "tb3_1/odom"


@pytest.mark.timeout(420)
def test_programs_that_hang_exit_or_print_without_end_do_not_stop_a_fleet(tmp_path: Path) -> None:
    for mode, seconds in SECONDS.items():
        (tmp_path / mode).mkdir()
        (tmp_path / mode / "bad.toml").write_text(FLEET.format(mode=mode, seconds=seconds, bad=BAD))
    terminals = [CommandLine(tmp_path / mode) for mode in SECONDS]
    with ThreadPoolExecutor() as pool:
        runs = pool.map(lambda each: each.run_fleet("bad.toml", each.folder / "results", "--json"), terminals)
    for terminal, ended in zip(terminals, runs, strict=True):
        with case(terminal.folder.name):
            report = json.loads(ended.out)
            assert report["robots"]["tb3_0"]["points_reached"] == 1
            logs = terminal.folder / "results" / "logs"
            assert "main goes on" in (logs / "endless_callback.log").read_text()
            assert "status 7" in (logs / "exits.log").read_text() + ended.err
            assert (logs / "chatty.log").read_text().count("x" * 1000) == 3000

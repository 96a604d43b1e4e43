"""The exercise of the page on ROS 1 programs runs unchanged, and its bounds grade the script."""

from __future__ import annotations

import json
from pathlib import Path

from tests.docs.readme import DOCS, blocks
from tests.harness.command_line import CommandLine


def test_a_students_script_is_graded_by_the_fleet_of_the_page(tmp_path: Path) -> None:
    page = (DOCS / "ros1.md").read_text()
    [script] = blocks("python", page)
    [fleet] = blocks("toml", page)
    (tmp_path / "exercise.toml").write_text(fleet)
    for name, text, status in (("whole", script, 0), ("half", script.replace("range(50)", "range(25)"), 1)):
        (tmp_path / "their_script.py").write_text(text)
        ended = CommandLine(tmp_path).run_fleet(tmp_path / "exercise.toml", tmp_path / name, "--json")
        assert ended.status == status, ended.err
        report = json.loads(ended.out)
        assert [each["name"] for each in report["checks"] if not each["ok"]] == (
            [] if status == 0 else ["turtlebot3.path_length_m"]
        )

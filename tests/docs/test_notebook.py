"""The notebook runs cell by cell on a fleet, as its first cell describes."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

from services.runtime.process import ROOT
from tests.harness.command_line import CommandLine

NOTEBOOK = ROOT / "docs/notebook.ipynb"
EXECUTE = """
import json, sys
import matplotlib
matplotlib.use("Agg")
import matplotlib.pyplot as plt
shown = 0
def show():
    global shown
    axes = plt.gca()
    assert axes.lines and all(len(each.get_xdata()) > 10 for each in axes.lines), axes.lines
    shown += 1
    plt.close("all")
plt.show = show
names = {}
for number, source in enumerate(json.load(sys.stdin)):
    exec(compile(source, f"cell {number}", "exec"), names)
error = names["figures"].odometry_error_max_m
drive = names["figures"].path_length_m
sent = names["commands"]["time"]
print(json.dumps({
    "shown": shown, "path": drive, "error": error, "stepped": names["after"] - names["before"],
    "driven": float(sent[-1] - sent[0]),
}))
"""
"""Runs the cells in one namespace and inspects each plot."""


def test_it_drives_a_robot_and_plots_its_run(tmp_path: Path) -> None:
    terminal = CommandLine(tmp_path)
    cells = json.loads(NOTEBOOK.read_text())["cells"]
    assert "./elea up turtlebot3 --set world=arena --record --detach" in "".join(cells[0]["source"])
    command = ["up", "turtlebot3", "--set", "world=arena", "--record", "--detach", "--report", "run"]
    started = terminal.run(
        *command, "--factor", "2", "--no-view", "--no-picture", "--no-saved", "--port", str(terminal.port)
    )
    assert started.status == 0, started.err
    try:
        done = subprocess.run(
            [sys.executable, "-P", "-c", EXECUTE],
            input=json.dumps(["".join(each["source"]) for each in cells if each["cell_type"] == "code"]),
            env=terminal.environment,
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 0, done.stderr
    finally:
        terminal.run("down")
    seen = json.loads(done.stdout.splitlines()[-1])
    assert seen["shown"] == 3
    assert seen["stepped"] == 200 * 5_000_000
    assert seen["driven"] > 7, "two times 4 s; on a busy machine the command that ends them is late"
    assert abs(seen["path"] - 0.2 * seen["driven"]) < 0.2, "at 0.2 m/s, less what gathering speed takes"
    assert seen["error"] > 0, "the odometry of a TurtleBot drifts"

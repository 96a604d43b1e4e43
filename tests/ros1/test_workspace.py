"""A read-only workspace of two packages outside the checkout, run by its launch file with nested includes."""

from __future__ import annotations

import json
import shutil
from functools import partial
from pathlib import Path

import pytest

from tests.harness.cases import case
from tests.harness.command_line import CommandLine
from tests.ros1.script_fleets import HERE, ScriptRun, assert_said, interrupt_when_said, side_by_side

SAID = {
    "west/monitor": ["rooms [('attic', 3), ('hall', 3), ('kitchen', 3)]", "took 0.005, tuple"],
    "tuned": ["kp 1.25 ki 0.10 x3 from launch mode 0 level 15", "kp 10.00 ki 0.10 x4 twice mode 1 level 4"],
    "tuner": [
        "before kp 1.25 ki 0.10",
        "after kp 3.50 mode 1",
        "clamped kp 10.00",
        "repeats 8 enabled True",
        "seen 1.25 to 10.00",
        "parameter 10.00",
    ],
    "count_server": ["counting"],
    "countdown_client": [
        "state 3: done",
        "updates 4, took about a second: True",
        "falling True",
        "state 4: too long",
        "state 2: preempted",
    ],
}
MEASURED = "updates 4, took about a second: True"
"""A line that holds only in lockstep: in real time, a program that has to wait for a processor sleeps for longer."""
SAID_IN_REAL_TIME = {program: [line for line in said if line != MEASURED] for program, said in SAID.items()}


def files(folder: Path) -> dict[str, int]:
    return {str(each): each.stat().st_mtime_ns for each in folder.rglob("*")}


def launch(folder: Path, package: Path, mode: str) -> ScriptRun:
    """Run a launch file, in lockstep for 8 s of simulation time, in real time until all lines are printed."""
    folder.mkdir()
    file, results, terminal = str(package / "launch/all.launch"), folder / "results", CommandLine(folder)
    ends = ("--duration", "8") if mode == "lockstep" else ()
    options = ("--mode", mode, *ends, "--report", str(results), "--no-view", "--no-picture", "--json")
    started = terminal.start("roslaunch", *options, "--port", str(terminal.port), file, "words:=a b c d e")
    if not ends:
        interrupt_when_said(started, results / "logs", SAID_IN_REAL_TIME)
    ended = terminal.finish(started)
    assert ended.status == 0, ended.out[-2000:] + ended.err[-4000:]
    return ScriptRun(json.loads(ended.out), results / "logs")


@pytest.mark.timeout(420)
def test_it_runs_as_it_lies_in_both_modes(tmp_path: Path) -> None:
    workspace = tmp_path / "somewhere"
    shutil.copytree(HERE / "workspaces/campus", workspace)
    for each in [workspace, *workspace.rglob("*")]:
        each.chmod(0o555)
    before = files(workspace)
    package = workspace / "src/campus_nodes"
    with side_by_side({mode: partial(launch, tmp_path / mode, package, mode) for mode in ("real", "lockstep")}) as runs:
        lockstep, real = runs["lockstep"].result(), runs["real"].result()
    asker = next(each for each in lockstep.processes() if each.startswith("asker"))
    assert lockstep.lines(asker)[-1] == "a b c d e -> 5"
    assert_said(lockstep, SAID)
    assert_said(real, SAID_IN_REAL_TIME)
    assert files(workspace) == before


BAD = {
    "malformed": ("<launch>\n  <node pkg='x' type='y' name='z'>\n</launch>\n", "bad.launch:3", ""),
    "loop": ("<launch>\n  <include file='$(dirname)/bad.launch'/>\n</launch>\n", "bad.launch:2", "include"),
    "substitution": ("<launch>\n\n  <param name='a' value='$(fnid x)'/>\n</launch>\n", "bad.launch:3", "fnid"),
    "argument": ("<launch>\n  <arg name='a'/>\n  <param name='b' value='$(arg c)'/>\n</launch>\n", "bad.launch", "arg"),
    "package": ("<launch>\n  <node pkg='no_such' type='y.py' name='z'/>\n</launch>\n", "bad.launch:2", "no_such"),
    "tag": ("<launch>\n  <nodes pkg='x'/>\n</launch>\n", "bad.launch:2", "nodes"),
    "machine": (
        "<launch>\n  <machine name='far' address='10.0.0.2'/>\n"
        "  <node pkg='x' type='y' name='z' machine='far'/>\n</launch>\n",
        "bad.launch:",
        "machine",
    ),
}


def test_a_bad_launch_file_is_told_with_file_and_line(tmp_path: Path) -> None:
    for name, (text, place, said) in BAD.items():
        with case(name):
            (tmp_path / "bad.launch").write_text(text)
            ended = CommandLine(tmp_path).run("roslaunch", "--print", str(tmp_path / "bad.launch"))
            assert place in ended.err + ended.out, ended
            assert said in ended.err + ended.out
            assert "Traceback" not in ended.err

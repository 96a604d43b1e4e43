"""Declarations and ``--help`` load nothing heavy: a command line answers at once."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

from services.catalog import service_kinds
from services.runtime.process import ROOT
from tests.harness.cli_commands import all_commands

PROGRAM = """
import runpy, sys
sys.argv = [sys.argv[1], *sys.argv[2:]]
try:
    runpy.run_module(sys.argv[0], run_name="__main__", alter_sys=False)
except SystemExit as end:
    status = end.code or 0
heavy = {"zenoh", "numpy", "pybullet", "rerun", "rerun_cli", "matplotlib", "psutil", "starlette", "uvicorn"}
print("status", status, *sorted(heavy & {name.partition(".")[0] for name in sys.modules}))
"""

OWN_HELP = [verb for verb in all_commands() if verb != ("test",)]
"""The help of ``test`` is pytest's."""

QUICK_S = 0.3
"""What a person waits for help and does not notice."""

COMMANDS = [
    *(("services", kind, "--help") for kind in service_kinds()),
    *(("services", kind, "--print-config") for kind in service_kinds()),
    ("deploy", "--help"),
    ("deploy", "--version"),
    *(("deploy", *verb, "--help") for verb in OWN_HELP),
]


@pytest.mark.parametrize("command", COMMANDS, ids=" ".join)
def test_help_is_light(command: tuple[str, ...]) -> None:
    ran = subprocess.run(
        [sys.executable, "-P", "-c", PROGRAM, *command],
        cwd=ROOT,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        timeout=30,
        check=False,
    )
    *said, last = ran.stdout.splitlines()
    assert last == "status 0", ran.stdout + ran.stderr
    assert said


@pytest.mark.parametrize("verb", [(), *OWN_HELP], ids=" ".join)
def test_help_comes_at_once(verb: tuple[str, ...]) -> None:
    """In processor time, which is what a person waits on a machine that is free; the best of some, since caches cool.

    It waits for nothing: neither a network nor another process.
    """
    took: list[float] = []
    while not took or (min(took) >= QUICK_S and len(took) < 5):
        took.append(_processor_time("deploy", *verb, "--help"))
    assert min(took) < QUICK_S


def _processor_time(module: str, *arguments: str) -> float:
    """Seconds of the processor that a program takes to its end, with what it starts."""
    command = [sys.executable, "-P", "-m", module, *arguments]
    started = subprocess.Popen(
        command, cwd=ROOT, env={**os.environ, "PYTHONPATH": str(ROOT)}, stdout=subprocess.DEVNULL
    )
    _, status, usage = os.wait4(started.pid, 0)
    started.returncode = os.waitstatus_to_exitcode(status)
    assert started.returncode == 0
    return usage.ru_utime + usage.ru_stime

"""Declarations and ``--help`` import nothing heavy, so that the command line answers at once."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable

import pytest

from deploy.bench.figures import Figure
from services.catalog import service_kinds
from services.runtime.process import ROOT
from tests.harness.cli_commands import all_commands

PROGRAM = """
import contextlib, io, json, runpy, sys
heavy = {"zenoh", "numpy", "pybullet", "rerun", "rerun_cli", "matplotlib", "psutil", "starlette", "uvicorn", "rich"}
for module, *arguments in json.load(sys.stdin):
    sys.argv = [module, *arguments]
    with contextlib.redirect_stdout(io.StringIO()) as out:
        try:
            runpy.run_module(module, run_name="__main__", alter_sys=False)
            status = 0
        except SystemExit as end:
            status = end.code or 0
    loaded = sorted(heavy & {name.partition(".")[0] for name in sys.modules})
    wanted = "Usage: elea " if module == "deploy" and "--help" in arguments else ""
    if status or loaded or not out.getvalue().strip() or not out.getvalue().startswith(wanted):
        sys.exit(f"{' '.join(sys.argv)}: status {status}, {len(out.getvalue())} characters, loaded {loaded}")
print("all are light")
"""
"""Prints the help of commands in turn in one process; a heavy import is reported with the first that loads it."""

OWN_HELP = [verb for verb in all_commands() if verb != ("test",)]
"""All commands except ``test``, whose help is pytest's."""

TRIES = 3

COMMANDS = [
    *(("services", kind, "--help") for kind in service_kinds()),
    *(("services", kind, "--print-config") for kind in service_kinds()),
    ("deploy", "--help"),
    ("deploy", "--version"),
    *(("deploy", *verb, "--help") for verb in OWN_HELP),
]


def test_help_is_light() -> None:
    ran = subprocess.run(
        [sys.executable, "-P", "-c", PROGRAM],
        cwd=ROOT,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        input=json.dumps(COMMANDS),
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert ran.stdout == "all are light\n", ran.stderr


@pytest.mark.bench
@pytest.mark.timeout(300)
def test_help_comes_at_once(keeps_bound: Callable[[Figure], None]) -> None:
    """Measured in processor time, the waiting time on an idle machine; the best of several, because of cold caches."""
    took = {
        " ".join(verb): min(_processor_time("deploy", *verb, "--help") for _ in range(TRIES))
        for verb in [(), *OWN_HELP]
    }
    slowest = max(took, key=took.__getitem__)
    about = f"processor time of the slowest --help, that of {slowest or 'elea'}"
    keeps_bound(Figure("help_cpu_s", "s", about, (took[slowest],), at_most=0.3))


def _processor_time(module: str, *arguments: str) -> float:
    """Return the processor time [s] of a program and its children."""
    command = [sys.executable, "-P", "-m", module, *arguments]
    started = subprocess.Popen(
        command, cwd=ROOT, env={**os.environ, "PYTHONPATH": str(ROOT)}, stdout=subprocess.DEVNULL
    )
    _, status, usage = os.wait4(started.pid, 0)
    started.returncode = os.waitstatus_to_exitcode(status)
    assert started.returncode == 0
    return usage.ru_utime + usage.ru_stime

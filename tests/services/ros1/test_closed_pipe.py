"""ROS 1 commands whose output isn't read to its end, as in ``rosmsg list | head -1``."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

from services.ros1 import command_line
from services.runtime.process import ROOT
from tests.harness.cases import case

TOOLS = Path(str(command_line.__file__)).parent
PROGRAM = """
import sys
from services.ros1.command_line import run_command
run_command(lambda: print(sys.argv[1]))
"""


def test_a_command_whose_reader_has_gone_ends_without_a_word() -> None:
    """Whether the pipe breaks during writing or at exit."""
    for size in (10, 1_000_000 // 10):
        reader, writer = os.pipe()
        os.close(reader)
        with case(f"{size} characters"):
            ended = subprocess.run(
                [sys.executable, "-P", "-c", PROGRAM, "x" * size],
                env={**os.environ, "PYTHONPATH": str(ROOT)},
                stdout=writer,
                stderr=subprocess.PIPE,
                timeout=120,
            )
            assert (ended.returncode, ended.stderr) == (0, b"")
        os.close(writer)


def test_each_command_runs_so() -> None:
    for file in TOOLS.glob("*_command.py"):
        with case(file.name):
            assert file.read_text().endswith('if __name__ == "__main__":\n    run_command(main)\n')

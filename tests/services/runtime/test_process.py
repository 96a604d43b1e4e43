"""A process ends with its parent; the processes that it starts don't."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

from services.runtime.process import PARENT, ROOT

BOUND = f"""
import os, subprocess, sys
from services.runtime.process import die_with_parent

die_with_parent()
code = "import os; from services.runtime.process import die_with_parent; die_with_parent(); print('runs')"
for words in ([sys.executable, "-c", code], ["sh", "-c", sys.executable + ' -c "' + code + '"; true']):
    print({PARENT!r} in os.environ, subprocess.run(words, capture_output=True, text=True).stdout.strip())
"""


@pytest.mark.process
def test_what_a_process_starts_is_not_bound_to_its_parent() -> None:
    """Neither directly nor through a shell: a program that a fleet runs may start others."""
    environment = {**os.environ, "PYTHONPATH": str(ROOT), PARENT: str(os.getpid())}
    done = subprocess.run(
        [sys.executable, "-P", "-c", BOUND], env=environment, capture_output=True, text=True, timeout=60, check=True
    )
    assert done.stdout.splitlines() == ["False runs"] * 2


@pytest.mark.process
def test_one_whose_parent_has_gone_ends_at_once() -> None:
    environment = {**os.environ, "PYTHONPATH": str(ROOT), PARENT: str(os.getppid())}
    done = subprocess.run([sys.executable, "-P", "-c", BOUND], env=environment, capture_output=True, timeout=60)
    assert (done.returncode, done.stdout) == (70, b"")

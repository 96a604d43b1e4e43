"""The reaper outlives its supervisor briefly: it kills the process groups that a dead supervisor left behind.

PR_SET_PDEATHSIG reaches the children of a killed supervisor, but not their children; the end of this pipe reaches this
process however the supervisor died. It is run as a script: it must start fast and imports nothing of the project.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Iterable
from contextlib import suppress


def read_orders(orders: Iterable[str]) -> set[int]:
    """Follow ``+GROUP`` and ``-GROUP`` lines to the end of the input; return the groups that are left."""
    groups: set[int] = set()
    for line in orders:
        sign, group = line[0], int(line[1:])
        (groups.add if sign == "+" else groups.discard)(group)
    return groups


class Reaper:
    """The supervisor's end of the pipe."""

    def __init__(self) -> None:
        self._process = subprocess.Popen(
            [sys.executable, "-I", "-S", __file__], stdin=subprocess.PIPE, start_new_session=True, text=True, bufsize=1
        )

    def watch(self, group: int) -> None:
        """Have this process group killed when the supervisor is gone."""
        self._send(f"+{group}\n")

    def forget(self, group: int) -> None:
        """Remove a process group that has ended; its number may soon be reused."""
        self._send(f"-{group}\n")

    def close(self) -> None:
        """Close the pipe, so that the reaper ends."""
        assert self._process.stdin is not None
        with suppress(BrokenPipeError):
            self._process.stdin.close()
        self._process.wait()

    def _send(self, order: str) -> None:
        assert self._process.stdin is not None
        try:
            self._process.stdin.write(order)
        except BrokenPipeError:
            sys.stderr.write("the reaper has died: grandchildren may outlive a killed supervisor\n")


if __name__ == "__main__":
    for left in read_orders(sys.stdin):
        try:
            os.killpg(left, signal.SIGKILL)
        except ProcessLookupError:
            continue

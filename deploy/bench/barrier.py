"""A bare barrier, the minimum cost of lockstep: plain Zenoh sessions that only step in time with a loop."""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path

import zenoh

from deploy.bench.peer import RAW_GRANT, RAW_REPORT, raw_session
from services.runtime.transport.unix_sockets import router_in

_GRANT = bytes(64)
"""Size [bytes] of a step grant with a few numbers."""
_BEGIN_S = 20.0
"""Wall time [s] for all members to subscribe."""
_SETTLE_S = 1.0
"""Wall time [s] for the links of a new session, which is visible before they are complete."""


class RawBarrier:
    """A barrier; each member is given by the number of physics steps between two of its own."""

    def __init__(self, session: zenoh.Session, strides: Sequence[int]) -> None:
        block = zenoh.CongestionControl.BLOCK
        self._strides = strides
        self._grants = [
            session.declare_publisher(f"{RAW_GRANT}/{number}", congestion_control=block)
            for number in range(len(strides))
        ]
        self._reports = session.declare_subscriber(f"{RAW_REPORT}/*", zenoh.handlers.RingChannel(1024))
        self._pending: set[int] = set()

    def begin(self) -> None:
        """Block until all members have subscribed; raises TimeoutError."""
        deadline = time.monotonic() + _BEGIN_S
        while not all(getattr(each.matching_status, "matching", False) for each in self._grants):
            if time.monotonic() > deadline:
                raise TimeoutError(f"not all members of a bare barrier subscribed within {_BEGIN_S:g} s")
            time.sleep(0.02)
        time.sleep(_SETTLE_S)

    def hold(self, step: int) -> None:
        """Wait for the members due at this step, and let them continue."""
        due = [number for number, stride in enumerate(self._strides) if step % stride == 0]
        while not self._pending.isdisjoint(due):
            self._recv_report()
        for number in due:
            self._grants[number].put(_GRANT)
            self._pending.add(number)

    def finish(self) -> None:
        """Wait for all members."""
        while self._pending:
            self._recv_report()

    def end(self) -> None:
        """Stop the members."""
        for each in self._grants:
            each.put(b"")

    def _recv_report(self) -> None:
        self._pending.discard(int(str(self._reports.recv().key_expr).rpartition("/")[2]))


@contextmanager
def raw_barrier(strides: Sequence[int]) -> Iterator[RawBarrier]:
    """Start a router and a process for each member; yield this side of the barrier."""
    with tempfile.TemporaryDirectory() as folder:
        yield from _run_barrier(strides, router_in(Path(folder)))


def _run_barrier(strides: Sequence[int], endpoint: str) -> Iterator[RawBarrier]:
    module = [sys.executable, "-P", "-m"]
    commands = [[*module, "services", "router", "--param", f"listen={endpoint}"]]
    commands += [[*module, "deploy.bench.peer", "member", endpoint, str(number)] for number in range(len(strides))]
    with ExitStack() as stack:
        for command in commands:
            quiet = subprocess.DEVNULL
            stack.enter_context(killed_at_exit(subprocess.Popen(command, stdout=quiet, stderr=quiet)))
        made = RawBarrier(stack.enter_context(raw_session(endpoint)), strides)
        made.begin()
        yield made
        made.end()


@contextmanager
def killed_at_exit(process: subprocess.Popen[bytes]) -> Iterator[None]:
    """Kill a process at the end."""
    try:
        yield
    finally:
        process.kill()
        process.wait()

"""Real processes for tests: each logs to a file and is ended by the test that started it."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Self

from messages.names import Identity
from services.runtime.log import Log
from services.runtime.node import Node
from services.runtime.process import PARENT, ROOT
from services.runtime.transport.unix_sockets import check_reachable, router_endpoint
from services.runtime.transport.zenoh import ZenohTransport
from services.runtime.transport.zenoh_config import configuration
from tests.harness.fork_children import is_forkable
from tests.harness.fork_server import ForkedProcess
from tests.harness.ports import free_port
from tests.harness.waiting import wait_until

STOP_S = 60.0
"""Wall time for a process to end on SIGINT before it is killed."""
ROUTER_S = 60.0
"""Wall time for a router to start on a busy machine."""


class Process:
    """A running program under the project's Python, with output and errors in ``log``. It dies with the test process.

    ``through`` is a command prefix that executes it, for example ``ip netns exec NAME``.

    ``with`` stops it at the end. ``wait``, ``stop`` and ``kill`` return the exit status, -N for signal N.
    """

    def __init__(
        self,
        arguments: Sequence[str],
        log: Path,
        env: Mapping[str, str] | None = None,
        through: Sequence[str] = (),
    ) -> None:
        environment = {**os.environ, "PYTHONPATH": str(ROOT), PARENT: str(os.getpid()), **(env or {})}
        self.log = log
        with log.open("ab") as out:
            if not through and arguments[:1] == ["-m"] and is_forkable(arguments[1]):
                self._child = ForkedProcess(arguments[1], arguments[2:], log.parent, environment, out, True)
                self.pid = self._child.pid
                return
            self._child = subprocess.Popen(
                [*through, sys.executable, "-P", *arguments],
                stdin=subprocess.DEVNULL,
                stdout=out,
                stderr=subprocess.STDOUT,
                cwd=log.parent,
                env=environment,
                start_new_session=True,
            )
        self.pid = self._child.pid

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exception: object) -> None:
        self.stop()

    @property
    def text(self) -> str:
        """Its output so far."""
        return self.log.read_text(errors="replace")

    @property
    def status(self) -> int | None:
        """The exit status, None while it runs."""
        return self._child.poll()

    def signal(self, number: signal.Signals) -> None:
        """Send a signal; no effect after its end."""
        self._child.send_signal(number)

    def wait(self, within: float = STOP_S) -> int:
        """Wait until it ends by itself; fail after ``within`` [s]."""
        try:
            return self._child.wait(within)
        except subprocess.TimeoutExpired:
            raise AssertionError(f"process {self.pid} still runs after {within} s:\n{self.text}") from None

    def stop(self) -> int:
        """End it with SIGINT, or with SIGKILL after STOP_S; resume it first if it is stopped."""
        self.signal(signal.SIGCONT)
        self.signal(signal.SIGINT)
        try:
            return self._child.wait(STOP_S)
        except subprocess.TimeoutExpired:
            return self.kill()

    def kill(self) -> int:
        """End it with SIGKILL."""
        self._child.kill()
        return self._child.wait(STOP_S)


def parameter_options(values: Mapping[str, object]) -> list[str]:
    """Return a service's options for these parameter values, which are written as JSON."""
    return [word for name, value in values.items() for word in ("--param", f"{name}={json.dumps(value)}")]


def start_service(name: str, *arguments: str, logs: Path, env: Mapping[str, str] | None = None) -> Process:
    """Start ``python -P -m services NAME ARGUMENTS`` with its log in the folder ``logs``."""
    return Process(["-m", "services", name, *arguments], _unused(logs, name), env)


class Network:
    """A router on a port of its own and the processes started on it; ``with`` ends them all."""

    def __init__(self, logs: Path) -> None:
        self.port = free_port()
        self.endpoint = router_endpoint(self.port)
        self._logs = logs
        self._stack = ExitStack()

    def __enter__(self) -> Self:
        self.router = start_service("router", "--param", f"listen={self.endpoint}", logs=self._logs)
        self._stack.enter_context(self.router)
        wait_until(self._listens, ROUTER_S, f"a router on {self.endpoint}")
        # The router lists the nodes for new ones only after it logs this; earlier ones would spend time scouting.
        wait_until(lambda: "listening on" in self.router.text, ROUTER_S, "a router that answers")
        return self

    def __exit__(self, *exception: object) -> None:
        self._stack.close()

    def start(self, name: str, *arguments: str, env: Mapping[str, str] | None = None) -> Process:
        """Start a service of the project on this network."""
        process = start_service(name, "--connect", self.endpoint, *arguments, logs=self._logs, env=env)
        return self._stack.enter_context(process)

    def run(self, file: Path, *arguments: str) -> Process:
        """Run a user's Python file on this network, as ``./elea run FILE`` does."""
        command = ["-m", "deploy", "run", str(file), "--connect", self.endpoint, *arguments]
        return self._stack.enter_context(Process(command, _unused(self._logs, file.stem)))

    @contextmanager
    def node(self, name: str = "tester", domain: str = "") -> Iterator[Node]:
        """Run a node in the test process; ``node.subscribe(TOPIC, "/name")`` returns a Subscriber to read."""
        identity = Identity.of(name)
        with (
            ZenohTransport(configuration("direct", (self.endpoint,), domain=domain)) as transport,
            Node(transport, identity, "tester", Log(identity.node)) as node,
        ):
            yield node

    def _listens(self) -> bool:
        assert self.router.status is None, self.router.text
        try:
            check_reachable(self.endpoint)
        except OSError:
            return False
        return True


def _unused(logs: Path, name: str) -> Path:
    """Return a log file not used yet: ``NAME-0.log``, ``NAME-1.log``, …"""
    return logs / f"{name}-{len(list(logs.glob(f'{name}-*.log')))}.log"

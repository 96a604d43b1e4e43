"""A fleet under the real supervisor, faults for its processes, and an observer on its network."""

from __future__ import annotations

import signal
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Self

import psutil

from messages.elea import ProcessState
from messages.geometry import Twist
from messages.names import Identity
from messages.std import String
from services.runtime.log import Log
from services.runtime.node import Node
from services.runtime.publisher import Publisher
from services.runtime.transport.unix_sockets import router_endpoint
from services.runtime.transport.zenoh import ZenohTransport
from services.runtime.transport.zenoh_config import Role, configuration
from tests.faults.fleet_recorder import FleetRecorder
from tests.faults.services.faulty_controller import FAULT
from tests.faults.services.faulty_controller import FULL_SPEED as FORWARD
from tests.harness.ports import free_port
from tests.harness.processes import Process
from tests.harness.robot_recorder import FULL_SPEED, RobotRecorder
from tests.harness.stopping import stop_process
from tests.harness.waiting import wait_until

START_S = 120.0
"""Wall time for a fleet to start on a busy machine."""
WITHIN_S = 60.0
"""Wall time limit for what takes one or two seconds on an idle machine."""
FORKER_S = 5.0
"""Wall time within which a supervisor's forking process ends after it."""


class SupervisedFleet:
    """Runs ``up`` with the test's fleet file; ``with`` ends it and asserts that no process is left.

    A fleet that ends by itself at once may be gone before a node joins it: it is not ``observed`` by one.
    """

    def __init__(self, description: str, robots: int, folder: Path, port: int = 0, observed: bool = True) -> None:
        self.port = port or free_port()
        self.endpoint = router_endpoint(self.port)
        self.folder = folder
        self._description, self._observed = description, observed
        self._robots = [f"tb3_{number}" for number in range(robots)]
        self._stack = ExitStack()
        self.descendants: set[psutil.Process] = set()

    def __enter__(self) -> Self:
        self.folder.mkdir(parents=True, exist_ok=True)
        file = self.folder / "fleet.toml"
        file.write_text(self._description)
        command = ["-m", "tests.faults.up_with_faults", "up", str(file), "--report", str(self.folder / "run")]
        command += ["--port", str(self.port), "--no-view", "--no-picture"]
        environment = {"XDG_STATE_HOME": str(self.folder.parent / "state")}
        self._stack.callback(self._assert_no_survivors)
        self.supervisor = self._stack.enter_context(Process(command, self.folder / "up.log", environment))
        self._stack.callback(self.note_descendants)
        if self._observed:
            node = self._stack.enter_context(self.node(f"observer_{self.folder.name}"))
            self.recorder = FleetRecorder(node, self._robots)
        return self

    def __exit__(self, *exception: object) -> None:
        self._stack.close()

    @contextmanager
    def node(self, name: str, role: Role = "direct") -> Iterator[Node]:
        """Run a node of the test on the fleet's network."""
        identity = Identity.of(name)
        with (
            ZenohTransport(configuration(role, (self.endpoint,))) as transport,
            Node(transport, identity, "tester", Log(identity.node)) as node,
        ):
            yield node

    def robot(self, name: str) -> RobotRecorder:
        """Return a robot's recorder."""
        return self.recorder.robots[name]

    def process(self, name: str) -> ProcessState:
        """Return a process's state as published by the supervisor."""
        return self.recorder.processes.get(name, ProcessState(name=name))

    def log(self, name: str) -> str:
        """Return a process's log, across all restarts."""
        file = self.folder / "run" / "logs" / f"{name.replace('/', '.')}.log"
        return file.read_text(errors="replace") if file.exists() else ""

    def wait(self, probe: Callable[[], object], what: str, within: float = WITHIN_S) -> None:
        """Poll the fleet until a condition holds."""

        def look() -> object:
            self.recorder.poll()
            assert self.supervisor.status is None, f"the supervisor has ended:\n{self.supervisor.text}"
            return probe()

        wait_until(look, within, what)

    def wait_ready(self, *names: str, within: float = WITHIN_S) -> None:
        """Wait until the supervisor reports these processes, by default all, as ready."""

        def ready() -> bool:
            known = self.recorder.processes
            return bool(known) and all(known[name].state == "ready" for name in names or known)

        self.wait(ready, f"ready: {', '.join(names) or 'all'}", within)
        self.note_descendants()

    def wait_full_speed(self, *robots: str) -> None:
        """Wait until these robots drive at full speed."""
        self.wait(lambda: all(self.robot(each).speed > FULL_SPEED for each in robots), f"{robots} at full speed")

    def wait_simulated(self, seconds: float, robot: str = "tb3_0") -> None:
        """Wait until simulation time has advanced by ``seconds``."""
        self.recorder.poll()
        track = self.robot(robot)
        end = track.samples[-1].time + seconds * 1e9
        self.wait(lambda: track.samples[-1].time >= end, f"{seconds} s of simulation time")

    def wait_restarted(self, before: ProcessState, within: float = WITHIN_S) -> int:
        """Wait until a restarted process is ready; return when [ns] the supervisor reported its start."""

        def ready() -> bool:
            now = self.process(before.name)
            return now.state == "ready" and now.pid != before.pid and now.restarts == before.restarts + 1

        self.wait(ready, f"{before.name} ready again", within)
        self.note_descendants()
        return self.recorder.started_ns[self.process(before.name).pid]

    def drive(self, commands: Publisher[Twist], probe: Callable[[], object], what: str) -> None:
        """Publish full-speed commands until a condition holds."""

        def step() -> object:
            commands.publish(FORWARD)
            return probe()

        self.wait(step, what)

    def send_signal(self, name: str, number: signal.Signals) -> int:
        """Signal a process; return the time, as ``send_signal`` does."""
        return send_signal(self.process(name).pid, number)

    def kill(self, name: str) -> int:
        """Kill a process with SIGKILL; return the time [ns]."""
        return self.send_signal(name, signal.SIGKILL)

    def trigger_fault(self, name: str) -> None:
        """Make a faulty service fail."""
        told = self.recorder.node.advertise(FAULT, f"/{name}/fault")
        self.wait(lambda: told.has_subscribers, f"/{name} to listen")
        told.publish(String(data="now"))

    def note_descendants(self) -> set[psutil.Process]:
        """Record and return all processes of the fleet so far; none may outlive it."""
        try:
            top = psutil.Process(self.supervisor.pid)
            self.descendants |= {top, *top.children(recursive=True)}
        except psutil.NoSuchProcess:
            pass
        return self.descendants

    def survivors(self) -> list[psutil.Process]:
        """Return the processes that still run; a zombie has ended."""
        return [each for each in self.descendants if _runs(each)]

    def _assert_no_survivors(self) -> None:
        """Assert that no process is left; the forking process, killed as the supervisor ends, may need a moment."""
        with suppress(AssertionError):
            wait_until(lambda: not self.survivors(), FORKER_S)
        left = self.survivors()
        for each in left:
            each.kill()
        assert left == [], f"{left}\n{self.supervisor.text}"


def send_signal(pid: int, number: signal.Signals) -> int:
    """Signal a process; return the time [ns, machine's clock] after which it has stopped or, with SIGCONT, may run."""
    before = time.time_ns()
    if number is signal.SIGSTOP:
        stop_process(pid)
    else:
        psutil.Process(pid).send_signal(number)
    return before if number is signal.SIGCONT else time.time_ns()


def _runs(process: psutil.Process) -> bool:
    try:
        return process.is_running() and process.status() != psutil.STATUS_ZOMBIE
    except psutil.NoSuchProcess:
        return False

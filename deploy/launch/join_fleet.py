"""Runs the nodes of a launch file alongside a running fleet, like a second roslaunch that joins the same master."""

from __future__ import annotations

import json
import os
import random
import select
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

from msgspec.structs import replace

from deploy import INTERRUPTED
from deploy.fleet import Fleet, RobotConfig
from deploy.processes import ProcessSpec, plan_processes
from deploy.restart_policy import Failed, Finished, Restart, decide_after_exit
from deploy.rosparam import DESCRIPTION, fleet_parameter_tree
from deploy.rosparam_tree import leaves
from deploy.service_parameters import BUILTIN_SERVICES, RunOptions
from messages.names import key as key_of
from services.runtime.errors import EleaError
from services.runtime.fleet_instances import FleetInstance
from services.runtime.network_address import NetworkAddress, fleet_router
from services.runtime.process import PARENT, ROOT
from services.sim.robot_names import robot_namespace

ROSCORE = "roscore"
"""The fleet of ``roscore``; it is replaced by a launch file that starts a world."""

STOP_S = 5.0
"""Wall time that a process has to exit after each signal."""
_POLL_S = 0.1
_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
_CALL_S = 5.0
_SINGLE = ("logger", "panel", "recorder", "state", *BUILTIN_SERVICES)
"""Services that only the running fleet provides; the simulation publishes its robots' states."""


@dataclass
class _ManagedProcess:
    """One process, its restarts, and the time of its next start."""

    spec: ProcessSpec
    popen: subprocess.Popen[bytes] | None = None
    restarts: list[float] = field(default_factory=list)
    due: float = 0.0
    done: bool = False


def join_fleet(fleet: Fleet, running: FleetInstance) -> int:
    """Spawn the robots, set the parameters and run the services of a fleet in the ``running`` one.

    Returns the exit status once all have ended, or after Ctrl-C.
    """
    address = NetworkAddress(fleet_router(running), running.domain)
    sys.stderr.write(f"joining the fleet {running.fleet}\n")
    _set_parameters(fleet, address)
    for robot in fleet.robot:
        _spawn(robot, fleet, address, alone=not _models(address))
    run = replace(fleet.run, port=running.port, mode="real")
    with tempfile.TemporaryDirectory(prefix="elea-launch-") as folder:
        options = RunOptions(folder=Path(folder), domain=running.domain)
        plan = plan_processes(replace(fleet, run=run, robot=()), options)
        return Programs([_joined(each, address) for each in plan if each.kind not in _SINGLE]).run()


def stop_fleet(running: FleetInstance) -> None:
    """Stop a fleet that is replaced, and wait for its end; raises EleaError."""
    sys.stderr.write(f"stopping the fleet {running.fleet}, which this launch file replaces\n")
    try:
        handle = os.pidfd_open(running.pid)
    except ProcessLookupError:
        return  # it has just ended by itself
    try:
        with suppress(ProcessLookupError):
            signal.pidfd_send_signal(handle, signal.SIGINT)
        if not select.select([handle], [], [], 60.0)[0]:
            raise EleaError(f"the fleet {running.fleet} does not stop: end it with ./elea down")
    finally:
        os.close(handle)


def _models(address: NetworkAddress) -> int:
    """Return the number of models in the running simulation."""
    from messages.requests import LIST
    from messages.std import Empty
    from services.runtime.light_node import open_transport
    from services.runtime.requests import call

    with open_transport(address.router, address.domain) as transport:
        return len(call(transport, LIST, key_of(LIST.name), Empty(), _CALL_S).models)


def _elea(*words: str) -> int:
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    return subprocess.run([sys.executable, "-P", "-m", "deploy", *words], env=environment, check=False).returncode


def _set_parameters(fleet: Fleet, address: NetworkAddress) -> None:
    tree = fleet_parameter_tree(fleet)
    stated = DESCRIPTION in fleet.rosparam or any(robot_namespace(each) == "/" for each in fleet.robot)
    if DESCRIPTION in tree and not stated and _models(address):
        del tree[DESCRIPTION]  # that of the running robots stays
    if not tree:
        return
    from messages.requests import ROSPARAM_SET
    from messages.rosparam import RosparamSet
    from services.runtime.light_node import open_transport
    from services.runtime.requests import call

    with open_transport(address.router, address.domain) as transport:
        for key, value in leaves(tree):
            message = RosparamSet(key=key, value=json.dumps(value))
            call(transport, ROSPARAM_SET, key_of(ROSPARAM_SET.name), message, _CALL_S)


def _spawn(robot: RobotConfig, fleet: Fleet, address: NetworkAddress, alone: bool) -> None:
    """Spawn a robot; only if it is ``alone``, its frames may have no prefix."""
    words = [robot.model, robot.name, "--connect", address.router, "--namespace", robot.namespace or f"/{robot.name}"]
    words += ["--domain", address.domain] if address.domain else []
    if robot.frame_prefix or (robot.frame_prefix == "" and alone):
        words += ["--frame-prefix", robot.frame_prefix]
    for axis, option in (("x", "-x"), ("y", "-y"), ("z", "-z"), ("yaw", "-Y")):
        words += [option, f"{getattr(robot.pose, axis)}"] if getattr(robot.pose, axis) else []
    for name, position in robot.joints.items():
        words += ["-J", f"{name}={position}"]
    for name, value in robot.parameters.items():
        words += ["--param", f"{name}={json.dumps(value)}"]
    for folder in fleet.run.packages:
        words += ["--package", folder]
    if _elea("sim", "spawn", *words) != 0:
        raise EleaError(f"the robot {robot.name} was not spawned")


def _joined(spec: ProcessSpec, address: NetworkAddress) -> ProcessSpec:
    """Return a process that connects to the running fleet's router instead of its own fleet's."""
    argv = list(spec.argv)
    if "--connect" in argv:
        index = argv.index("--connect")
        argv[index + 1] = address.router
    return replace(spec, argv=tuple(argv))


class Programs:
    """Programs that run until all have ended, a required one has, or a signal arrives."""

    def __init__(self, specs: Sequence[ProcessSpec]) -> None:
        self._processes = [_ManagedProcess(each) for each in specs]
        self._rng = random.Random(0)
        self._status = 0
        self._interrupted = False

    def run(self) -> int:
        """Run them; return the exit status: 1 if one has failed, 130 for an interrupt."""
        for number in _SIGNALS:
            signal.signal(number, self._interrupt)  # also if the shell made the process ignore it
        try:
            while not self._interrupted and any(not each.done for each in self._processes):
                if any(self._update(each) for each in self._processes if not each.done):
                    break
                time.sleep(_POLL_S)
        finally:
            _stop([each.popen for each in self._processes if each.popen is not None])
            for number in _SIGNALS:
                signal.signal(number, signal.default_int_handler)
        return INTERRUPTED if self._interrupted else self._status

    def _interrupt(self, number: int, frame: object) -> None:
        """Note a signal; an exception could lose a program that is just being started."""
        self._interrupted = True

    def _update(self, process: _ManagedProcess) -> bool:
        """Start a program, or handle its end; return whether all others must end with it."""
        now, name = time.monotonic(), process.spec.name
        if process.popen is None:
            process.popen = _start(process.spec) if now >= process.due else None
            return False
        if (status := process.popen.poll()) is None:
            return False
        process.popen = None
        match decide_after_exit(process.spec.policy, process.restarts, now, status, self._rng.random()):
            case Restart(pause):
                sys.stderr.write(f"{name} ended with status {status}; restarting in {pause:.1f} s\n")
                process.restarts.append(now)
                process.due = now + pause
                return False
            case Finished():
                sys.stderr.write(f"{name} finished cleanly\n")
            case Failed(reason):
                sys.stderr.write(f"{name} has died: {reason}\n")
                self._status = 1
        process.done = True
        if process.spec.required:
            sys.stderr.write(f"{name} is required: stopping all others\n")
        return process.spec.required


def _start(spec: ProcessSpec) -> subprocess.Popen[bytes]:
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "PYTHONUNBUFFERED": "1", PARENT: str(os.getpid())}
    return subprocess.Popen(
        spec.argv,
        stdin=subprocess.DEVNULL,
        env={**environment, **spec.environment},
        cwd=spec.cwd or None,
        start_new_session=True,
    )


def _stop(processes: list[subprocess.Popen[bytes]]) -> None:
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGKILL):
        left = [each for each in processes if each.poll() is None]
        for each in left:
            each.send_signal(number)
        deadline = time.monotonic() + STOP_S
        while any(each.poll() is None for each in left) and time.monotonic() < deadline:
            time.sleep(0.02)

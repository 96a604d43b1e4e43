"""Runs a script as the main program: its kernel, its signals, its end."""

from __future__ import annotations

import ast
import atexit
import builtins
import io
import os
import re
import signal
import sys
import threading
import time
import traceback
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import FrameType, ModuleType
from typing import Any

from messages.interfaces import catalogue
from messages.names import Identity
from services.runtime.errors import BadInput
from services.runtime.process import CLOSE_S, ROOT, exit_now, exit_within
from services.runtime.transport.api import Transport
from services.runtime.transport.unix_sockets import check_reachable
from services.runtime.transport.zenoh import ZenohTransport
from services.runtime.transport.zenoh_config import Role, configuration, default_router, endpoint
from services.script.api import ScriptStopped, set_kernel
from services.script.interface_finder import install
from services.script.kernel import KernelOptions, ScriptKernel
from services.script.loader import SITE_PACKAGES, Keyboard, ScriptLoader, loop_pass, pin_randomness, python2_builtins
from services.script.lockstep_threading import queue_module, thread_module, threading_module
from services.script.node_loop import OwnTime
from services.script.script_time import ScriptTime, datetime_module, time_module
from services.script.source import PASS
from services.script.turns import place_of
from services.script.workspace import Workspace, workspace_of

ROS_COMMANDS = ROOT / "deploy" / "ros1_commands" / "bin"
"""The commands of ROS 1 under their names."""
NOTICE_S = 0.7
"""Wall time [s] after the hooks in which the main thread must notice the shutdown before it is interrupted."""
LEAVE_S = 10.0
"""Wall time [s] for a script that has noticed the shutdown to complete its work."""
SWITCH_S = 0.0005
"""Wall time [s] after which a computing thread lets another one run.

The network's thread needs it for each token and each message: with Python's 5 ms, a script that imports its libraries
kept it from accepting links for seconds.
"""
HOOKS_S = 5.0
"""Wall time [s] for the shutdown hooks after a signal; their waits are then ended."""
STILL_S = 1.5
"""Wall time [s] without a change of time after which hooks stop waiting for it: the simulation may have ended first."""
_LATE_CHECKS = 4
"""Checks or waits after which a script that was asked to end is assumed to continue its loop."""
_INTERRUPTS = 3
_NO_FLEET = (
    "start a fleet with ./elea up, which is joined as soon as it runs; --wall-time runs the script without a simulation"
)


def run_script(options: dict[str, Any]) -> int:
    """Run the script; return its exit status."""
    file = Path(os.path.abspath(options["file"]))
    sys.setswitchinterval(SWITCH_S)
    kernel = ScriptKernel(
        lambda: _transport(options),
        KernelOptions(
            simulated=not options["wall_time"],
            lockstep=options["lockstep"],
            rate=options["rate"],
            log_level=options["log_level"],
            awaits_parameters=options["await_params"],
            frame_prefix=options["frame_prefix"],
        ),
    )
    set_kernel(kernel)
    workspace = workspace_of(file)
    _prepare(file, options, workspace)
    run = ScriptRun(kernel, _loader(file, options, kernel, workspace))
    run.install_signal_handlers()
    if options["name"]:
        identity = Identity.of(options["name"], options["namespace"])
        kernel.start_early(identity.node, identity.namespace)
    status = run.run(file)
    if options["name"] and not run.asked:
        kernel.await_start()
    kernel.stop_loop()
    exit_within(CLOSE_S, status)
    kernel.close()
    return status


def _prepare(file: Path, options: dict[str, Any], workspace: Workspace) -> None:
    """Set up the process as the script expects it: arguments, paths, environment."""
    sys.argv = [options["file"], *options["args"]]
    if options["name"]:
        sys.argv.append(f"__name:={options['name']}")
    sys.argv += options["remap"]
    if options["namespace"] not in ("", "/"):
        os.environ["ROS_NAMESPACE"] = options["namespace"]
    router = options["connect"][0] if options["connect"] else default_router()
    os.environ.update(ros_environment(workspace, router, os.environ))
    set_paths(file.parent, workspace.python_paths())
    install(catalogue(), workspace.package_path)
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(line_buffering=True, errors="backslashreplace")


def ros_environment(workspace: Workspace, router: str, environment: Mapping[str, str]) -> dict[str, str]:
    """Return the variables of a ROS 1 shell: ``rosrun`` or ``rosbag`` started by a script are ours, in its fleet.

    Args:
        workspace: The packages around the script.
        router: The endpoint of the fleet's router, whose port selects the fleet for the commands.
        environment: The variables of the process.
    """
    path = [each for each in environment.get("PATH", "").split(os.pathsep) if each and each != str(ROS_COMMANDS)]
    port = re.search(r"(\d+)(?:/[^/]*\.sock)?$", router)
    return {
        "PATH": os.pathsep.join([str(ROS_COMMANDS), *path]),
        "ROS_DISTRO": "noetic",
        "ROS_VERSION": "1",
        "ROS_MASTER_URI": f"http://localhost:{port[1] if port else 11311}",
        "ROS_PACKAGE_PATH": os.pathsep.join(map(str, workspace.roots)),
    }


def _loader(file: Path, options: dict[str, Any], kernel: ScriptKernel, workspace: Workspace) -> ScriptLoader:
    """Return the loader of the script's own modules, with the modules and builtins that replace Python's."""
    read_line: Callable[..., str] = input
    modules: dict[str, ModuleType] = {}
    if not options["wall_time"]:
        clock = ScriptTime(kernel, kernel.follows_simulation, fixed=options["lockstep"])
        modules = {"time": time_module(clock), "datetime": datetime_module(clock)}
    imported: Callable[[str], None] = _nothing
    if kernel.turns is not None:
        imported = pin_randomness(options["seed"], options["name"] or file.stem)
        modules["threading"] = threading_module(kernel.turns)
        modules["_thread"] = thread_module(modules["threading"])
        modules["queue"] = queue_module(modules["threading"], modules["time"], builtins.__import__)
        read_line = _outside_input(kernel)
        sys.stdin = Keyboard(sys.stdin, kernel.outside)
    extras = {**python2_builtins(read_line), PASS: loop_pass(kernel.threads.point), "input": read_line}
    folders = [file.parent, *([workspace.own] if workspace.own else []), *workspace.python_paths()]
    return ScriptLoader(folders, modules, extras, workspace, imported)


def _outside_input(kernel: ScriptKernel) -> Callable[..., str]:
    stdin = sys.stdin

    def read_line(prompt: object = "", /) -> str:
        with kernel.outside("standard input"):
            ours, sys.stdin = sys.stdin, stdin
            try:
                return input(prompt)
            finally:
                sys.stdin = ours

    return read_line


def _nothing(name: str) -> None:
    pass


def set_paths(folder: Path, packages: Sequence[Path] = ()) -> None:
    """Set the import path: the script's folder, our ROS libraries, before those of an installed ROS, the packages of
    its workspace, and this project.
    """
    ours = [str(folder), str(SITE_PACKAGES), *map(str, packages)]
    rest = [each for each in sys.path if each not in (*ours, "")]
    if str(ROOT) not in rest:
        rest.append(str(ROOT))
    if foreign := [each for each in rest if "/opt/ros/" in each]:
        sys.stderr.write(f"Elea's own rospy is used, not that of {foreign[0]}\n")
    sys.path[:] = [*ours, *rest]


def _transport(options: dict[str, Any]) -> Transport:
    role: Role = "star" if options["topology"] == "star" else "direct"
    endpoints = options["connect"] or (default_router(),)
    tree = configuration(role, endpoints, domain=options["domain"], reliable=options["lockstep"])
    _warn_without_router(endpoints[0], options["wall_time"])
    return ZenohTransport(tree)


def _warn_without_router(router: str, wall_time: bool) -> None:
    """Warn that there is no router through which to meet other nodes; it is joined once it appears."""
    try:
        check_reachable(endpoint(router), 0.2)
    except OSError as error:
        what = "other scripts are found once roscore or a fleet runs" if wall_time else _NO_FLEET
        sys.stderr.write(f"no router at {router} ({error.strerror or error}): {what}\n")


class ScriptRun:
    """A script running in the main thread, and its end: by itself, or because it was asked to."""

    def __init__(self, kernel: ScriptKernel, loader: ScriptLoader) -> None:
        self._kernel, self._loader = kernel, loader
        self.asked = self._over = self._running = False
        """Whether it was asked to end, whether it has ended, and whether it is running."""
        self._status = 0
        kernel.end_process = self._end

    def install_signal_handlers(self) -> None:
        """End in an orderly way at SIGINT, SIGTERM and SIGHUP."""
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            signal.signal(number, self._on_signal)

    def run(self, file: Path) -> int:
        """Run the file to its end, and its exit handlers; return the exit status."""
        self._status = self._execute(file)
        try:
            self._join_threads()
            atexit._run_exitfuncs()
        except (KeyboardInterrupt, ScriptStopped):
            pass
        except BaseException:  # noqa: BLE001 - what an exit function raises ends nothing else
            traceback.print_exc()
        self._over = True
        self._kernel.shut_down("the script has ended")
        for stream in (sys.stdout, sys.stderr):
            try:
                stream.flush()
            except (OSError, ValueError):
                continue
        return self._status

    def _execute(self, file: Path) -> int:
        self._running = True
        try:
            self._loader.run(file)
        except SystemExit as error:
            return self._exit_status(error)
        except BadInput:
            raise
        except BaseException as error:  # noqa: BLE001 - whatever the script raises is its own
            if self.asked and _is_interruption(error):
                return 0
            if type(error) is KeyboardInterrupt:
                return 130
            _print_traceback(error)
            return 1
        return 0

    def _exit_status(self, error: SystemExit) -> int:
        if error.code is None:
            return 0
        if isinstance(error.code, int):
            return error.code & 0xFF
        sys.stderr.write(f"{error.code}\n")
        return 1

    def _join_threads(self) -> None:
        """Wait for the script's own threads, except daemons, as Python does at its end."""
        for thread in threading.enumerate():
            if thread is not threading.main_thread() and not thread.daemon:
                while thread.is_alive() and not self._kernel.shutting_down:
                    thread.join(0.1)

    def _on_signal(self, number: int, frame: FrameType | None) -> None:
        if self._over:
            exit_now(self._status)
        if not self._running:
            exit_now(0)
        if self.asked or self._kernel.node is None:
            self.asked = True
            raise KeyboardInterrupt
        self._end(f"signal-{number}")

    def _end(self, reason: str) -> None:
        """Ask the script to end, and enforce it."""
        self.asked = True
        threading.Thread(target=self._enforce_end, name="end", daemon=True).start()
        self._kernel.shut_down(reason)
        self._kernel.stop_awaiting_ticks()

    def _enforce_end(self) -> None:
        """Interrupt a main thread that does not notice the request to end; end without it if necessary."""
        deadline, seen, since = time.monotonic() + HOOKS_S, -1, time.monotonic()
        while not self._kernel.hooks_done and (now := time.monotonic()) < min(deadline, since + STILL_S):
            if (shown := self._kernel.now()) != seen:
                seen, since = shown, now
            time.sleep(0.02)
        self._kernel.end_waits()
        _wait_own_time(NOTICE_S)
        deadline = time.monotonic() + LEAVE_S
        while self._kernel.noticed and self._kernel.late_checks < _LATE_CHECKS and time.monotonic() < deadline:
            time.sleep(0.02)
        for _ in range(_INTERRUPTS):
            if self._over:
                return
            main = threading.main_thread().ident
            if main is not None:
                signal.pthread_kill(main, signal.SIGINT)
            _wait_own_time(0.1)
        if not self._over:
            sys.stderr.write(
                f"the script did not end when it was asked to: {place_of(threading.main_thread().ident)}\n"
            )
            if not self._kernel.lockstep:  # there, its end would wait for the turn of the thread that does not end
                exit_within(CLOSE_S, 0)
                self._kernel.close()
            exit_now(0)


def _wait_own_time(seconds: float) -> None:
    """Wait for ``seconds``, without counting the time in which the main thread waits for a processor."""
    waited = OwnTime(threading.main_thread())
    while not waited.exceeds(seconds):
        time.sleep(0.02)


def _is_interruption(error: BaseException) -> bool:
    """Return whether an exception only reports that the process was asked to end.

    After shutdown, a service call is refused as if there were no server, as in ROS.
    """
    names = {kind.__name__ for kind in type(error).__mro__}
    if "ServiceException" in names:
        return str(error).endswith(" unavailable")
    return isinstance(error, KeyboardInterrupt | ScriptStopped) or "ROSInterruptException" in names


def _print_traceback(error: BaseException) -> None:
    """Print the traceback as Python would, without the lines of the loader."""
    trace = traceback.TracebackException.from_exception(error)
    inner: traceback.TracebackException | None = trace
    while inner is not None:
        inner.stack = traceback.StackSummary.from_list([each for each in inner.stack if not _loads(each.filename)])
        inner = inner.__cause__ or inner.__context__
    sys.stderr.write("".join(trace.format()))


def _loads(file: str) -> bool:
    """Return whether a file belongs to the loader."""
    return file.startswith(("<frozen importlib", str(ROOT / "services" / "script") + os.sep)) or file == ast.__file__

"""Runs commands and services as forks of a server process that has already imported the project.

Starting Python and importing takes a command 0.2 s and a service up to 0.5 s; most do little else. Otherwise a fork
behaves as ``python -m deploy``: a process of its own, with its environment, folder, streams, signals and exit status.
The project's processes that a forked command starts are forked, too (see ``tests.harness.fork_children``). Where a
command replaces itself with a service, as ``bag record`` does, the same process continues as that service. Import times
are measured elsewhere.
"""

from __future__ import annotations

import gc
import importlib
import json
import os
import pkgutil
import runpy
import selectors
import signal
import socket
import subprocess
import sys
import tempfile
import threading
from collections.abc import Mapping, Sequence
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import IO, Any, NoReturn

from services.catalog import service_kinds
from services.runtime.process import PARENT, ROOT
from services.script import python2
from tests.harness.fork_children import HASHES, fixes_same_hashes, fork_children, is_forkable

STREAMS = (0, 1, 2)
_OTHERS = ("logger",)
"""Services that cannot be imported before a fork: their imports start threads."""
_LOADED = (
    "deploy.run_fleet",
    "deploy.detach",
    "deploy.doctor.checks",
    "services.runtime.start",
    "services.script.command_line",
    "services.script.message_classes",
    "services.script.run",
)
_starting = threading.Lock()
_execute = os.execve
_SINGLE = {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}


class ForkedProcess(subprocess.Popen[str]):
    """``python -m MODULE ARGUMENTS`` for a module that ``is_forkable``, with empty standard input.

    Its parent is the fork server, which dies with this process. Without ``log``, its output and errors are pipes. With
    the path of a ``terminal``, all three streams are that terminal, the controlling terminal of the session that it
    leads.
    """

    def __init__(
        self,
        module: str,
        arguments: Sequence[str],
        cwd: Path,
        env: Mapping[str, str],
        log: IO[Any] | int = subprocess.PIPE,
        start_new_session: bool = False,
        terminal: str = "",
    ) -> None:
        self._terminal = terminal
        with _starting:  # tests start fleets in parallel, from threads
            _server()
        errors = subprocess.STDOUT if log != subprocess.PIPE else subprocess.PIPE
        super().__init__(
            [module, *arguments],
            cwd=cwd,
            env=env,
            text=True,
            stdin=subprocess.DEVNULL,
            stdout=log,
            stderr=errors,
            start_new_session=start_new_session,
        )

    def _execute_child(self, args: list[str], executable: Any, preexec: Any, close: Any, *rest: Any) -> None:
        # As in CPython 3.11.
        _, cwd, env, _, _, _, in_read, _, out_read, out_write, _, err_write, _, _, _, _, _, new_session, _ = rest
        self._link = socket.socket(socket.AF_UNIX)
        self._link.connect(_server()[0])
        _, server = _server()
        own = {**env, PARENT: str(server)} if PARENT in env else dict(env)
        asked = {"arguments": args, "cwd": str(cwd), "env": own, "new_session": new_session, "terminal": self._terminal}
        socket.send_fds(self._link, [json.dumps(asked).encode() + b"\n"], [in_read, out_write, err_write])
        for each in (in_read, *((out_write, err_write) if out_read != -1 else ())):
            os.close(each)
        self._closed_child_pipe_fds = True
        self._answers = self._link.makefile()
        self.pid = int(self._answers.readline())
        self._child_created = True

    def _internal_poll(self, *_: Any, **__: Any) -> int | None:
        return self._wait_for(0.0)

    def _wait(self, timeout: float | None) -> int:
        if (status := self._wait_for(timeout)) is None:
            raise subprocess.TimeoutExpired(self.args, timeout or 0.0)
        return status

    def _wait_for(self, seconds: float | None) -> int | None:
        if self.returncode is None:
            with selectors.DefaultSelector() as selector:
                selector.register(self._link, selectors.EVENT_READ)
                if selector.select(seconds):
                    self.returncode = int(self._answers.readline())
                    self._answers.close()
                    self._link.close()
        return self.returncode


class ForkedVerb(ForkedProcess):
    """``python -m deploy ARGUMENTS``, with output and errors as pipes."""

    def __init__(self, arguments: Sequence[str], cwd: Path, env: Mapping[str, str]) -> None:
        super().__init__("deploy", arguments, cwd, env)


def run_verb(
    *arguments: str, cwd: Path = ROOT, env: Mapping[str, str] = os.environ, within: float = 60.0
) -> subprocess.CompletedProcess[str]:
    """Run a command to its end; kill it if it takes longer than ``within`` [s]."""
    return run_module("deploy", *arguments, cwd=cwd, env=env, within=within)


def run_module(
    module: str, *arguments: str, cwd: Path = ROOT, env: Mapping[str, str] = os.environ, within: float = 60.0
) -> subprocess.CompletedProcess[str]:
    """Run ``python -m MODULE ARGUMENTS`` to its end; kill it if it takes longer than ``within`` [s]."""
    with ForkedProcess(module, arguments, cwd, env) as process:
        try:
            out, err = process.communicate(timeout=within)
        except BaseException:
            process.kill()
            raise
    return subprocess.CompletedProcess(arguments, process.returncode, out, err)


@cache
def _server() -> tuple[str, int]:
    """Start the fork server and return its socket path and process id; it ends at EOF on its standard input."""
    folder = os.environ.get("XDG_RUNTIME_DIR")  # of this test run, removed at its end
    path = str(Path(tempfile.mkdtemp(prefix="fork-", dir=folder)) / "socket")
    command = [sys.executable, "-P", "-m", "tests.harness.fork_server", path]
    env = {**os.environ, **_SINGLE, HASHES: "0", "PYTHONPATH": str(ROOT)}
    server = subprocess.Popen(command, env=env, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    assert server.stdout is not None
    assert "ready\n" in server.stdout, "the server of forks did not start"  # after any output of libraries
    _server.process = server  # type: ignore[attr-defined]
    return path, server.pid


def _serve(path: str) -> None:
    """Fork for each connection; send the process id, and the exit status once it ends."""
    import deploy.commands
    import deploy.live

    for package in (deploy.commands, deploy.live):
        for each in pkgutil.iter_modules(package.__path__, f"{package.__name__}."):
            importlib.import_module(each.name)
    for name in (*_LOADED, *(f"services.{each}.loop" for each in service_kinds() if each not in _OTHERS)):
        importlib.import_module(name)
    python2.convert("pass", "")  # compiles the patterns of its fixes at first use, which takes 0.07 s
    assert len(os.listdir("/proc/self/task")) == 1, "a fork has only one of the threads"
    gc.collect()
    gc.freeze()
    reading, writing = os.pipe()
    os.set_blocking(writing, False)
    signal.set_wakeup_fd(writing)
    signal.signal(signal.SIGCHLD, lambda *_: None)
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    links: dict[int, socket.socket] = {}
    with socket.socket(socket.AF_UNIX) as listener, selectors.DefaultSelector() as selector:
        listener.bind(path)
        listener.listen(64)
        for each in (listener, reading, 0):
            selector.register(each, selectors.EVENT_READ)
        print("ready", flush=True)
        while True:
            for key, _ in selector.select():
                if key.fileobj == 0:
                    return
                if key.fileobj == reading:
                    os.read(reading, 4096)
                    _tell_ended(links)
                else:
                    _fork(listener, links)


def _fork(listener: socket.socket, links: dict[int, socket.socket]) -> None:
    link, _ = listener.accept()
    message, streams, *_ = socket.recv_fds(link, 1 << 20, len(STREAMS))
    while not message.endswith(b"\n"):
        message += link.recv(1 << 20)
    if pid := os.fork():
        links[pid] = link
        link.sendall(f"{pid}\n".encode())
        for each in streams:
            os.close(each)
        return
    for target, each in zip(STREAMS, streams, strict=True):
        os.dup2(each, target)
    os.closerange(max(STREAMS) + 1, 1024)
    become(json.loads(message))


def become(asked: dict[str, Any]) -> NoReturn:
    """Run the requested process in this one, whose streams are set up, and exit with its status."""
    signal.set_wakeup_fd(-1)
    for number in (signal.SIGCHLD, signal.SIGTERM, signal.SIGHUP):
        if signal.getsignal(number) != signal.SIG_IGN:
            signal.signal(number, signal.SIG_DFL)
    signal.signal(signal.SIGINT, signal.default_int_handler)
    os.execve = _execute_or_become  # type: ignore[assignment]
    os.execv = lambda program, words: _execute_or_become(program, words, os.environ)  # type: ignore[assignment]
    if asked["new_session"]:
        os.setsid()
    if terminal := asked.get("terminal"):
        _take_terminal(terminal)
    os.chdir(asked["cwd"])
    os.environ.clear()
    os.environ.update(asked["env"])
    module, *arguments = asked["arguments"]
    sys.argv = [str(ROOT / module / "__main__.py"), *arguments]
    fork_children(become, arguments)
    status = 1
    try:
        runpy.run_module(module, run_name="__main__", alter_sys=True)
        status = 0
    except SystemExit as ended:
        status = ended.code if isinstance(ended.code, int) else 0 if ended.code is None else 1
    except BaseException:  # noqa: BLE001 as the interpreter does it at the end of a program
        sys.excepthook(*sys.exc_info())  # type: ignore[arg-type]
    finally:
        for each in (sys.stdout, sys.stderr):
            with suppress(OSError, ValueError):
                each.flush()
        os._exit(status)


def _execute_or_become(program: Any, words: Sequence[str], environment: Mapping[str, str]) -> NoReturn:
    """Replace this process, as ``os.execve``; for one of the project, without restarting Python."""
    words, folders = list(words), set(environment.get("PYTHONPATH", "").split(os.pathsep))
    ours = words[:3] == [sys.executable, "-P", "-m"] and is_forkable(words[3]) and folders == {str(ROOT)}
    # A command that starts processes is copied at its start, which requires a process without threads.
    forks = words[3:4] == ["deploy"] and len(os.listdir("/proc/self/task")) > 1
    if ours and not forks and fixes_same_hashes(environment):
        become({"arguments": words[3:], "cwd": os.getcwd(), "env": dict(environment), "new_session": False})
    _execute(program, words, environment)


def _take_terminal(path: str) -> None:
    """Make a terminal the standard streams; the first that a session leader opens becomes its controlling terminal."""
    descriptor = os.open(path, os.O_RDWR)
    for each in STREAMS:
        os.dup2(descriptor, each)
    os.close(descriptor)
    sys.stdout.reconfigure(line_buffering=True)  # type: ignore[union-attr]


def _tell_ended(links: dict[int, socket.socket]) -> None:
    while links:
        try:
            pid, status = os.waitpid(-1, os.WNOHANG)
        except ChildProcessError:
            return
        if not pid:
            return
        with links.pop(pid) as link, suppress(OSError):
            link.sendall(f"{os.waitstatus_to_exitcode(status)}\n".encode())


if __name__ == "__main__":
    _serve(sys.argv[1])

"""Lets a forked command fork the project's processes, as its own children, from a thread-free copy of itself.

A supervisor has network threads; a fork of it would inherit locks that nothing releases. So a command that starts
processes is copied before it does anything. The copy forks twice for each start; as the intermediate process ends at
once, the kernel makes the new process a child of the command, which is a subreaper: the command can wait for it, and it
dies with the command, as if started directly.
"""

from __future__ import annotations

import ctypes
import json
import os
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from typing import Any

_STARTING_VERBS = ("up", "sweep")
_PR_SET_PDEATHSIG, _PR_SET_CHILD_SUBREAPER = 1, 36
_STREAMS = (0, 1, 2)
_turn = threading.Lock()

HASHES = "PYTHONHASHSEED"
"""The environment variable that sets Python's hash seed, and with it the order of sets, at start."""
_hashes = os.environ.get(HASHES)
"""The hash seed of the forking process."""

Become = Callable[[dict[str, Any]], None]
"""Runs the requested process in the current one, and ends with it."""


def is_forkable(module: str) -> bool:
    """Whether a fork can run the module, without starting Python."""
    return module in ("deploy", "services", "services.script", "tests.faults.up_with_faults") or module.startswith(
        "tests.faults.services."
    )


def fixes_same_hashes(environment: Mapping[str, str]) -> bool:
    """Whether a fork has the hash seed that an environment sets, if it sets one."""
    return environment.get(HASHES, _hashes) == _hashes


def fork_children(become: Become, arguments: Sequence[str]) -> None:
    """If this process runs a command that starts processes, make ``subprocess`` fork those of the project from now on.

    Args:
        become: Runs the requested process in the current one.
        arguments: Arguments of this process, the command first.
    """
    if not arguments or arguments[0] not in _STARTING_VERBS:
        return
    libc, supervisor = ctypes.CDLL(None), os.getpid()
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    if not os.fork():
        libc.prctl(_PR_SET_PDEATHSIG, signal.SIGKILL, 0, 0, 0)
        ours.close()
        _serve(theirs, supervisor, become)
    theirs.close()
    libc.prctl(_PR_SET_CHILD_SUBREAPER, 1, 0, 0, 0)
    _Popen.link, _Popen.pythonpath = ours, os.environ.get("PYTHONPATH", "")
    subprocess.Popen = _Popen  # type: ignore[misc]


class _Popen(subprocess.Popen[Any]):
    """``subprocess.Popen`` that starts the project's processes by forking."""

    link: socket.socket
    pythonpath: str

    def _execute_child(self, args: Any, *rest: Any) -> None:
        # As in CPython 3.11 to 3.13.
        cwd, env, pipes, new_session = rest[4], rest[5], rest[9:15], rest[20]
        words, environment = list(args), dict(os.environ if env is None else env)
        ours = words[:3] == [sys.executable, "-P", "-m"] and is_forkable(words[3])
        if not ours or environment.get("PYTHONPATH") != self.pythonpath or not fixes_same_hashes(environment):
            return super()._execute_child(args, *rest)  # type: ignore[misc]
        asked = {"arguments": words[3:], "cwd": str(cwd or os.getcwd()), "env": environment, "new_session": new_session}
        in_read, _, _, out_write, _, err_write = pipes
        given = zip(_STREAMS, (in_read, out_write, err_write), strict=True)
        with _turn:
            streams = [own if each == -1 else each for own, each in given]
            socket.send_fds(self.link, [json.dumps(asked).encode()], streams)
            self.pid = int(self.link.recv(32))
        self._child_created = True
        self._close_pipe_fds(*pipes)  # type: ignore[attr-defined]
        return None


def _serve(link: socket.socket, supervisor: int, become: Become) -> None:
    """Fork the requested processes until the requesting process ends."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)
    while True:
        message, streams, *_ = socket.recv_fds(link, 1 << 20, len(_STREAMS))
        if not message:
            os._exit(0)
        reading, writing = os.pipe()
        between = os.fork()
        if not between:
            _fork_again(writing, streams, supervisor, become, json.loads(message))
        os.waitpid(between, 0)  # from here on the new process is the supervisor's child
        link.sendall(os.read(reading, 32))
        for each in (reading, writing, *streams):
            os.close(each)


def _fork_again(writing: int, streams: Sequence[int], supervisor: int, become: Become, asked: dict[str, Any]) -> None:
    between = os.getpid()
    if pid := os.fork():
        os.write(writing, str(pid).encode())
        os._exit(0)
    while (parent := os.getppid()) == between:
        time.sleep(0.0005)
    if parent != supervisor:  # it has ended
        os._exit(1)
    for target, each in zip(_STREAMS, streams, strict=True):
        os.dup2(each, target)
    os.closerange(max(_STREAMS) + 1, 1024)
    for number in (signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_DFL)
    for stream in (sys.stdout, sys.stderr):
        with suppress(OSError, ValueError):
            stream.reconfigure(write_through=True)  # type: ignore[union-attr]
    become(asked)

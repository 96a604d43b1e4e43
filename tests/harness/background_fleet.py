"""Runs a fleet in the background, commands on it, and an external publisher that uses plain Zenoh."""

from __future__ import annotations

import json
import signal
import subprocess
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import msgpack
import numpy as np
import zenoh

from services.runtime.transport.unix_sockets import router_endpoint
from services.runtime.transport.wire import pack_attachment
from tests.harness.command_line import CommandLine, CommandResult
from tests.harness.external_client import external_client

BURGER = """
[run]
mode = "real"
ends = "never"

[[robot]]
name = "tb3_0"
model = "burger"
"""
"""A fleet file with one robot, in real time and without an end; keys appended to it belong to that robot."""
IDLE = f"""
name = "idle"
description = "A burger and a waffle, and nobody who drives them"
{BURGER}
[[robot]]
name = "tb3_1"
model = "waffle"
pose = {{ x = 0.0, y = 1.0, yaw = 0.0 }}
"""
WEATHER = {
    "temperature": 20.5,
    "wind": [1, 2],
    "grid": msgpack.ExtType(1, msgpack.packb(["<i2", [2, 2], np.arange(4, dtype="<i2").tobytes()])),
}
"""A message of a type unknown to this project."""
SAMPLE_S = 0.02
"""Wall time between two messages of the external publisher."""


class BackgroundFleet:
    """A running fleet and the commands on it."""

    def __init__(self, terminal: CommandLine) -> None:
        self.command_line = terminal
        self.endpoint = router_endpoint(terminal.port)

    def run(self, *arguments: str, status: int = 0) -> CommandResult:
        """Run a command to its end; assert its exit status and that it printed no traceback."""
        ended = self.command_line.run(*arguments)
        assert ended.status == status, ended.out + ended.err
        assert "Traceback" not in ended.err
        return ended

    def run_json(self, *arguments: str, status: int = 0) -> Any:
        """Run a command with ``--json`` and return the JSON document that it prints."""
        return json.loads(self.run(*arguments, "--json", status=status).out)

    def run_json_lines(self, *arguments: str, status: int = 0) -> list[Any]:
        """Run a command with ``--json`` and return the JSON lines that it prints."""
        return [json.loads(each) for each in self.run(*arguments, "--json", status=status).out.splitlines()]

    @contextmanager
    def start(self, *arguments: str) -> Iterator[subprocess.Popen[str]]:
        """Start a command that runs until stopped; it is killed at the end of the block if it still runs."""
        process = self.command_line.start(*arguments)
        try:
            yield process
        finally:
            if process.poll() is None:
                process.kill()
            process.communicate()


def interrupt(process: subprocess.Popen[str]) -> CommandResult:
    """End a command with SIGINT (Ctrl-C) and return its result."""
    assert process.stdout is not None
    assert process.stderr is not None
    process.send_signal(signal.SIGINT)
    # Not communicate(): it would miss text that an earlier readline() left in the buffer.
    out, err = process.stdout.read(), process.stderr.read()
    return CommandResult(process.wait(60), out, err)


@contextmanager
def background_fleet(folder: Path, text: str = IDLE) -> Iterator[BackgroundFleet]:
    """Run a fleet in the background from the text of its file; it is shut down at the end of the block."""
    file = folder / "fleet.toml"
    file.write_text(text)
    terminal = CommandLine(folder)
    started = terminal.run_fleet(file, folder / "results", "--detach")
    try:
        assert started.status == 0, started.err
        yield BackgroundFleet(terminal)
    finally:
        terminal.run("down")


@contextmanager
def external_publisher(
    endpoint: str, key: str, payload: Any, *, encoding: str = "", numbers: bool = False
) -> Iterator[None]:
    """Publish ``payload`` every SAMPLE_S from a plain Zenoh client; with ``numbers``, messages carry sequence numbers
    of which every fourth is missing.
    """
    stop = threading.Event()

    def send(session: zenoh.Session) -> None:
        number, packed = 0, payload if isinstance(payload, bytes) else msgpack.packb(payload)
        while not stop.wait(SAMPLE_S):
            number += 2 if number % 4 == 2 else 1
            beside = {"attachment": pack_attachment(number, b"stranger-stranger"[:16])} if numbers else {}
            session.put(key, packed, **beside, **({"encoding": encoding} if encoding else {}))

    with external_client(endpoint) as session:
        thread = threading.Thread(target=send, args=(session,))
        thread.start()
        try:
            yield
        finally:
            stop.set()
            thread.join()

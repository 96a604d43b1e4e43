"""In lockstep, a process stopped for longer than a link's lease of 2 s keeps its links and loses no message."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from contextlib import ExitStack

import pytest

from messages.topics import Quality
from services.runtime.process import PARENT, ROOT
from services.runtime.transport.unix_sockets import router_endpoint
from services.runtime.transport.zenoh import ZenohTransport
from services.runtime.transport.zenoh_config import Role, configuration
from tests.harness.ports import free_port
from tests.harness.stopping import stop_process
from tests.harness.waiting import wait_until

pytestmark = pytest.mark.waits

STOPPED_S = 3.0
ROLES: tuple[Role, ...] = ("direct", "star")

READER = """
import sys
from services.runtime.transport.zenoh import ZenohTransport
from services.runtime.transport.zenoh_config import configuration

with ZenohTransport(configuration(sys.argv[2], (sys.argv[1],), reliable=True)) as transport:
    inlet = transport.subscribe(sys.argv[2], 1024)
    print("reading", flush=True)
    numbers = []
    while not numbers or numbers[-1] != "end":
        transport.wait(inlet)
        while (sample := inlet.recv()) is not None:
            numbers.append(sample[0].decode())
    print(*numbers, flush=True)
"""


def test_it_reads_all_that_was_sent_meanwhile() -> None:
    router = router_endpoint(free_port())
    environment = {**os.environ, "PYTHONPATH": str(ROOT), PARENT: str(os.getpid())}
    with ExitStack() as stack:
        stack.enter_context(ZenohTransport(configuration("router", listen=(router,), reliable=True)))
        readers = []
        for role in ROLES:
            sender = stack.enter_context(ZenohTransport(configuration(role, (router,), reliable=True)))
            command = [sys.executable, "-P", "-c", READER, router, role]
            reader = stack.enter_context(subprocess.Popen(command, stdout=-1, text=True, env=environment))
            stack.callback(reader.kill)
            assert reader.stdout is not None
            assert reader.stdout.readline() == "reading\n"
            readers.append((reader, sender.advertise(role, "test", Quality.SENSOR)))
        for _, numbers in readers:
            wait_until(lambda outlet=numbers: outlet.has_subscribers, 20.0, "the reader")  # type: ignore[misc]
        sent: list[str] = []

        def send(text: str) -> None:
            sent.append(text)
            for _, numbers in readers:
                numbers.put(text.encode(), attachment=b"")

        send("first")
        for reader, _ in readers:
            stop_process(reader.pid)
        until = time.monotonic() + STOPPED_S
        while time.monotonic() < until:
            send(str(len(sent)))
            time.sleep(0.05)
        for reader, _ in readers:
            os.kill(reader.pid, signal.SIGCONT)
        send("end")
        for reader, _ in readers:
            assert reader.communicate(timeout=120.0)[0].split() == sent

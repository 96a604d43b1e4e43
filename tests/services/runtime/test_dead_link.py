"""A node on a dead link to its router ends promptly when asked to, in both topologies."""

from __future__ import annotations

import signal
import socket
import threading
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path

from messages.names import Identity
from messages.topics import ODOM
from services.runtime.log import Log
from services.runtime.node import Node
from services.runtime.transport.unix_sockets import path_of
from services.runtime.transport.zenoh import ZenohTransport
from services.runtime.transport.zenoh_config import configuration
from tests.harness.cases import case
from tests.harness.processes import Network, Process
from tests.harness.waiting import wait_until

LINGER_S = 60
"""Wall time for which the sockets linger when closed. A node that waits for it, as nodes once did for Zenoh's 10 s, is
ended by the runtime after 15 s, with status 1."""
UNSENT_BYTES = 20_000
"""More than is ever on its way to a proxy that reads: the rest of a link's data when nobody takes it."""

TALKER = """
import os
import socket
import struct
import time
from contextlib import suppress

from messages.nav import Odometry
from messages.requests import SUPERVISOR_STOP, Name
from messages.topics import ODOM
from services.runtime import Service, main
from services.runtime.errors import CallFailed


def linger():
    for descriptor in map(int, os.listdir("/proc/self/fd")):
        with suppress(OSError), socket.socket(fileno=os.dup(descriptor)) as link:
            if link.family == socket.AF_INET:
                link.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, {linger}))


def run(ctx):
    linger()
    odom = ctx.advertise(ODOM)
    ctx.node.heartbeat.state = "running"
    end = time.monotonic() + {talk}
    while time.monotonic() < end:
        ctx.idle()
        for _ in range(20):
            odom.publish(Odometry())
    with suppress(CallFailed):  # on a busy machine, the lease of the link may end before the process is asked to
        ctx.call(SUPERVISOR_STOP, Name(name="x"), timeout=600.0, name="/slow")
    while True:
        ctx.idle()


main(Service(name="talker", about="Talks, then asks.", run=run))
"""


class BlackHoleProxy:
    """A proxy of a router that forwards everything until ``shut``, and then neither reads nor writes."""

    def __init__(self, router: str) -> None:
        self._router = str(path_of(router))
        self._shut, self._sockets = threading.Event(), [socket.socket()]
        self.given_up = threading.Event()
        """Set once a client has closed its dead link and opened another one, which is dead too."""
        self._clients: list[socket.socket] = []
        # Unread data must stay with its sender, which lingers for unacknowledged data.
        self._sockets[0].setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        self._sockets[0].bind(("127.0.0.1", 0))
        self._sockets[0].listen()
        self.endpoint = f"tcp/127.0.0.1:{self._sockets[0].getsockname()[1]}"
        threading.Thread(target=self._accept, daemon=True).start()

    def shut(self) -> None:
        self._shut.set()

    def unsent_bytes(self) -> int:
        """Bytes that clients have sent and the kernel keeps, since the proxy's buffers are full."""
        ports = {each.getpeername()[1] for each in self._clients}
        rows = [line.split() for line in Path("/proc/net/tcp").read_text().splitlines()[1:]]
        return sum(int(queues.partition(":")[0], 16) for _, near, _, _, queues, *_ in rows if _port(near) in ports)

    def close(self) -> None:
        for each in self._sockets:
            each.close()

    def _accept(self) -> None:
        while True:
            try:
                near, _ = self._sockets[0].accept()
            except OSError:
                return
            self._sockets.append(near)
            self._clients.append(near)
            if self._shut.is_set():
                self.given_up.set()
                continue
            far = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
            far.connect(self._router)
            self._sockets.append(far)
            for pair in ((near, far), (far, near)):
                threading.Thread(target=self._copy, args=pair, daemon=True).start()

    def _copy(self, origin: socket.socket, target: socket.socket) -> None:
        try:
            while not self._shut.is_set() and (data := origin.recv(4096)):
                if not self._shut.is_set():
                    target.sendall(data)
        except OSError:
            return


def _port(address: str) -> int:
    """Return the port of an address in ``/proc/net/tcp``."""
    return int(address.rpartition(":")[2], 16)


@contextmanager
def hole(network: Network) -> Iterator[BlackHoleProxy]:
    made = BlackHoleProxy(network.endpoint)
    try:
        yield made
    finally:
        made.close()


def test_node_on_a_dead_link_ends_soon(tmp_path: Path) -> None:
    """In both topologies, in parallel."""
    with ThreadPoolExecutor() as pool:
        folders = [tmp_path / topology for topology in ("direct", "star")]
        for each in folders:
            each.mkdir()
        for folder, done in [(folder, pool.submit(_end_on_dead_links, folder, folder.name)) for folder in folders]:
            with case(folder.name):
                done.result()


def _end_on_dead_links(tmp_path: Path, topology: str) -> None:
    identity = Identity.of("listener")
    with (
        Network(tmp_path) as network,
        ZenohTransport(configuration("star", (network.endpoint,))) as transport,
        Node(transport, identity, "tester", Log(identity.node)) as node,
        hole(network) as talks,
        hole(network) as asks,
    ):
        heard, slow = node.subscribe(ODOM, "/odom"), transport.serve("slow")

        def begin(way: BlackHoleProxy, name: str, talk: str) -> Process:
            (tmp_path / f"{name}.py").write_text(TALKER.format(talk=talk, linger=LINGER_S))
            command = ["-m", "deploy", "run", str(tmp_path / f"{name}.py"), "--connect", way.endpoint, "--name", name]
            return Process([*command, "--topology", topology], tmp_path / f"{name}.log")

        with begin(talks, "talker", "1000") as talker, begin(asks, "asker", "0") as asker:
            wait_until(lambda: (node.update_subscribers(), heard.messages)[1], 20, "odometry")
            unanswered = wait_until(slow.recv, 20, "a request, which is never answered")
            # The link is dead: sent data isn't read. Zenoh, with a lease of 2 s, usually hasn't noticed yet.
            asks.shut()
            _ends_without_lingering(asker)
            del unanswered  # only now: a query that is dropped ends its request
            talks.shut()
            wait_until(
                lambda: talks.unsent_bytes() > UNSENT_BYTES or talks.given_up.is_set(), 20, "samples that nobody takes"
            )
            _ends_without_lingering(talker)


def _ends_without_lingering(process: Process) -> None:
    process.signal(signal.SIGINT)
    assert process.wait(LINGER_S) == 0, process.text

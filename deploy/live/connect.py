"""The short-lived node of a command, and its loop."""

from __future__ import annotations

import getpass
import os
import re
import socket
import time
from collections.abc import Iterator
from contextlib import contextmanager

from deploy.live.output import exit_quietly, is_pipe_closed
from services.runtime.light_node import LightNode, open_transport
from services.runtime.network_address import NetworkAddress
from services.runtime.process import install_signal_handlers
from services.runtime.transport.api import RawSubscriber


def spin(live: LightNode, inlet: RawSubscriber, seconds: float | None = None) -> Iterator[None]:
    """Yield at each sample of ``inlet`` and ten times a second, until the node is stopped or
    ``seconds`` have passed.
    """
    deadline = None if seconds is None else time.monotonic() + seconds
    while not live.stopping and (deadline is None or time.monotonic() < deadline):
        yield
        if live.stopping:
            return
        if is_pipe_closed():
            exit_quietly()
        live.transport.wait(inlet)


def user_and_host() -> str:
    """Return user and machine in characters that are legal in a name: ``anna_laptop``."""
    try:
        user = getpass.getuser()
    except (KeyError, OSError):  # in a container, a user without an entry in the user database
        user = str(os.getuid())
    return re.sub(r"[^A-Za-z0-9]+", "_", f"{user[:64]}_{socket.gethostname()[:64]}").strip("_")


@contextmanager
def cli_node(address: NetworkAddress, role: str, owner: str = "") -> Iterator[LightNode]:
    """Join the network as a node that SIGINT and SIGTERM stop; raises BadInput without a router."""
    with open_transport(address.router, address.domain) as transport:
        made = LightNode(transport, role, owner)
        install_signal_handlers(made.stop)
        yield made

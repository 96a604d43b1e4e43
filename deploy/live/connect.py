"""Joining the network from the command line: a bare transport, or a short-lived node."""

from __future__ import annotations

import getpass
import os
import re
import socket
import time
from collections.abc import Iterator
from contextlib import contextmanager

from deploy.live.output import exit_quietly, is_pipe_closed
from deploy.network_address import NetworkAddress
from services.runtime.errors import BadInput
from services.runtime.graph import Entity, Kind
from services.runtime.process import install_signal_handlers
from services.runtime.transport.api import RawSubscriber, Token, Transport


@contextmanager
def connect(router: str, domain: str = "", patience: float = 2.0) -> Iterator[Transport]:
    """A transport through the router at an endpoint; raises BadInput if none listens there within ``patience`` [s]."""
    from services.runtime.transport.unix_sockets import is_listening
    from services.runtime.transport.zenoh import ZenohTransport
    from services.runtime.transport.zenoh_config import configuration, endpoint

    where = endpoint(router)
    try:
        is_listening(where, patience)
    except OSError as error:
        cause = "it is another user's" if isinstance(error, PermissionError) else "is a fleet up?"
        raise BadInput(f"no router at {where} ({error.strerror or error}): {cause}") from None
    with ZenohTransport(configuration("star", (where,), domain=domain)) as transport:
        yield transport


class CliNode:
    """A light node of a command: a unique name, tokens for its topics, no heartbeat.

    Its name begins with an underscore, which hides it in lists, as in ROS 2. With ``owner`` the name is the same each
    time, also of several at once, so that one can release a stop that another requested.
    """

    def __init__(self, transport: Transport, role: str, owner: str = "") -> None:
        self.transport = transport
        self.node = f"/_{role}_{owner or transport.session[:12]}"
        self.stopping = False
        self._tokens: list[Token] = []
        self._declare("node", role, "-", "-")

    def declare_subscription(self, name: str, record: str, detail: str) -> None:
        """Show a subscription."""
        self._declare("sub", name, record, detail)

    def declare_publication(self, name: str, record: str, detail: str) -> None:
        """Show a publication."""
        self._declare("pub", name, record, detail)

    def stop(self) -> None:
        """End the turns; from a signal."""
        self.stopping = True
        self.transport.wake()

    def spin(self, inlet: RawSubscriber, seconds: float | None = None) -> Iterator[None]:
        """Turn at every sample of ``inlet``, and ten times a second, until it is stopped or ``seconds`` have passed."""
        deadline = None if seconds is None else time.monotonic() + seconds
        while not self.stopping and (deadline is None or time.monotonic() < deadline):
            yield
            if self.stopping:
                return
            if is_pipe_closed():
                exit_quietly()
            self.transport.wait(inlet)

    def _declare(self, kind: Kind, name: str, record: str, detail: str) -> None:
        entity = Entity(self.transport.session, kind, self.node, name, record or "-", detail)
        self._tokens.append(self.transport.declare_token(entity.key))


def user_and_host() -> str:
    """The user and the machine, in letters that a name may have: ``anna_laptop``."""
    try:
        user = getpass.getuser()
    except (KeyError, OSError):  # a container's user that no table names
        user = str(os.getuid())
    return re.sub(r"[^A-Za-z0-9]+", "_", f"{user[:64]}_{socket.gethostname()[:64]}").strip("_")


@contextmanager
def cli_node(place: NetworkAddress, role: str, owner: str = "") -> Iterator[CliNode]:
    """Join the network; raises BadInput without a router. SIGINT and SIGTERM stop it."""
    with connect(place.router, place.domain) as transport:
        made = CliNode(transport, role, owner)
        install_signal_handlers(made.stop)
        yield made

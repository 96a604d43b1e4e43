"""The stay of a verb on the network: shown in the graph, ended by Ctrl-C, by a closed pipe or by a deadline."""

from __future__ import annotations

import getpass
import os
import re
import socket
import time
from collections.abc import Iterator
from contextlib import contextmanager

from deploy.live.output import leave_quietly, reader_gone
from deploy.live.visit import visit
from deploy.place import Place
from services.runtime.graph import Entity, Kind
from services.runtime.network.transport import Inlet, Token, Transport
from services.runtime.process import on_stop


class Session:
    """A light node: a name of its own that nobody else can have, tokens for what it reads and writes, no heartbeat.

    Its name begins with an underscore, which hides it in lists, as in ROS 2. With ``owner`` it is the same in every
    stay, and in several at once: what one of them says, another can take back.
    """

    def __init__(self, transport: Transport, role: str, owner: str = "") -> None:
        self.transport = transport
        self.node = f"/_{role}_{owner or transport.session[:12]}"
        self.stopping = False
        self._tokens: list[Token] = []
        self._show("node", role, "-", "-")

    def reads(self, name: str, record: str, detail: str) -> None:
        """Show a subscription."""
        self._show("sub", name, record, detail)

    def writes(self, name: str, record: str, detail: str) -> None:
        """Show a publication."""
        self._show("pub", name, record, detail)

    def stop(self) -> None:
        """End the turns; from a signal."""
        self.stopping = True
        self.transport.nudge()

    def turns(self, inlet: Inlet, seconds: float | None = None) -> Iterator[None]:
        """Turn at every sample of ``inlet``, and ten times a second, until it is stopped or ``seconds`` have passed."""
        deadline = None if seconds is None else time.monotonic() + seconds
        while not self.stopping and (deadline is None or time.monotonic() < deadline):
            yield
            if self.stopping:
                return
            if reader_gone():
                leave_quietly()
            self.transport.wait(inlet)

    def _show(self, kind: Kind, name: str, record: str, detail: str) -> None:
        entity = Entity(self.transport.session, kind, self.node, name, record or "-", detail)
        self._tokens.append(self.transport.token(entity.key))


def person() -> str:
    """The user and the machine, in letters that a name may have: ``anna_laptop``."""
    try:
        user = getpass.getuser()
    except (KeyError, OSError):  # a container's user that no table names
        user = str(os.getuid())
    return re.sub(r"[^A-Za-z0-9]+", "_", f"{user[:64]}_{socket.gethostname()[:64]}").strip("_")


@contextmanager
def session(place: Place, role: str, owner: str = "") -> Iterator[Session]:
    """Join the network for a while; raises BadInput when nobody is there. SIGINT and SIGTERM stop it."""
    with visit(place.router, place.domain) as transport:
        made = Session(transport, role, owner)
        on_stop(made.stop)
        yield made

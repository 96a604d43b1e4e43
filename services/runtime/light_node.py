"""The network without a service's loop: a bare transport, and a node with a name and tokens but no heartbeat."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from services.runtime.errors import BadInput
from services.runtime.graph import Entity, Kind
from services.runtime.transport.api import Token, Transport

_NO_FLEET = "is a fleet up? ./elea ps lists those that run, --port chooses one, ./elea up starts one"


@contextmanager
def open_transport(router: str, domain: str = "", timeout: float = 2.0) -> Iterator[Transport]:
    """Open a transport through the router at an endpoint; raises BadInput if none listens within ``timeout`` [s]."""
    from services.runtime.transport.unix_sockets import check_reachable
    from services.runtime.transport.zenoh import ZenohTransport
    from services.runtime.transport.zenoh_config import configuration, endpoint

    where = endpoint(router)
    try:
        check_reachable(where, timeout)
    except OSError as error:
        cause = "it is another user's" if isinstance(error, PermissionError) else _NO_FLEET
        raise BadInput(f"no router at {where} ({error.strerror or error}): {cause}") from None
    with ZenohTransport(configuration("star", (where,), domain=domain)) as transport:
        yield transport


class LightNode:
    """A node with a unique name and tokens for its topics, but no heartbeat.

    Its name begins with an underscore, which hides it in lists, as in ROS 2. With ``owner`` the name is the same in all
    sessions, also concurrent ones, so that one can revoke what another has published.
    """

    def __init__(self, transport: Transport, role: str, owner: str = "") -> None:
        self.transport = transport
        self.node = f"/_{role}_{owner or transport.session[:12]}"
        self.stopping = False
        self._tokens: list[Token] = []
        self._declare("node", role, "-", "-")

    def declare_subscription(self, name: str, record: str, detail: str) -> None:
        """Declare a subscription to the graph."""
        self._declare("sub", name, record, detail)

    def declare_publication(self, name: str, record: str, detail: str) -> None:
        """Declare a publication to the graph."""
        self._declare("pub", name, record, detail)

    def stop(self) -> None:
        """Ask this node to stop and wake its transport; for signal handlers."""
        self.stopping = True
        self.transport.wake()

    def _declare(self, kind: Kind, name: str, record: str, detail: str) -> None:
        entity = Entity(self.transport.session, kind, self.node, name, record or "-", detail)
        self._tokens.append(self.transport.declare_token(entity.key))

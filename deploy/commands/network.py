"""A short visit to the network, for verbs that ask it something."""

from __future__ import annotations

import socket
from collections.abc import Iterator
from contextlib import contextmanager

from deploy.claim import running
from deploy.commands.options import chosen
from deploy.fleet import PORT
from services.runtime.errors import BadInput
from services.runtime.transport import Transport


def place(connect: str, domain: str, port: int | None) -> tuple[str, str]:
    """The router and domain that options choose: what they say, else the running fleet's, else the default ones."""
    if not connect and running():
        fleet = chosen(port)
        return f"tcp/127.0.0.1:{fleet.port}", domain or fleet.domain
    return connect or f"tcp/127.0.0.1:{port or PORT}", domain


@contextmanager
def visit(router: str, domain: str = "") -> Iterator[Transport]:
    """A transport through the router at an endpoint; raises BadInput when nobody listens there."""
    from services.runtime.zenoh_config import configuration, endpoint
    from services.runtime.zenoh_transport import ZenohTransport

    where = endpoint(router)
    host, _, port = where.partition("/")[2].rpartition(":")
    try:
        socket.create_connection((host.strip("[]"), int(port)), timeout=2.0).close()
    except OSError as error:
        raise BadInput(f"no router at {where} ({error.strerror or error}): is a fleet up?") from None
    with ZenohTransport(configuration("star", (where,), domain=domain)) as transport:
        yield transport

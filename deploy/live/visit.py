"""A short visit to the network, for verbs that ask it something."""

from __future__ import annotations

import socket
from collections.abc import Iterator
from contextlib import contextmanager

from services.runtime.errors import BadInput
from services.runtime.network.transport import Transport


@contextmanager
def visit(router: str, domain: str = "", patience: float = 2.0) -> Iterator[Transport]:
    """A transport through the router at an endpoint; raises BadInput when nobody listens there for ``patience`` [s]."""
    from services.runtime.network.zenoh_config import configuration, endpoint
    from services.runtime.network.zenoh_transport import ZenohTransport

    where = endpoint(router)
    host, _, port = where.partition("/")[2].rpartition(":")
    try:
        socket.create_connection((host.strip("[]"), int(port)), timeout=patience).close()
    except OSError as error:
        raise BadInput(f"no router at {where} ({error.strerror or error}): is a fleet up?") from None
    with ZenohTransport(configuration("star", (where,), domain=domain)) as transport:
        yield transport

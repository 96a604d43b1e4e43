"""A short visit to the network, for verbs that ask it something."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from services.runtime.errors import BadInput
from services.runtime.network.transport import Transport


@contextmanager
def visit(router: str, domain: str = "", patience: float = 2.0) -> Iterator[Transport]:
    """A transport through the router at an endpoint; raises BadInput when nobody listens there for ``patience`` [s]."""
    from services.runtime.network.sockets import knock
    from services.runtime.network.zenoh_config import configuration, endpoint
    from services.runtime.network.zenoh_transport import ZenohTransport

    where = endpoint(router)
    try:
        knock(where, patience)
    except OSError as error:
        cause = "it is another user's" if isinstance(error, PermissionError) else "is a fleet up?"
        raise BadInput(f"no router at {where} ({error.strerror or error}): {cause}") from None
    with ZenohTransport(configuration("star", (where,), domain=domain)) as transport:
        yield transport

"""Bring a service up on the network and run its loop."""

from __future__ import annotations

from typing import Any

from services.runtime.context import Context
from services.runtime.identity import Identity
from services.runtime.log import Log
from services.runtime.node import Node
from services.runtime.process import CLOSE_S, end_within, give_way, on_stop
from services.runtime.service import Service
from services.runtime.zenoh_config import DEFAULT_ROUTER, Role, configuration
from services.runtime.zenoh_transport import ZenohTransport


def serve(service: Service, options: dict[str, Any]) -> None:
    """Open the transport, declare the node, run the loop; raises what ends it."""
    run = service.entry()
    identity: Identity = options["identity"]
    log = Log(identity.node, options["log_level"])
    if (options["lockstep"] and service.holds_lockstep) or service.observer:
        give_way()
    tree = _configuration(service, options)
    with ZenohTransport(tree) as transport, Node(transport, identity, service.name, log) as node:

        def stop() -> None:
            node.stopping = True
            transport.nudge()

        on_stop(stop)
        context = Context(node, options["params"], service.rate, options["lockstep"], service.observer)
        for topic in service.writes:
            context.writer(topic)
        try:
            run(context)
        finally:
            end_within(CLOSE_S + 10.0, 1)


def _configuration(service: Service, options: dict[str, Any]) -> dict[str, Any]:
    """Zenoh's configuration: the router listens where its parameters say, everybody else joins it."""
    domain = options["domain"]
    if service.routes:
        params = options["params"]
        return configuration("router", params.link, (params.listen,), domain)
    role: Role = "star" if options["topology"] == "star" else "direct"
    return configuration(role, options["connect"] or (DEFAULT_ROUTER,), domain=domain, reliable=options["lockstep"])

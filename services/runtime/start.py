"""Bring a service up on the network and run its loop."""

from __future__ import annotations

from typing import Any

from messages.names import Identity
from services.runtime.context import Context
from services.runtime.errors import Stopped
from services.runtime.log import Log
from services.runtime.node import Node
from services.runtime.parameters.client import ParameterClient
from services.runtime.parameters.subscription import ParameterSubscription
from services.runtime.parameters.validation import stated
from services.runtime.process import CLOSE_S, exit_within, install_signal_handlers, set_batch_scheduling
from services.runtime.service import Service
from services.runtime.transport.zenoh import ZenohTransport
from services.runtime.transport.zenoh_config import Role, check_listen, configuration, default_router


def run_service(service: Service, options: dict[str, Any]) -> None:
    """Open the transport, declare the node, run the loop; raises what ends it."""
    run = service.entry()
    identity: Identity = options["identity"]
    log = Log(identity.node, options["log_level"])
    if (options["lockstep"] and service.role == "member") or service.role == "observer":
        set_batch_scheduling()
    tree = _configuration(service, options)
    # The router is the first to start, unless it joins others.
    settle = {"settle_s": 0.0} if service.role == "router" and not options["params"].link else {}
    with ZenohTransport(tree, **settle) as transport, Node(transport, identity, service.name, log) as node:

        def stop() -> None:
            node.stopping = True
            transport.wake()
            if node.calling:
                raise Stopped("the process was asked to end while it waited for an answer")

        followed = _parameter_subscription(service, node, options)
        params = followed.params if followed is not None else options["params"]
        context = Context(node, params, service.rate, options["lockstep"], service.role == "observer", followed)
        install_signal_handlers(stop)  # so far a signal ended whatever was waited for
        try:
            run(context)
        finally:
            exit_within(CLOSE_S + 10.0, 1)


def _parameter_subscription(service: Service, node: Node, options: dict[str, Any]) -> ParameterSubscription[Any] | None:
    """The service's set, as the parameter service has it; None for a service without one."""
    if service.parameter_set is None or not options["params"].__struct_fields__:
        return None
    ParameterClient.of(node, quiet=service.role == "router").expected = options["await_params"]
    name = node.identity.resolve(service.parameter_set or node.identity.node)
    followed: ParameterSubscription[Any] = ParameterSubscription(
        node,
        name,
        options["params"],
        fleet=stated(service.parameters, options["fleet"]),
        command_line=stated(service.parameters, options["command_line"]),
    )
    followed.start()
    return followed


def _configuration(service: Service, options: dict[str, Any]) -> dict[str, Any]:
    """Zenoh's configuration: the router listens as its parameters say, all others join it."""
    domain = options["domain"]
    if service.role == "router":
        params = options["params"]
        listen = (params.listen or default_router(), *params.also)
        return configuration(
            "router", params.link, check_listen(listen, params.insecure, "--param insecure=true"), domain
        )
    role: Role = "star" if options["topology"] == "star" else "direct"
    return configuration(role, options["connect"] or (default_router(),), domain=domain, reliable=options["lockstep"])

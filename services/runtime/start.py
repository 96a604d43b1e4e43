"""Start a service, or several in one container, on the network and run their loops."""

from __future__ import annotations

import traceback
from collections.abc import Sequence
from functools import partial
from typing import Any

from messages.names import Identity
from services.runtime.composition.container import Container, NodeFailed
from services.runtime.context import Context, MakePacer
from services.runtime.errors import BadInput, EleaError, Stopped, TryAgain, list_names
from services.runtime.log import Log
from services.runtime.node import Node
from services.runtime.parameters.client import ParameterClient
from services.runtime.parameters.subscription import ParameterSubscription
from services.runtime.parameters.validation import stated
from services.runtime.process import CLOSE_S, exit_within, install_signal_handlers, set_batch_scheduling
from services.runtime.service import Run, Service
from services.runtime.transport.zenoh import ZenohTransport
from services.runtime.transport.zenoh_config import Role, check_listen, configuration, default_router

_MAX_LISTED = 8
"""Maximum nodes listed in an error."""


def run_service(service: Service, options: dict[str, Any]) -> None:
    """Open the transport, declare the node and run the loop; raises the error that ends it."""
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

        subscription = _parameter_subscription(service, node, options)
        params = subscription.params if subscription is not None else options["params"]
        steps = options["lockstep"] and (service.steps or service.role in ("member", "free"))  # others keep links only
        context = Context(node, params, service.rate, steps, service.role == "observer", subscription)
        install_signal_handlers(stop)  # until here, a signal raised Stopped at once
        try:
            run(context)
        finally:
            exit_within(CLOSE_S + 10.0, 1)


def run_container(members: Sequence[tuple[Service, dict[str, Any]]], network: dict[str, Any]) -> None:
    """Open one transport and run the loops of several services on it; raises the error that ends them.

    Args:
        members: Each service with its options.
        network: The options that all of them share.
    """
    if network["lockstep"]:
        set_batch_scheduling()
    runs = [service.entry() for service, _ in members]
    connect = network["connect"] or (default_router(),)
    role: Role = "star" if network["topology"] == "star" else "direct"
    tree = configuration(role, connect, domain=network["domain"], reliable=network["lockstep"])
    with ZenohTransport(tree) as transport:
        container = Container(transport)
        for (service, options), run in zip(members, runs, strict=True):
            identity: Identity = options["identity"]
            steps = network["lockstep"] and service.steps
            loop = partial(_run_component, service, run, {**options, **network, "lockstep": steps})
            container.add(identity, service.name, Log(identity.node, network["log_level"]), loop, steps)
        install_signal_handlers(container.stop)
        try:
            container.run()
        except NodeFailed as failure:
            raise _failure(failure, container.nodes) from None
        finally:
            exit_within(CLOSE_S + 10.0, 1)


def _run_component(
    service: Service, run: Run, options: dict[str, Any], node: Node, make_pacer: MakePacer | None
) -> None:
    """Run the loop of one node of a container."""
    subscription = _parameter_subscription(service, node, options)
    params = subscription.params if subscription is not None else options["params"]
    run(Context(node, params, service.rate, options["lockstep"], False, subscription, make_pacer))


def _failure(failure: NodeFailed, nodes: Sequence[str]) -> EleaError:
    """Return the error of a container's process; prints the traceback unless it is an EleaError."""
    error = failure.error
    others = [each for each in nodes if each != failure.node]
    ends = f"; its process ends, and with it {list_names(others, _MAX_LISTED)}" if others else ""
    for kind in (TryAgain, BadInput, EleaError):
        if isinstance(error, kind):
            return kind(f"{failure.node}: {error}{ends}")
    traceback.print_exception(error)
    return EleaError(f"{failure.node} failed: {type(error).__name__}: {error}{ends}")


def _parameter_subscription(service: Service, node: Node, options: dict[str, Any]) -> ParameterSubscription[Any] | None:
    """Subscribe to the service's parameter set; None for a service without one."""
    if service.parameter_set is None or not options["params"].__struct_fields__:
        return None
    ParameterClient.of(node, quiet=service.role == "router").expected = options["await_params"]
    name = node.identity.resolve(service.parameter_set or node.identity.node)
    subscription: ParameterSubscription[Any] = ParameterSubscription(
        node,
        name,
        options["params"],
        fleet=stated(service.parameters, options["fleet"]),
        command_line=stated(service.parameters, options["command_line"]),
    )
    subscription.start()
    return subscription


def _configuration(service: Service, options: dict[str, Any]) -> dict[str, Any]:
    """Return Zenoh's configuration: the router listens as its parameters define, all others connect to it."""
    domain = options["domain"]
    if service.role == "router":
        params = options["params"]
        listen = (params.listen or default_router(), *params.also)
        checked = check_listen(listen, params.insecure, "--param insecure=true")
        return configuration("router", params.link, checked, domain, reliable=options["lockstep"])
    role: Role = "star" if options["topology"] == "star" else "direct"
    return configuration(role, options["connect"] or (default_router(),), domain=domain, reliable=options["lockstep"])

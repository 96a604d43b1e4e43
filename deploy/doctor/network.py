"""Checks ports and the router, and reports the nodes' own health data."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence

from deploy.doctor import Finding, fail, ok, warn
from deploy.doctor.fleet import OBSERVATION_S, check_fleet, nodes_with_loop, observe_fleet, why_lost
from messages.elea import Health, InputHealth
from services.runtime.errors import BadInput, list_names
from services.runtime.fleet_instances import FleetInstance, running_fleets
from services.runtime.graph import Entity
from services.runtime.network_address import NetworkAddress, fleet_router
from services.runtime.ports import port_in_use
from services.runtime.transport.unix_sockets import check_reachable, is_unix, make_private, path_of, remove_stale
from services.runtime.transport.zenoh_config import is_local

VIEWER_PORT = 9876
MOST_ALIKE = 3
"""Maximum number of topics or nodes with the same finding that are reported one by one."""


def ports(address: NetworkAddress) -> Iterator[Finding]:
    """Check whether a router and a live view can listen, or name the holder of the port."""
    fleets = running_fleets()
    held = _fleet_at(address.router, fleets)
    if not is_local(address.router):
        yield ok("port", f"{address.router} is not this machine's")
    elif held is not None:
        yield ok("port", f"{address.router} is held by the fleet {held.fleet} (supervisor {held.pid})")
    elif is_unix(address.router):
        yield from _sockets(address.router)
    elif port_in_use(port := int(address.router.rpartition(":")[2])):
        yield warn(
            "port",
            f"{port} is used by a program that is not one of your fleets",
            f"find it: ss -ltnp sport = :{port}; or use --port",
        )
    else:
        yield ok("port", f"{port} is free for a router")
    if port_in_use(VIEWER_PORT) and not fleets:
        yield warn(
            "live view", f"{VIEWER_PORT} is held by another program", f"find it: ss -ltnp sport = :{VIEWER_PORT}"
        )


def _sockets(router: str) -> Iterator[Finding]:
    """Check whether a router can listen on a Unix socket."""
    folder = path_of(router).parent
    try:
        make_private(folder)
        remove_stale(folder)
    except BadInput as error:
        yield fail("sockets", str(error), "fleets cannot start until this is fixed")
        return
    try:
        check_reachable(router)
    except OSError:
        yield ok("sockets", f"{router} is free for a router, and not accessible to other users")
    else:
        yield warn(
            "sockets", f"{router} is used by a router that no fleet of yours has started", "end it, or use --port"
        )


def access() -> Iterator[Finding]:
    """Report who, besides this user, can drive the robots of the running fleets."""
    for each in running_fleets():
        for where in each.listen:
            users = "every user of this machine" if is_local(where) else "anyone who can reach it over the network"
            yield warn(
                "access",
                f"{each.fleet} listens on {where}: {users} can drive its robots",
                "if this is not needed, remove --listen, and tcp from the fleet file; see docs/security.md",
            )


def router(address: NetworkAddress, asked: bool) -> Iterator[Finding]:
    """Check that the router answers, nodes publish heartbeats, and nothing is lost or refused; ``asked`` if a router
    was named.
    """
    if not asked and not running_fleets():
        yield ok("router", "no fleet is running")
        return
    from services.runtime.graph import snapshot
    from services.runtime.light_node import open_transport

    began = time.monotonic()
    try:
        with open_transport(address.router, address.domain) as transport:
            took = time.monotonic() - began
            entities = snapshot(transport)
            yield ok("router", f"{address.router} joined within {took:.2f} s, {len(nodes_with_loop(entities))} nodes")
            yield from requests(entities)
            seen = observe_fleet(transport, entities)
            yield from nodes(entities, seen.heartbeats, lambda topic, beat: why_lost(topic, beat, seen))
            yield from check_fleet(entities, seen)
    except BadInput as error:
        yield fail("router", str(error), _advice(address.router, running_fleets()))


def requests(entities: Sequence[Entity]) -> Iterator[Finding]:
    """Report requests with several servers: a call of one gets an error instead of an answer."""
    served: dict[str, set[tuple[str, str]]] = {}
    for each in entities:
        if each.kind == "srv":
            served.setdefault(each.name, set()).add((each.node, each.session))
    rivals: dict[tuple[tuple[str, str], ...], list[str]] = {}
    for name, servers in sorted(served.items()):
        if len(servers) > 1:
            rivals.setdefault(tuple(sorted(servers)), []).append(name)
    for several, names in rivals.items():
        processes = ", ".join(f"{node} (session {session[:8]})" for node, session in several)
        listed = list_names(names, 5)
        yield fail("requests", f"{len(several)} processes serve {listed}: {processes}", "stop all but one of them")
    if served and not rivals:
        yield ok("requests", f"{len(served)} services, each served by one process")


def nodes(
    entities: Sequence[Entity], beats: dict[str, Health], cause: Callable[[str, Health], str] | None = None
) -> Iterator[Finding]:
    """Report problems of nodes: no heartbeat, waiting, losses, refusals; ``cause`` gives the cause of losses."""
    silent = [each for each in nodes_with_loop(entities) if each not in beats]
    for name in silent:
        yield warn(
            f"node {name}",
            f"no heartbeat in {OBSERVATION_S:g} s: it is busy, stopped or hung",
            "see ./elea logs, ./elea ps",
        )
    for name, beat in sorted(beats.items()):
        if beat.state == "waiting":
            yield warn(
                f"node {name}", f"it waits: {beat.note or 'it does not say for what'}", "is a simulation running?"
            )
        yield from _losses(beat, cause)
        for each in beat.inputs:
            if each.refused:
                yield warn(
                    f"node {name}",
                    f"{each.topic}: {each.refused} messages refused, the last one: {each.reason}",
                    "see its publishers: ./elea graph",
                )
            if each.resynced or each.repeated > each.received:
                yield warn(
                    f"node {name}",
                    f"{each.topic}: the sequence numbers of a publisher restarted {each.resynced} times, and "
                    f"{each.repeated} repeated messages were dropped, {each.received} accepted",
                    "a program restarted with its old publisher id (choose a new one at each start), or forges "
                    "numbers: ./elea topic info -v",
                )
        if beat.refused_requests:
            yield warn(
                f"node {name}",
                f"{beat.refused_requests} requests were refused, the last one: {beat.request_reason}",
                f"see the log: ./elea logs {name.strip('/')}",
            )
        for what in ("lost", "refused", "resynced"):
            if (unlisted := getattr(beat, what) - sum(getattr(each, what) for each in beat.inputs)) > 0:
                yield warn(
                    f"node {name}",
                    f"{unlisted} messages {what} on topics that the last heartbeat does not list",
                    f"see all: ./elea node info {name}",
                )
    if beats and not silent:
        sound = "none waits, loses or refuses messages" if not _any_problems(beats) else "see above"
        yield ok("nodes", f"{len(beats)} nodes send heartbeats; {sound}")


def _losses(beat: Health, cause: Callable[[str, Health], str] | None) -> Iterator[Finding]:
    """Report the losses of a node; several topics with the same cause in one finding."""
    name, by_cause = beat.node, dict[str, list[InputHealth]]()
    for each in beat.inputs:
        if each.lost:
            why = cause(each.topic, beat) if cause else f"see whether the count grows: ./elea node info {name}"
            by_cause.setdefault(why, []).append(each)
    for why, inputs in by_cause.items():
        if len(inputs) > MOST_ALIKE:
            lost, sent = sum(each.lost for each in inputs), sum(each.lost + each.received for each in inputs)
            listed = ", ".join(each.topic for each in inputs[:MOST_ALIKE])
            topics = f"{len(inputs)} topics, {listed} and {len(inputs) - MOST_ALIKE} more"
            yield warn(f"node {name}", f"{topics}: {lost} of {sent} messages were lost on the way", why)
            continue
        for each in inputs:
            lost, sent = each.lost, each.lost + each.received
            yield warn(f"node {name}", f"{each.topic}: {lost} of {sent} messages were lost on the way", why)


def _any_problems(beats: dict[str, Health]) -> bool:
    return any(b.state == "waiting" or _has_problems(b) for b in beats.values())


def _has_problems(beat: Health) -> bool:
    return bool(beat.lost or beat.refused or beat.resynced) or any(
        i.lost or i.refused or i.resynced for i in beat.inputs
    )


def _advice(router: str, fleets: Sequence[FleetInstance]) -> str:
    if _fleet_at(router, fleets) is not None:
        return "the fleet may be starting, or its router may hang: ./elea ps, ./elea logs router, ./elea restart router"
    advice = "start a fleet: ./elea up; or name its router with --connect"
    elsewhere = ", ".join(f"{each.fleet} with --port {each.port}" for each in fleets)
    return f"{advice}; running: {elsewhere}" if elsewhere else advice


def _fleet_at(router: str, fleets: Sequence[FleetInstance]) -> FleetInstance | None:
    """Return the running fleet whose router has this endpoint."""
    return next((each for each in fleets if router in (fleet_router(each), *each.listen)), None)

"""Ports, the router, and what the nodes of the network say of themselves."""

from __future__ import annotations

import socket
import time
from collections.abc import Iterator, Sequence

from deploy.claim import Running, running
from deploy.doctor import Finding, fail, ok, warn
from deploy.place import Place
from messages.elea import Health
from services.runtime.errors import BadInput
from services.runtime.graph import Entity
from services.runtime.network.transport import Transport

LISTEN_S = 1.6
"""Wall time in which each node beats once, and a busy one as well."""
VIEWER_PORT = 9876


def ports(place: Place) -> Iterator[Finding]:
    """Whether a router and a live view can listen, or who does."""
    fleets = {each.port: each for each in running()}
    address = place.router.partition("/")[2]
    port = int(address.rpartition(":")[2])
    if not address.startswith("127.0.0.1:"):
        yield ok("port", f"{place.router} is not this machine's")
    elif port in fleets:
        yield ok("port", f"{port} is held by the fleet {fleets[port].fleet} (supervisor {fleets[port].pid})")
    elif _taken(port):
        yield warn(
            "port",
            f"{port} is held by a program that is no fleet of yours",
            f"see who: ss -ltnp sport = :{port}; or use --port",
        )
    else:
        yield ok("port", f"{port} is free for a router")
    if _taken(VIEWER_PORT) and not fleets:
        yield warn(
            "live view", f"{VIEWER_PORT} is held by another program", f"see who: ss -ltnp sport = :{VIEWER_PORT}"
        )


def router(place: Place, asked: bool) -> Iterator[Finding]:
    """The router answers, the nodes beat, and nothing is lost or refused; ``asked`` when a router was named."""
    if not asked and not running():
        yield ok("router", "no fleet runs")
        return
    from deploy.live.visit import visit
    from services.runtime.graph import snapshot

    began = time.monotonic()
    try:
        with visit(place.router, place.domain) as transport:
            took = time.monotonic() - began
            entities = snapshot(transport)
            yield ok("router", f"{place.router} joined within {took:.2f} s, {len(_nodes(entities))} nodes")
            yield from nodes(entities, _beats(transport))
    except BadInput as error:
        yield fail("router", str(error), _advice(place.router, running()))


def nodes(entities: Sequence[Entity], beats: dict[str, Health]) -> Iterator[Finding]:
    """What is wrong with nodes: no heartbeat, waiting, losses, refusals."""
    silent = [each for each in _nodes(entities) if each not in beats]
    for name in silent:
        yield warn(
            f"node {name}", f"no heartbeat in {LISTEN_S} s: it is busy, stopped or hung", "see ./elea logs, ./elea ps"
        )
    for name, beat in sorted(beats.items()):
        if beat.state == "waiting":
            yield warn(
                f"node {name}", f"it waits: {beat.note or 'it does not say for what'}", "is a simulation running?"
            )
        for each in beat.inputs:
            if each.lost:
                yield warn(
                    f"node {name}",
                    f"{each.topic}: {each.lost} of {each.received + each.lost} messages were lost on the way",
                    "the machine is overloaded, or the node too slow: see ./elea ps",
                )
            if each.refused:
                yield warn(
                    f"node {name}",
                    f"{each.topic}: {each.refused} messages refused, the last one: {each.reason}",
                    "see who publishes it: ./elea graph",
                )
    if beats and not silent:
        sound = "none waits, loses or refuses" if not _troubled(beats) else "see above"
        yield ok("nodes", f"{len(beats)} beat, {sound}")


def _beats(link: Transport) -> dict[str, Health]:
    """The last heartbeat of each node within LISTEN_S."""
    from messages.topics import HEALTH
    from services.runtime.inputs import Input

    source, heard = Input(HEALTH, HEALTH.name, HEALTH.name[1:], link), {}
    deadline = time.monotonic() + LISTEN_S
    while time.monotonic() < deadline:
        link.wait(source.inlet)
        source.admit()
        heard.update({beat.node: beat for beat, _ in source.batch})
    return heard


def _nodes(entities: Sequence[Entity]) -> list[str]:
    """The nodes that have a loop; those of short-lived tools, whose names begin with an underscore, have none."""
    names = {each.node for each in entities if each.kind == "node"}
    return sorted(each for each in names if not each.rpartition("/")[2].startswith("_"))


def _troubled(beats: dict[str, Health]) -> bool:
    return any(b.state == "waiting" or any(i.lost or i.refused for i in b.inputs) for b in beats.values())


def _advice(router: str, fleets: Sequence[Running]) -> str:
    port = router.rpartition(":")[2]
    if any(str(each.port) == port for each in fleets):
        return "the fleet may be starting, or its router hang: ./elea ps, ./elea logs router, ./elea restart router"
    advice = "start a fleet: ./elea up; or name its router with --connect"
    elsewhere = ", ".join(f"{each.fleet} with --port {each.port}" for each in fleets)
    return f"{advice}; running: {elsewhere}" if elsewhere else advice


def _taken(port: int) -> bool:
    with socket.socket() as probe:
        probe.settimeout(0.5)
        return probe.connect_ex(("127.0.0.1", port)) == 0

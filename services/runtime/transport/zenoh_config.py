"""The one function that writes Zenoh's configuration; every key in it was measured to matter."""

from __future__ import annotations

import ipaddress
from collections.abc import Iterable
from typing import Any, Literal

from services.runtime.errors import BadInput
from services.runtime.transport import unix_sockets

PORT = 7447
"""Default port of a fleet, and Zenoh's own default. It names the folder of the fleet's Unix sockets, and is the TCP
port of a fleet that also listens on TCP."""

Role = Literal["router", "direct", "star"]
"""A router; a peer that talks straight to its fellows; a client that goes through the router."""

OPEN_MS = 500
"""Maximum wall time [ms] of opening a peer. It ends earlier when the router, and all peers that it knows, are linked
and have sent their declarations. A router would always wait that long, for nothing."""

RELIABLE_S = 30
"""Wall time [s] that lockstep keeps a link whose other side is silent or takes nothing. The end of a process closes its
links at once, and a supervisor ends one that hangs."""

LARGEST_MESSAGE = 8 << 20
"""Bytes; a larger message is dropped by the receiving link before it is put together."""

_QUEUES = ("control", "real_time", "interactive_high", "interactive_low", "data_high", "data", "data_low", "background")
"""One for each priority; declarations are in the first."""
_BATCHED = {
    "id": "batched",
    "messages": ["put"],
    "key_exprs": ["**"],
    "overwrite": {"express": False},
    "flows": ["egress"],
}
"""A router forwards messages in batches, also commands. One by one, sixteen filled its queue: beside twelve
busy processes a client lost 65 of 105,600 samples, all of them commands; in batches, 0 of 59,400. Through a router a
message of its own is no faster: 429 us there and back, in batches 409."""


_UNFIT = {
    "tls": "it needs certificates, which Elea does not have yet",
    "quic": "it needs certificates, which Elea does not have yet",
    "ws": "it is as open as tcp, and slower",
    "udp": "it loses messages",
}
"""Protocols of Zenoh that are refused, and why."""


def default_router() -> str:
    """The default endpoint of a node's router."""
    return unix_sockets.router_endpoint(PORT)


def endpoint(text: str) -> str:
    """Check an endpoint, ``unixsock-stream/PATH`` or ``tcp/HOST:PORT``; a bare ``HOST:PORT`` is taken as tcp.

    Raises BadInput.
    """
    full = text if "/" in text else f"tcp/{text}"
    protocol, _, address = full.partition("/")
    if protocol == unix_sockets.PROTOCOL:
        unix_sockets.check_path(address)
        return full
    if protocol in _UNFIT:
        raise BadInput(f"the endpoint {text!r} cannot be used: {_UNFIT[protocol]}; write it as tcp/HOST:PORT")
    host, _, port = address.rpartition(":")
    if protocol != "tcp" or not host or not port.isdecimal() or int(port) > 65535:
        raise BadInput(f"{text!r} is not an endpoint; write it as tcp/127.0.0.1:7447 or {unix_sockets.PROTOCOL}//PATH")
    return full


def is_local(checked: str) -> bool:
    """Whether an endpoint, as ``endpoint`` gives it, is out of reach for other machines."""
    if unix_sockets.is_unix(checked):
        return True
    host = checked.partition("/")[2].rpartition(":")[0].strip("[]")
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


def check_listen(endpoints: Iterable[str], insecure: bool, allow: str = "--insecure") -> tuple[str, ...]:
    """The checked endpoints; raises BadInput for one that other machines can reach, unless that is allowed.

    ``allow`` is the option that allows it, for errors.
    """
    checked = tuple(endpoint(each) for each in endpoints)
    if not insecure:
        for each in checked:
            if not is_local(each):
                raise BadInput(
                    f"listening on {each}: {OPEN_TO_ALL}. Listen on 127.0.0.1, or on an address of a network that you "
                    f"trust, and then say so with {allow}"
                )
    return checked


OPEN_TO_ALL = "anyone who can reach this address can read everything and drive the robots, without a password"


def configuration(
    role: Role,
    connect: tuple[str, ...] = (),
    listen: tuple[str, ...] = (),
    domain: str = "",
    reliable: bool = False,
    first: bool = False,
) -> dict[str, Any]:
    """The configuration of one session, as the tree that Zenoh reads as JSON5.

    This machine by default: a peer listens on a Unix socket beside its router's, or on 127.0.0.1 where the router is
    reached by TCP; nothing is multicast. Gossip makes peers of one router find each other. Leases of 2 s on both sides
    (RELIABLE_S in lockstep), because each side waits for the lease that the *other* announces; retries after 0.1 to
    0.5 s, because the default of 4 s leaves a fleet dumb after its router returns. Shared memory is off: a receiver
    keeps 17 MB for each sender that restarts. ``first``: the supervisor, which starts before the router and does not
    wait for links.

    ``reliable`` (lockstep) keeps the link to a process that stands still for RELIABLE_S, and waits up to 2 s for room
    before it drops, in the router as well; simulation time waits with it. A link between peers that was given up comes
    back only when one of them finds the router anew. Of 12,000 samples to a client that stood still for 0.8 s, a router
    that waits 10 ms lost 2,700, this one none.

    Commands, each a packet of its own, queue in 16 batches for each link in place of 2, made when they are needed: in
    real time, beside 40 processes that start others on two cores, ``lab`` lost 1 to 7 messages in most runs of 20 s,
    and none in 13 with 16; memory is the same. The same holds for all messages in a router: of a lockstep fleet at full
    speed, its clients lost 27 of 49,500 samples; and of what nodes declare, because a router that waits for room there
    holds its tables, and a new link that waits for these may have stopped the one thread that tells it of room: beside
    twelve busy processes, 100 robots in ten stood still for 20 s in 9 of 11 starts. On the wall clock a router's full
    queue has 10 ms to move in place of 1, as its sender may not have had a processor. A stuck client costs this once:
    Zenoh then drops what is for it without waiting, until it takes something again.
    """
    connects = tuple(endpoint(each) for each in connect)
    listens = tuple(endpoint(each) for each in listen) or (_socket_beside(connects) if role == "direct" else ())
    lease_s = RELIABLE_S if reliable else 2
    patience = 2_000_000 if reliable else 10_000 if role == "router" else 1_000
    tree: dict[str, Any] = {
        "mode": {"router": "router", "direct": "peer", "star": "client"}[role],
        "listen": {"endpoints": list(listens)},
        "connect": {
            "endpoints": list(connects),
            "timeout_ms": 10_000 if role == "star" else -1,
            "exit_on_failure": role == "star",
            "retry": {"period_init_ms": 100, "period_max_ms": 500, "period_increase_factor": 1.5},
        },
        "scouting": {
            "delay": 0 if first or role == "router" else OPEN_MS,
            "multicast": {"enabled": False},
            "gossip": {"enabled": role != "star"},
        },
        "timestamping": {"enabled": True},
        "transport": {
            "unicast": {"open_timeout": 2000, "accept_timeout": 1000, "accept_pending": 1000},
            "link": {
                "tx": {
                    "lease": lease_s * 1000,
                    "keep_alive": 4,
                    "queue": {
                        "size": dict.fromkeys(_QUEUES, 16) if role == "router" else {"real_time": 16},
                        "congestion_control": {
                            "drop": {"wait_before_drop": patience},
                            "block": {"wait_before_close": RELIABLE_S * 1_000_000 if reliable else 1_000_000},
                        },
                    },
                },
                "rx": {"max_message_size": LARGEST_MESSAGE},
            },
            "shared_memory": {"enabled": False},
        },
    }
    if role == "router":
        tree["qos"] = {"network": [_BATCHED]}
    if domain:
        tree["namespace"] = domain
    return tree


def _socket_beside(routers: tuple[str, ...]) -> tuple[str, ...]:
    """The endpoints of a peer of these routers: one reached by TCP may have peers that no Unix socket reaches."""
    unix = [each for each in routers if unix_sockets.is_unix(each)][:1]
    tcp = ("tcp/127.0.0.1:0",) if len(unix) < len(routers) or not routers else ()
    return (*map(unix_sockets.node_endpoint, unix), *tcp)

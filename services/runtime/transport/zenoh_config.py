"""Zenoh's configuration, in one function; every key in it was measured to matter."""

from __future__ import annotations

import ipaddress
import os
from collections.abc import Iterable
from typing import Any, Literal

from services.runtime.errors import BadInput
from services.runtime.transport import unix_sockets

PORT = 7447
"""Default port of a fleet, which is Zenoh's own default. It names the folder of the fleet's Unix sockets, and is the
TCP port of a fleet that also listens on TCP."""

Role = Literal["router", "direct", "star"]
"""A router; a peer with direct links to other peers; a client that goes through the router."""

OPEN_MS = 500
"""Maximum wall time [ms] of opening a peer. It ends earlier when the router, and all peers that it knows, are linked
and have sent their declarations. A router would always wait that long, for nothing."""

RELIABLE_S = 30
"""Wall time [s] that lockstep keeps a link whose other side is silent or receives nothing. The end of a process closes
its links at once, and a supervisor ends a hung one."""

LINKING_S = 30
"""Wall time [s] for two processes of one machine to establish a link. When it has passed, Zenoh gives up half-way: a
process that got no CPU time for that long may keep a link on which it sends but never receives. With the 1 and 2 s
used for TCP links, 6 of 400 starts of six peers, each stopped for up to 3 s while joining, left one peer that did not
receive from another; with 10 and 30 s, none of 650 did."""

LARGEST_MESSAGE = 8 << 20
"""Maximum bytes of a message; a larger one is dropped by the receiving link before it is reassembled."""

_QUEUES = ("control", "real_time", "interactive_high", "interactive_low", "data_high", "data", "data_low", "background")
"""The queue of each priority; declarations use the first."""
_BATCHED = {
    "id": "batched",
    "messages": ["put"],
    "overwrite": {"express": False},
    "flows": ["egress"],
}
"""A router forwards all messages in batches, including commands. One by one, sixteen filled its queue: beside twelve
busy processes, a client lost 65 of 105,600 samples, all of them commands; in batches, 0 of 59,400. Through a router, a
separate message is no faster: a round trip takes 429 us, in batches 409 us.

It names no keys, which means all of them. With ``key_exprs``, Zenoh 1.10 keeps for each link and key whether they
match, and reads this without a lock: a client that left while messages flowed to it could end the router with a
segmentation fault."""


_UNFIT = {
    "tls": "it needs certificates, which Elea does not have yet",
    "quic": "it needs certificates, which Elea does not have yet",
    "ws": "it is as open as tcp, and slower",
    "udp": "it loses messages",
}
"""Refused protocols of Zenoh, with the reason."""


def default_router() -> str:
    """Return the default endpoint of a node's router."""
    return unix_sockets.router_endpoint(PORT)


def endpoint(text: str) -> str:
    """Check and return an endpoint, ``unixsock-stream/PATH`` or ``tcp/HOST:PORT``; a bare ``HOST:PORT`` means tcp.

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
    """Return whether an endpoint checked by ``endpoint`` is unreachable for other machines."""
    if unix_sockets.is_unix(checked):
        return True
    host = checked.partition("/")[2].rpartition(":")[0].strip("[]")
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


def check_listen(endpoints: Iterable[str], insecure: bool, allow: str = "--insecure") -> tuple[str, ...]:
    """Check and return endpoints; raises BadInput for one that other machines can reach, unless ``insecure``.

    ``allow`` is the option that allows it, for the error text.
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
    """Return the configuration of one session, as the tree that Zenoh reads as JSON5.

    It is limited to this machine by default: a peer listens on a Unix socket beside its router's, or on 127.0.0.1 if
    the router is reached by TCP; multicast is off. Gossip makes peers of one router find each other when one of them
    joins it; ``peer_links`` restores a link that breaks later. Leases are 2 s on both sides (RELIABLE_S in lockstep),
    because each side waits for the lease that the *other* announces; retries follow after 0.1 to 0.5 s, because the
    default of 4 s leaves a fleet without links after its router returns. Shared memory is off: a receiver keeps 17 MB
    for each sender that restarts. ``first``: the supervisor, which starts before the router and does not wait for
    links.

    ``reliable`` (lockstep) keeps the link to a stopped process for RELIABLE_S, and waits up to 2 s for space before it
    drops a message, in the router as well; simulation time waits meanwhile. Of 12,000 samples to a client stopped for
    0.8 s, a router that waits 10 ms lost 2,700, this one none.

    Commands, each a packet of its own, queue in 16 batches per link instead of 2, allocated on demand: in real time,
    beside 40 processes that start others on two cores, ``lab`` lost 1 to 7 messages in most runs of 20 s, and none in
    13 runs with 16; memory use is the same. Data keeps its 2: with 16, the maximum throughput fell from 160,000 to
    104,000 messages a second. The price: beside fleets that kept both cores busy, a simulation of six robots that
    lagged by a second lost 50 to 213 messages on its link to the grader in 3 of 4 runs with 2, and none with 16. A
    router has 16 for all messages (otherwise, in a lockstep fleet at full speed, its clients lost 27 of 49,500 samples)
    and for declarations: a router that waits for space there locks its tables, and a new link that waits for these may
    block the only thread that reports free space: beside twelve busy processes, 100 robots in ten processes stood still
    for 20 s in 9 of 11 starts. On the wall clock, a router waits 10 ms instead of 1 for space in a full queue, as its
    sending thread may not have had a CPU. A stuck client costs this once: Zenoh then drops its messages without
    waiting, until it receives again.
    """
    connects = tuple(endpoint(each) for each in connect)
    session = _new_session_id()
    listens = tuple(endpoint(each) for each in listen) or (
        _socket_beside(connects, session) if role == "direct" else ()
    )
    local = all(map(unix_sockets.is_unix, (*connects, *listens)))
    lease_s = RELIABLE_S if reliable else 2
    drop_wait_us = 2_000_000 if reliable else 10_000 if role == "router" else 1_000
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
            "unicast": {
                "open_timeout": LINKING_S * 1000 if local else 2000,
                "accept_timeout": LINKING_S * 1000 if local else 1000,
                "accept_pending": 1000,
            },
            "link": {
                "tx": {
                    "lease": lease_s * 1000,
                    "keep_alive": 4,
                    "queue": {
                        "size": dict.fromkeys(_QUEUES, 16) if role == "router" else {"real_time": 16},
                        "congestion_control": {
                            "drop": {"wait_before_drop": drop_wait_us},
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
    if role == "direct" and not listen:
        tree["id"] = session  # names the socket
    return tree


def _new_session_id() -> str:
    """Return a random id of 32 hex digits, of which Zenoh takes no zero for the first."""
    while (made := os.urandom(16).hex()).startswith("0"):
        pass
    return made


def _socket_beside(routers: tuple[str, ...], session: str) -> tuple[str, ...]:
    """Return the endpoints of a peer of these routers; with one reached by TCP also a TCP endpoint, for its peers."""
    unix = [each for each in routers if unix_sockets.is_unix(each)][:1]
    tcp = ("tcp/127.0.0.1:0",) if len(unix) < len(routers) or not routers else ()
    return (*(unix_sockets.node_endpoint(each, session) for each in unix), *tcp)

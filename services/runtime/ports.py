"""TCP ports: find a free one, check whether one is in use, and why a server cannot listen on one."""

from __future__ import annotations

import socket

LOOPBACK = "127.0.0.1"


def free_port() -> int:
    """Return a port chosen by the system that was free at the time of the call."""
    with socket.socket() as probe:
        probe.bind((LOOPBACK, 0))
        return int(probe.getsockname()[1])


def first_free_port(port: int) -> int:
    """Return the first port from ``port`` to ``port + 99`` that a server can listen on; ``port`` if there is none."""
    return next((each for each in range(port, min(port + 100, 65536)) if not bind_error(each)), port)


def port_in_use(port: int, timeout: float = 0.5) -> bool:
    """Return whether a program accepts connections on a loopback port within ``timeout`` [s]."""
    with socket.socket() as probe:
        probe.settimeout(timeout)
        return probe.connect_ex((LOOPBACK, port)) == 0


def bind_error(port: int, host: str = LOOPBACK) -> OSError | None:
    """Return the error of listening on a port of a host name or address, or None if it would succeed."""
    try:
        family, kind, protocol, _, address = socket.getaddrinfo(
            host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
        )[0]
        with socket.socket(family, kind, protocol) as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            probe.bind(address)
    except OSError as error:
        return error
    return None

"""TCP ports: a free one, whether one is in use, and why a server cannot listen on one."""

from __future__ import annotations

import socket

LOOPBACK = "127.0.0.1"


def free_port() -> int:
    """A port that was free a moment ago, chosen by the system."""
    with socket.socket() as probe:
        probe.bind((LOOPBACK, 0))
        return int(probe.getsockname()[1])


def first_free_port(port: int) -> int:
    """``port`` if a server can listen on it, else the first free one of the next 99; ``port`` if there is none."""
    return next((each for each in range(port, min(port + 100, 65536)) if not bind_error(each)), port)


def port_in_use(port: int, timeout: float = 0.5) -> bool:
    """Whether a program accepts connections on a port within ``timeout`` [s]."""
    with socket.socket() as probe:
        probe.settimeout(timeout)
        return probe.connect_ex((LOOPBACK, port)) == 0


def bind_error(port: int, host: str = LOOPBACK) -> OSError | None:
    """Why a server could not listen on a port of a name or address, or None when it could."""
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

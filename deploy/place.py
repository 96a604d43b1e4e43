"""The network that a person means: that of the fleet which runs, unless told otherwise."""

from __future__ import annotations

from typing import NamedTuple

from deploy.claim import Running, running
from deploy.fleet import PORT
from services.runtime.errors import BadInput


class Place(NamedTuple):
    """A network to join: the endpoint of a router, and the domain of the fleet."""

    router: str
    domain: str

    @property
    def arguments(self) -> list[str]:
        """The words with which a service is started there."""
        return ["--connect", self.router, *(("--domain", self.domain) if self.domain else ())]


def place_of(connect: str = "", domain: str = "", port: int | None = None) -> Place:
    """The network that the options name; raises BadInput where several fleets run and none is chosen."""
    if not connect and running():
        fleet = chosen(port)
        return Place(f"tcp/127.0.0.1:{fleet.port}", domain or fleet.domain)
    return Place(connect or f"tcp/127.0.0.1:{port or PORT}", domain)


def chosen(port: int | None) -> Running:
    """The fleet that runs on ``port``, or the only one; raises BadInput."""
    fleets = running()
    if not fleets:
        raise BadInput("no fleet runs: start one with ./elea up")
    if port is None and len(fleets) == 1:
        return fleets[0]
    for each in fleets:
        if each.port == port:
            return each
    listed = ", ".join(f"{each.fleet} (--port {each.port})" for each in fleets)
    raise BadInput(
        f"{'several fleets run' if port is None else f'no fleet runs on port {port}'}: choose one of {listed}"
    )

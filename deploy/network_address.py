"""The network that the command line's options select: by default that of the running fleet."""

from __future__ import annotations

from typing import NamedTuple

from services.runtime.errors import BadInput
from services.runtime.fleet_instances import FleetInstance, running_fleets
from services.runtime.transport.unix_sockets import router_endpoint
from services.runtime.transport.zenoh_config import PORT, endpoint, is_local


class NetworkAddress(NamedTuple):
    """A network to join: the endpoint of a router, and the domain of the fleet."""

    router: str
    domain: str

    @property
    def arguments(self) -> list[str]:
        """The words with which a service is started there."""
        far = () if is_local(endpoint(self.router)) else ("--topology", "star")  # peers meet on one machine alone
        return ["--connect", self.router, *(("--domain", self.domain) if self.domain else ()), *far]


def resolve_address(connect: str = "", domain: str = "", port: int | None = None) -> NetworkAddress:
    """The network that the options name; raises BadInput where several fleets run and none is chosen."""
    if not connect and running_fleets():
        fleet = select_fleet(port)
        return NetworkAddress(fleet_router(fleet), domain or fleet.domain)
    return NetworkAddress(connect or router_endpoint(port or PORT), domain)


def fleet_router(fleet: FleetInstance) -> str:
    """The endpoint of a running fleet's router, as its supervisor recorded it: the environment may differ here."""
    return fleet.router or router_endpoint(fleet.port)


def select_fleet(port: int | None) -> FleetInstance:
    """The fleet that runs on ``port``, or the only one; raises BadInput."""
    fleets = running_fleets()
    if not fleets:
        raise BadInput("no fleet is running: start one with ./elea up")
    if port is None and len(fleets) == 1:
        return fleets[0]
    for each in fleets:
        if each.port == port:
            return each
    listed = ", ".join(f"{each.fleet} (--port {each.port})" for each in fleets)
    problem = "several fleets are running" if port is None else f"no fleet is running on port {port}"
    raise BadInput(f"{problem}: choose one of {listed}")

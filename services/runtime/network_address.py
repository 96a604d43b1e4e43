"""The network selected by the options of the command line, by default that of the running fleet."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from services.runtime.errors import BadInput, unknown_name
from services.runtime.fleet_instances import FleetInstance, running_fleets
from services.runtime.transport.unix_sockets import router_endpoint
from services.runtime.transport.zenoh_config import PORT, endpoint, is_local


class NetworkAddress(NamedTuple):
    """A network to join: the endpoint of a router, and the domain of the fleet."""

    router: str
    domain: str

    @property
    def arguments(self) -> list[str]:
        """The command-line options that start a service on this network."""
        far = () if is_local(endpoint(self.router)) else ("--topology", "star")  # peers connect only on one machine
        return ["--connect", self.router, *(("--domain", self.domain) if self.domain else ()), *far]


def resolve_address(connect: str = "", domain: str = "", port: int | None = None) -> NetworkAddress:
    """Return the network that the options select; raises BadInput if several fleets run and none is chosen."""
    if not connect and running_fleets():
        fleet = select_fleet(port)
        return NetworkAddress(fleet_router(fleet), domain or fleet.domain)
    return NetworkAddress(connect or router_endpoint(port or PORT), domain)


def fleet_router(fleet: FleetInstance) -> str:
    """Return the endpoint of a running fleet's router, as recorded by its supervisor: the environment may differ."""
    return fleet.router or router_endpoint(fleet.port)


def port_of_fleet(name: str, port: int | None = None) -> int:
    """Return the port of the running fleet ``name``, of the one on ``port`` if several have it; raises BadInput."""
    fleets = running_fleets()
    found = [each for each in fleets if each.fleet == name and port in (None, each.port)]
    if len(found) == 1:
        return found[0].port
    if found:
        raise BadInput(f"{len(found)} fleets named {name} are running: choose one of {_choices(found)}")
    if any(each.fleet == name for each in fleets):
        raise BadInput(f"the fleet {name} does not run on port {port}: choose one of {_choices(fleets)}")
    raise unknown_name("running fleet", name, [each.fleet for each in fleets])


def select_fleet(port: int | None) -> FleetInstance:
    """Return the fleet that runs on ``port``, or the only one; raises BadInput."""
    fleets = running_fleets()
    if not fleets:
        raise BadInput("no fleet is running: start one with ./elea up")
    if port is None and len(fleets) == 1:
        return fleets[0]
    for each in fleets:
        if each.port == port:
            return each
    problem = "several fleets are running" if port is None else f"no fleet is running on port {port}"
    raise BadInput(f"{problem}: choose one of {_choices(fleets)}")


def _choices(fleets: Sequence[FleetInstance]) -> str:
    """Format ``--fleet bare, --fleet two``; with ports where several fleets have the same name."""
    names = [each.fleet for each in fleets]
    return ", ".join(
        f"--fleet {each.fleet}" if names.count(each.fleet) == 1 else f"--port {each.port} ({each.fleet})"
        for each in fleets
    )

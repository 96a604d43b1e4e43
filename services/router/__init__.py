"""The router: the meeting point of a machine's nodes, and the link to other machines."""

from typing import Annotated

from msgspec import Meta

from services.runtime.parameters.base import Parameters
from services.runtime.service import Service


class RouterParameters(Parameters, frozen=True, kw_only=True):
    """Where the router listens and which other routers it joins."""

    listen: Annotated[
        str,
        Meta(
            description="Endpoint for this machine's nodes; the user's Unix socket of port 7447 by default.",
            extra={"live": False},
        ),
    ] = ""
    also: Annotated[
        tuple[str, ...],
        Meta(description="Further endpoints to listen on, e.g. tcp/127.0.0.1:7447.", extra={"live": False}),
    ] = ()
    insecure: Annotated[
        bool, Meta(description="Allow endpoints that other machines can reach.", extra={"live": False})
    ] = False
    link: Annotated[
        tuple[str, ...],
        Meta(description="Endpoints of routers on other machines to connect to.", extra={"live": False}),
    ] = ()


SERVICE = Service(
    name="router",
    about="Zenoh router: connects the nodes of a machine, and other machines.",
    run="services.router.loop:run",
    parameters=RouterParameters,
    role="router",
)

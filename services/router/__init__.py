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
            description="endpoint where the nodes of this machine meet; the user's Unix socket of port 7447 by default",
            extra={"live": False},
        ),
    ] = ""
    also: Annotated[
        tuple[str, ...],
        Meta(description="further endpoints to listen on, as tcp/127.0.0.1:7447", extra={"live": False}),
    ] = ()
    insecure: Annotated[
        bool, Meta(description="listen where other machines can reach the router, too", extra={"live": False})
    ] = False
    link: Annotated[
        tuple[str, ...], Meta(description="endpoints of routers on other machines", extra={"live": False})
    ] = ()


SERVICE = Service(
    name="router",
    about="The meeting point of all nodes of a machine.",
    run="services.router.loop:run",
    parameters=RouterParameters,
    role="router",
)

"""The router service: connects the nodes of a machine with each other and with other machines."""

from services.runtime import Parameters, Service, param


class RouterParameters(Parameters):
    """Parameters of the router: its endpoints, and other routers to join."""

    listen: str = param(
        "",
        text="Endpoint for this machine's nodes; the user's Unix socket of port 7447 by default.",
        live=False,
    )
    also: tuple[str, ...] = param((), text="Further endpoints to listen on, e.g. tcp/127.0.0.1:7447.", live=False)
    insecure: bool = param(False, text="Allow endpoints that other machines can reach.", live=False)
    link: tuple[str, ...] = param((), text="Endpoints of routers on other machines to connect to.", live=False)


SERVICE = Service(
    name="router",
    about="Zenoh router: connects the nodes of a machine, and other machines.",
    run="services.router.loop:run",
    parameters=RouterParameters,
    role="router",
)

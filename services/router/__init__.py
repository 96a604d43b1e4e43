"""The router: the meeting point of a machine's nodes, and the link to other machines."""

from services.runtime import Parameters, Service, param


class RouterParameters(Parameters, frozen=True, kw_only=True):
    """Where the router listens and which other routers it joins."""

    listen: str = param(
        "",
        text="endpoint where the nodes of this machine meet; the user's Unix socket of port 7447 by default",
        live=False,
    )
    also: tuple[str, ...] = param((), text="further endpoints to listen on, as tcp/127.0.0.1:7447", live=False)
    insecure: bool = param(False, text="listen where other machines can reach the router, too", live=False)
    link: tuple[str, ...] = param((), text="endpoints of routers on other machines", live=False)


SERVICE = Service(
    name="router",
    about="The meeting point of all nodes of a machine.",
    run="services.router.loop:run",
    parameters=RouterParameters,
    role="router",
)

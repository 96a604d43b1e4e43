"""The panel service: a web page on the loopback to watch, drive, tune and stop a fleet."""

from __future__ import annotations

from services.runtime import Parameters, Service, param


class PanelParameters(Parameters, frozen=True, kw_only=True):
    """Where the page is, and what those who look at it may do."""

    port: int = param(
        8600, 0, 65535, "", "port on 127.0.0.1; when it is taken, the next free one; 0 takes any", live=False
    )
    address: str = param(
        "", text="file for the page's address and token, readable by its owner", max_length=4096, live=False
    )
    deadline: float = param(5.0, 0.1, 30, "s", "wall time after which a request counts as unanswered")
    silence: float = param(0.3, 0.1, 2, "s", "a page that drives and says nothing for so long has let the robot go")
    give_way: float = param(
        3.0, 0.3, 60, "s", "simulation time for which zero is held after a drive; then others may drive"
    )
    max_linear: float = param(1.0, 0.05, 10, "m/s", "no page drives a robot faster")
    max_angular: float = param(3.0, 0.1, 20, "rad/s", "no page turns a robot faster")
    pages: int = param(16, 1, 64, "", "pages that may be open at once", live=False)


SERVICE = Service(
    name="panel",
    about="a web page on the loopback to watch, drive, tune and stop a fleet",
    run="services.panel.loop:run",
    parameters=PanelParameters,
    role="observer",
)

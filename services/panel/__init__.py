"""The panel service: a web page on the loopback interface to watch, drive, tune and stop a fleet."""

from __future__ import annotations

from services.runtime import Parameters, Service, param


class PanelParameters(Parameters):
    """Parameters of the panel: the page's address, and the limits on its users."""

    port: int = param(
        8600, 0, 65535, "", "Port on 127.0.0.1; the next free one if it is taken, any free one if 0.", live=False
    )
    address: str = param(
        "", text="File for the page's address and token, readable only by its owner.", max_length=4096, live=False
    )
    deadline: float = param(5.0, 0.1, 30, "s", "Wall time after which a request counts as unanswered.")
    silence: float = param(0.3, 0.1, 2, "s", "Release the robot when the driving page has sent nothing for this long.")
    give_way: float = param(
        3.0, 0.3, 60, "s", "Simulation time for which zero is sent after a drive, before others may drive."
    )
    max_linear: float = param(1.0, 0.05, 10, "m/s", "Maximum speed that a page can command.")
    max_angular: float = param(3.0, 0.1, 20, "rad/s", "Maximum turn rate that a page can command.")
    pages: int = param(16, 1, 64, "", "Maximum number of pages open at once.", live=False)


SERVICE = Service(
    name="panel",
    about="Serves a web page on the loopback to watch, drive, tune and stop a fleet.",
    run="services.panel.loop:run",
    parameters=PanelParameters,
    role="observer",
)

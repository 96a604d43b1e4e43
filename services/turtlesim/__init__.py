"""The turtlesim service: turtles on a plane, with the topics, services and parameters of ROS's turtlesim.

It runs on simulation time: in a fleet, its world has no robots. ROS's turtlesim moves its turtles every 16 ms of wall
time; this one every 20 ms of simulation time, which are four physics steps.
"""

from __future__ import annotations

from services.runtime import Parameters, Service, param

RATE_HZ = 50


class TurtlesimParameters(Parameters):
    """Parameters of turtlesim; a new colour is painted at the next ``clear`` or ``reset``, as in ROS."""

    background_r: int = param(69, 0, 255, "", "Red of the background.")
    background_g: int = param(86, 0, 255, "", "Green of the background.")
    background_b: int = param(255, 0, 255, "", "Blue of the background.")
    holonomic: bool = param(False, text="Whether turtles also move sideways, by linear.y.", live=False)


SERVICE = Service(
    name="turtlesim",
    about="Moves turtles on a plane and draws their trails, as ROS's turtlesim.",
    run="services.turtlesim.loop:run",
    rate=RATE_HZ,
    alone="it subscribes to topics as turtles are spawned",
    parameters=TurtlesimParameters,
)

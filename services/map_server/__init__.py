"""The map server: publishes the map of a map.yaml on a latched topic, like ROS's map_server."""

from __future__ import annotations

from services.runtime import Parameters, Service, param


class MapServerParameters(Parameters):
    """Parameters of the map server."""

    map: str = param("", text="The map.yaml of the map.", max_length=4096, live=False)
    frame_id: str = param("map", text="Frame of the map.", max_length=255, live=False)


SERVICE = Service(
    name="map_server",
    about="Publishes the map of a map.yaml, and answers static_map.",
    run="services.map_server.loop:run",
    rate=10,
    parameters=MapServerParameters,
    parameter_set=None,
)

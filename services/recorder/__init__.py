"""The recorder service: writes what travels on the bus into a bag that ROS 2's tools read."""

from __future__ import annotations

from typing import Annotated

from msgspec import Meta

from services.runtime.parameters.base import Parameters
from services.runtime.service import Service


class RecorderParameters(Parameters, frozen=True, kw_only=True):
    """What to record, and where to."""

    output: Annotated[str, Meta(description="folder of the bag; it must not be there yet")] = "bag"
    topics: Annotated[
        tuple[str, ...], Meta(description="names of the topics to record; all of them when nothing else is chosen")
    ] = ()
    regex: Annotated[str, Meta(description="regular expression: record the topics in whose names it is found")] = ""
    exclude: Annotated[str, Meta(description="regular expression: do not record topics in whose names it is found")] = (
        ""
    )
    max_size: Annotated[
        int,
        Meta(ge=0, le=2**50, description="begin a new file at this size; 0 is no limit", extra={"unit": "byte"}),
    ] = 0
    max_duration: Annotated[
        float, Meta(ge=0, le=1e9, description="begin a new file after this wall time; 0: never", extra={"unit": "s"})
    ] = 0.0
    resume: Annotated[bool, Meta(description="go on in the folder if it is there, with another file")] = False
    members: Annotated[
        tuple[str, ...], Meta(description="nodes that tick before it does: then it has heard of all their topics")
    ] = ()


SERVICE = Service(
    name="recorder",
    about="records topics into a bag: MCAP in a rosbag2 folder, as ROS 2's tools read it",
    run="services.recorder.loop:run",
    rate=100,
    parameters=RecorderParameters,
    role="observer",
)

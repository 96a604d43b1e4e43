"""The recorder service: writes what travels on the bus into a bag that ROS 2's tools read."""

from __future__ import annotations

from typing import Annotated

from msgspec import Meta

from services.runtime.parameters.base import Parameters
from services.runtime.service import Service


class RecorderParameters(Parameters, frozen=True, kw_only=True):
    """What to record, and where to."""

    output: Annotated[str, Meta(description="Folder of the bag; it must not exist yet.")] = "bag"
    topics: Annotated[
        tuple[str, ...], Meta(description="Topics to record; all if neither topics nor regex is given.")
    ] = ()
    regex: Annotated[str, Meta(description="Record topics whose names match this regular expression.")] = ""
    exclude: Annotated[str, Meta(description="Do not record topics whose names match this regular expression.")] = ""
    max_size: Annotated[
        int,
        Meta(ge=0, le=2**50, description="Start a new file at this size; 0 for no limit.", extra={"unit": "byte"}),
    ] = 0
    max_duration: Annotated[
        float,
        Meta(ge=0, le=1e9, description="Start a new file after this wall time; 0 for no limit.", extra={"unit": "s"}),
    ] = 0.0
    resume: Annotated[bool, Meta(description="Continue an existing bag with another file.")] = False
    members: Annotated[
        tuple[str, ...], Meta(description="Nodes to wait for before recording, so that all their topics are known.")
    ] = ()


SERVICE = Service(
    name="recorder",
    about="Records topics into a bag: MCAP in a rosbag2 folder, readable by ROS 2.",
    run="services.recorder.loop:run",
    rate=100,
    parameters=RecorderParameters,
    role="observer",
)

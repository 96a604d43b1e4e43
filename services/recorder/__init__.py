"""The recorder service: writes what travels on the bus into a bag that ROS 2's tools read."""

from __future__ import annotations

from services.runtime import Parameters, Service, param


class RecorderParameters(Parameters, frozen=True, kw_only=True):
    """What to record, and where to."""

    output: str = param("bag", text="folder of the bag; it must not be there yet")
    topics: tuple[str, ...] = param((), text="names of the topics to record; all of them when nothing else is chosen")
    regex: str = param("", text="regular expression: record the topics in whose names it is found")
    exclude: str = param("", text="regular expression: do not record topics in whose names it is found")
    max_size: int = param(0, 0, 2**50, "byte", "begin a new file at this size; 0 is no limit")
    max_duration: float = param(0.0, 0, 1e9, "s", "begin a new file after this wall time; 0: never")
    resume: bool = param(False, text="go on in the folder if it is there, with another file")
    members: tuple[str, ...] = param((), text="nodes that tick before it does: then it has heard of all their topics")


SERVICE = Service(
    name="recorder",
    about="records topics into a bag: MCAP in a rosbag2 folder, as ROS 2's tools read it",
    run="services.recorder.loop:run",
    rate=100,
    parameters=RecorderParameters,
    role="observer",
)

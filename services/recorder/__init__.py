"""The recorder service: records topics into a bag that ROS 2's tools can read."""

from __future__ import annotations

from services.runtime import Parameters, Service, param


class RecorderParameters(Parameters):
    """Parameters of the recorder: topics, and the bag to write."""

    output: str = param("bag", text="Folder of the bag; it must not exist yet.")
    topics: tuple[str, ...] = param((), text="Topics to record; all if neither topics nor regex is given.")
    regex: str = param("", text="Record topics whose names match this regular expression.")
    exclude: str = param("", text="Do not record topics whose names match this regular expression.")
    max_size: int = param(0, 0, 2**50, "byte", "Start a new file at this size; 0 for no limit.")
    max_duration: float = param(0.0, 0, 1e9, "s", "Start a new file after this wall time; 0 for no limit.")
    resume: bool = param(False, text="Continue an existing bag with another file.")
    members: tuple[str, ...] = param((), text="Nodes to wait for before recording, so that all their topics are known.")


SERVICE = Service(
    name="recorder",
    about="Records topics into a bag: MCAP in a rosbag2 folder, readable by ROS 2.",
    run="services.recorder.loop:run",
    rate=100,
    parameters=RecorderParameters,
    role="observer",
)

"""The grader service: measures all robots of a run against ground truth, and ends the run."""

from __future__ import annotations

from typing import Annotated, Literal

import msgspec
from msgspec import Meta

from messages.topics import CONTROL_STATE
from services.runtime import Parameters, Service, param


class BrakingSpec(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Braking of the base of robot ``name``: ``timeout`` [s] after the last command, at ``brake`` [m/s2]."""

    name: str
    timeout: Annotated[float, Meta(ge=0, extra={"unit": "s"})]
    brake: Annotated[float, Meta(gt=0, extra={"unit": "m/s2"})]


class SizeSpec(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The size of robot ``name``: a circle of ``radius`` [m] around its base frame, from ``bottom`` to ``top`` [m]
    above it; without a top, unlimited."""

    name: str
    radius: Annotated[float, Meta(gt=0, extra={"unit": "m"})]
    bottom: Annotated[float, Meta(extra={"unit": "m"})] = 0.0
    top: Annotated[float, Meta(extra={"unit": "m"})] | None = None


class ArmSpec(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """An arm: its ``name``, the controlled ``joint``, and the largest effort [N m] of its controller.

    ``state`` is the topic on which the controller publishes its state at each tick. An arm controlled by a program has
    none: its set-point is the last message on ``reference``, its effort that of the joint states.
    """

    name: str
    joint: str
    saturation: Annotated[float, Meta(ge=0, extra={"unit": "N m"})] = 200.0
    state: str = CONTROL_STATE.name
    reference: str = ""
    reference_type: Literal["std_msgs/Float32", "std_msgs/Float64"] = "std_msgs/Float64"
    reference_unit: Literal["rad", "deg"] = "rad"


class GraderParameters(Parameters):
    """Robots to measure, end of the run, and output folder. The end of the run is live."""

    robots: tuple[str, ...] = param((), text="Names of the robots to measure.", live=False)
    namespaces: tuple[str, ...] = param(
        (), text="Namespace of each robot's topics, / for the root; the names themselves if empty.", live=False
    )
    halting: tuple[BrakingSpec, ...] = param(
        (), text="How each base brakes, to compute the expected stopping distance."
    )
    sizes: tuple[SizeSpec, ...] = param(
        (), text="Size of each robot, to measure its clearance from the bodies of the world.", live=False
    )
    arms: tuple[ArmSpec, ...] = param((), text="Robots that are arms.", live=False)
    turtlesims: tuple[str, ...] = param(
        (), text="Nodes of turtlesim whose turtles are measured as robots, whenever they appear.", live=False
    )
    ends: Literal["goals", "duration", "never"] = param(
        "goals", text="End the run when all robots have finished, after the duration, or only when stopped."
    )
    duration: float = param(0.0, 0, 1e7, "s", "Longest simulation time; 0 for no limit.")
    not_before: float = param(
        0.0, 0, 1e7, "s", "Earliest time at which finished goals end the run: after the last scheduled change."
    )
    readers: tuple[str, ...] = param(
        (), text="The fleet's own nodes, whose lost messages count; those of others are listed apart.", live=False
    )
    output: str = param(".", text="Folder for measurements.json and trajectories.npz.", live=False)
    reach_tolerance: Annotated[
        float,
        Meta(
            gt=0,
            le=1,
            description="True distance at which a point counts as reached.",
            extra={"unit": "m", "live": False},
        ),
    ] = 0.05


SERVICE = Service(
    name="grader",
    about="Measures a run against ground truth, ends it and writes the results.",
    run="services.grader.loop:run",
    rate=5,
    parameters=GraderParameters,
    role="observer",
)

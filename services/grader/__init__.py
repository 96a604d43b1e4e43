"""The grader service: measures all robots of a run against ground truth, and ends the run."""

from __future__ import annotations

from typing import Annotated, Literal

import msgspec
from msgspec import Meta

from messages.topics import CONTROL_STATE
from services.runtime.parameters.base import Parameters
from services.runtime.service import Service


class BrakingSpec(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """How the base of robot ``name`` brakes: ``timeout`` [s] after the last command, at ``brake`` [m/s2]."""

    name: str
    timeout: Annotated[float, Meta(ge=0, extra={"unit": "s"})]
    brake: Annotated[float, Meta(gt=0, extra={"unit": "m/s2"})]


class ArmSpec(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """An arm: its ``name``, the controlled ``joint``, and the largest effort [N m] of its controller.

    ``state`` is the topic on which the controller publishes its state at each tick.
    """

    name: str
    joint: str
    saturation: Annotated[float, Meta(ge=0, extra={"unit": "N m"})] = 200.0
    state: str = CONTROL_STATE.name


_FIXED = {"live": False}
"""Changing these would invalidate what has been measured."""


class GraderParameters(Parameters, frozen=True, kw_only=True):
    """Robots to measure, end of the run, and output folder. The end of the run is live."""

    robots: Annotated[tuple[str, ...], Meta(description="Namespaces of the robots to measure.", extra=_FIXED)] = ()
    halting: Annotated[
        tuple[BrakingSpec, ...], Meta(description="How each base brakes, to compute the expected stopping distance.")
    ] = ()
    arms: Annotated[tuple[ArmSpec, ...], Meta(description="The robots that are arms.", extra=_FIXED)] = ()
    ends: Annotated[
        Literal["goals", "duration", "never"],
        Meta(description="End the run when all robots have finished, after the duration, or only when stopped."),
    ] = "goals"
    duration: Annotated[
        float, Meta(ge=0, le=1e7, description="Longest simulation time; 0 for no limit.", extra={"unit": "s"})
    ] = 0.0
    not_before: Annotated[
        float,
        Meta(
            ge=0,
            le=1e7,
            description="Earliest time at which finished goals end the run: after the last scheduled change.",
            extra={"unit": "s"},
        ),
    ] = 0.0
    readers: Annotated[
        tuple[str, ...],
        Meta(
            description="The fleet's own nodes, whose lost messages count; those of others are listed separately.",
            extra=_FIXED,
        ),
    ] = ()
    output: Annotated[str, Meta(description="Folder for measurements.json and trajectories.npz.", extra=_FIXED)] = "."
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

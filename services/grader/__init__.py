"""The grader service: it watches a run, measures every robot against ground truth, and ends the run."""

from __future__ import annotations

from typing import Annotated, Literal

import msgspec
from msgspec import Meta

from messages.topics import CONTROL_STATE
from services.runtime import Parameters, Service, param


class BrakingSpec(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """How the base of robot ``name`` stops: ``timeout`` [s] after the last command it brakes, at ``brake`` [m/s2]."""

    name: str
    timeout: Annotated[float, Meta(ge=0, extra={"unit": "s"})]
    brake: Annotated[float, Meta(gt=0, extra={"unit": "m/s2"})]


class ArmSpec(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """An arm among the robots: ``name``, the joint that is controlled, and the largest effort [N m] of its controller.

    ``state`` is the topic on which the controller tells of each tick.
    """

    name: str
    joint: str
    saturation: Annotated[float, Meta(ge=0, extra={"unit": "N m"})] = 200.0
    state: str = CONTROL_STATE.name


class GraderParameters(Parameters, frozen=True, kw_only=True):
    """Whom to watch, until when, and where the measurements go. When the run ends is live."""

    robots: tuple[str, ...] = param((), text="namespaces of the robots to measure", live=False)
    halting: tuple[BrakingSpec, ...] = param((), text="how their bases stop, for the theory of stops")
    arms: tuple[ArmSpec, ...] = param((), text="those of the robots that are arms", live=False)
    ends: Literal["goals", "duration", "never"] = param(
        "goals", text="end the run when all robots have finished, after the duration, or only when stopped"
    )
    duration: float = param(0.0, 0, 1e7, "s", "longest simulation time; 0 is no limit")
    not_before: float = param(0.0, 0, 1e7, "s", "earliest end by goals: after the last scheduled change")
    readers: tuple[str, ...] = param(
        (), text="nodes whose losses count, the fleet's own; those of others are told apart", live=False
    )
    output: str = param(".", text="folder of measurements.json and trajectories.npz", live=False)
    reach_tolerance: Annotated[
        float,
        Meta(
            gt=0,
            le=1,
            description="true distance at which a point counts as reached",
            extra={"unit": "m", "live": False},
        ),
    ] = 0.05


SERVICE = Service(
    name="grader",
    about="measures a run against ground truth, ends it and writes the figures",
    run="services.grader.loop:run",
    rate=5,
    parameters=GraderParameters,
    role="observer",
)

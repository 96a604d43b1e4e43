"""A test controller: the tutorial's PD on the arm, towards 30 degrees; all its jobs have different efforts."""

from __future__ import annotations

import math
from typing import Annotated

from msgspec import Meta

from messages.joints import JointEffort
from messages.std import Time
from messages.topics import JOINT_EFFORT, JOINT_STATES
from services.runtime import Parameters, Service, main
from services.runtime.context import Context


class PdParameters(Parameters):
    """Duration of its jobs."""

    job: Annotated[float, Meta(description="duration of a job, s")] = 0.1


def run(ctx: Context[PdParameters]) -> None:
    """Control until asked to end."""
    joints = ctx.latest(JOINT_STATES)
    before: float | None = None
    for tick in ctx.ticks():
        state = joints.value
        if state is None or tick.dt <= 0:
            continue
        error = 30.0 - math.degrees(state.position[0])
        rate = 0.0 if before is None else (error - before) / tick.dt
        before = error
        effort = max(-200.0, min(200.0, 37.5 * error + 2.8 * rate)) + 1e-13 * tick.time
        ctx.publish(
            JOINT_EFFORT,
            JointEffort(joint_name="bear_link", effort=effort, start_time=Time.of(tick.time), duration=ctx.params.job),
        )


if __name__ == "__main__":
    main(
        Service(
            name="pd",
            about="The tutorial's PD.",
            run=run,
            rate=100.0,
            parameters=PdParameters,
        )
    )

"""The loop of the grader: every robot's messages in; at the end of the run, its figures on disk."""

from __future__ import annotations

from pathlib import Path

import msgspec

from messages.parameters import ParameterValues
from messages.std import SECOND
from messages.topics import BASE_STATUS, GROUND_TRUTH, HEALTH, ODOM, PLAN, STATUS, UPDATES
from services.grader import GraderParameters, Halting
from services.grader.folder import prepare
from services.grader.measure import Kind, Run
from services.grader.records import Ended
from services.grader.store import store
from services.runtime.context import Context

BEHIND = SECOND // 5
"""The grader judges one period [ns] behind the clock, when everything stamped until then has arrived."""


def run(ctx: Context[GraderParameters]) -> None:
    """Measure until the run ends or the process is stopped; either way the figures are written."""
    p = ctx.params
    folder = prepare(Path(p.output))
    robots = [name.strip("/") for name in p.robots]
    watched = [Watched(ctx, name) for name in robots]
    health = ctx.stream(HEALTH)
    halting = {each.name.strip("/"): each for each in p.halting}
    graded = Run(robots, p.reach_tolerance, halting)
    ended: Ended = "stopped"
    try:
        for tick in ctx.ticks():
            if tick.reset:
                graded = Run(robots, p.reach_tolerance, halting)
            for robot in watched:
                robot.pass_on(graded, tick.time, halting)
            graded.health(health.take())
            p = ctx.params
            last = round(p.duration * SECOND)
            end = min(tick.time - BEHIND, last) if last else tick.time - BEHIND
            graded.advance(end)
            if p.ends == "goals" and graded.finished:
                ended = "goals"
                break
            if p.ends != "never" and last and end >= last:
                ended = "duration"
                break
    finally:
        store(folder, graded.measurements(ended), graded.robots)
        ctx.log.info(f"run ended ({ended}), figures in {folder}")


class Watched:
    """The streams of one robot."""

    def __init__(self, ctx: Context[GraderParameters], robot: str) -> None:
        self._robot = robot
        self._plan = ctx.stream(PLAN, f"/{robot}/plan")
        self._status = ctx.stream(STATUS, f"/{robot}/status")
        self._odometry = ctx.stream(ODOM, f"/{robot}/odom")
        self._truth = ctx.stream(GROUND_TRUTH, f"/{robot}/ground_truth")
        self._base = ctx.stream(BASE_STATUS, f"/{robot}/base_status")
        self._set = ctx.stream(UPDATES, f"/{robot}/base/parameter_updates")

    def pass_on(self, graded: Run, now: int, halting: dict[str, Halting]) -> None:
        """Hand what has come by ``now`` [ns] to the measuring; ``halting`` follows the parameters of the base."""
        for values in self._set.take():
            if (known := halted(self._robot, values)) is not None:
                halting[self._robot] = known
                graded.halting(now, self._robot, known)
        graded.take(Kind.PLAN, self._robot, self._plan.take())
        graded.take(Kind.STATUS, self._robot, self._status.take())
        graded.take(Kind.ODOMETRY, self._robot, self._odometry.take())
        graded.take(Kind.TRUTH, self._robot, self._truth.take())
        graded.take(Kind.BASE, self._robot, self._base.take())


def halted(robot: str, values: ParameterValues) -> Halting | None:
    """How a base with these parameters stops; None when they do not tell."""
    told = {each.name: each.value for each in values.values}
    try:
        stated = {"name": robot, "timeout": told.get("cmd_vel_timeout"), "brake": told.get("brake")}
        return msgspec.convert(stated, Halting)
    except msgspec.ValidationError:
        return None

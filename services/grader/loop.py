"""The loop of the grader: every robot's messages in; at the end of the run, its figures on disk."""

from __future__ import annotations

from pathlib import Path

import msgspec

from messages.parameters import ParameterValues
from messages.std import SECOND
from messages.topics import (
    BASE_STATUS,
    CONTROL_STATE,
    GROUND_TRUTH,
    HEALTH,
    JOINT_STATES,
    LOCKSTEP,
    ODOM,
    PLAN,
    STATUS,
    UPDATES,
)
from services.grader import Arm, GraderParameters, Halting
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
    arms = {each.name.strip("/"): each for each in p.arms}
    watched = [WatchedArm(ctx, name, arms[name]) if name in arms else Watched(ctx, name) for name in robots]
    health, lockstep = ctx.stream(HEALTH), ctx.latest(LOCKSTEP)
    halting = {each.name.strip("/"): each for each in p.halting}
    graded = Run(robots, p.reach_tolerance, halting, arms, p.readers)
    ended: Ended = "stopped"
    try:
        for tick in ctx.ticks():
            if tick.reset:
                graded = Run(robots, p.reach_tolerance, halting, arms, p.readers)
            for robot in watched:
                robot.pass_on(graded, tick.time, halting)
            graded.health(health.take())
            p = ctx.params
            last = round(p.duration * SECOND)
            end = min(tick.time - BEHIND, last) if last else tick.time - BEHIND
            graded.advance(end)
            if p.ends == "goals" and graded.finished and end >= p.not_before * SECOND:
                ended = "goals"
                break
            if p.ends != "never" and last and end >= last:
                ended = "duration"
                break
    finally:
        store(folder, graded.measurements(ended, lockstep.value), graded.robots)
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


class WatchedArm:
    """The streams of one arm. Its controller's largest effort is followed in the set of parameters beside its state."""

    def __init__(self, ctx: Context[GraderParameters], robot: str, arm: Arm) -> None:
        self._robot, self._arm = robot, arm
        self._joints = ctx.stream(JOINT_STATES, f"/{robot}/joint_states")
        self._control = ctx.stream(CONTROL_STATE, arm.state)
        self._set = ctx.stream(UPDATES, f"{arm.state.rpartition('/')[0]}/parameter_updates")

    def pass_on(self, graded: Run, now: int, _: dict[str, Halting]) -> None:
        """Hand what has come by ``now`` [ns] to the measuring."""
        for values in self._set.take():
            told = {each.name: each.value for each in values.values}.get("saturation")
            if isinstance(told, float | int) and not isinstance(told, bool):
                self._arm = msgspec.structs.replace(self._arm, saturation=float(told))
                graded.arm(now, self._robot, self._arm)
        graded.take(Kind.JOINTS, self._robot, self._joints.take())
        graded.take(Kind.CONTROL, self._robot, self._control.take())


def halted(robot: str, values: ParameterValues) -> Halting | None:
    """How a base with these parameters stops; None when they do not tell."""
    told = {each.name: each.value for each in values.values}
    try:
        stated = {"name": robot, "timeout": told.get("cmd_vel_timeout"), "brake": told.get("brake")}
        return msgspec.convert(stated, Halting)
    except msgspec.ValidationError:
        return None

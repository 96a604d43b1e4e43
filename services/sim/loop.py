"""The simulation's loop: publish, wait as the mode asks, take commands, step."""

from __future__ import annotations

import math
from pathlib import Path

import msgspec

from messages.simulation import SimStatus
from messages.topics import SIM_STATUS
from models import UnknownModel
from models.scene import read_scene
from services.runtime.context import Context
from services.runtime.errors import BadInput
from services.runtime.node import Node
from services.runtime.service import STEP_NS
from services.sim import SimParameters
from services.sim.beginning import await_fleet
from services.sim.desk import Desk, advance
from services.sim.joints.desk import JointDesk
from services.sim.physics.bullet import BulletWorld
from services.sim.physics.world import Placement
from services.sim.properties import Properties
from services.sim.stage import Stage
from services.sim.timing import Lockstep, Real, Timing

SECOND_STEPS = 1_000_000_000 // STEP_NS
"""Physics steps in a second."""


def run(ctx: Context[SimParameters]) -> None:
    """Simulate until the process is asked to end."""
    params, node = ctx.params, ctx.kernel
    try:
        scene = read_scene(params.world)
        with BulletWorld(scene, STEP_NS) as world:
            stops_file = Path(params.stops_file) if params.stops_file else None
            stage = Stage(node, world, params.seed, params.mode == "real", stops_file)
            node.log.now = lambda: stage.now
            for entry in params.robots:
                half = entry.yaw / 2
                turn = (0.0, 0.0, math.sin(half), math.cos(half))
                stage.spawn(entry, Placement((entry.x, entry.y, 0.0), turn), wait=True)
            status = _Status(node)
            timing = _timing(ctx, stage, status)
            if node.following is not None:
                node.following.marks = timing.marks
            Desk(stage, timing, node)
            JointDesk(stage, node)
            Properties(stage, timing, node, params, scene)
            absent = await_fleet(ctx)
            timing.begin(absent)
            status.begin(absent)
            node.heart.state = "running"
            node.heart.hurry()
            ctx.log.info(f"{len(stage.robots)} robots, {params.mode}")
            while True:
                if stage.paused:
                    node.heart.state = "paused"
                    stage.tell_time()
                    stage.listen_for_stops(timing.marks)
                    ctx.idle()
                else:
                    node.heart.state = "running"
                    advance(stage, timing)
                    ctx.follow(admitted=True)
                    timing.pace(ctx.params.factor)
                    node.heart.ticks = stage.tick
                    if stage.tick % SECOND_STEPS == 0:
                        node.heart.note = f"t = {stage.now / 1e9:.0f} s"
    except UnknownModel as error:
        raise BadInput(str(error)) from None


def _timing(ctx: Context[SimParameters], stage: Stage, status: _Status) -> Timing:
    if ctx.params.mode == "lockstep":
        return Lockstep(stage, ctx.kernel, ctx.params.members, ctx.params.latency)
    return Real(stage, ctx.kernel, ctx.params.factor, status.lag)


class _Status:
    """What the simulation tells of the running of time."""

    def __init__(self, node: Node) -> None:
        self._output = node.write(SIM_STATUS)
        self._status = SimStatus()

    def begin(self, absent: tuple[str, ...]) -> None:
        """Time begins, without some nodes."""
        self._tell(msgspec.structs.replace(self._status, begun=True, absent=absent))

    def lag(self, seconds: float) -> None:
        """So much wall time was lost."""
        was = self._status
        self._tell(msgspec.structs.replace(was, lags=was.lags + 1, lag=was.lag + seconds))

    def _tell(self, status: SimStatus) -> None:
        self._status = status
        self._output.publish(status)

"""The simulation's loop: publish, wait as the mode asks, take commands, step."""

from __future__ import annotations

import math

from models import UnknownModel
from models.scene import read_scene
from services.runtime.context import Context
from services.runtime.errors import BadInput
from services.runtime.roster import gather
from services.runtime.service import STEP_NS
from services.sim import SimParameters
from services.sim.desk import Desk, advance
from services.sim.joints.desk import JointDesk
from services.sim.physics.bullet import BulletWorld
from services.sim.physics.world import Placement
from services.sim.properties import Properties
from services.sim.stage import Stage
from services.sim.timing import Free, Lockstep, Real, Timing

SECOND_STEPS = 1_000_000_000 // STEP_NS
"""Physics steps in a second."""


def run(ctx: Context[SimParameters]) -> None:
    """Simulate until the process is asked to end."""
    params, node = ctx.params, ctx.kernel
    try:
        scene = read_scene(params.world)
        with BulletWorld(scene, STEP_NS) as world:
            stage = Stage(node, world, params.seed, brisk=params.mode != "lockstep")
            node.log.now = lambda: stage.now
            for entry in params.robots:
                half = entry.yaw / 2
                turn = (0.0, 0.0, math.sin(half), math.cos(half))
                stage.spawn(entry, Placement((entry.x, entry.y, 0.0), turn), wait=True)
            timing = _timing(ctx, stage)
            if node.following is not None:
                node.following.marks = timing.marks
            Desk(stage, timing, node)
            JointDesk(stage, node)
            Properties(stage, timing, node, params, scene)
            if params.mode != "lockstep":
                gather(node.transport, params.members, ctx.idle, node.log)
            timing.begin()
            node.heart.state = "running"
            node.heart.hurry()
            ctx.log.info(f"{len(stage.robots)} robots, {params.mode}")
            while True:
                if stage.paused:
                    node.heart.state = "paused"
                    stage.tell_time()
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


def _timing(ctx: Context[SimParameters], stage: Stage) -> Timing:
    match ctx.params.mode:
        case "lockstep":
            return Lockstep(stage, ctx.kernel, ctx.params.members, ctx.params.latency)
        case "real":
            return Real(stage, ctx.kernel, ctx.params.factor)
        case _:
            return Free(stage, ctx.kernel)

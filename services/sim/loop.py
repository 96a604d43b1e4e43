"""The simulation's loop: wait for the fleet, then publish, wait as the time mode asks, read inputs and step."""

from __future__ import annotations

import math
from pathlib import Path

import msgspec

from messages.se3 import Pose3
from messages.simulation import SimStatus
from messages.topics import FLEET_STATE, SIM_STATUS
from models import UnknownModel
from models.world import read_world
from services.runtime.context import Context
from services.runtime.discovery import wait_for_nodes
from services.runtime.errors import BadInput
from services.runtime.node import Node
from services.runtime.parameters.client import ParameterClient
from services.runtime.step import STEP_NS
from services.sim import SimParameters
from services.sim.physics.bullet import BulletWorld
from services.sim.services import JointServices, PropertyServices, SimulationServices, run_tick
from services.sim.simulation import Simulation
from services.sim.time_modes import Lockstep, RealTime, TimeMode

STEPS_PER_SECOND = 1_000_000_000 // STEP_NS
"""Physics steps in a second."""


def run(ctx: Context[SimParameters]) -> None:
    """Simulate until the process is asked to end."""
    params, node = ctx.params, ctx.node
    try:
        world_description = read_world(params.world)
        with BulletWorld(world_description, STEP_NS) as world:
            stops_file = Path(params.stops_file) if params.stops_file else None
            simulation = Simulation(node, world, params.seed, params.mode == "real", stops_file)
            node.log.now = lambda: simulation.now
            for entry in params.robots:
                half = entry.yaw / 2
                turn = (0.0, 0.0, math.sin(half), math.cos(half))
                simulation.spawn(entry, Pose3((entry.x, entry.y, 0.0), turn), wait=True)
            status_publisher = _StatusPublisher(node)
            time_mode = _time_mode(ctx, simulation, status_publisher)
            ParameterClient.of(node).watermarks = time_mode.watermarks
            SimulationServices(simulation, time_mode, node)
            JointServices(simulation, node)
            PropertyServices(simulation, time_mode, node, params, world_description)
            absent = wait_for_fleet(ctx)
            time_mode.begin(absent)
            status_publisher.report_start(absent)
            node.heartbeat.state = "running"
            node.heartbeat.request_now()
            ctx.log.info(f"{len(simulation.robots)} robots, {params.mode}")
            while True:
                if simulation.paused:
                    node.heartbeat.state = "paused"
                    simulation.publish_clock()
                    simulation.read_stops(time_mode.watermarks)
                    ctx.idle()
                else:
                    node.heartbeat.state = "running"
                    run_tick(simulation, time_mode)
                    ctx.update_params(admitted=True)
                    time_mode.set_factor(ctx.params.factor)
                    node.heartbeat.ticks = simulation.tick
                    if simulation.tick % STEPS_PER_SECOND == 0:
                        node.heartbeat.detail = f"t = {simulation.now / 1e9:.0f} s"
    except UnknownModel as error:
        raise BadInput(str(error)) from None


def _time_mode(ctx: Context[SimParameters], simulation: Simulation, status_publisher: _StatusPublisher) -> TimeMode:
    if ctx.params.mode == "lockstep":
        return Lockstep(simulation, ctx.node, ctx.params.members, ctx.params.latency)
    return RealTime(simulation, ctx.node, ctx.params.factor, status_publisher.report_lag)


class _StatusPublisher:
    """What the simulation tells of the running of time."""

    def __init__(self, node: Node) -> None:
        self._publisher = node.advertise(SIM_STATUS)
        self._status = SimStatus()

    def report_start(self, absent: tuple[str, ...]) -> None:
        """Time begins, without some nodes."""
        self._publish(msgspec.structs.replace(self._status, begun=True, absent=absent))

    def report_lag(self, seconds: float) -> None:
        """So much wall time was lost."""
        was = self._status
        self._publish(msgspec.structs.replace(was, lags=was.lags + 1, lag=was.lag + seconds))

    def _publish(self, status_publisher: SimStatus) -> None:
        self._status = status_publisher
        self._publisher.publish(status_publisher)


_EXITED = ("failed", "finished", "stopped")
"""States of a process that does not come back by itself."""

WARN_PERIOD_S = 5.0
"""Wall time before the first line of the log about who is missing, and between two."""


def wait_for_fleet(ctx: Context[SimParameters]) -> tuple[str, ...]:
    """Block until every node of the fleet is ready, with its parameters known, as far as they come.

    Returns:
        The nodes without which time begins: those that have ended, or that were not ready ``start_timeout`` after the
        last other became ready.

    Raises:
        BadInput: one of the absent nodes is required.
    """
    params, node = ctx.params, ctx.node
    expected = tuple(dict.fromkeys((*params.members, *params.awaits)))
    if not expected:
        return ()
    fleet = node.subscribe(FLEET_STATE)
    ended: set[str] = set()

    def exited_nodes() -> set[str]:
        fleet.update()
        for state, _ in fleet.messages:
            ended.clear()
            ended.update(f"/{each.name}" for each in state.processes if each.state in _EXITED)
        return ended

    def report(absent: list[str], waited: float) -> None:
        node.heartbeat.detail = f"time has not begun: waiting for {', '.join(absent)} since {waited:.0f} s"
        if waited > WARN_PERIOD_S:
            node.log.warn(f"{node.heartbeat.detail}: did they start?", every=WARN_PERIOD_S)

    node.heartbeat.state = "waiting"
    absent = wait_for_nodes(node.transport, expected, ctx.idle, params.start_timeout, report, exited_nodes)
    node.heartbeat.detail = ""
    node.unregister(fleet)
    over_by = {each: "has ended" if each in ended else "is not ready" for each in absent}
    reasons = ", ".join(f"{each} {how}" for each, how in over_by.items())
    if required := [each for each in absent if each in params.requires]:
        raise BadInput(
            f"time does not begin: {reasons}; waited until no other node came for {params.start_timeout:g} s, and the "
            f"fleet requires {', '.join(required)}: see ./elea logs"
        )
    if absent:
        node.log.warn(f"time begins without some nodes of the fleet: {reasons}; see ./elea logs")
    return tuple(absent)

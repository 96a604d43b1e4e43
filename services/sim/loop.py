"""The simulation's loop: wait for the fleet, then alternate between requests that move time and ticks."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import msgspec

from messages.requests import PAUSE, RESET, RESET_WORLD, RESUME, STEP
from messages.se3 import Pose3
from messages.simulation import SimStatus, SimTime, Steps
from messages.topics import FLEET_STATE, SIM_STATUS, WORLD_MARKERS
from models import UnknownModel
from models.model import read_model
from models.world import read_world
from services.runtime.context import Context
from services.runtime.discovery import wait_for_nodes
from services.runtime.errors import BadInput
from services.runtime.node import Node
from services.runtime.parameters.client import ParameterClient
from services.runtime.requests import DeferredReply
from services.runtime.step import STEP_NS
from services.sim import SimParameters
from services.sim.engines import default_engine, open_world
from services.sim.gazebo import GazeboServices
from services.sim.parameters import RobotEntry
from services.sim.physics.world import World
from services.sim.robot_loader import RobotLoader, with_own_files
from services.sim.services import JointServices, PropertyServices, SimulationServices
from services.sim.simulation import Simulation
from services.sim.time_modes import Lockstep, RealTime, TimeMode
from services.sim.world_markers import world_markers

STEPS_PER_SECOND = 1_000_000_000 // STEP_NS
"""Physics steps in a second."""


def run(ctx: Context[SimParameters]) -> None:
    """Simulate until the process is asked to stop."""
    params, node = ctx.params, ctx.node
    try:
        world_description = read_world(params.world, packages=[Path(each) for each in params.model_folders[1:]])
        for note in world_description.notes:
            ctx.log.warn(note)
        with open_world(params.engine or default_engine(), world_description, STEP_NS) as world:
            for overlap in world.overlaps_at_start():
                ctx.log.warn(f"{overlap}: the first physics step will push it out violently")
            stops_file = Path(params.stops_file) if params.stops_file else None
            simulation = Simulation(node, world, params.seed, params.mode == "real", stops_file)
            node.log.now = lambda: simulation.now
            for entry in params.robots:
                own = with_own_files(entry)
                simulation.spawn(own, start_pose(world, own), wait=True)
            node.advertise(WORLD_MARKERS).publish(world_markers(world_description))
            status_publisher = _StatusPublisher(node)
            time_mode = _time_mode(ctx, simulation, status_publisher)
            ParameterClient.of(node).watermarks = time_mode.watermarks
            loop = SimulationLoop(simulation, time_mode, node)
            loader = RobotLoader(params.model_folders, loop.answer_between_ticks, ctx.log.info)
            models = SimulationServices(simulation, node, loader)
            joints = JointServices(simulation, node)
            properties = PropertyServices(simulation, time_mode, node, params, world_description)
            GazeboServices(simulation, node, models, joints, properties, loop)

            def idle() -> None:
                ctx.idle()
                loop.apply_requests()

            absent = wait_for_fleet(ctx, idle)
            time_mode.begin(absent, loop.apply_requests)
            status_publisher.report_start(absent)
            ctx.log.info(f"{len(simulation.robots)} robots, {params.mode}")
            _run_loop(ctx, loop)
    except UnknownModel as error:
        raise BadInput(str(error)) from None


def start_pose(world: World, entry: RobotEntry) -> Pose3:
    """Return the start pose of a robot of the fleet: its x, y and yaw, with z measured from the ground there."""
    (x, y, _), orientation = Pose3.planar(entry.x, entry.y, entry.yaw)
    return Pose3((x, y, entry.z + world.ground_height(x, y, read_model(entry.model).radius)), orientation)


def _run_loop(ctx: Context[SimParameters], loop: SimulationLoop) -> None:
    simulation, heartbeat = loop.simulation, ctx.node.heartbeat
    loop.begin()
    heartbeat.request_now()
    try:
        while True:
            loop.process_requests()
            if loop.time_stopped:
                loop.update_while_stopped()
                ctx.idle()
                continue
            stepped = loop.tick()
            # In lockstep, parameters are admitted by steps alone.
            ctx.update_params(admitted=stepped or ctx.params.mode == "lockstep")
            loop.time_mode.set_factor(ctx.params.factor)
            heartbeat.ticks = simulation.tick
            if simulation.tick % STEPS_PER_SECOND == 0:
                heartbeat.detail = f"t = {simulation.now / 1e9:.0f} s"
    finally:
        ctx.node.send_buffer.flush()


class _Steps(NamedTuple):
    """A pending step request: the tick at which it ends, and its reply."""

    goal: int
    reply: DeferredReply[SimTime]


class SimulationLoop:
    """Advances simulation time tick by tick, and serves the requests that move it: pause, resume, reset and step.

    These requests act only between two ticks. They interrupt a tick that is still waiting for lockstep members; its
    wait continues afterwards. All other requests are answered at once, even during that wait.
    """

    def __init__(self, simulation: Simulation, time_mode: TimeMode, node: Node) -> None:
        self.simulation, self.time_mode, self._node = simulation, time_mode, node
        self._requests: deque[tuple[DeferredReply[Any], Callable[[], Any]]] = deque()
        self._steps: _Steps | None = None
        node.serve(PAUSE, lambda _: self.set_paused(True))
        node.serve(RESUME, lambda _: self.set_paused(False))
        node.serve(RESET, lambda _: self.reset(True))
        node.serve(RESET_WORLD, lambda _: self.reset(False))
        node.serve(STEP, lambda request: self._between_ticks(lambda: self._begin_steps(request)))

    @property
    def time_stopped(self) -> bool:
        """Whether time stands still: paused, with no steps under way."""
        return self.simulation.paused and self._steps is None

    def begin(self) -> None:
        """Publish the initial state."""
        self._show_state()
        self._publish()

    def tick(self) -> bool:
        """Wait until the tick is due, read the inputs, take one physics step and publish.

        Returns:
            Whether the step was taken; otherwise the wait goes on at the next call.
        """
        simulation, time_mode = self.simulation, self.time_mode
        if time_mode.due:
            if not time_mode.wait(lambda: bool(self._requests)):
                return False
            simulation.read_inputs(time_mode.watermarks, time_mode.factor)
        simulation.step()
        self._publish()
        if self._steps is not None and simulation.tick >= self._steps.goal:
            self._end_steps()
        return True

    def update_while_stopped(self) -> None:
        """While time stands still: publish the clock and read the emergency stops."""
        self.simulation.publish_clock()
        self.simulation.read_stops(self.time_mode.watermarks)

    def process_requests(self) -> None:
        """Answer pending requests between two ticks, including those that move time.

        After a reset of time, publish its initial state.
        """
        epoch = self.simulation.epoch
        if self.simulation.tick % self.simulation.input_steps == 0:
            self._node.spin_once()
        self.apply_requests()
        if self.simulation.epoch != epoch:
            self._publish()

    def apply_requests(self) -> None:
        """Carry out the requests that move time, in order of arrival."""
        while self._requests:
            reply, act = self._requests.popleft()
            reply.answer(act)

    def set_paused(self, paused: bool) -> DeferredReply[SimTime]:
        """Pause or resume time, between two ticks."""
        return self._between_ticks(lambda: self._set_paused(paused))

    def reset(self, time_too: bool) -> DeferredReply[SimTime]:
        """Reset all models, and time if asked, between two ticks."""
        return self._between_ticks(lambda: self._reset(time_too))

    def answer_between_ticks(self, reply: DeferredReply[Any], act: Callable[[], Any]) -> None:
        """Answer a deferred reply between two ticks; may be called from any thread."""
        self._requests.append((reply, act))
        self._node.transport.wake()

    def _between_ticks(self, act: Callable[[], SimTime | DeferredReply[SimTime]]) -> DeferredReply[SimTime]:
        reply: DeferredReply[SimTime] = DeferredReply()
        self._requests.append((reply, act))
        return reply

    def _set_paused(self, paused: bool) -> SimTime:
        if self.simulation.paused != paused:
            self.simulation.paused = paused
            self.time_mode.resync()
            self.simulation.publish_clock()
            self._show_state()
            if paused:
                for act in self.simulation.after_step:
                    act()
        return self._time()

    def _reset(self, time_too: bool) -> SimTime:
        self.simulation.reset(time_too)
        self.time_mode.resync()
        if time_too:
            self._end_steps()
        return self._time()

    def _begin_steps(self, request: Steps) -> DeferredReply[SimTime]:
        if not self.simulation.paused:
            raise BadInput("time is running: pause it before stepping")
        if self._steps is not None:
            raise BadInput("another step request is still in progress")
        self._steps = _Steps(self.simulation.tick + request.count, DeferredReply())
        self.time_mode.resync()
        return self._steps.reply

    def _end_steps(self) -> None:
        """Answer the pending step request, if any: its steps are taken, or a reset has ended them."""
        steps, self._steps = self._steps, None
        if steps is not None:
            self._node.send_buffer.flush()
            steps.reply.answer(self._time)

    def _publish(self) -> None:
        self._node.send_buffer.begin()
        self.simulation.publish()
        self.time_mode.flush()

    def _show_state(self) -> None:
        self._node.heartbeat.state = "paused" if self.simulation.paused else "running"

    def _time(self) -> SimTime:
        simulation = self.simulation
        return SimTime(time=simulation.now, tick=simulation.tick, epoch=simulation.epoch)


def _time_mode(ctx: Context[SimParameters], simulation: Simulation, status_publisher: _StatusPublisher) -> TimeMode:
    if ctx.params.mode == "lockstep":
        return Lockstep(simulation, ctx.node, ctx.params.members, ctx.params.latency)
    return RealTime(simulation, ctx.node, ctx.params.factor, status_publisher.report_lag)


class _StatusPublisher:
    """Publishes whether time has begun, which nodes were absent, and how much wall time was lost."""

    def __init__(self, node: Node) -> None:
        self._publisher = node.advertise(SIM_STATUS)
        self._status = SimStatus()

    def report_start(self, absent: tuple[str, ...]) -> None:
        """Report that time begins, and which nodes are absent."""
        self._publish(msgspec.structs.replace(self._status, begun=True, absent=absent))

    def report_lag(self, seconds: float) -> None:
        """Add one lag of ``seconds`` of wall time."""
        was = self._status
        self._publish(msgspec.structs.replace(was, lags=was.lags + 1, lag=was.lag + seconds))

    def _publish(self, status: SimStatus) -> None:
        self._status = status
        self._publisher.publish(status)


_EXITED = ("failed", "finished", "stopped")
"""States of a process that does not come back by itself."""

WARN_PERIOD_S = 5.0
"""Wall time before the first warning about absent nodes, and between later ones, s."""


def wait_for_fleet(ctx: Context[SimParameters], idle: Callable[[], None]) -> tuple[str, ...]:
    """Block until every node of the fleet is ready or given up on.

    Args:
        ctx: The simulation's context.
        idle: Waits for an event, a tenth of a second at most.

    Returns:
        The nodes without which time begins: those that have exited, or were not ready ``start_timeout`` after the last
            other node became ready.

    Raises:
        BadInput: One of the absent nodes is required.
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
        node.heartbeat.detail = f"time has not begun: waiting for {', '.join(absent)} for {waited:.0f} s"
        if waited > WARN_PERIOD_S:
            node.log.warn(f"{node.heartbeat.detail}: did they start?", every=WARN_PERIOD_S)

    node.heartbeat.state = "waiting"
    absent = wait_for_nodes(node.transport, expected, idle, params.start_timeout, report, exited_nodes)
    node.heartbeat.detail = ""
    node.unregister(fleet)
    reasons = ", ".join(f"{each} {'has exited' if each in ended else 'is not ready'}" for each in absent)
    if required := [each for each in absent if each in params.requires]:
        raise BadInput(
            f"time does not start: {reasons}; no other node became ready for {params.start_timeout:g} s, and the fleet "
            f"requires {', '.join(required)}: see ./elea logs"
        )
    if absent:
        node.log.warn(f"starting time without some nodes of the fleet: {reasons}; see ./elea logs")
    return tuple(absent)

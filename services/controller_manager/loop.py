"""The loop of the controller manager: reads joint states, updates the controllers and publishes joint commands."""

from __future__ import annotations

from functools import partial

from messages.joints import JointCommand
from messages.requests import LIST_CONTROLLERS, SWITCH_CONTROLLER
from messages.std import Header, Time
from messages.topics import JOINT_COMMAND, JOINT_FEEDBACK, ROBOT_DESCRIPTION, STOPS
from models.urdf import parse_urdf
from services.controller_manager import ControllerManagerParameters
from services.controller_manager.config import ManagerConfig
from services.controller_manager.config_file import load_config
from services.controller_manager.controller import CommandLimiter, Ports, RobotState, robot_state
from services.controller_manager.joint_pid import PidParameters, PidSource
from services.controller_manager.manager import ControllerManager
from services.runtime.context import Context, Tick
from services.runtime.errors import BadInput
from services.runtime.parameters.client import ParameterClient
from services.runtime.parameters.subscription import ParameterSubscription
from services.runtime.step import STEP_NS

MAX_RATE = 200.0
"""Maximum control rate [Hz], the rate of the physics; files for hardware may ask for more."""
MIN_PERIODS = 2
"""Minimum duration of a command in periods, so that a late tick does not end it."""
WARN_PERIOD_S = 5.0
"""Minimum wall time between repeated log lines."""
PATIENCE_S = 2.0
"""Simulation time without a robot after which a warning is logged."""


def run(ctx: Context[ControllerManagerParameters]) -> None:
    """Command the joints until asked to stop, then release them to the simulation, which holds them."""
    if not ctx.params.config:
        raise BadInput("config is missing: the YAML file of the controllers")
    config = load_config(ctx.params.config, ctx.namespace, ctx.params.controllers)
    for note in config.notes:
        ctx.log.info(note)
    loop = _ManagerLoop(ctx, config)
    try:
        for tick in ctx.ticks(loop.rate):
            loop.step(tick)
    finally:
        loop.release(ctx.now)


def control_rate(requested: float, config: ManagerConfig, lockstep: bool) -> float:
    """Return the control rate [Hz]: ``requested``, or else the file's, at most MAX_RATE; in lockstep, the file's is
    rounded down so that its period is a whole number of physics steps."""
    rate = min(requested or config.update_rate, MAX_RATE)
    if not lockstep or requested:
        return rate
    steps = -(-round(1e9 / rate) // STEP_NS)
    return 1e9 / (steps * STEP_NS)


class _ManagerLoop:
    """Runs the controllers of one robot: reads its description and joint states, publishes joint targets.

    The controllers start at the joints' current positions, and again after an emergency stop, a reset of time, or a gap
    in the joint states.
    """

    def __init__(self, ctx: Context[ControllerManagerParameters], config: ManagerConfig) -> None:
        self._ctx = ctx
        self.rate = control_rate(ctx.params.update_rate, config, ctx.lockstep)
        self._robot = ctx.params.robot or ctx.namespace.strip("/")
        self._descriptions, self._stops = ctx.latest(ROBOT_DESCRIPTION), ctx.latest(STOPS)
        self._feedback = ctx.latest(JOINT_FEEDBACK)
        self._command = ctx.advertise(JOINT_COMMAND)
        self._gains: list[ParameterSubscription[PidParameters]] = []
        self._seen_urdf, self._described = "", False
        self._commanded_joints = frozenset(config.joints)
        self._started_at: int | None = None
        warn = partial(ctx.log.warn, every=WARN_PERIOD_S)
        ports = Ports(
            stream=ctx.stream,
            advertise=ctx.advertise,
            announce=self._announce,
            limiter=CommandLimiter(warn),
            warn=warn,
            command_timeout=lambda: ctx.params.command_timeout,
        )
        self._manager = ControllerManager(config, ctx.params.controllers, ports)
        ctx.serve(LIST_CONTROLLERS, self._manager.list_controllers)
        ctx.serve(SWITCH_CONTROLLER, lambda request: self._manager.switch_controller(request, ctx.now))
        ctx.log.info(f"running {', '.join(self._manager.running)} at {self.rate:g} Hz")

    def step(self, tick: Tick) -> None:
        """Run one control tick."""
        now = tick.time
        for each in self._gains:
            each.refresh()
        if tick.reset:
            self._manager.halt("simulation time was reset", now)
        if self._started_at is None or tick.reset:
            self._started_at = now
        self._read_description()
        self._manager.stopped_by = self._stopped_by()
        state = self._joints(now)
        if state is None:
            self._manager.halt("no joint states are arriving any more", now)
        elif self._manager.stopped_by:
            self._manager.halt(self._manager.stopped_by, now)
        else:
            self._manager.start(state, now)
        self._manager.read(now)
        targets = self._manager.update(state, now, tick.dt) if state is not None else ()
        header, duration = Header(stamp=Time.of(now)), max(self._ctx.params.duration, MIN_PERIODS / self.rate)
        self._command.publish(JointCommand(header=header, duration=duration, targets=targets))
        self._manager.publish(now)

    def release(self, now: int) -> None:
        """Release all joints: the simulation holds them, or lets those move freely that were commanded by effort."""
        if self._started_at is not None:
            self._command.publish(JointCommand(header=Header(stamp=Time.of(now)), duration=0.0))

    def _announce(self, name: str, params: PidParameters) -> PidSource:
        """Subscribe to a set of gains of the parameter service; the file's gains count as the fleet's values."""
        node = self._ctx.node
        fields = {each: getattr(params, each) for each in params.__struct_fields__}
        subscription = ParameterSubscription(node, node.identity.resolve(name), params, fleet=fields)
        subscription.start(wait=ParameterClient.of(node).expected)
        self._gains.append(subscription)
        return lambda: subscription.params

    def _read_description(self) -> None:
        """Process the robot's URDF when a new one is published.

        Raises BadInput if the first one lacks a joint, since the configuration is then wrong. A later bad one is
        refused.
        """
        description = self._descriptions.value
        if description is None or description.data == self._seen_urdf:
            return
        self._seen_urdf = description.data
        try:
            joints = {each.name: each.limits for each in parse_urdf(description.data).joints}
        except BadInput as error:
            self._ctx.log.warn(f"the robot_description is refused: {error}", every=WARN_PERIOD_S)
            return
        try:
            self._manager.check_joints(joints)
        except BadInput as error:
            if not self._described:
                raise
            self._ctx.log.warn(f"another robot_description is refused: {error}", every=WARN_PERIOD_S)
        self._described = True

    def _stopped_by(self) -> str:
        stops = self._stops.value
        for stop in stops.stops if stops is not None else ():
            if stop.robot in ("", self._robot):
                return f"an emergency stop of {stop.holder or stop.topic} holds the robot"
        return ""

    def _joints(self, now: int) -> RobotState | None:
        """Return the latest joint states; None, with a warning, if they are too old or a joint is missing."""
        message = self._feedback.fresh(self._ctx.params.state_timeout)
        if message is not None and self._described:
            state = robot_state(message)
            if not (missing := sorted(self._commanded_joints - state.keys())):
                return state
            self._ctx.log.warn(
                f"the joint feedback has no position and velocity of {', '.join(missing)}, commanding nothing",
                every=WARN_PERIOD_S,
            )
            return None
        if self._started_at is not None and now - self._started_at > PATIENCE_S * 1e9:
            what = "joint_feedback" if self._described else "robot_description"
            self._ctx.log.warn(
                f"nothing on {self._ctx.namespace.rstrip('/')}/{what}, commanding nothing: is the robot in the "
                "simulation, and does it have joints besides its wheels?",
                every=WARN_PERIOD_S,
            )
        return None

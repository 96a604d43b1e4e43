"""The loop of turtlesim: receives commands and service requests, publishes poses, colours and markers."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from messages.base import Message
from messages.gazebo import WorldStates
from messages.geometry import Pose as BodyPose
from messages.geometry import Twist, Vector3
from messages.requests import (
    SET_PEN,
    TELEPORT_ABSOLUTE,
    TELEPORT_RELATIVE,
    TURTLESIM_CLEAR,
    TURTLESIM_KILL,
    TURTLESIM_RESET,
    TURTLESIM_SPAWN,
    Request,
)
from messages.std import Header, Time
from messages.std_srvs import Empty, EmptyResponse
from messages.topics import CMD_VEL, COLOR_SENSOR, MARKERS, TURTLE_POSE, TURTLE_STATES, Topic
from messages.turtlesim import (
    Color,
    Kill,
    KillResponse,
    SetPen,
    SetPenResponse,
    Spawn,
    SpawnResponse,
    TeleportAbsolute,
    TeleportAbsoluteResponse,
    TeleportRelative,
    TeleportRelativeResponse,
)
from services.runtime.context import Context, Tick
from services.runtime.errors import BadInput
from services.runtime.graph import token_pattern
from services.script.stepping_services import SteppingServices
from services.turtlesim import RATE_HZ, TurtlesimParameters
from services.turtlesim.background import Background
from services.turtlesim.markers import FRAME, PlaneMarkers
from services.turtlesim.plane import Pen, Plane, TurtleState
from services.turtlesim.rotate_absolute import RotateAbsoluteServer
from services.turtlesim.turtle import Turtle, Velocity

PERIOD_NS = round(1e9 / RATE_HZ)
TURTLE_REQUESTS: tuple[Request[Any, Any], ...] = (SET_PEN, TELEPORT_ABSOLUTE, TELEPORT_RELATIVE)
MARKERS_PERIOD_NS = 100_000_000


def run(ctx: Context[TurtlesimParameters]) -> None:
    """Move the turtles until asked to stop. A reset of simulation time restarts with turtle1."""
    Turtlesim(ctx).run()


class Turtlesim:
    """The plane, and the topics and services of its turtles."""

    def __init__(self, ctx: Context[TurtlesimParameters]) -> None:
        self._ctx, self._background = ctx, Background(ctx)
        self._plane = Plane(self._background.colour)
        self._topics: dict[str, TurtleTopics] = {}
        self._services = SteppingServices(ctx)
        self._markers, self._markers_due = PlaneMarkers(self._plane), 0
        self._states, self._output = ctx.advertise(TURTLE_STATES), ctx.advertise(MARKERS)
        self._viewers = ctx.node.transport.watch(token_pattern("sub", "*", self._output.name))

    def run(self) -> None:
        """Serve requests and run the ticks."""
        self._background.publish()
        self._plane.clear(self._background.colour)
        services = self._services
        services.serve(TURTLESIM_CLEAR, self._clear, TURTLESIM_CLEAR.name)
        services.serve(TURTLESIM_RESET, self._reset, TURTLESIM_RESET.name)
        services.serve(TURTLESIM_SPAWN, self._spawn, TURTLESIM_SPAWN.name)
        services.serve(TURTLESIM_KILL, self._kill, TURTLESIM_KILL.name)
        self._update_topics()
        self._ctx.log.info("turtle1 is in the middle of its plane; ./elea panel shows it")
        for tick in self._ctx.ticks(meanwhile=self._services.answer_late, reports_reads=True):
            self._step(tick)

    def _step(self, tick: Tick) -> None:
        if tick.reset:
            self._restart()
        self._services.update()
        steps = max(1, round(tick.dt * 1e9 / PERIOD_NS)) if tick.dt else 0
        for name, topics in self._topics.items():
            state = self._plane.turtles[name]
            state.turtle = topics.commanded(state.turtle, tick, self._ctx.params.holonomic)
            for _ in range(steps):
                self._plane.move(name, lambda turtle: turtle.step(tick.time, tick.dt / steps))
            if state.turtle.at_wall:
                x, y = state.turtle.x, state.turtle.y
                self._ctx.log.warn(f"{name} runs into the wall, and is held at ({x:.3f}, {y:.3f}) m", every=1.0)
            topics.publish(state)
        self._publish_states(tick.time)
        self._publish_markers(tick.time, tick.reset)

    def _publish_states(self, now: int) -> None:
        turtles = {name: each.turtle for name, each in self._plane.turtles.items()}
        self._states.publish(
            WorldStates(
                header=Header(stamp=Time.of(now), frame_id=FRAME),
                name=tuple(self._ctx.node.identity.resolve(name)[1:] for name in turtles),
                pose=tuple(BodyPose.planar(each.x, each.y, each.theta) for each in turtles.values()),
                twist=tuple(
                    Twist(linear=Vector3(x=each.ahead, y=each.left), angular=Vector3(z=each.turn))
                    for each in (turtle.velocity for turtle in turtles.values())
                ),
            )
        )

    def _publish_markers(self, now: int, reset: bool) -> None:
        """Publish changes ten times per second, and everything for a new viewer."""
        arrived = False
        while (token := self._viewers.poll()) is not None:
            arrived = arrived or token.alive
        if arrived or reset or now >= self._markers_due:
            self._markers_due = now + MARKERS_PERIOD_NS
            for message in self._markers.messages(now, arrived):
                self._output.publish(message)

    def _clear(self, _: Empty) -> EmptyResponse:
        self._plane.clear(self._background.colour)
        return EmptyResponse()

    def _reset(self, _: Empty) -> EmptyResponse:
        self._restart()
        return EmptyResponse()

    def _restart(self) -> None:
        """Begin again with turtle1, without a goal."""
        self._plane.reset(self._background.colour)
        self._update_topics()
        for topics in self._topics.values():
            topics.actions.restart()

    def _spawn(self, asked: Spawn) -> SpawnResponse:
        name = self._plane.spawn(asked.name, asked.x, asked.y, asked.theta)
        self._update_topics()
        turtle = self._plane.turtles[name].turtle
        self._ctx.log.info(f"{name} is at ({turtle.x:.3f}, {turtle.y:.3f}) m, {turtle.theta:.3f} rad")
        return SpawnResponse(name=name)

    def _kill(self, asked: Kill) -> KillResponse:
        self._plane.kill(asked.name)
        self._update_topics()
        return KillResponse()

    def _set_pen(self, name: str, asked: SetPen) -> SetPenResponse:
        state = self._plane.turtles[name]
        if asked.off:
            state.pen = Pen(state.pen.colour, state.pen.width, down=False)
        else:
            colour = Color(r=asked.r, g=asked.g, b=asked.b)
            state.pen = Pen(colour, asked.width or state.pen.width)
        return SetPenResponse()

    def _teleport_absolute(self, name: str, asked: TeleportAbsolute) -> TeleportAbsoluteResponse:
        self._plane.move(name, lambda turtle: turtle.placed(asked.x, asked.y, asked.theta))
        return TeleportAbsoluteResponse()

    def _teleport_relative(self, name: str, asked: TeleportRelative) -> TeleportRelativeResponse:
        self._plane.move(name, lambda turtle: turtle.displaced(asked.linear, asked.angular))
        return TeleportRelativeResponse()

    def _update_topics(self) -> None:
        """Create the topics and services of new turtles, and close those of removed turtles."""
        turtles = self._plane.turtles
        for name in [each for each in self._topics if each not in turtles]:
            self._topics.pop(name).close()
            for request in TURTLE_REQUESTS:
                self._services.hide(request, f"{name}/{request.name}")
        for name in turtles:
            if name not in self._topics:
                self._topics[name] = TurtleTopics(self._ctx, name)
                self._serve(name, SET_PEN, self._set_pen)
                self._serve(name, TELEPORT_ABSOLUTE, self._teleport_absolute)
                self._serve(name, TELEPORT_RELATIVE, self._teleport_relative)

    def _serve(self, name: str, request: Request[Any, Any], handle: Callable[[str, Any], Message]) -> None:
        """Serve a turtle's request; it is refused after the turtle was removed."""

        def answer(asked: Message) -> Message:
            if name not in self._plane.turtles:
                raise BadInput(f"the turtle {name!r} was killed")
            return handle(name, asked)

        self._services.serve(request, answer, f"{name}/{request.name}")


class TurtleTopics:
    """The topics of one turtle, and its action server."""

    def __init__(self, ctx: Context[TurtlesimParameters], name: str) -> None:
        node = ctx.node

        def name_of(topic: Topic[Any]) -> str:
            return f"{name}/{topic.name}"

        self._node = node
        self._commands = node.subscribe(CMD_VEL, name_of(CMD_VEL))
        self._poses, self._colours = (node.advertise(each, name_of(each)) for each in (TURTLE_POSE, COLOR_SENSOR))
        self.actions = RotateAbsoluteServer(node, name)

    def close(self) -> None:
        """Close the topics."""
        self.actions.close()
        self._node.unregister(self._commands, self._poses, self._colours)

    def commanded(self, turtle: Turtle, tick: Tick, holonomic: bool) -> Turtle:
        """Return the turtle under its newest command, or under its goal if it has one."""
        for twist, _ in () if tick.reset else self._commands.messages[-1:]:
            turtle = turtle.command(velocity_of(twist, holonomic), tick.time)
        return self.actions.step(turtle, tick.time, not tick.reset)

    def publish(self, state: TurtleState) -> None:
        """Publish pose and colour."""
        self._poses.publish(state.turtle.pose())
        self._colours.publish(state.sensed_colour)


def velocity_of(twist: Twist, holonomic: bool) -> Velocity:
    """Convert a command to the velocity of a turtle."""
    return Velocity(twist.linear.x, twist.linear.y if holonomic else 0.0, twist.angular.z)

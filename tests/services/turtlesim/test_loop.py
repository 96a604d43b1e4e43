"""Turtlesim's loop on an in-memory network; the test plays drivers and simulation time."""

from __future__ import annotations

import io
import json
import math

import msgspec
import pytest

from messages.actionlib import GoalID, Status
from messages.base import encode
from messages.geometry import Twist, Vector3
from messages.names import Identity
from messages.requests import (
    SET_PEN,
    TELEPORT_ABSOLUTE,
    TURTLESIM_CLEAR,
    TURTLESIM_KILL,
    TURTLESIM_RESET,
    TURTLESIM_SPAWN,
)
from messages.rosparam import RosparamTree
from messages.std_srvs import Empty, EmptyResponse
from messages.topics import CMD_VEL, COLOR_SENSOR, MARKERS, ROSPARAM_TREE, TURTLE_POSE, TURTLE_STATES, Quality, Topic
from messages.turtlesim import (
    Color,
    Kill,
    Pose,
    RotateAbsoluteActionGoal,
    RotateAbsoluteActionResult,
    RotateAbsoluteGoal,
    SetPen,
    Spawn,
    SpawnResponse,
    TeleportAbsolute,
)
from messages.visualization import Marker, MarkerArray
from services.runtime.context import Context
from services.runtime.errors import CallFailed
from services.runtime.log import Log
from services.runtime.node import Node
from services.runtime.publisher import Publisher
from services.runtime.testing import ServiceHarness, run_service
from services.runtime.transport.memory import MemoryBus, MemoryTransport
from services.script.lockstep_calls import CallRequest, call_topic
from services.script.stepping_services import SteppingServices
from services.turtlesim import SERVICE, TurtlesimParameters
from services.turtlesim.plane import Plane
from services.turtlesim.turtle import PLANE_M

DRIVE, POSE = CMD_VEL.named("turtle1/cmd_vel"), TURTLE_POSE.named("turtle1/pose")
DRAWING = MARKERS.named("/turtlesim/markers")
GOAL = Topic("turtle1/rotate_absolute/goal", RotateAbsoluteActionGoal, 0, Quality.EVENT, "")
CANCEL = Topic("turtle1/rotate_absolute/cancel", GoalID, 0, Quality.EVENT, "")
RESULT = Topic("turtle1/rotate_absolute/result", RotateAbsoluteActionResult, 0, Quality.EVENT, "")


class Stand:
    """The service and its simulation time."""

    def __init__(self, service: ServiceHarness) -> None:
        self.service, self.ticks = service, -1

    def run(self, seconds: float, epoch: int = 0) -> Pose:
        for _ in range(round(seconds * 50)):
            self.ticks += 1
            self.service.set_time(self.ticks / 50, epoch)
        return self.service.drain(POSE)[-1]


def test_turtles_are_driven_spawned_killed_and_reset() -> None:
    with run_service(SERVICE) as service:
        stand = Stand(service)
        stand.run(0.02)
        service.publish(DRIVE, Twist.planar(1.0, 0.0))
        assert stand.run(1.0).x == pytest.approx(PLANE_M / 2 + 1.0, abs=0.03)
        assert service.call(TURTLESIM_SPAWN, Spawn(x=2.0, y=3.0, theta=1.0)).name == "turtle2"
        with pytest.raises(CallFailed, match="there is already a turtle 'turtle2'"):
            service.call(TURTLESIM_SPAWN, Spawn(name="turtle2"))
        service.call(SET_PEN, SetPen(r=9, width=1), name="turtle2/set_pen")
        service.call(TELEPORT_ABSOLUTE, TeleportAbsolute(x=4.0, y=3.0), name="turtle2/teleport_absolute")
        stand.run(0.04)
        second = service.drain(TURTLE_POSE.named("turtle2/pose"))
        assert [(each.x, each.y) for each in second] == [(4.0, 3.0)] * 2
        service.publish(CMD_VEL.named("turtle2/cmd_vel"), Twist.planar(-1.0, 0.0))
        stand.run(0.1)
        assert service.drain(COLOR_SENSOR.named("turtle2/color_sensor"))[-1] == Color(r=9), "on the line that it drew"
        service.call(TURTLESIM_KILL, Kill(name="turtle2"))
        assert not service.reads(CMD_VEL.named("turtle2/cmd_vel"))
        with pytest.raises(CallFailed, match="the turtle 'turtle2' was killed"):
            service.call(SET_PEN, SetPen(), name="turtle2/set_pen")
        with pytest.raises(CallFailed, match="unknown turtle 'turtle2'"):
            service.call(TURTLESIM_KILL, Kill(name="turtle2"))
        service.publish(DRIVE, Twist.planar(20.0, 0.0))
        assert stand.run(1.0).x == pytest.approx(PLANE_M, abs=1e-6)
        assert "turtle1 runs into the wall, and is held at (11.089, 5.544) m" in service.log
        service.call(TURTLESIM_RESET, Empty())
        assert stand.run(0.1).x == pytest.approx(PLANE_M / 2)
        service.publish(DRIVE, Twist.planar(1.0, 0.0))
        stand.run(0.5)
        stand.ticks = -1
        assert stand.run(0.1, epoch=1).x == pytest.approx(PLANE_M / 2), "a reset of time begins again, too"


def test_viewers_get_the_background_and_every_trail() -> None:
    with run_service(SERVICE, params={"background_r": 1}) as service:
        stand = Stand(service)
        stand.run(0.02)
        service.publish(DRIVE, Twist.planar(1.0, 1.0))
        stand.run(1.0)
        service.call(SET_PEN, SetPen(g=255, width=9), name="turtle1/set_pen")
        service.publish(DRIVE, Twist.planar(1.0, 0.0))
        stand.run(1.3)
        shown = shown_markers(service.drain(DRAWING))
        plane, first, second = shown.values()
        assert (plane.ns, plane.type, plane.scale.x, plane.color.r) == ("background", Marker.CUBE, PLANE_M, 1 / 255)
        assert [each.ns for each in (first, second)] == ["trail/turtle1"] * 2
        assert (first.points[-1].x, first.points[-1].y) == (second.points[0].x, second.points[0].y)
        assert (second.color.g, second.scale.x) == (1.0, pytest.approx(9 / 45))
        assert math.dist(*[(p.x, p.y) for p in second.points]) == pytest.approx(1.0, abs=0.03), "two points"
        stand.run(0.3)
        assert service.drain(DRAWING) == [], "nothing new"
        service.join(DRAWING)
        stand.run(0.1)
        again = shown_markers(service.drain(DRAWING))
        assert list(again) == list(shown), "everything, for the viewer that came"
        service.call(TURTLESIM_CLEAR, Empty())
        stand.run(0.1)
        [wiped] = service.drain(DRAWING)
        assert [each.action for each in wiped.markers] == [Marker.DELETEALL, Marker.ADD]


def shown_markers(messages: list[MarkerArray]) -> dict[tuple[str, int], Marker]:
    """Return the markers that a viewer shows after these messages."""
    shown: dict[tuple[str, int], Marker] = {}
    for each in (marker for message in messages for marker in message.markers):
        if each.action == Marker.DELETEALL:
            shown = {}
        else:
            shown[each.ns, each.id] = each
    return shown


def test_states_have_the_speed_to_the_side_of_a_holonomic_turtle() -> None:
    with run_service(SERVICE, params={"holonomic": True}) as service:
        stand = Stand(service)
        stand.run(0.02)
        command = Twist(linear=Vector3(x=0.5, y=-0.25), angular=Vector3(z=1.0))
        service.publish(DRIVE, command)
        stand.run(0.1)
        assert service.drain(TURTLE_STATES)[-1].twist == (command,)


def test_it_turns_to_a_heading_and_says_how_that_ended() -> None:
    with run_service(SERVICE) as service:
        stand = Stand(service)
        stand.run(0.02)
        service.publish(GOAL, RotateAbsoluteActionGoal(goal_id=GoalID(id="a"), goal=RotateAbsoluteGoal(theta=1.5)))
        assert stand.run(2.0).theta == pytest.approx(1.5, abs=0.021)
        [result] = service.drain(RESULT)
        assert (result.status.goal_id.id, result.status.status) == ("a", Status.SUCCEEDED)
        assert result.result.delta == pytest.approx(-1.5, abs=0.021)
        for name in ("b", "c"):
            goal = RotateAbsoluteActionGoal(goal_id=GoalID(id=name), goal=RotateAbsoluteGoal(theta=-1.5))
            service.publish(GOAL, goal)
            stand.run(0.1)
        service.publish(CANCEL, GoalID())
        at = stand.run(0.1).theta
        assert [(each.status.goal_id.id, each.status.status) for each in service.drain(RESULT)] == [
            ("b", Status.PREEMPTED),
            ("c", Status.PREEMPTED),
        ]
        assert stand.run(0.5).theta == at, "it rests"


def test_the_background_is_in_the_tree_of_ros_1s_parameters() -> None:
    with run_service(SERVICE) as service:
        stand = Stand(service)
        stand.run(0.1)
        tree = {"turtlesim": {"background_r": 255, "background_g": "much"}}
        service.publish(ROSPARAM_TREE, RosparamTree(revision=1, tree=json.dumps(tree)))
        stand.run(0.1)
        assert service.drain(COLOR_SENSOR.named("turtle1/color_sensor"))[-1].r == 69, "not before it is cleared"
        service.call(TURTLESIM_CLEAR, Empty())
        stand.run(0.1)
        assert service.drain(COLOR_SENSOR.named("turtle1/color_sensor"))[-1] == Color(r=255, g=86, b=255)
        assert "background_g = 'much' in the parameter tree is not a colour value" in service.log


def test_in_lockstep_scripts_are_answered_within_a_tick() -> None:
    """Requests, replies and the list of services are topics, which lockstep orders."""
    bus = MemoryBus()
    with MemoryTransport(bus) as there, MemoryTransport(bus) as here:
        node = Node(there, Identity.of("turtlesim"), "turtlesim", Log("/turtlesim", out=io.StringIO()))
        with node:
            ctx = Context(node, TurtlesimParameters(), 50, lockstep=True)
            services = SteppingServices(ctx)
            plane = Plane(Color())
            spawn = TURTLESIM_SPAWN

            def handle(asked: Spawn) -> SpawnResponse:
                return SpawnResponse(name=plane.spawn(asked.name, asked.x, asked.y, asked.theta))

            services.serve(spawn, handle, "spawn")
            replies = here.subscribe("spawn/_reply", 16)
            told = here.subscribe("_scripts", 16, latched=True)
            output = Publisher(call_topic("/spawn", "request"), "/spawn/_request", "spawn/_request", "/script", here)
            for number, name in enumerate(("leo", "leo")):
                output.publish_encoded(encode(CallRequest("/script", number, encode(Spawn(name=name)))))
            output.publish_encoded(b"nonsense")
            node.update_subscribers()
            services.update()
            answers = [msgspec.msgpack.decode(each[0]) for each in iter(replies.recv, None)]
            assert [(each["number"], each["ok"]) for each in answers] == [(0, True), (1, False)]
            assert msgspec.msgpack.decode(answers[0]["payload"]) == {"name": "leo"}
            assert "there is already" in msgspec.msgpack.decode(answers[1]["payload"])["reason"]
            ends = msgspec.msgpack.decode(told.recv()[0])["ends"]  # type: ignore[index]
            assert {"kind": "srv", "name": "/spawn", "type": "turtlesim/Spawn", "latched": False} in ends
            services.hide(spawn, "spawn")
            services.update()
            assert not [each for each in msgspec.msgpack.decode(told.recv()[0])["ends"] if each["kind"] == "srv"]  # type: ignore[index]


def test_in_real_time_calls_wait_for_a_tick_but_not_for_long() -> None:
    bus, waited = MemoryBus(), 3600.0
    with MemoryTransport(bus) as there, MemoryTransport(bus) as here:
        node = Node(there, Identity.of("turtlesim"), "turtlesim", Log("/turtlesim", out=io.StringIO()))
        with node, pytest.MonkeyPatch.context() as patch:
            services = SteppingServices(Context(node, TurtlesimParameters(), 50))
            services.serve(TURTLESIM_CLEAR, lambda _: EmptyResponse(), "clear")
            assert "clear/_request" not in [each.pattern for each in bus.subscribers], "that is for lockstep"
            for answer, patience_s in ((services.update, waited), (services.answer_late, -1.0)):
                patch.setattr("services.script.stepping_services.HELD_S", waited)
                asked = here.query_async("clear", encode(Empty()), waited)
                node.spin_once()
                services.answer_late()
                assert asked.poll() is None
                patch.setattr("services.script.stepping_services.HELD_S", patience_s)
                answer()
                (reply,) = asked.poll() or ()
                assert reply.ok


def test_the_service_reset_ends_the_goal_of_turtle1() -> None:
    with run_service(SERVICE) as service:
        stand = Stand(service)
        stand.run(0.02)
        service.publish(GOAL, RotateAbsoluteActionGoal(goal=RotateAbsoluteGoal(theta=3.0)))
        assert stand.run(0.5).theta > 0.1
        service.call(TURTLESIM_RESET, Empty())
        pose = stand.run(0.5)
        assert (pose.theta, pose.angular_velocity) == (0.0, 0.0)

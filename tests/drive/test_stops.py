"""A base whose commander falls silent, dies or is overruled by an emergency stop ends where theory says."""

from __future__ import annotations

import math

import pytest

from messages.geometry import Twist
from messages.std import Bool
from messages.topics import CMD_VEL, E_STOP, GROUND_TRUTH
from models.figures import read_model
from models.stopping import Stop, stopping
from services.runtime.identity import Identity
from services.runtime.lockstep.marks import Marks
from services.runtime.log import Log
from services.runtime.network.memory_transport import MemoryTransport
from services.runtime.network.wire import member_id
from services.runtime.node import Node
from tests.drive.rehearsal import NAME, Rehearsal, rehearsal

SPEEDS = (0.2, 0.5, 0.75)
STANDING = 1e-3
"""m/s; below it a robot stands."""
WHEELS = read_model("p3dx").wheels
assert WHEELS is not None


def at_speed(world: Rehearsal, speed: float) -> None:
    """Commanded until it runs evenly."""
    world.drive(speed, 0.0, 0.5 + speed / 0.3)
    assert world.truth().twist.twist.linear.x == pytest.approx(speed, rel=2e-3)


def measured(world: Rehearsal, seconds: float = 4.0) -> Stop:
    """Time and way from now to the standstill, by ground truth at 50 Hz."""
    begin, start = world.now, world.truth().pose.pose.position
    world.run(seconds)
    states = [each for each in world.heard(GROUND_TRUTH) if each.header.stamp.ns / 1e9 >= begin]
    moving = [each.header.stamp.ns / 1e9 for each in states if abs(each.twist.twist.linear.x) > STANDING]
    end = states[-1].pose.pose.position
    assert abs(states[-1].twist.twist.linear.x) < STANDING
    return Stop(moving[-1] + 0.02 - begin, math.hypot(end.x - start.x, end.y - start.y))


def near(stop: Stop, theory: Stop) -> None:
    """Within 5 % in distance; in time within 5 % and the 20 ms between two looks."""
    assert stop.distance == pytest.approx(theory.distance, rel=0.05)
    assert abs(stop.time - theory.time) <= 0.05 * theory.time + 0.02


@pytest.mark.parametrize("speed", SPEEDS)
@pytest.mark.parametrize("timeout", [0.25, 0.5])
def test_a_silent_commander(speed: float, timeout: float) -> None:
    with rehearsal(cmd_vel_timeout=timeout) as world:
        at_speed(world, speed)
        world.send(CMD_VEL, Twist.planar(speed, 0.0))
        near(measured(world), stopping(speed, timeout, WHEELS.brake))
        assert world.base.arbiter.commands_timed_out == 1


@pytest.mark.parametrize("speed", SPEEDS)
def test_an_emergency_stop(speed: float) -> None:
    with rehearsal() as world:
        at_speed(world, speed)
        world.send(E_STOP, Bool(data=True))
        near(measured(world), stopping(speed, 0.0, WHEELS.brake))
        world.drive(speed, 0.0, 1.0)
        assert abs(world.truth().twist.twist.linear.x) < STANDING, "it latches"


@pytest.mark.parametrize("speed", SPEEDS)
def test_a_commander_that_dies(speed: float) -> None:
    """Its liveliness goes, which the network tells at once: no time-out passes."""
    with rehearsal() as world:
        at_speed(world, speed)
        arbiter = world.base.arbiter
        source = arbiter.decide(world.stage.now).source
        assert source is not None
        arbiter.lost(source, world.stage.now)
        near(measured(world), stopping(speed, 0.0, WHEELS.brake))


def test_a_member_of_lockstep_that_died_commands_no_more() -> None:
    """From the tick in which lockstep goes on without it, though its publications are still seen."""
    identity, marks = Identity.of("controller"), Marks()
    with (
        rehearsal() as world,
        Node(MemoryTransport(world.bus), identity, "controller", Log(identity.node)) as controller,
    ):
        controller.write(CMD_VEL, f"/{NAME}/cmd_vel").publish(Twist.planar(0.5, 0.0))
        world.run(0.02)
        assert world.status().source == identity.node
        marks.died = {member_id(identity.node, controller.transport.session)}
        world.stage.listen(marks, 0.0)
        assert (world.status().timed_out, world.status().source) == (True, "")
        assert not marks.died


@pytest.mark.parametrize("speed", SPEEDS)
def test_a_command_to_stand_still_is_a_gentle_stop(speed: float) -> None:
    """At the comfort limit of 0.3 m/s2, not at the brake's."""
    with rehearsal() as world:
        at_speed(world, speed)
        start, begin = world.truth().pose.pose.position, world.now
        world.drive(0.0, 0.0, 0.5 + speed / 0.3)
        theory = stopping(speed, 0.0, 0.3)
        assert world.truth().pose.pose.position.x - start.x == pytest.approx(theory.distance, rel=0.02)
        assert world.now - begin > theory.time


@pytest.mark.parametrize(("speed", "time", "way"), [(0.5, 1.92, 0.55), (0.75, 2.75, 1.13)])
def test_braking_as_ros_does_takes_the_comfort_limit(speed: float, time: float, way: float) -> None:
    with rehearsal(brake=0.3) as world:
        at_speed(world, speed)
        world.send(CMD_VEL, Twist.planar(speed, 0.0))
        stop = measured(world)
        assert stop == pytest.approx((time, way), rel=0.02)


def test_a_burger_stops_within_eight_centimetres() -> None:
    with rehearsal("burger") as world:
        at_speed(world, 0.22)
        world.send(CMD_VEL, Twist.planar(0.22, 0.0))
        stop = measured(world)
        near(stop, stopping(0.22, 0.25, 2.0))
        assert stop.distance < 0.08


def test_spinning_brakes_at_a_limit_of_its_own() -> None:
    with rehearsal(brake_angular=3.0) as world:
        world.drive(0.0, 1.5, 2.0)
        begin = world.now
        world.send(E_STOP, Bool(data=True))
        world.run(1.0)
        spinning = [each for each in world.heard(GROUND_TRUTH) if abs(each.twist.twist.angular.z) > 0.005]
        assert spinning[-1].header.stamp.ns / 1e9 - begin == pytest.approx(1.5 / 3.0, abs=0.03)

"""A base stops within the theoretical distance when its commands cease, their publisher dies, or on emergency stop."""

from __future__ import annotations

import math

import pytest

from messages.geometry import Pose, Twist
from messages.names import Identity
from messages.requests import DELETE, LIST_STOPS, RELEASE_STOP, RESET, SPAWN, Name
from messages.simulation import ReleaseStop, SpawnModel
from messages.std import Bool, Empty
from messages.topics import CMD_VEL, E_STOP, GROUND_TRUTH
from models.dynamics import StopPrediction, predict_stop
from models.model import read_model
from services.runtime.errors import CallFailed
from services.runtime.lockstep.watermarks import Watermarks
from services.runtime.log import Log
from services.runtime.node import Node
from services.runtime.publisher import Publisher
from services.runtime.transport.memory import MemoryTransport
from services.runtime.transport.wire import member_id
from services.sim.actuation import BaseActuation
from tests.services.sim.drive.simulation_harness import NAME, SimulationHarness, run_simulation

SPEEDS = (0.2, 0.5, 0.75)
STANDING = 1e-3
"""Speed [m/s] below which a robot counts as stopped."""
WHEELS = read_model("p3dx").wheels
assert WHEELS is not None


def at_speed(world: SimulationHarness, speed: float) -> None:
    """Drive until the speed is steady."""
    world.drive(speed, 0.0, 0.5 + speed / 0.3)
    assert world.truth().twist.twist.linear.x == pytest.approx(speed, rel=2e-3)


def measured(world: SimulationHarness, seconds: float = 4.0) -> StopPrediction:
    """Return time and distance from now to standstill, from ground truth at 50 Hz."""
    begin, start = world.now, world.truth().pose.pose.position
    world.run(seconds)
    states = [each for each in world.received(GROUND_TRUTH) if each.header.stamp.ns / 1e9 >= begin]
    moving = [each.header.stamp.ns / 1e9 for each in states if abs(each.twist.twist.linear.x) > STANDING]
    end = states[-1].pose.pose.position
    assert abs(states[-1].twist.twist.linear.x) < STANDING
    return StopPrediction(moving[-1] + 0.02 - begin, math.hypot(end.x - start.x, end.y - start.y))


def near(stop: StopPrediction, theory: StopPrediction) -> None:
    """Assert agreement within 5 % in distance, and within 5 % plus a sample period of 20 ms in time."""
    assert stop.distance == pytest.approx(theory.distance, rel=0.05)
    assert abs(stop.time - theory.time) <= 0.05 * theory.time + 0.02


@pytest.mark.slow
@pytest.mark.parametrize("speed", SPEEDS)
@pytest.mark.parametrize("timeout", [0.25, 0.5])
def test_a_silent_commander(speed: float, timeout: float) -> None:
    with run_simulation(cmd_vel_timeout=timeout) as world:
        at_speed(world, speed)
        world.publish(CMD_VEL, Twist.planar(speed, 0.0))
        near(measured(world), predict_stop(speed, timeout, WHEELS.brake))
        assert world.base.arbiter.commands_timed_out == 1


@pytest.mark.slow
@pytest.mark.parametrize("speed", SPEEDS)
def test_an_emergency_stop(speed: float) -> None:
    with run_simulation() as world:
        at_speed(world, speed)
        world.publish(E_STOP, Bool(data=True))
        near(measured(world), predict_stop(speed, 0.0, WHEELS.brake))
        world.drive(speed, 0.0, 1.0)
        assert abs(world.truth().twist.twist.linear.x) < STANDING, "it latches"


@pytest.mark.slow
@pytest.mark.parametrize("speed", SPEEDS)
def test_a_commander_that_dies(speed: float) -> None:
    """The network reports the loss of its liveliness token at once, without waiting for the time-out."""
    with run_simulation() as world:
        at_speed(world, speed)
        source = world.base.arbiter.decide(world.simulation.now).source
        assert source is not None
        world.base.publisher_lost(source, world.simulation.now)
        near(measured(world), predict_stop(speed, 0.0, WHEELS.brake))


def test_a_member_of_lockstep_that_died_commands_no_more() -> None:
    """From the tick in which lockstep goes on without it, although its publishers are still visible."""
    identity, marks = Identity.of("controller"), Watermarks()
    with (
        run_simulation() as world,
        Node(MemoryTransport(world.bus), identity, "controller", Log(identity.node)) as controller,
    ):
        controller.advertise(CMD_VEL, f"/{NAME}/cmd_vel").publish(Twist.planar(0.5, 0.0))
        world.run(0.02)
        assert world.status().source == identity.node
        marks.lost_members = {member_id(identity.node, controller.transport.session)}
        world.simulation.read_inputs(marks, 0.0)
        assert (world.status().timed_out, world.status().source) == (True, "")
        assert not marks.lost_members


@pytest.mark.parametrize("speed", SPEEDS)
def test_a_command_to_stand_still_is_a_gentle_stop(speed: float) -> None:
    """At the comfort limit of 0.3 m/s2, not the brake's."""
    with run_simulation() as world:
        at_speed(world, speed)
        start, begin = world.truth().pose.pose.position, world.now
        world.drive(0.0, 0.0, 0.5 + speed / 0.3)
        theory = predict_stop(speed, 0.0, 0.3)
        assert world.truth().pose.pose.position.x - start.x == pytest.approx(theory.distance, rel=0.02)
        assert world.now - begin > theory.time


@pytest.mark.parametrize(("speed", "time", "way"), [(0.5, 1.92, 0.55), (0.75, 2.75, 1.13)])
def test_braking_as_ros_does_takes_the_comfort_limit(speed: float, time: float, way: float) -> None:
    with run_simulation(brake=0.3) as world:
        at_speed(world, speed)
        world.publish(CMD_VEL, Twist.planar(speed, 0.0))
        stop = measured(world)
        assert stop == pytest.approx((time, way), rel=0.02)


def test_a_burger_stops_within_eight_centimetres() -> None:
    with run_simulation("burger") as world:
        at_speed(world, 0.22)
        world.publish(CMD_VEL, Twist.planar(0.22, 0.0))
        stop = measured(world)
        near(stop, predict_stop(0.22, 0.25, 2.0))
        assert stop.distance < 0.08


def test_spinning_brakes_at_a_limit_of_its_own() -> None:
    with run_simulation(brake_angular=3.0) as world:
        world.drive(0.0, 1.5, 2.0)
        begin = world.now
        world.publish(E_STOP, Bool(data=True))
        world.run(1.0)
        spinning = [each for each in world.received(GROUND_TRUTH) if abs(each.twist.twist.angular.z) > 0.005]
        assert spinning[-1].header.stamp.ns / 1e9 - begin == pytest.approx(1.5 / 3.0, abs=0.03)


def test_stops_of_several_add_up_and_what_was_commanded_before_a_reset_moves_nothing() -> None:
    with run_simulation() as world:
        at_speed(world, 0.5)
        world.publish(E_STOP, Bool(data=True), sender="/panel")
        world.publish(E_STOP, Bool(data=True), sender="/tool")
        world.publish(E_STOP, Bool(data=False), sender="/tool")
        world.drive(0.5, 0.0, 1.0)
        status = world.status()
        assert (status.e_stopped, len(status.stopped_by)) == (True, 1)
        world.call(RESET, Empty())
        world.drive(0.5, 0.0, 0.2)
        assert abs(world.truth().twist.twist.linear.x) < STANDING, "time that is reset ends no stop"
        world.publish(E_STOP, Bool(data=False), sender="/panel")
        world.run(0.2)
        assert (world.status().e_stopped, world.status().stopped_by) == (False, ())
        assert abs(world.truth().twist.twist.linear.x) < STANDING
        at_speed(world, 0.5)
        world.publish(E_STOP, Bool(data=True))
        world.publish(E_STOP, Bool(data=False))
        near(measured(world), predict_stop(0.5, 0.0, WHEELS.brake))


def test_a_robot_is_spawned_stopped_and_deleted_with_its_stop() -> None:
    spawn = SpawnModel(name="late", model="burger", pose=Pose.planar(2.0, 0.0))
    with run_simulation() as world:
        world.call(SPAWN, spawn)
        stop = Publisher(E_STOP, "/late/e_stop", "late/e_stop", "/panel", MemoryTransport(world.bus))
        stop.publish(Bool(data=True))
        world.run(0.02)
        held = world.call(LIST_STOPS, Empty()).stops
        assert [(each.robot, each.topic) for each in held] == [("late", "/late/e_stop")]
        with pytest.raises(CallFailed, match=r"no emergency stop of p3dx to release \(active stops: late\)"):
            world.call(RELEASE_STOP, ReleaseStop(name=NAME))
        world.call(DELETE, Name(name="late"))
        assert world.call(LIST_STOPS, Empty()).stops == ()
        stop.close()
        world.call(SPAWN, spawn)
        world.run(0.02)
        assert world.call(LIST_STOPS, Empty()).stops == ()
        late = world.simulation.find("late").actuation
        assert isinstance(late, BaseActuation)
        assert not late.controller.arbiter.e_stopped

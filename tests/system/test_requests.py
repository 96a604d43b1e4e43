"""Requests to a running simulation: time pauses and steps exactly, models are spawned and deleted, all is reset."""

from __future__ import annotations

import math
from collections.abc import Iterator

import pytest

from messages.geometry import Pose, Twist
from messages.requests import DELETE, GET_STATE, LIST, PAUSE, RESET, RESET_WORLD, RESUME, SET_STATE, STEP, Name
from messages.simulation import ModelList, SetModelState, SimTime, Steps
from messages.std import Empty
from messages.topics import CLOCK, CMD_VEL
from services.runtime.errors import CallFailed
from services.runtime.step import STEP_NS
from tests.harness.message_recorder import WITHIN_S, MessageRecorder, distance
from tests.harness.waiting import wait_until
from tests.system.two_robot_simulation import STARTS, TwoRobotSimulation, two_robot_simulation

pytestmark = pytest.mark.waits


@pytest.fixture(scope="module", params=["real", "lockstep"])
def running(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[TwoRobotSimulation]:
    """A simulation with a reset monitor, which in lockstep is a member."""
    mode = str(request.param)
    with two_robot_simulation(tmp_path_factory.mktemp(mode), mode) as made:
        wait_until(lambda: made.health("/reset_monitor").ticks > 0, WITHIN_S, "ticks of the reset monitor")
        yield made
        assert "twice" not in made.reset_monitor.text


@pytest.fixture
def paused(running: TwoRobotSimulation) -> Iterator[SimTime]:
    """Pause time during the test."""
    stopped = running.call(PAUSE, Empty())
    yield stopped
    running.call(RESUME, Empty())


def test_pause_stops_the_clock(running: TwoRobotSimulation, paused: SimTime) -> None:
    clock = MessageRecorder(running.node.subscribe(CLOCK))
    tick = [clock.wait_next() for _ in range(5)][-1]
    assert tick.paused
    assert (tick.clock.ns, tick.tick, tick.epoch) == (paused.time, paused.tick, paused.epoch)
    wait_until(lambda: running.health("/sim").state == "paused", WITHIN_S, "a sim that says that it is paused")
    wait_until(lambda: running.health("/reset_monitor").state == "paused", WITHIN_S, "a controller that says so")
    assert running.call(PAUSE, Empty()) == paused


@pytest.mark.parametrize("count", [1, 7, 400])
def test_steps_are_exact(running: TwoRobotSimulation, paused: SimTime, count: int) -> None:
    stepped = running.call(STEP, Steps(count=count))
    assert stepped.tick == paused.tick + count
    assert stepped.time == paused.time + count * STEP_NS
    assert running.call(PAUSE, Empty()) == stepped


def test_steps_need_a_pause_and_a_number(running: TwoRobotSimulation, paused: SimTime) -> None:
    with pytest.raises(CallFailed, match="count"):
        running.call(STEP, Steps(count=0))
    running.call(RESUME, Empty())
    with pytest.raises(CallFailed, match="time is running: pause it"):
        running.call(STEP, Steps(count=1))


def test_resume_goes_on_from_where_time_stood(running: TwoRobotSimulation) -> None:
    stopped = running.call(PAUSE, Empty())
    clock = MessageRecorder(running.node.subscribe(CLOCK))
    clock.wait_next()
    assert running.call(RESUME, Empty()).time == stopped.time
    wait_until(lambda: not clock.wait_next().paused, WITHIN_S, "a clock that goes")
    first = next(each for each in clock.received() if not each.paused and each.clock.ns >= stopped.time)
    assert first.clock.ns - stopped.time <= 8 * STEP_NS
    wait_until(lambda: clock.wait_next().clock.ns > stopped.time + 10**9, WITHIN_S, "a second more")


def test_a_state_is_set_and_told(running: TwoRobotSimulation, paused: SimTime) -> None:
    asked = SetModelState(name="tb3_0", pose=Pose.planar(2.0, -1.0, 0.5), twist=Twist.planar(0.1, 0.0))
    told = running.call(SET_STATE, asked)
    assert told == running.call(GET_STATE, Name(name="tb3_0"))
    assert told.pose.position.x == pytest.approx(2.0, abs=1e-9)
    assert told.pose.position.y == pytest.approx(-1.0, abs=1e-9)
    assert told.pose.orientation.yaw == pytest.approx(0.5, abs=1e-9)
    assert told.twist.linear.x == pytest.approx(0.1, abs=1e-9)
    models = running.call(LIST, Empty()).models
    assert models[0] == told
    assert [(each.name, each.model) for each in models] == [(name, "burger") for name in STARTS]
    running.call(RESET_WORLD, Empty())


def test_reset_begins_a_new_epoch(running: TwoRobotSimulation) -> None:
    away(running)
    before = running.call(PAUSE, Empty())
    reset = running.call(RESET, Empty())
    assert reset == SimTime(time=0, tick=0, epoch=before.epoch + 1)
    home(running.call(LIST, Empty()))
    running.call(RESUME, Empty())
    truth = running.truth["tb3_0"]
    wait_until(lambda: truth.wait_next().header.stamp.ns < before.time, WITHIN_S, "ground truth of the new epoch")
    truth.wait_until_still()
    clock = MessageRecorder(running.node.subscribe(CLOCK))
    assert clock.wait_next().epoch == reset.epoch
    said = wait_until(lambda: words(running, f"epoch {reset.epoch},"), WITHIN_S, "word of the reset monitor")
    assert len(said) == 1
    assert "odometry False" in said[0]


def test_reset_world_keeps_time(running: TwoRobotSimulation) -> None:
    away(running)
    before = running.call(PAUSE, Empty())
    after = running.call(RESET_WORLD, Empty())
    assert after == before
    home(running.call(LIST, Empty()))
    running.call(RESUME, Empty())
    running.truth["tb3_0"].wait_until_still()


def test_what_is_deleted_is_gone(running: TwoRobotSimulation) -> None:
    assert running.call(DELETE, Name(name="tb3_1")).text == "deleted tb3_1"
    assert [each.name for each in running.call(LIST, Empty()).models] == ["tb3_0"]
    with pytest.raises(CallFailed, match=r"unknown model 'tb3_1'; did you mean 'tb3_0'"):
        running.call(GET_STATE, Name(name="tb3_1"))
    assert not [each for each in running.health("/sim").outputs if each.topic.startswith("/tb3_1/")]
    running.truth["tb3_0"].wait_after(0.1)


def away(running: TwoRobotSimulation) -> None:
    """Drive tb3_0 away from its place."""
    commands, truth = running.node.advertise(CMD_VEL, "/tb3_0/cmd_vel"), running.truth["tb3_0"]
    start = truth.wait_next()

    def moved() -> bool:
        commands.publish(Twist.planar(0.2, 0.0))
        return distance(start, truth.wait_next()) > 0.05

    wait_until(moved, WITHIN_S, "a robot that drives")


def words(running: TwoRobotSimulation, text: str) -> list[str]:
    """Return the reset monitor's log lines that contain ``text``."""
    return [line for line in running.reset_monitor.text.splitlines() if text in line]


def home(listed: ModelList) -> None:
    """Assert that every robot stands still at its spawn pose."""
    for model in listed.models:
        at, twist = model.pose.position, model.twist.linear
        assert math.hypot(at.x, at.y - STARTS[model.name]) < 1e-9
        assert (twist.x, twist.y) == (0.0, 0.0)

"""Stopping distance when a controller is killed, stops commanding or requests an emergency stop, in real processes.

Everything is in lockstep, so each instant is known to the physics step. A command of tick t reaches the base at t with
latency 0, and one period of the controller later with latency 1, while the next tick is computed. When a controller is
killed in its tick, the simulation waits for it there: with latency 0 in that very tick, one period T after the last
command arrived; with latency 1 when it would collect the tick, again T after the last command arrived. The network
reports that the controller is gone, and the base brakes in that step. So the distance from the last command on is v T +
v^2 / 2a in both cases; when a controller stops commanding it is v timeout + v^2 / 2a.

Stops by a released key, at the same speeds, are tested in tests/services/teleop/test_script_drives.py.
"""

from __future__ import annotations

import json
import signal
from collections.abc import Iterator, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path

import pytest

from messages.nav import Odometry
from models.dynamics import StopPrediction, predict_stop
from models.model import read_model
from services.runtime.step import STEP_NS
from services.sim.parameters import BaseParameters
from tests.harness.message_recorder import distance, speed, time_of
from tests.harness.processes import Network, parameter_options
from tests.harness.waiting import wait_until
from tests.system import commander
from tests.system.commander import HANGS, RATE, SPEEDS, End
from tests.system.lockstep_recorder import NODE, WITHIN_S, LockstepRecorder, RobotRecording

WHEELS = read_model("p3dx").wheels
assert WHEELS is not None
BRAKE = WHEELS.brake
TIMEOUT = BaseParameters().cmd_vel_timeout
PERIOD = 1 / RATE
"""Simulation time between two commands [s]."""
END = 3.2
"""Simulation time [s] of the tick in which the controller ends; the fastest robot needs 0.75 / 0.3 = 2.5 s to speed."""
STANDING = 1e-3
"""Speed [m/s] below which a robot counts as stopped."""
STEP_S = STEP_NS / 1e9
LOOK = 0.02
"""Sample period of the recorder [s, simulation time]."""


class Robot:
    """The recording of one robot."""

    def __init__(self, seen: RobotRecording, name: str) -> None:
        self._truth, self.base = seen.truth[name], seen.status[name][-1]

    def at(self, seconds: float) -> Odometry:
        """Return the ground truth at exactly this time [s]."""
        return next(each for each in self._truth if each.header.stamp.ns == round(seconds * 1e9))

    def stop(self, begin: float) -> StopPrediction:
        """Return time and distance from ``begin`` [s] to standstill, from ground truth at 50 Hz."""
        end = self._truth[-1]
        assert abs(speed(end)) < STANDING
        moving = [time_of(each) for each in self._truth if abs(speed(each)) > STANDING]
        return StopPrediction(moving[-1] + LOOK - begin, distance(self.at(begin), end))


class Drive:
    """The three robots in lockstep with their controller and a recorder that misses no sample."""

    def __init__(self, network: Network, folder: Path, end: End, latency: int = 0) -> None:
        entries = [{"name": name, "model": "p3dx", "y": 2.0 * index} for index, name in enumerate(SPEEDS)]
        settings = {"robots": entries, "mode": "lockstep", "latency": latency, "members": ["/commander", NODE]}
        network.start("sim", "--lockstep", *parameter_options(settings))
        self.lockstep_recorder = LockstepRecorder(network, folder, list(SPEEDS), END + 1.2, END + latency * LOOK)
        ends = "--lockstep", "--param", f"end={json.dumps(end)}", "--param", f"at={END}"
        self.commander = network.run(Path(commander.__file__), *ends)

    def robots(self) -> dict[str, Robot]:
        """Return the recordings up to a time at which all have stopped."""
        seen = self.lockstep_recorder.recording()
        return {name: Robot(seen, name) for name in SPEEDS}


def near(robot: Robot, v: float, begin: float, coasting: float, theory: StopPrediction) -> None:
    """Assert that from ``begin`` [s] on the robot keeps its speed for ``coasting`` [s] and stops as in theory.

    Tolerances: 5 % in distance; 5 % plus a sample period of 20 ms in time.
    """
    assert speed(robot.at(begin)) == pytest.approx(v, rel=2e-3)
    assert speed(robot.at(begin + coasting)) == pytest.approx(v, rel=2e-3)
    assert speed(robot.at(begin + coasting + LOOK)) < v - 0.5 * STEP_S * BRAKE
    stop = robot.stop(begin)
    print(f"{v:g} m/s: {stop.distance:.4f} m of {theory.distance:.4f}, {stop.time:.3f} s of {theory.time:.3f}")
    assert stop.distance == pytest.approx(theory.distance, rel=0.05)
    assert abs(stop.time - theory.time) <= 0.05 * theory.time + LOOK


def run(folder: Path, end: End, latency: int = 0) -> dict[str, Robot]:
    """Run a drive and return its robots; a hung controller is killed."""
    folder.mkdir()
    with Network(folder) as network:
        drive = Drive(network, folder, end, latency)
        if end == "hangs":
            wait_until(lambda: HANGS in drive.commander.text, WITHIN_S, "the tick in which it ends")
            drive.lockstep_recorder.wait_tick()
            assert drive.commander.kill() == -signal.SIGKILL
        return drive.robots()


@pytest.fixture(scope="module")
def drives(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Mapping[str, Future[dict[str, Robot]]]]:
    """All drives in parallel, as each mostly waits while it starts and ends."""
    folder = tmp_path_factory.mktemp("stops")
    ends: dict[str, tuple[End, int]] = {
        "killed 0": ("hangs", 0),
        "killed 1": ("hangs", 1),
        "silent": ("falls silent", 0),
        "stops": ("stops", 0),
    }
    with ThreadPoolExecutor(len(ends)) as pool:
        yield {name: pool.submit(run, folder / name, *each) for name, each in ends.items()}


@pytest.mark.parametrize("latency", [0, 1])
def test_a_commander_that_is_killed(drives: Mapping[str, Future[dict[str, Robot]]], latency: int) -> None:
    """It is killed with SIGKILL in the middle of a tick; the base doesn't wait for the time-out.

    With latency 1 the simulation is one grant ahead of the report for which it waits.
    """
    last, robots = END if latency else END - PERIOD, drives[f"killed {latency}"].result()
    for name, v in SPEEDS.items():
        base = robots[name].base
        assert base.last_command.ns == round(last * 1e9)
        assert (base.timed_out, base.commands_timed_out) == (True, 1)
        near(robots[name], v, last, PERIOD, predict_stop(v, PERIOD, BRAKE))


def test_a_commander_that_falls_silent(drives: Mapping[str, Future[dict[str, Robot]]]) -> None:
    last, robots = END - PERIOD, drives["silent"].result()
    for name, v in SPEEDS.items():
        base = robots[name].base
        assert base.last_command.ns == round(last * 1e9)
        assert (base.timed_out, base.commands_timed_out) == (True, 1)
        near(robots[name], v, last, 0.24, predict_stop(v, TIMEOUT, BRAKE))


def test_an_emergency_stop_that_the_commander_does_not_heed(drives: Mapping[str, Future[dict[str, Robot]]]) -> None:
    robots = drives["stops"].result()
    for name, v in SPEEDS.items():
        base = robots[name].base
        assert base.e_stopped
        assert base.last_command.ns > END * 1e9
        near(robots[name], v, END, 0.0, predict_stop(v, 0.0, BRAKE))

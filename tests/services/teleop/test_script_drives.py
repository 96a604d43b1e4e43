"""Scripts that drive simulated robots in lockstep: stopping distance, priorities, and repeatability."""

from __future__ import annotations

import math
from pathlib import Path
from typing import NamedTuple

import pytest

from messages.elea import BaseStatus
from messages.nav import Odometry
from models.model import WheelConfig, read_model
from services.teleop.hold_detector import MIN_REPEAT_TIMEOUT_S
from tests.harness.cases import case
from tests.harness.message_recorder import distance, speed, time_of
from tests.harness.processes import Network, parameter_options
from tests.harness.robot_recorder import STANDSTILL_SPEED
from tests.system.lockstep_recorder import NODE, LockstepRecorder

APART = 3.0
"""Distance [m] between robots that drive side by side."""


class Driven(NamedTuple):
    """A robot's ground truth and base statuses, oldest first."""

    samples: list[Odometry]
    states: list[BaseStatus]

    @property
    def speeds(self) -> dict[float, float]:
        """The forward speed [m/s] by time [s]."""
        return {round(time_of(each), 3): speed(each) for each in self.samples}


class Drive(NamedTuple):
    """A robot's model and its drivers, services with parameters; ``base`` are the base's parameters."""

    model: str
    drivers: dict[str, dict[str, object]]
    base: dict[str, object] | None = None


def driven(logs: Path, seconds: float, drives: dict[str, Drive]) -> dict[str, Driven]:
    """Run robots side by side, in lockstep with all their drivers, and return their records up to ``seconds``."""
    drivers = [(name, kind, each.drivers[kind]) for name, each in drives.items() for kind in each.drivers]
    settings = {
        "robots": [
            {"name": name, "model": each.model, "y": APART * number, "parameters": each.base or {}}
            for number, (name, each) in enumerate(drives.items())
        ],
        "mode": "lockstep",
        "members": [NODE, *(f"/{name}/{kind}" for name, kind, _ in drivers)],
    }
    with Network(logs) as network:
        spectator = LockstepRecorder(network, logs, list(drives), seconds)
        for where, kind, parameters in (("", "sim", settings), *drivers):
            namespace = ["--namespace", f"/{where}"] if where else []
            network.start(kind, *namespace, "--lockstep", *parameter_options(parameters))
        seen = spectator.recording()
        return {name: Driven(seen.truth[name], seen.status[name]) for name in drives}


def at(samples: list[Odometry], seconds: float) -> Odometry:
    """Return the sample at a time [s]."""
    return next(each for each in samples if time_of(each) == pytest.approx(seconds))


def wheels(model: str) -> WheelConfig:
    figures = read_model(model).wheels
    assert figures is not None
    return figures


class Stop(NamedTuple):
    """A key held until a robot drives at ``v`` [m/s], with the times [s] of its last repeat and of the stop command."""

    model: str
    v: float

    @property
    def braking(self) -> float:
        return self.v / wheels(self.model).acceleration

    @property
    def before(self) -> float:
        """Time of the last ground truth sample before the last repeat."""
        return 0.04 * math.ceil((1.5 + self.braking) / 0.04)

    @property
    def last(self) -> float:
        return self.before + 0.01

    @property
    def told(self) -> float:
        return self.last + MIN_REPEAT_TIMEOUT_S + 0.01

    @property
    def script(self) -> dict[str, object]:
        return {"keys": f"i@0.49-{self.last:.2f}", "speed": self.v, "key_delay": 0.52, "key_interval": 0.02}


STOPS = {
    "slow": Stop("burger", 0.2),
    "heavy": Stop("p3dx", 0.2),
    "faster": Stop("p3dx", 0.5),
    "fastest": Stop("p3dx", 0.75),
}
STAMPED: dict[str, object] = {"stamped": True, "frame_id": "stamped/base_link"}


@pytest.fixture(scope="module")
def alone(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Driven]:
    """Robots driven only by a script."""
    drives = {name: Drive(stop.model, {"teleop": stop.script}) for name, stop in STOPS.items()}
    drives["held"] = Drive("burger", {"teleop": {"keys": "i@0.5-3", "speed": 0.2}})
    script = {"keys": "i@0.5-2", "speed": 0.2, **STAMPED}
    drives["stamped"] = Drive("burger", {"teleop": script}, {"use_stamped_vel": True})
    seconds = max(stop.told + stop.braking for stop in STOPS.values()) + 0.5
    return driven(tmp_path_factory.mktemp("alone"), max(seconds, 3.2), drives)


def test_a_released_key_stops_the_robot_on_the_way_that_theory_says(alone: dict[str, Driven]) -> None:
    """The dead-man time-out at full speed, then braking for v / a: s = v t + v^2 / 2a, within 5 %.

    The last repeat is 0.01 s after a ground truth sample; zero is published at the first tick after its time-out.
    """
    for name, stop in STOPS.items():
        with case(stop.model, stop.v):
            samples, v = alone[name].samples, stop.v
            assert at(samples, 0.48).pose.pose.position.x == pytest.approx(0.0, abs=1e-3)
            there = at(samples, stop.before)
            assert speed(there) == pytest.approx(v, rel=0.01)
            way = v * (stop.told - stop.before) + v * stop.braking / 2
            assert distance(there, samples[-1]) == pytest.approx(way, rel=0.05)
            stood = next(
                time_of(each) for each in samples if time_of(each) > stop.told and abs(speed(each)) < STANDSTILL_SPEED
            )
            assert stood - stop.told == pytest.approx(stop.braking, rel=0.05, abs=0.04)


def test_a_held_key_shows_no_stutter_in_the_robot(alone: dict[str, Driven]) -> None:
    """The first repeat arrives after twice the base's time-out."""
    speeds = alone["held"].speeds
    assert max(speeds) > 3.0
    assert all(abs(v - 0.2) < 0.01 for now, v in speeds.items() if 0.8 < now < 3.0)


def test_a_base_of_newer_ros_is_driven_by_stamped_commands(alone: dict[str, Driven]) -> None:
    found = alone["stamped"]
    assert found.states[-1].stale_dropped == 0
    assert all(abs(v - 0.2) < 0.01 for now, v in found.speeds.items() if 0.8 < now < 2.0)


CROSSED = {
    "r": Drive(
        "burger",
        {
            "waypoint": {"goals": [[5, 0]]},
            "teleop": {"keys": ",@3-5", "speed": 0.2, "give_way": 0.5},
        },
    )
}


@pytest.fixture(scope="module")
def interrupted(tmp_path_factory: pytest.TempPathFactory) -> Driven:
    """A robot that a script drives back while a controller drives it."""
    return driven(tmp_path_factory.mktemp("interrupted"), 8.0, CROSSED)["r"]


def test_it_wins_over_a_controller_and_gives_way_when_it_falls_silent(interrupted: Driven) -> None:
    speeds = interrupted.speeds
    assert all(v > 0.2 for now, v in speeds.items() if 1.5 < now < 3.0)
    assert all(v == pytest.approx(-0.2, abs=0.01) for now, v in speeds.items() if 3.6 < now < 4.9)
    assert all(abs(v) < 0.005 for now, v in speeds.items() if 5.4 < now < 5.7)
    assert all(v > 0.15 for now, v in speeds.items() if 6.8 < now < 8.0)
    obeyed = [each.source for each in interrupted.states if each.source]
    changes = [source for index, source in enumerate(obeyed) if index == 0 or source != obeyed[index - 1]]
    assert changes == ["/r/waypoint", "/r/teleop", "/r/waypoint"]


def test_a_script_repeats_bit_for_bit(interrupted: Driven, tmp_path: Path) -> None:
    assert driven(tmp_path, 8.0, CROSSED)["r"] == interrupted

"""Scripts that drive real robots in lockstep: the way to a stop, who wins over whom, and that it repeats."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import NamedTuple

import pytest

from messages.elea import BaseStatus
from messages.nav import Odometry
from models.model import WheelConfig, read_model
from services.teleop.hold_detector import MIN_REPEAT_TIMEOUT_S
from tests.harness.message_recorder import distance, speed, time_of
from tests.harness.processes import Network
from tests.harness.robot_recorder import STANDSTILL_SPEED
from tests.system.lockstep_recorder import NODE, LockstepRecorder


class Driven(NamedTuple):
    """What a robot did: its ground truth, and the states of its base, oldest first."""

    samples: list[Odometry]
    states: list[BaseStatus]

    @property
    def speeds(self) -> dict[float, float]:
        """Speed ahead [m/s] by time [s]."""
        return {round(time_of(each), 3): speed(each) for each in self.samples}


def driven(
    logs: Path,
    model: str,
    seconds: float,
    *drivers: tuple[str, dict[str, object]],
    base: dict[str, object] | None = None,
) -> Driven:
    """What a robot ``r`` does until ``seconds`` of simulation time, in lockstep with its drivers: services with
    parameters.
    """
    settings = {
        "robots": [{"name": "r", "model": model, "parameters": base or {}}],
        "mode": "lockstep",
        "members": [NODE, *(f"/r/{kind}" for kind, _ in drivers)],
    }
    with Network(logs) as network:
        spectator = LockstepRecorder(network, logs, ["r"], seconds)
        for kind, parameters in (("sim", settings), *drivers):
            words = [w for key, value in parameters.items() for w in ("--param", f"{key}={json.dumps(value)}")]
            where = [] if kind == "sim" else ["--namespace", "/r"]
            network.start(kind, *where, "--lockstep", *words)
        seen = spectator.recording()
        return Driven(seen.truth["r"], seen.status["r"])


def at(samples: list[Odometry], seconds: float) -> Odometry:
    """The sample of an instant."""
    return next(each for each in samples if time_of(each) == pytest.approx(seconds))


def wheels(model: str) -> WheelConfig:
    figures = read_model(model).wheels
    assert figures is not None
    return figures


@pytest.mark.parametrize(("model", "v"), [("burger", 0.2), ("p3dx", 0.2), ("p3dx", 0.5), ("p3dx", 0.75)])
def test_a_released_key_stops_the_robot_on_the_way_that_theory_says(tmp_path: Path, model: str, v: float) -> None:
    """The dead-man's time-out at speed, then v / a of braking: s = v t + v^2 / 2a, within 5 %.

    The last repeat comes 0.01 s after a sample of ground truth, and zero goes out at the first tick after its time-out.
    """
    a = wheels(model).acceleration
    before = 0.04 * math.ceil((1.5 + v / a) / 0.04)
    last = before + 0.01
    told = last + MIN_REPEAT_TIMEOUT_S + 0.01
    script = {"keys": f"i@0.49-{last:.2f}", "speed": v, "key_delay": 0.52, "key_interval": 0.02}
    samples = driven(tmp_path, model, told + v / a + 0.5, ("teleop", script)).samples
    assert at(samples, 0.48).pose.pose.position.x == pytest.approx(0.0, abs=1e-3)
    there = at(samples, before)
    assert speed(there) == pytest.approx(v, rel=0.01)
    assert distance(there, samples[-1]) == pytest.approx(v * (told - before) + v * v / (2 * a), rel=0.05)
    stood = next(time_of(each) for each in samples if time_of(each) > told and abs(speed(each)) < STANDSTILL_SPEED)
    assert stood - told == pytest.approx(v / a, rel=0.05, abs=0.04)


def test_a_held_key_shows_no_stutter_in_the_robot(tmp_path: Path) -> None:
    """The first repeat comes after twice the base's time-out."""
    speeds = driven(tmp_path, "burger", 4.0, ("teleop", {"keys": "i@0.5-3", "speed": 0.2})).speeds
    assert all(abs(v - 0.2) < 0.01 for now, v in speeds.items() if 0.8 < now < 3.0)


def test_a_base_of_newer_ros_is_driven_by_stamped_commands(tmp_path: Path) -> None:
    script = {"keys": "i@0.5-2", "speed": 0.2, "stamped": True, "frame_id": "r/base_link"}
    found = driven(tmp_path, "burger", 3.0, ("teleop", script), base={"use_stamped_vel": True})
    assert found.states[-1].stale_dropped == 0
    assert all(abs(v - 0.2) < 0.01 for now, v in found.speeds.items() if 0.8 < now < 2.0)


WAY: tuple[str, dict[str, object]] = ("waypoint", {"goals": [[5, 0]]})
BACK: tuple[str, dict[str, object]] = ("teleop", {"keys": ",@3-5", "speed": 0.2, "give_way": 0.5})


@pytest.fixture(scope="module")
def interrupted(tmp_path_factory: pytest.TempPathFactory) -> Driven:
    """A robot that a script drives back on its way."""
    return driven(tmp_path_factory.mktemp("interrupted"), "burger", 8.0, WAY, BACK)


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
    assert driven(tmp_path, "burger", 8.0, WAY, BACK) == interrupted

"""Scripts that drive real robots in lockstep: the way to a stop, who wins over whom, and that it repeats."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from messages.elea import BaseStatus
from messages.nav import Odometry
from messages.topics import BASE_STATUS
from models.figures import Wheels, read_model
from services.teleop.dead_man import LEAST_S
from tests.faults.track import STANDING
from tests.processes import Network
from tests.system.watched import Truth, Watched, apart, speed, time_of
from tests.waiting import until

SECONDS = 60.0
"""Wall time for what takes a few seconds on a machine that is not busy."""


@contextmanager
def driven(
    logs: Path, model: str, *drivers: tuple[str, dict[str, object]], base: dict[str, object] | None = None
) -> Iterator[tuple[Truth, Watched[BaseStatus]]]:
    """A robot ``r`` in lockstep with its drivers, each a service with parameters."""
    members = [f"/r/{kind}" for kind, _ in drivers]
    settings = {
        "robots": [{"name": "r", "model": model, "parameters": base or {}}],
        "mode": "lockstep",
        "members": members,
    }
    with Network(logs) as network, network.node() as node:
        truth, status = Truth(node, "r"), Watched(node.read(BASE_STATUS, "/r/base_status"))
        for kind, parameters in (("sim", settings), *drivers):
            words = [w for key, value in parameters.items() for w in ("--param", f"{key}={json.dumps(value)}")]
            where = [] if kind == "sim" else ["--namespace", "/r"]
            network.start(kind, *where, "--lockstep", *words)
        yield truth, status


def seen(truth: Truth, status: Watched[BaseStatus], seconds: float) -> list[Odometry]:
    """Ground truth up to ``seconds`` of simulation time."""

    def there() -> bool:
        status.all()
        return bool(truth.all()) and time_of(truth.all()[-1]) >= seconds

    until(there, SECONDS, f"simulation time {seconds} s")
    return [each for each in truth.all() if time_of(each) <= seconds]


def at(samples: list[Odometry], seconds: float) -> Odometry:
    """The sample of an instant."""
    return next(each for each in samples if time_of(each) == pytest.approx(seconds))


def wheels(model: str) -> Wheels:
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
    told = last + LEAST_S + 0.01
    script = {"keys": f"i@0.49-{last:.2f}", "speed": v, "key_delay": 0.52, "key_interval": 0.02}
    with driven(tmp_path, model, ("teleop", script)) as (truth, status):
        samples = seen(truth, status, told + v / a + 0.5)
    assert at(samples, 0.48).pose.pose.position.x == pytest.approx(0.0, abs=1e-3)
    there = at(samples, before)
    assert speed(there) == pytest.approx(v, rel=0.01)
    assert apart(there, samples[-1]) == pytest.approx(v * (told - before) + v * v / (2 * a), rel=0.05)
    stood = next(time_of(each) for each in samples if time_of(each) > told and abs(speed(each)) < STANDING)
    assert stood - told == pytest.approx(v / a, rel=0.05, abs=0.04)


def test_a_held_key_shows_no_stutter_in_the_robot(tmp_path: Path) -> None:
    """The first repeat comes after twice the base's time-out."""
    with driven(tmp_path, "burger", ("teleop", {"keys": "i@0.5-3", "speed": 0.2})) as (truth, status):
        speeds = {time_of(each): speed(each) for each in seen(truth, status, 4.0)}
    assert all(abs(v - 0.2) < 0.01 for now, v in speeds.items() if 0.8 < now < 3.0)


def test_a_base_of_newer_ros_is_driven_by_stamped_commands(tmp_path: Path) -> None:
    script = {"keys": "i@0.5-2", "speed": 0.2, "stamped": True, "frame_id": "r/base_link"}
    with driven(tmp_path, "burger", ("teleop", script), base={"use_stamped_vel": True}) as (truth, status):
        speeds = {time_of(each): speed(each) for each in seen(truth, status, 3.0)}
        assert status.all()[-1].stale_dropped == 0
    assert all(abs(v - 0.2) < 0.01 for now, v in speeds.items() if 0.8 < now < 2.0)


WAY: tuple[str, dict[str, object]] = ("waypoint", {"goals": [[5, 0]]})
BACK: tuple[str, dict[str, object]] = ("teleop", {"keys": ",@3-5", "speed": 0.2, "give_way": 0.5})


def test_it_wins_over_a_controller_and_gives_way_when_it_falls_silent(tmp_path: Path) -> None:
    with driven(tmp_path, "burger", WAY, BACK) as (truth, status):
        samples = seen(truth, status, 8.0)
        states = list(status.all())
    speeds = {round(time_of(each), 3): speed(each) for each in samples}
    assert all(v > 0.2 for now, v in speeds.items() if 1.5 < now < 3.0)
    assert all(v == pytest.approx(-0.2, abs=0.01) for now, v in speeds.items() if 3.6 < now < 4.9)
    assert all(abs(v) < 0.005 for now, v in speeds.items() if 5.4 < now < 5.7)
    assert all(v > 0.15 for now, v in speeds.items() if 6.8 < now < 8.0)
    obeyed = [each.source for each in states if each.source]
    changes = [source for index, source in enumerate(obeyed) if index == 0 or source != obeyed[index - 1]]
    assert changes == ["/r/waypoint", "/r/teleop", "/r/waypoint"]


def test_a_script_repeats_bit_for_bit(tmp_path: Path) -> None:
    runs = []
    for name in ("one", "two"):
        (tmp_path / name).mkdir()
        with driven(tmp_path / name, "burger", WAY, BACK) as (truth, status):
            runs.append(seen(truth, status, 7.0))
    assert runs[0] == runs[1]

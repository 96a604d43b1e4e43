"""``--set``, which overrides keys of a fleet file, and the start pose that a world defines."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Any

import pytest

from deploy.fleet_file import FLEETS, parse_fleet, read_fleet
from deploy.report.notes import fleet_notes, overrides_note, start_lines
from messages.se3 import Pose3
from models import WORLDS, urdf_path
from models.bodies import CylinderShape
from models.model import read_model
from models.world import read_world
from services.runtime.errors import BadInput
from services.runtime.step import STEP_NS
from services.sim.engines import default_engine, open_world
from services.sim.physics.world import Body, Motor

FILE = """\
name = "pair"
[[robot]]
name = "a"
model = "burger"
pose = { x = 1.0, yaw = 1.5 }
services = [{ kind = "waypoint", name = "driver" }]
[[robot]]
name = "b"
model = "waffle"
pose = "world"
[[every_robot]]
kind = "waypoint"
"""


def parsed(*overrides: str) -> Any:
    return parse_fleet(Path("pair.toml"), FILE, overrides)


def test_keys_of_the_run_of_robots_and_of_services_are_set() -> None:
    fleet = parsed("run.seed=7", "run.mode=real", "b.model=burger", "a.pose.x=-2", 'a.parameters.odometry="world"')
    assert (fleet.run.seed, fleet.run.mode, fleet.robot[1].model) == (7, "real", "burger")
    assert (fleet.robot[0].pose.x, fleet.robot[0].pose.yaw) == (-2.0, 1.5)
    assert fleet.robot[0].parameters == {"odometry": "world"}
    fleet = parsed("driver.laps=2", "waypoint.laps=3", "grader.reach_tolerance=0.1", "world=house", "waypoint.laps=4")
    assert fleet.robot[0].services[0].parameters == {"laps": 2}
    assert fleet.every_robot[0].parameters == {"laps": 4}, "the last one counts"
    assert {each.kind: each.parameters for each in fleet.service} == {"grader": {"reach_tolerance": 0.1}}
    assert fleet.world == "house"
    assert (fleet.robot[1].pose.x, fleet.robot[1].pose.y) == (-3.0, 1.0), "the start of that world"
    assert parsed("b.pose.y=2").robot[1].pose.y == 2.0


def test_what_cannot_be_set_is_told_with_the_assignment() -> None:
    for text, what in {
        "model=waffle": "this fleet has 2 robots: say which, e.g. ROBOT.model=… (a, b)",
        "b.model=wafle": "--set b.model=wafle: unknown model 'wafle'; did you mean 'waffle'",
        "b.modle=waffle": "--set b.modle=waffle: unknown key 'modle'; did you mean 'model'",
        "a.pose.x=far": "--set a.pose.x=far: robot[0].pose.x: Expected `float`, got `str`",
        "b.pose.yaw=-180": "--set b.pose.yaw=-180: robot[1].pose.yaw: -180 rad is more than a whole turn, 6.28: angles "
        "are in rad, so write -3.1416 for -180 degrees",
        "a.parameters.odometry=true": "--set a.parameters.odometry=true: parameter odometry",
        "driver.laps=-1": "--set driver.laps=-1",
        "run.factor=0": "--set run.factor=0: run.factor",
        "world=hose": "--set world=hose: unknown world 'hose'; did you mean 'house'",
        "wrold=house": "--set wrold=house: unknown key 'wrold'; did you mean 'world'",
        "run=3": "run is a table",
        "a=burger": "say which of its keys, e.g. a.model=…",
        "a.services.kind=x": "services is a list",
        "a.services.driver.laps=1": "--set a.services.driver.laps=1: services is a list",
        "a.services.0.parameters.laps=1": "services is a list",
        "model": "is not an assignment: write KEY=VALUE",
        "a..x=3": "is not an assignment",
    }.items():
        with pytest.raises(BadInput) as caught:
            parsed(text)
        assert what in str(caught.value), text
    for name, robots, what in (
        ("lab", 3, "this fleet has no [[grid]] of robots; the fleet swarm has one"),
        ("swarm", 0, "grid[0].robots: Expected `int` >= 1"),
    ):
        with pytest.raises(BadInput) as caught:
            read_fleet(FLEETS / f"{name}.toml", (), robots)
        assert str(caught.value) == f"--robots {robots}: {what}"


def test_the_fleet_turtlebot3_has_plain_names_and_starts_where_its_world_says() -> None:
    for overrides, model, place in (
        ((), "burger", (0.0, 0.0)),
        (("model=waffle", "world=arena"), "waffle", (-2.0, -0.5)),
        (("model=waffle_pi", "world=house"), "waffle_pi", (-3.0, 1.0)),
    ):
        fleet = read_fleet(FLEETS / "turtlebot3.toml", overrides)
        [robot] = fleet.robot
        assert (robot.model, robot.namespace, robot.frame_prefix) == (model, "/", "")
        assert (robot.pose.x, robot.pose.y) == place
        assert (fleet.run.mode, fleet.run.ends) == ("real", "never")
        lines = start_lines(fleet, overrides)
        assert "a sender that hangs does not stop the robot" in lines[-1]
        assert lines[:-1] == ((f"changed on the command line: {', '.join(overrides)}",) if overrides else ())
    assert start_lines(read_fleet(FLEETS / "bare.toml"), ()) == ()


def test_every_start_is_clear_and_every_world_can_be_driven_in() -> None:
    """A waffle_pi, the widest TurtleBot, turns once at the start of each world without touching anything."""
    model = read_model("waffle_pi")
    assert model.wheels is not None
    motors = tuple(Motor(joint, model.wheels.torque) for joint in (model.wheels.left_joint, model.wheels.right_joint))
    for name in WORLDS:
        world = read_world(name)
        assert world.start is not None
        with open_world(default_engine(), world, STEP_NS) as physics:
            start = Pose3.planar(world.start.x, world.start.y, world.start.yaw)
            body = physics.spawn(Body("robot", urdf_path("waffle_pi"), start, motors))
            body.set_speeds((-5.0, 5.0))
            for _ in range(800):
                physics.step()
                assert not [each for each in physics.contacts() if "robot" in (each.body, each.other)], name
        assert body is not None


def test_the_doors_of_the_house_are_wide_enough() -> None:
    """A disc of 0.78 m diameter reaches every room from the start, on a grid of 5 cm, past all furniture."""
    world, radius, cell = read_world("house"), 0.39, 0.05
    blocked = set()
    for box in world.boxes:
        if box.position[2] - box.size[2] / 2 > 0.3:
            continue
        c, s, reach = math.cos(box.yaw), math.sin(box.yaw), math.hypot(*box.size[:2]) / 2 + radius
        for i in range(round((box.position[0] - reach) / cell), round((box.position[0] + reach) / cell) + 1):
            for j in range(round((box.position[1] - reach) / cell), round((box.position[1] + reach) / cell) + 1):
                dx, dy = i * cell - box.position[0], j * cell - box.position[1]
                along, across = abs(c * dx + s * dy) - box.size[0] / 2, abs(c * dy - s * dx) - box.size[1] / 2
                if math.hypot(max(along, 0.0), max(across, 0.0)) < radius:
                    blocked.add((i, j))
    for body in world.bodies:
        [part] = body.parts
        assert isinstance(part.shape, CylinderShape)
        x, y, _ = body.pose.position
        n = round((part.shape.radius + radius) / cell)
        near = [(round(x / cell) + i, round(y / cell) + j) for i in range(-n, n + 1) for j in range(-n, n + 1)]
        blocked |= {each for each in near if math.hypot(each[0] * cell - x, each[1] * cell - y) < n * cell}
    assert world.start is not None
    reached = [(round(world.start.x / cell), round(world.start.y / cell))]
    seen = set(reached)
    for i, j in reached:
        for each in ((i + 1, j), (i - 1, j), (i, j + 1), (i, j - 1)):
            if each not in seen and each not in blocked and abs(each[0]) < 200 and abs(each[1]) < 150:
                seen.add(each)
                reached.append(each)
    rooms = {
        "kitchen": (2, 3),
        "hall": (1, 0),
        "bedroom": (4.5, 2),
        "study": (-5, -2),
        "bathroom": (-2.3, -3),
        "dining": (3, -4),
    }
    for room, (x, y) in rooms.items():
        assert (round(x / cell), round(y / cell)) in seen, room
    assert all(abs(i * cell) < 7.5 and abs(j * cell) < 5 for i, j in seen), "nobody gets out"


def test_the_report_tells_how_far_odometry_is_from_the_wheels() -> None:
    [note] = [each for each in fleet_notes(parsed("run.seed=3")) if each.startswith("Odometry")]
    assert re.search(r"\(seed 3\): a: left radius [+-]\d\.\d\d %, .*; b: left radius", note)
    assert [note] != [each for each in fleet_notes(parsed("run.seed=4")) if each.startswith("Odometry")]
    exact = fleet_notes(parsed("a.parameters.odometry=world", "b.parameters.odometry_error=0"))
    assert not [each for each in exact if each.startswith("Odometry")]
    assert overrides_note(("run.seed=3",)) == ("Changed on the command line: run.seed=3.",)

"""A user's world, outside the checkout, in a real fleet: it repeats bit for bit, and its bag has the moving bodies."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
from PIL import Image

from messages.gazebo import WorldStates
from messages.topics import WORLD_MARKERS, WORLD_STATES
from messages.visualization import MarkerArray
from services.bag.reader import MessageDecoder, open_bag
from tests.harness.command_line import CommandLine

WORLD = """
plan = "rooms.png"
resolution = 0.1
origin = [-2.0, -2.0]

[[bodies]]
name = "ball"
shape = "sphere"
radius = 0.1
mass = 0.1
position = [0.5, 0.0, 0.1]

[[obstacles]]
name = "cart"
shape = "box"
size = [0.3, 0.3, 0.3]
path = [[1.0, -1.0], [1.0, 1.0]]
speed = 1.0
"""

FLEET = """
name = "site"
world = "worlds/site.toml"

[run]
ends = "duration"
duration = 3.0

[[robot]]
name = "tb3"
model = "burger"
services = [{ kind = "waypoint", parameters = { goals = [[1.5, 0.0]] } }]

[[service]]
kind = "recorder"

[bounds]
collisions = 9
"""


def test_a_world_of_the_user_repeats_and_is_recorded(tmp_path: Path) -> None:
    pixels = np.full((40, 40), 255, np.uint8)
    pixels[[0, -1]] = 0
    pixels[:, [0, -1]] = 0
    (tmp_path / "worlds").mkdir()
    Image.fromarray(pixels).save(tmp_path / "worlds" / "rooms.png")
    (tmp_path / "worlds" / "site.toml").write_text(WORLD)
    file = tmp_path / "fleet.toml"
    file.write_text(FLEET)
    terminal, hashes = CommandLine(tmp_path), []
    for name in ("one", "two"):
        terminal.run_fleet(str(file), tmp_path / name, "--no-saved", "--no-view", "--no-picture")
        hashes.append(json.loads((tmp_path / name / "report.json").read_text())["run"]["trajectory_hash"])
    assert hashes[0] == hashes[1]

    typed = MessageDecoder()
    topics = (WORLD_MARKERS.name, WORLD_STATES.name)
    told = [typed.decode(each) for each in open_bag(tmp_path / "one" / "bag").entries() if each.channel.name in topics]
    (markers,) = [each for each in told if isinstance(each, MarkerArray)]
    assert [(each.ns, each.text) for each in markers.markers] == [
        *(("ground", "ground"), *[("fixed", "plan")] * 4, ("movable", "ball"), ("moving", "cart"))
    ]
    states = [each for each in told if isinstance(each, WorldStates)]
    assert len(states) >= 30
    assert {each.name for each in states} == {("ball", "cart")}
    assert states[-1].pose[0].position.x > 0.51, "the robot has pushed the ball"
    (late,) = [each for each in states if each.header.stamp.ns == 2_500_000_000]
    assert abs(late.pose[1].position.y - 0.5) < 1e-4, "it is on its way back"

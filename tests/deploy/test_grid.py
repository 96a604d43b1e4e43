"""A grid in a fleet file: its robots, their goals, and errors with its line."""

from __future__ import annotations

import json
import math
from pathlib import Path

import pytest

from deploy.fleet import Fleet, GridConfig, StartPose
from deploy.fleet_file import find_fleet, parse_fleet, read_fleet
from deploy.grid import grid_robots
from deploy.processes import plan_processes
from deploy.service_parameters import RunOptions
from services.runtime.errors import BadInput

FILE = """\
name = "many"
[[robot]]
name = "lone"
model = "waffle"
goals = [[7, 1]]
pose = { x = 5.0, yaw = 1.0 }
[[grid]]
robots = 5
name = "tb3"
model = "burger"
spacing = 0.5
pose = { y = 1.0, yaw = 0.5 }
goals = "rotate"
parameters = { odometry = "world" }
services = [{ kind = "state" }]
[[every_robot]]
kind = "local_planner"
from_robot = ["goals"]
"""


def read(text: str = FILE, *overrides: str) -> Fleet:
    return parse_fleet(Path("many.toml"), text, overrides)


def test_its_robots_stand_in_rows_around_its_pose_behind_the_fleets_own() -> None:
    fleet = read()
    assert [each.name for each in fleet.robot] == ["lone", "tb3_0", "tb3_1", "tb3_2", "tb3_3", "tb3_4"]
    poses = [each.pose for each in fleet.robot[1:]]
    assert [(p.x, p.y) for p in poses] == [(-0.5, 0.75), (0.0, 0.75), (0.5, 0.75), (-0.5, 1.25), (0.0, 1.25)]
    assert {p.yaw for p in poses} == {0.5}
    assert fleet.robot[1].goals == ((0.5, 1.25),)
    assert fleet.robot[1].parameters == {"odometry": "world"}
    assert [each.kind for each in fleet.robot[1].services] == ["state"]
    assert fleet.grid == ()


def test_every_rule_gives_each_robot_a_goal_of_its_own() -> None:
    for count in (1, 2, 5, 9, 100, 200):
        for rule in ("shuffle", "mirror", "rotate"):
            grid = GridConfig(robots=count, model="burger", goals=rule, pose=StartPose(x=3.0, y=-2.0), seed=4)
            robots = grid_robots(grid)
            goals = {goal for each in robots for goal in each.goals}
            assert len(goals) == count
            assert robots == grid_robots(grid), "a seed gives the same goals in each run"
            starts = {(each.pose.x, each.pose.y) for each in robots}
            if rule == "shuffle":
                assert goals == starts
                assert count == 1 or all((each.pose.x, each.pose.y) != each.goals[0] for each in robots)
            if math.isqrt(count) ** 2 == count:
                assert goals == starts
    assert grid_robots(GridConfig(robots=9, model="burger", goals="shuffle", seed=1)) != grid_robots(
        GridConfig(robots=9, model="burger", goals="shuffle", seed=2)
    )
    assert grid_robots(GridConfig(robots=2, model="burger"))[0].goals == ()


def test_services_get_the_goals_of_their_robot_in_the_frame_of_its_odometry() -> None:
    fleet = read(FILE.replace('parameters = { odometry = "world" }', 'parameters = { odometry_origin = "start" }'))
    given = {}
    for spec in plan_processes(fleet, RunOptions(folder=Path())):
        for argument in spec.argv:
            if argument.startswith("goals="):
                given[f"/{spec.name}"] = json.loads(argument.removeprefix("goals="))
    assert len(given) == 6
    assert given["/lone/local_planner"] == [[7, 1]]
    apart = (1.0, 0.5)  # from tb3_0's start to its goal, in the world frame
    turned = [
        apart[0] * math.cos(0.5) + apart[1] * math.sin(0.5),
        apart[1] * math.cos(0.5) - apart[0] * math.sin(0.5),
    ]
    assert given["/tb3_0/local_planner"] == [pytest.approx(turned)]


def test_the_command_line_changes_the_only_grid() -> None:
    assert len(read_fleet(find_fleet("swarm")).robot) == 100
    fleet = read(FILE, "grid.robots=2", "grid.model=waffle", "state.publish_default_positions=true")
    assert [each.model for each in fleet.robot[1:]] == ["waffle", "waffle"]
    assert fleet.robot[1].services[0].parameters == {"publish_default_positions": True}
    two = FILE + '[[grid]]\nrobots = 1\nname = "more"\nmodel = "burger"\ngoals = "mirror"\n'
    assert len(read(two).robot) == 7
    for text, overrides, wanted in (
        (two, ("grid.robots=2",), "several"),
        (FILE.replace("[[grid]]", "[[robot]]").replace("robots = 5\n", ""), ("grid.robots=2",), "no .*grid"),
        (FILE, ("grid=2",), "is a table"),
        (FILE, ("grid.robots=0",), "--set grid.robots=0: .*>= 1"),
        (FILE, ("grid.rows=2",), "unknown key 'rows'"),
    ):
        with pytest.raises(BadInput, match=wanted):
            read(text, *overrides)


def test_errors_name_the_line_of_the_grid() -> None:
    for old, new, line, wanted in (
        ("robots = 5", "robots = 1001", 8, "<= 1000"),
        ('goals = "rotate"', 'goals = "around"', 13, "around"),
        ('goals = "rotate"', "", 18, "tb3_0 has no goals"),
        ('model = "burger"', 'model = "burgher"', 10, "did you mean 'burger'"),
        ('name = "tb3"', 'name = "tb 3"', 9, "tb 3_0"),
        ('odometry = "world"', 'odometri = "world"', 14, "unknown parameter 'odometri'"),
        ('kind = "state"', 'kind = "stat"', 15, "did you mean 'state'"),
        ("spacing = 0.5", "space = 0.5", 11, "unknown key 'space'"),
        ("goals = [[7, 1]]", "", 18, "lone has no goals"),
        ('from_robot = ["goals"]', 'from_robot = ["goals"]\nparameters = { goals = [] }', 18, "among the parameters"),
        ('from_robot = ["goals"]', 'from_robot = ["law"]', 18, "law"),
    ):
        assert old in FILE
        with pytest.raises(BadInput, match=wanted) as caught:
            read(FILE.replace(old, new, 1))
        assert f"many.toml:{line}:" in str(caught.value), caught.value

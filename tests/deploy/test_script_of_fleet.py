"""A ROS 1 program as a service of a fleet: its command line, its parameters, and errors."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from deploy.fleet_file import read_fleet
from deploy.processes import plan_processes
from deploy.rosparam import fleet_parameter_tree
from deploy.rosparam_tree import get_parameter, set_parameter
from deploy.service_parameters import RunOptions
from services.runtime.errors import BadInput

SCRIPT = "import rospy\nrospy.init_node('talker')\nprint 'python 2'\n"
FLEET = """
name = "own"
[rosparam]
speed = 1
"arm/gains" = {{ p = 2.0, list = [1, "a"] }}
[[robot]]
name = "tb3_0"
model = "burger"
services = [{{ kind = "scripts/talker.py"{more} }}]
[[service]]
kind = "./scripts/plain"
name = "second"
remap = {{ chatter = "/news" }}
"""


def fleet(folder: Path, more: str = "", script: str = SCRIPT) -> Path:
    (folder / "scripts").mkdir(parents=True, exist_ok=True)
    for name in ("talker.py", "plain"):
        (folder / "scripts" / name).write_text(script)
    path = folder / "own.toml"
    path.write_text(FLEET.format(more=more))
    return path


def test_a_script_runs_with_its_own_arguments_behind_its_file(tmp_path: Path) -> None:
    more = ', args = ["a:=b", "_x:=1"], environment = { MODEL = "burger" }, cwd = "scripts", restart = "never"'
    more += ', frame_prefix = "tb3_0/"'
    plan = plan_processes(read_fleet(fleet(tmp_path, more)), RunOptions(folder=tmp_path))
    by_name = {each.name: each for each in plan}
    talker, second = by_name["tb3_0/talker"], by_name["second"]
    assert talker.argv[1:8] == ("-P", "-m", "services.script", "--namespace", "/tb3_0", "--name", "talker")
    assert talker.argv[talker.argv.index("--frame-prefix") + 1] == "tb3_0/"
    assert "--frame-prefix" not in second.argv
    assert talker.argv[-3:] == (str(tmp_path / "scripts/talker.py"), "a:=b", "_x:=1")
    assert {"--lockstep", "--await-params"} <= set(talker.argv)
    assert (talker.environment, talker.cwd) == (
        {"MODEL": "burger", "PYTHONHASHSEED": "0"},
        str(tmp_path / "scripts"),
    ), "sets of texts have one order in every run of lockstep"
    assert second.argv[second.argv.index("--remap") + 1] == "chatter:=/news"
    assert second.argv[-1] == str(tmp_path / "scripts/plain")
    (sim,) = (each for each in plan if each.kind == "sim")
    (members,) = (each for each in sim.argv if each.startswith("members="))
    assert {"/second", "/tb3_0/talker"} <= set(json.loads(members.partition("=")[2]))


def test_parameters_fill_the_tree_those_of_a_script_below_its_node(tmp_path: Path) -> None:
    read = read_fleet(fleet(tmp_path, ', parameters = { "pid/p" = 0.5, on = true }'))
    tree = fleet_parameter_tree(read)
    assert "<robot" in tree["tb3_0"].pop("robot_description")
    assert "<robot" in tree.pop("robot_description")
    assert tree == {
        "speed": 1,
        "arm": {"gains": {"p": 2.0, "list": [1, "a"]}},
        "tb3_0": {"talker": {"pid": {"p": 0.5}, "on": True}},
    }
    set_parameter(tree, "/speed/max", 3)
    assert get_parameter(tree, "/") == {
        "speed": {"max": 3},
        "arm": {"gains": {"p": 2.0, "list": [1, "a"]}},
        "tb3_0": {"talker": {"pid": {"p": 0.5}, "on": True}},
    }
    for key in ("/none", "/speed/max/deep", "arm/none"):
        with pytest.raises(KeyError):
            get_parameter(tree, key)


def test_what_is_wrong_with_it_is_told_with_file_and_line(tmp_path: Path) -> None:
    cases = {
        ", parameters = { day = 2020-01-01 }": r"own\.toml:9: day: a parameter is text, a number",
        ', cwd = "nowhere"': r"own\.toml:9: there is no folder .*nowhere",
        ', environment = { "A=B" = "c" }': r"own\.toml:9: 'A=B' is not a valid variable name",
        ', from_start = ["goals"]': r"own\.toml:9: from_start is for services",
    }
    for more, said in cases.items():
        with pytest.raises(BadInput, match=said):
            read_fleet(fleet(tmp_path, more))
    with pytest.raises(BadInput, match=r"own\.toml:\d+: .*is written for ROS 2 \(rclpy\): ROS 2 programs"):
        read_fleet(fleet(tmp_path / "two", script="import rclpy\n"))
    path = fleet(tmp_path)
    path.write_text(path.read_text() + '[[service]]\nkind = "panel"\nargs = ["x"]\n')
    with pytest.raises(BadInput, match=r"own\.toml:16: args is for programs of ROS alone"):
        read_fleet(path)

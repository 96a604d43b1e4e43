"""The ROS 1 commands in a shell: the commands that they call, and the variables that the shell code sets."""

from __future__ import annotations

import os
from pathlib import Path
from typing import NoReturn

import pytest

from deploy.ros1_commands import commands
from deploy.ros1_commands.commands import COMMANDS, TOOLS, run_command
from deploy.ros1_commands.shell import BIN, shell_code
from services.runtime.errors import BadInput, EleaError
from services.runtime.fleet_instances import FleetInstance


class Replaced(Exception):
    """Raised instead of replacing this process."""


@pytest.fixture
def executed(monkeypatch: pytest.MonkeyPatch) -> list[list[str]]:
    """The command lines that would have replaced the process."""
    found: list[list[str]] = []

    def execve(program: str, arguments: list[str], environment: dict[str, str]) -> NoReturn:
        found.append(arguments[2:])
        raise Replaced

    monkeypatch.setattr(os, "execve", execve)
    return found


def run(name: str, *words: str) -> None:
    with pytest.raises(Replaced):
        run_command(name, words)


def test_every_command_has_its_link(executed: list[list[str]]) -> None:
    links = {each.name for each in BIN.iterdir()}
    assert set(COMMANDS) <= links
    assert {each for each in links if not each.startswith("rqt")} == {each for each in COMMANDS if each != "rqt"}
    assert all(os.access(each, os.X_OK) for each in BIN.iterdir())
    with pytest.raises(BadInput, match=r"unknown command of ROS 1 'rostopci'; did you mean 'rostopic'"):
        run_command("rostopci", [])


def test_words_of_ros_1_become_those_of_elea(executed: list[list[str]], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(commands, "running_fleets", lambda: ())
    run("roslaunch", "pkg", "a.launch", "x:=1")
    run("rosbag", "record", "-O", "drive.bag", "/odom", "/scan")
    run("rosbag", "play", "drive.bag", "-r", "2", "-u", "5", "--clock", "/a:=/b", "--topics", "/odom", "/scan")
    run("rqt_graph")
    run("rosmsg", "show", "std_msgs/Empty")
    assert [" ".join(each) for each in executed] == [
        "-m deploy roslaunch pkg a.launch x:=1",
        "-m deploy bag record -o drive /odom /scan",
        "-m deploy bag play drive -r 2 --duration 5 -m /a:=/b --topics /odom --topics /scan",
        "-m deploy panel",
        f"-m services.script --wall-time {TOOLS / 'rosmsg_command.py'} rosmsg show std_msgs/Empty",
    ]
    with pytest.raises(EleaError, match=r"Unable to communicate with master! No fleet is running: roscore"):
        run_command("rostopic", ["list"])


def test_the_port_in_ros_master_uri_chooses_a_fleet(executed: list[list[str]], monkeypatch: pytest.MonkeyPatch) -> None:
    fleets = [
        FleetInstance(fleet=f"f{port}", mode="real", port=port, pid=1, folder="", started="") for port in (7447, 7450)
    ]
    monkeypatch.setattr(commands, "running_fleets", lambda: tuple(fleets))
    monkeypatch.setenv("ROS_MASTER_URI", "http://localhost:7450")
    run("rosrun", "talks", "talker.py")
    run("rosnode", "kill", "/tb3_0/talker")
    assert executed[0] == ["-m", "deploy", "rosrun", "--port", "7450", "talks", "talker.py"]
    assert executed[1][:4] == ["-m", "services.script", "--wall-time", "--connect"]
    assert "7450" in executed[1][4]
    assert executed[1][-3:] == [str(TOOLS / "rosnode_command.py"), "kill", "/tb3_0/talker"]
    assert run_command("roscore", []) == 0
    monkeypatch.delenv("ROS_MASTER_URI")
    choices = r"ROS_MASTER_URI=URL, URL being one of http://localhost:7447 \(f7447\), http://localhost:7450 \(f7450\)"
    with pytest.raises(BadInput, match=choices):
        run_command("rostopic", ["list"])
    run("rosmsg", "show", "std_msgs/Empty")
    assert executed[-1][-4:] == [str(TOOLS / "rosmsg_command.py"), "rosmsg", "show", "std_msgs/Empty"]


def test_bags_of_ros_1_are_played_by_a_program_of_ros_1(
    executed: list[list[str]], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(commands, "running_fleets", lambda: ())
    bag = tmp_path / "old.bag"
    bag.write_bytes(b"#ROSBAG V2.0\n")
    run("rosbag", "info", "-y", str(bag))
    assert executed[0][-4:] == [str(TOOLS / "rosbag_command.py"), "info", "-y", str(bag)]
    with pytest.raises(EleaError, match="No fleet is running"):
        run_command("rosbag", ["play", str(bag)])


def test_what_is_not_needed_says_so(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("ROS_PACKAGE_PATH", "")
    assert [run_command(name, []) for name in ("catkin_make", "catkin", "rosdep", "rosversion")] == [0, 0, 0, 0]
    said = capsys.readouterr().out
    assert "nothing needs to be built" in said
    assert "noetic" in said
    assert run_command("catkin_create_pkg", ["mine", "std_msgs", "rospy"]) == 0
    assert run_command("rospack", ["find", "mine"]) == 0
    assert capsys.readouterr().out.endswith(f"{tmp_path / 'mine'}\n")
    with pytest.raises(BadInput, match=r"package 'mien' not found; did you mean 'mine'"):
        run_command("rospack", ["find", "mien"])
    with pytest.raises(BadInput, match="exists already"):
        run_command("catkin_create_pkg", ["mine"])


def test_the_shell_finds_commands_and_packages(tmp_path: Path) -> None:
    source = tmp_path / "it's a ws/src"
    (source / "one").mkdir(parents=True)
    (source / "one/package.xml").write_text("<package><name>one</name></package>")
    code = shell_code(source / "one", {"PATH": f"/usr/bin:{BIN}:/bin", "ROS_PACKAGE_PATH": "/other"})
    lines = dict(line.removeprefix("export ").split("=", 1) for line in code.splitlines() if line.startswith("export"))
    assert lines["PATH"] == f"{BIN}:/usr/bin:/bin"
    assert lines["ROS_PACKAGE_PATH"] == "'" + f"{source}:/other".replace("'", "'\"'\"'") + "'"
    assert "roscd()" in code

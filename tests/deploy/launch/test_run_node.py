"""Well-known nodes that are started by hand: the commands that replace them."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import NoReturn

import pytest

from deploy.launch.run_node import run_known_node


class Replaced(Exception):
    """Raised instead of replacing this process."""


@pytest.fixture
def executed(monkeypatch: pytest.MonkeyPatch) -> list[list[str]]:
    """Collect the commands that would replace this process."""
    commands: list[list[str]] = []

    def execve(program: str, arguments: list[str], environment: dict[str, str]) -> NoReturn:
        commands.append(arguments[4:])
        raise Replaced

    monkeypatch.delenv("ROS_NAMESPACE", raising=False)
    monkeypatch.setattr(os, "execve", execve)
    return commands


def test_arguments_may_have_spaces(tmp_path: Path, executed: list[list[str]]) -> None:
    file = tmp_path / "my map.yaml"
    with pytest.raises(Replaced):
        run_known_node("map_server", "map_server", [str(file), "map:=plan"], None)
    with pytest.raises(Replaced):
        run_known_node("tf", "tf_echo", ["map", "base link", "5"], 7447)
    assert executed == [
        ["run", "map_server", "--remap", "map:=plan", "--param", f"map={json.dumps(str(file))}"],
        ["tf", "echo", "--port", "7447", "map", "base link"],
    ]


def test_the_namespace_is_that_of_the_command_line_or_of_the_shell(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, executed: list[list[str]]
) -> None:
    file = str(tmp_path / "map.yaml")
    monkeypatch.setenv("ROS_NAMESPACE", "tb3_0")
    for package, program, words in (
        ("map_server", "map_server", [file]),
        ("map_server", "map_server", [file, "__ns:=other"]),
        ("turtlebot3_teleop", "turtlebot3_teleop_key", []),
        ("turtlebot3_teleop", "turtlebot3_teleop_key", ["cmd_vel:=/tb3_1/cmd_vel"]),
    ):
        with pytest.raises(Replaced):
            run_known_node(package, program, words, None)
    parameter = f"map={json.dumps(file)}"
    assert executed == [
        ["run", "map_server", "--namespace", "tb3_0", "--param", parameter],
        ["run", "map_server", "--namespace", "other", "--param", parameter],
        ["teleop", "/tb3_0"],
        ["teleop", "/tb3_1"],
    ]

"""ROS 1 programs at a terminal: a teleop in raw mode, and questions with ``input``."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

from tests.harness.background_fleet import background_fleet
from tests.harness.waiting import wait_until
from tests.ros1.script_fleets import HERE
from tests.services.teleop.pseudo_terminal import PseudoTerminal

WITHIN_S = 30.0
FLEET = """
name = "terminal"
[run]
mode = "real"
ends = "never"
[[robot]]
name = "robot"
model = "burger"
namespace = "/"
frame_prefix = ""
[[service]]
kind = "turtlesim"
"""


def test_keys_drive_a_robot_and_answers_send_a_turtle(tmp_path: Path) -> None:
    with background_fleet(tmp_path, FLEET) as fleet:
        run = ["-m", "deploy", "run", "--port", str(fleet.command_line.port)]
        environment = fleet.command_line.environment

        def odometry() -> dict[str, float]:
            pose = json.loads(fleet.run("topic", "echo", "/odom", "--once", "--json").out)["pose"]["pose"]
            return {"x": pose["position"]["x"], "turn": abs(pose["orientation"]["z"])}

        with (
            PseudoTerminal([*run, str(HERE / "scripts/turtles/goto_goal.py")], environment) as terminal,
            PseudoTerminal([*run, str(HERE / "scripts/drive/teleop_keys.py"), "_speed:=0.15"], environment) as keys,
        ):
            for question, answer in (("x goal", "7"), ("y goal", "6.5"), ("tolerance", "0.5")):
                _wait_for(terminal, question)
                terminal.type(f"{answer}\n")
            _wait_for(keys, "w/x: forward and back")
            _hold(keys, "w", lambda: "currently: speed 0.15" in keys.text)
            wait_until(lambda: odometry()["x"] > 0.1, WITHIN_S, "the robot forward")
            _hold(keys, "a", lambda: odometry()["turn"] > 0.2)
            _hold(keys, "q", lambda: keys.ended)
            assert keys.wait() == 0, keys.text
            _wait_for(terminal, "reached True")
            assert terminal.wait() == 0, terminal.text


def _hold(terminal: PseudoTerminal, key: str, done: Callable[[], bool]) -> None:
    """Type a key repeatedly until ``done``: keys are lost while a program sets its terminal up for the next one."""

    def held() -> bool:
        terminal.type(key)
        return done()

    wait_until(held, WITHIN_S, f"what {key} does")


def _wait_for(terminal: PseudoTerminal, text: str) -> None:
    wait_until(lambda: text in terminal.text, WITHIN_S, text)

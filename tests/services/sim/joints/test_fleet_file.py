"""A fleet file gives the parameters of an arm's joints in the place of a base's."""

from __future__ import annotations

from pathlib import Path

import pytest

from deploy.fleet_file import parse_fleet
from deploy.service_parameters import NodeGroups, RunOptions, service_parameters
from services.runtime.errors import BadInput
from services.runtime.parameters.validation import build
from services.sim import SimParameters

FLEET = """name = "x"
[[robot]]
name = "arm"
model = "arm"
{line}
[[robot]]
name = "tb3"
model = "burger"
parameters = {{ cmd_vel_timeout = 0.5 }}
"""


def test_they_reach_the_simulation() -> None:
    line = 'parameters = { effort_mode = "sum", effort_clamp = "each", velocity_rule = "gazebo", damping = 1 }'
    fleet = parse_fleet(Path("x.toml"), FLEET.format(line=line))
    made = build(SimParameters, service_parameters("sim", fleet, RunOptions(folder=Path("out")), NodeGroups()))
    arm, tb3 = made.robots
    asked = arm.joint_parameters
    assert (asked.effort_mode, asked.effort_clamp, asked.velocity_rule, asked.damping) == ("sum", "each", "gazebo", 1.0)
    assert tb3.parameters.cmd_vel_timeout == 0.5


@pytest.mark.parametrize(
    ("line", "says"),
    [
        (
            'parameters = { effort_mode = "add" }',
            r"x\.toml:5: parameter effort_mode = 'add': expected one of replace, sum",
        ),
        ("parameters = { damping = -1 }", r"x\.toml:5: parameter damping = -1: Expected `float` >= 0"),
        ("parameters = { cmd_vel_timeout = 1 }", r"x\.toml:5: unknown parameter 'cmd_vel_timeout' \(known: damping, "),
    ],
)
def test_what_is_wrong_is_told_with_file_and_line(line: str, says: str) -> None:
    with pytest.raises(BadInput, match=says):
        parse_fleet(Path("x.toml"), FLEET.format(line=line))

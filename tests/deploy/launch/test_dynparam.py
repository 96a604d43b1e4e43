"""dynparam of dynamic_reconfigure on a running fleet, typed as in ROS 1, and as a node of a launch file."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.harness.background_fleet import BURGER, background_fleet
from tests.harness.waiting import wait_until
from tests.ros1.script_fleets import HERE

SERVER = HERE / "workspaces/arm_course/src/arm_parameters/scripts/server.py"
FLEET = f"""
name = "dynparam"
{BURGER}
services = [{{ kind = "waypoint" }}]
[[service]]
kind = "{SERVER}"
"""
VALUES = "'reference_type': {kind}, 'Kp': {gain}, 'Kd': 1.0, 'ref_angle': 0.0, 'sin_ref_gain': 30.0, 'sin_ref_f': 0.2"
GROUPS = "'id': 0, 'parent': 0, 'name': 'Default', 'type': '', 'state': True, 'groups': {}, 'parameters': {}"
WRITTEN_BY_ROS = """!!python/object/new:dynamic_reconfigure.encoding.Config
dictitems:
  Kp: 4.5
  groups: !!python/object/new:dynamic_reconfigure.encoding.Config
    dictitems:
      Kp: 4.5
      groups: !!python/object/new:dynamic_reconfigure.encoding.Config
        state: []
      id: 0
      name: Default
      parameters: !!python/object/new:dynamic_reconfigure.encoding.Config
        state: []
      parent: 0
      reference_type: 1
      state: true
      type: ''
    state: []
  reference_type: 1
state: []
"""


@pytest.mark.timeout(300)
def test_it_reads_and_changes_values_as_in_ros(tmp_path: Path) -> None:
    """An enum is set by value or name and shown by value; only dynamic_reconfigure servers are listed."""
    with background_fleet(tmp_path, FLEET) as fleet:

        def dynparam(*words: str, status: int = 0) -> str:
            port = str(fleet.command_line.port)
            ended = fleet.run("rosrun", "--port", port, "dynamic_reconfigure", "dynparam", *words, status=status)
            return ended.out if status == 0 else ended.out + ended.err

        def shown(kind: int, gain: float) -> str:
            values = VALUES.format(kind=kind, gain=gain)
            return f"{{{values}, 'groups': {{{GROUPS}, {_sorted_by_place(kind, gain)}}}}}\n"

        # A node of ROS 1 is ready before its servers are.
        wait_until(lambda: "/arm_parameters\n" in dynparam("list"), 60.0, "the server")
        assert dynparam("list") == "/arm_parameters\n"
        assert dynparam("get", "arm_parameters") == shown(0, 8.0)
        dynparam("set", "/arm_parameters", "reference_type", "1")
        assert dynparam("get", "/arm_parameters") == shown(1, 8.0)
        assert "reference_type  sine" in fleet.run("param", "get", "/arm_parameters").out
        dynparam("dump", "arm_parameters", "sine.yaml")
        dynparam("set", "/arm_parameters", "{reference_type: 0, Kp: 300}")
        assert dynparam("get", "/arm_parameters") == shown(0, 100.0), "clamped, as a server of ROS does"
        dynparam("load", "/arm_parameters", "sine.yaml")
        assert dynparam("get", "/arm_parameters") == shown(1, 8.0)
        dynparam("set", "arm_parameters", "reference_type", "Step")
        dynparam("set", "arm_parameters", "Kp", "-3")
        assert dynparam("get", "/arm_parameters") == shown(0, 0.0)
        (tmp_path / "ros.yaml").write_text(WRITTEN_BY_ROS)
        dynparam("load", "/arm_parameters", "ros.yaml")
        assert dynparam("get", "/arm_parameters") == shown(1, 4.5)
        for words, status, said in (
            (("set", "/arm_parameters", "Kq", "1"), 1, "error updating parameters: don't know parameter: Kq"),
            (("set", "/arm_parameters", "reference_type", "cosine"), 1, "can't set parameter 'reference_type' of"),
            (("set", "/arm_parameters", "just words"), 2, "give a node, a parameter and its value"),
            (("set", "-t", "0.3", "/nobody", "Kp", "1"), 1, "/nobody/set_parameters"),
            (("load", "/arm_parameters", "nowhere.yaml"), 1, "nowhere.yaml: No such file"),
            (("sett",), 1, "dynparam set "),
        ):
            assert said in dynparam(*words, status=status)

        launch = tmp_path / "tune.launch"
        launch.write_text(
            '<launch><node name="tune" pkg="dynamic_reconfigure" type="dynparam" required="true" '
            'args="set_from_parameters arm_parameters"><param name="Kp" value="12"/></node></launch>'
        )
        fleet.run("roslaunch", "--port", str(fleet.command_line.port), str(launch))
        assert dynparam("get", "/arm_parameters") == shown(1, 12.0)


def _sorted_by_place(kind: int, gain: float) -> str:
    """Return a group's parameters, in the order of the file."""
    return (
        f"'Kp': {gain}, 'Kd': 1.0, 'reference_type': {kind}, 'ref_angle': 0.0, 'sin_ref_gain': 30.0, 'sin_ref_f': 0.2"
    )

"""Launch file nodes that services of this project replace: turtlesim, transforms, joint states, maps."""

from __future__ import annotations

from pathlib import Path

from deploy.launch.open_launch import checked_fleet
from services.catalog import script_api
from tests.deploy.launch.launch_harness import LaunchWorkspace

LAUNCH = """
  <node pkg="turtlesim" type="turtlesim_node" name="sim"><param name="background_r" value="9"/></node>
  <group ns="turtlesim2"><node pkg="turtlesim" type="turtlesim_node" name="sim"/></group>
  <node pkg="turtlesim" type="mimic" name="mimic"><remap from="input" to="turtle1"/></node>
  <node pkg="turtlesim" type="draw_square" name="square"/>
  <node pkg="turtlesim" type="turtle_teleop_key" name="keys"/>
  <node pkg="tf" type="static_transform_publisher" name="one" args="1 2 3 0.1 0.2 0.3 /world /map 100"/>
  <node pkg="tf2_ros" type="static_transform_publisher" name="two" args="1 2 3 0 0 0 1 map odom"/>
  <node pkg="joint_state_publisher" type="joint_state_publisher" name="joints"/>
  <node pkg="map_server" type="map_server" name="map" args="$(find talks)/maps/hall.yaml"/>
"""


def test_they_are_services_of_the_fleet(tmp_path: Path) -> None:
    workspace = LaunchWorkspace(tmp_path)
    workspace.write("talks/maps/hall.yaml", "")
    made = workspace.fleet(LAUNCH)
    fleet = checked_fleet(workspace.source / "talks/launch/test.launch", made)
    found = {(each.namespace, each.name): each for each in fleet.service if each.name}
    assert {place: Path(each.kind).name for place, each in found.items()} == {
        ("", "sim_node"): "turtlesim",
        ("/turtlesim2", "sim"): "turtlesim",
        ("", "mimic"): "mimic",
        ("", "square"): "draw_square",
        ("", "one"): "static_transform",
        ("", "two"): "static_transform",
        ("", "joints"): "state",
        ("", "map"): "map_server",
    }
    notes = "\n".join(made.notes)
    assert "fleets have a node /sim of their own, so this one is /sim_node" in notes
    assert "./elea teleop /turtle1 --speed 2 --turn 2" in made.toml() + notes + "\n".join(made.by_hand)
    assert fleet.rosparam["sim_node"] == {"background_r": 9}, "with its private parameters"
    for node in ("mimic", "square"):
        assert script_api(found["", node].kind) == "ros1"
    one, two = found["", "one"].parameters, found["", "two"].parameters
    assert (one["x"], one["yaw"], one["roll"], one["frame_id"], one["child_frame_id"]) == (1, 0.1, 0.3, "world", "map")
    assert (two["quaternion"], two["frame_id"]) == ([0, 0, 0, 1], "map")
    assert found["", "map"].parameters == {"map": str(workspace.source / "talks/maps/hall.yaml")}
    assert found["", "joints"].parameters == {"publish_transforms": False, "publish_default_positions": True}

"""Well-known ROS nodes: the part of Elea that replaces each, or why one has no replacement."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from deploy.launch.launch_file import LaunchNode
from services.runtime.errors import BadInput

PUBLISHED_BY_SIM = "the simulation publishes the frames and joint states of its robots itself"

NOTHING_TO_DO: dict[tuple[str, str], str] = {
    ("gazebo_ros", "paused"): "the simulation starts immediately; ./elea sim pause pauses it",
    ("gazebo_ros", "gzclient"): "",
    ("rosbridge_server", "*"): "browsers connect through the panel",
    ("rosapi", "*"): "",
    ("tf2_web_republisher", "*"): "",
    ("robot_pose_publisher", "*"): "",
    ("diagnostic_aggregator", "*"): "",
    ("turtlebot3_bringup", "turtlebot3_diagnostics"): "",
    ("rosserial_python", "serial_node.py"): "the simulation is the robot's hardware",
    ("hls_lfcd_lds_driver", "*"): "the simulation is the robot's laser",
}
"""Nodes that need no process here, with the reason."""

KEYBOARDS = {
    ("teleop_twist_keyboard", "*"): "./elea teleop",
    ("turtlebot3_teleop", "*"): "./elea teleop",
    ("turtlesim", "turtle_teleop_key"): "./elea teleop /turtle1 --speed 2 --turn 2",
    ("key_teleop", "*"): "./elea teleop",
    ("turtlebot_teleop", "*"): "./elea teleop",
    ("teleop_twist_joy", "*"): "./elea teleop",
    ("joy", "*"): "./elea teleop",
}
"""Interactive nodes: they need their own terminal, in which this command replaces them."""

VIEWERS = {("rviz", "*"), ("gazebo_ros", "gzclient"), ("gazebo_ros", "gazebo"), ("rqt_rviz", "*")}
"""Nodes that are replaced by the viewer."""

PANELS = {
    "rqt_gui",
    "rqt_plot",
    "rqt_graph",
    "rqt_console",
    "rqt_image_view",
    "rqt_reconfigure",
    "rqt_robot_steering",
    "rqt_steering",
    "rqt_tf_tree",
    "rqt_topic",
    "rqt_publisher",
    "rqt_logger_level",
    "image_view",
    "plotjuggler",
}
"""Packages that are replaced by the panel."""

NOT_HERE = {
    "gmapping": "SLAM is not part of Elea",
    "slam_gmapping": "SLAM is not part of Elea",
    "hector_mapping": "SLAM is not part of Elea",
    "cartographer_ros": "SLAM is not part of Elea",
    "slam_karto": "SLAM is not part of Elea",
    "amcl": "localisation against a map is not part of Elea; /ground_truth has the true pose",
    "move_base": "the navigation stack is not part of Elea; the service waypoint drives through points",
    "moveit_ros_move_group": "MoveIt is not part of Elea",
    "nodelet": "nodelets are C++",
    "rosbag": "./elea bag record and ./elea bag play do this",
}
"""Why well-known packages are not supported."""


def lookup(table: dict[tuple[str, str], str], node: LaunchNode) -> str | None:
    """Return the entry of a node by its package and type, or of all nodes of its package; None if there is none."""
    kind = node.type.removesuffix(".py")
    return next(
        (table[key] for key in ((node.package, kind), (node.package, node.type), (node.package, "*")) if key in table),
        None,
    )


def is_viewer(node: LaunchNode) -> bool:
    """Return whether the viewer replaces a node."""
    return (node.package, node.type) in VIEWERS or (node.package, "*") in VIEWERS


def is_panel(node: LaunchNode) -> bool:
    """Return whether the panel replaces a node."""
    return node.package in PANELS


def is_gazebo(node: LaunchNode) -> bool:
    """Return whether a node is Gazebo itself."""
    return node.package == "gazebo_ros" and node.type in ("gazebo", "gzserver", "debug", "perf")


def is_static_transform(node: LaunchNode) -> bool:
    """Return whether a node publishes a static transform."""
    return node.package in ("tf", "tf2_ros") and node.type == "static_transform_publisher"


def is_controller_spawner(node: LaunchNode) -> bool:
    """Return whether a node starts ros_control controllers."""
    return node.package == "controller_manager" and node.type in ("spawner", "controller_manager", "spawner.py")


def static_transform(node: LaunchNode) -> dict[str, Any]:
    """Return a static transform's parameters from the arguments of tf or tf2_ros; raises BadInput.

    ``x y z yaw pitch roll frame child [period]`` or ``x y z qx qy qz qw frame child [period]``.
    """
    words = node.words
    numbers: list[float] = []
    while words and len(numbers) < 7:
        try:
            numbers.append(float(words[0]))
        except ValueError:
            break
        words.pop(0)
    if len(numbers) not in (6, 7) or len(words) < 2:
        raise BadInput(
            f"{node.where}: static_transform_publisher needs x y z yaw pitch roll frame child, or x y z qx qy qz qw "
            f"frame child, not {node.args[:120]!r}"
        )
    names = ("yaw", "pitch", "roll") if len(numbers) == 6 else ()
    rotation: dict[str, Any] = dict(zip(names, numbers[3:], strict=True)) if names else {"quaternion": numbers[3:]}
    place = dict(zip("xyz", numbers[:3], strict=True))
    return {**place, **rotation, "frame_id": words[0].strip("/"), "child_frame_id": words[1].strip("/")}


def world_argument(node: LaunchNode) -> str:
    """Return the world that Gazebo is started with; "" without one."""
    words = node.words
    skip = False
    for word in words:
        if skip:
            skip = False
        elif word in ("-e", "--physics", "-s", "-p", "--seed", "--iters", "-o", "--profile", "-g"):
            skip = True
        elif not word.startswith("-") and (":=" not in word):
            return word
    return ""


def map_file(node: LaunchNode) -> Path | None:
    """Return the map file of a map server; None without one."""
    words = [each for each in node.words if ":=" not in each]
    return Path(words[0]) if words else None

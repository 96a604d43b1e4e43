"""The standard packages as texts in the folder ``packages/``, one file per package.

Names, types and values are facts of these packages, without their comments: std_msgs, common_msgs, common_interfaces,
ros_comm, ros_comm_msgs, rcl_interfaces, geometry2, actionlib, common_tutorials, ros_tutorials, control_msgs,
ros_control, ros2_control, navigation_msgs, dynamic_reconfigure, bond_core, executive_smach, pcl_msgs and
unique_identifier_msgs (BSD-3-Clause or Apache-2.0), gazebo_ros_pkgs, turtlebot3_msgs, example_interfaces and demos
(Apache-2.0). The ROS 1 form is that of Noetic, the ROS 2 form that of Jazzy, but of Humble for control_msgs and
controller_manager_msgs. beginner_tutorials is not included, since readers of ROS's tutorials create that package
themselves.

A section ``== Twist.msg`` begins a type, ``;`` or a new line ends a statement, and ``1:`` or ``2:`` before a statement
limits it to ROS 1 or ROS 2. Times are written as in ROS 1.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from pathlib import Path

FOLDER = Path(__file__).parent / "packages"

Texts = Mapping[str, tuple[str, str]]
"""Text in ROS 1's and in ROS 2's form by file name (``Twist.msg``)."""


@cache
def packages() -> frozenset[str]:
    """Return the names of the standard packages."""
    return frozenset(path.stem for path in FOLDER.glob("*.txt"))


@cache
def texts(package: str) -> Texts:
    """Return the definitions of a standard package."""
    found: dict[str, tuple[list[str], list[str]]] = {}
    forms: tuple[list[str], list[str]] = [], []
    for line in (FOLDER / f"{package}.txt").read_text().splitlines():
        if line.startswith("== "):
            forms = found[line[3:]] = [], []
            continue
        for statement in line.split(";"):
            number, mark, rest = statement.strip().partition(": ")
            for form, lines in zip("12", forms, strict=True):
                if mark and number in ("1", "2"):
                    if number == form:
                        lines.append(rest)
                else:
                    lines.append(statement.strip())
    return {file: ("\n".join(one), "\n".join(two)) for file, (one, two) in found.items()}

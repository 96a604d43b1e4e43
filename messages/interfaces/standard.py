"""The standard packages as texts in the folder ``packages/``, one file a package.

Names, types and values are facts of these packages, without their comments: std_msgs, common_msgs, common_interfaces,
ros_comm, ros_comm_msgs, rcl_interfaces, geometry2, actionlib, common_tutorials, ros_tutorials, control_msgs,
ros_control, ros2_control, navigation_msgs, dynamic_reconfigure, bond_core, executive_smach, pcl_msgs and
unique_identifier_msgs (BSD-3-Clause or Apache-2.0), gazebo_ros_pkgs, turtlebot3_msgs, example_interfaces and demos
(Apache-2.0). The form of ROS 1 is that of Noetic, the form of ROS 2 that of Jazzy, and of Humble for control_msgs and
controller_manager_msgs. beginner_tutorials is not among them: it is the package that readers of ROS's tutorials make.

A section ``== Twist.msg`` begins a type, ``;`` or a new line ends a statement, and ``1:`` or ``2:`` before a statement
says that only this ROS has it. Times are written as in ROS 1.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from pathlib import Path

FOLDER = Path(__file__).parent / "packages"

Texts = Mapping[str, tuple[str, str]]
"""By the name of a file (``Twist.msg``), its text in ROS 1's form and in ROS 2's."""


@cache
def packages() -> frozenset[str]:
    """The names of the standard packages."""
    return frozenset(path.stem for path in FOLDER.glob("*.txt"))


@cache
def texts(package: str) -> Texts:
    """The definitions of a standard package."""
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

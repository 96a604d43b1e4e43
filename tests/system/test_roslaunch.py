"""A read-only workspace outside the checkout: its launch file runs in lockstep; its program drives and is graded."""

from __future__ import annotations

import json
import os
from pathlib import Path

from tests.harness.command_line import CommandLine

DRIVER = """#!/usr/bin/env python
import rospy
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry

class Driver:
    def __init__(self):
        rospy.init_node('driver')
        self.x = None
        self.pub = rospy.Publisher('/cmd_vel', Twist, queue_size=1)
        rospy.Subscriber('/odom', Odometry, self.odom)

    def odom(self, msg):
        self.x = msg.pose.pose.position.x

    def run(self):
        rate = rospy.Rate(10)
        goal = rospy.get_param('~goal')
        while not rospy.is_shutdown() and (self.x is None or self.x < goal):
            cmd = Twist()
            cmd.linear.x = rospy.get_param('/limits/speed')
            self.pub.publish(cmd)
            rate.sleep()
        self.pub.publish(Twist())
        print 'reached %.1f in a world with %s' % (goal, rospy.get_param('robot_description').count('<robot'))

if __name__ == '__main__':
    Driver().run()
"""
LAUNCH = """<launch>
  <arg name="goal" default="9"/>
  <arg name="model" default="burger"/>
  <include file="$(find gazebo_ros)/launch/empty_world.launch"><arg name="gui" value="false"/></include>
  <param name="robot_description"
         command="$(find xacro)/xacro $(find turtlebot3_description)/urdf/turtlebot3_$(arg model).urdf.xacro"/>
  <node pkg="gazebo_ros" type="spawn_model" name="spawn" args="-urdf -model tb3 -param robot_description"/>
  <rosparam file="$(find course)/config/limits.yaml" ns="limits"/>
  <include file="$(dirname)/drive.launch" pass_all_args="true"/>
</launch>
"""
DRIVE = """<launch>
  <arg name="goal"/>
  <node pkg="course" type="driver.py" name="driver" required="true"><param name="goal" value="$(arg goal)"/></node>
  <node pkg="course" type="absent" name="absent"/>
</launch>
"""


def workspace(folder: Path) -> Path:
    """Write a workspace with one read-only package."""
    package = folder / "ws/src/course_folder"
    files = {
        "package.xml": "<package><name>course</name></package>",
        "scripts/driver.py": DRIVER,
        "launch/world.launch": LAUNCH,
        "launch/drive.launch": DRIVE,
        "config/limits.yaml": "speed: 0.2\n",
    }
    for name, text in files.items():
        (package / name).parent.mkdir(parents=True, exist_ok=True)
        (package / name).write_text(text)
    for path in (package, *package.rglob("*")):
        os.chmod(path, 0o555 if path.is_dir() else 0o444)
    return folder / "ws"


def test_a_launch_file_runs_in_lockstep_and_its_program_is_graded(tmp_path: Path) -> None:
    terminal = CommandLine(workspace(tmp_path))
    terminal.environment |= {"XDG_STATE_HOME": str(tmp_path / "state"), "ROS_PACKAGE_PATH": ""}
    results = tmp_path / "results"
    run = terminal.run(
        *("roslaunch", "course", "world.launch", "goal:=0.5", "--mode", "lockstep", "--duration", "30"),
        *("--port", str(terminal.port), "--report", str(results), "--no-view", "--no-picture"),
    )
    assert run.status == 0, run.err
    assert "course/absent is left out: course has no Python program of this name" in run.err
    assert "the fleet ended: driver has finished" in run.err
    assert "reached 0.5 in a world with 1" in (results / "logs/driver.log").read_text()
    robots = json.loads((results / "report.json").read_text())["robots"]
    assert set(robots) == {"tb3"}
    assert 0.45 < robots["tb3"]["path_length_m"] < 0.7

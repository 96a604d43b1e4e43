"""The fleet turtlebot3 in real time: a program written only for a TurtleBot3 finds its topics and drives it."""

from __future__ import annotations

import json
from pathlib import Path

from tests.harness.command_line import CommandLine
from tests.harness.waiting import wait_until

PLAIN = {"/cmd_vel", "/odom", "/scan", "/imu", "/joint_states", "/camera/image", "/tf", "/tf_static", "/clock"}


def test_a_waffle_in_the_house_is_driven_by_its_plain_names(tmp_path: Path) -> None:
    terminal, results = CommandLine(tmp_path), tmp_path / "results"
    overrides = ("--set", "model=waffle", "--set", "world=house")
    started = terminal.run_fleet("turtlebot3", results, "--detach", "--no-saved", *overrides)
    try:
        assert started.status == 0, started.err
        assert set(terminal.run("topic", "list").out.split()) >= PLAIN

        def drive_on() -> bool:
            """Drive for a while, in which a busy machine may not simulate much; return whether it has moved enough."""
            driven = terminal.run("topic", "pub", "/cmd_vel", "{linear: {x: 0.2}}", "-r", "25", "-t", "40", "-q")
            assert driven.status == 0, driven.err
            odometry = json.loads(terminal.run("topic", "echo", "/odom", "--once", "--json").out)
            assert (odometry["header"]["frame_id"], odometry["child_frame_id"]) == ("odom", "base_footprint")
            return bool(odometry["pose"]["pose"]["position"]["x"] > -2.9)

        wait_until(drive_on, 60.0, "a robot that drives from x = -3 on, where TurtleBot3's house has its robot")
    finally:
        ended = terminal.run("down")
    assert ended.status == 0, ended.err
    report = json.loads((results / "report.json").read_text())
    assert report["robots"]["turtlebot3"]["path_length_m"] > 0.1
    assert report["robots"]["turtlebot3"]["odometry_error_max_m"] > 0
    notes = "\n".join(report["notes"])
    assert "Changed on the command line: model=waffle, world=house." in notes
    assert "a sender that hangs does not stop the robot" in notes
    assert "Odometry drifts as on a real robot" in notes

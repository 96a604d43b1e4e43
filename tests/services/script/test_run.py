"""The environment of a script's process."""

from __future__ import annotations

from pathlib import Path

from services.script.run import ROS_COMMANDS, ros_environment
from services.script.workspace import Workspace


def test_programs_that_a_script_starts_are_ours_and_join_its_fleet(tmp_path: Path) -> None:
    workspace = Workspace(None, (tmp_path / "a", tmp_path / "b"))
    for router, port in (
        ("unixsock-stream//tmp/elea-0/7801/router.sock", 7801),
        ("tcp/127.0.0.1:7447", 7447),
        ("unixsock-stream//elsewhere", 11311),
    ):
        found = ros_environment(workspace, router, {"PATH": f"/opt/ros/bin:{ROS_COMMANDS}:/bin"})
        assert found["PATH"].split(":") == [str(ROS_COMMANDS), "/opt/ros/bin", "/bin"]
        assert found["ROS_MASTER_URI"] == f"http://localhost:{port}"
        assert found["ROS_PACKAGE_PATH"] == f"{tmp_path / 'a'}:{tmp_path / 'b'}"
    assert (ROS_COMMANDS / "rosrun").is_file()

"""A catkin workspace in a folder, with launch files written from text."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from deploy.launch.fleet_of_launch import FleetOfLaunch, fleet_of_launch
from deploy.launch.launch_file import Launch, read_launch
from deploy.launch.packages import LaunchPackages
from services.script.workspace import workspace_of

TALKER = "#!/usr/bin/env python\nimport rospy\nrospy.init_node('talker')\n"


class LaunchWorkspace:
    """A workspace whose ``src`` has the packages ``talks`` and ``robots``."""

    def __init__(self, folder: Path) -> None:
        self.source = folder / "ws/src"
        for name in ("talks", "robots"):
            self.write(f"{name}/package.xml", f"<package><name>{name}</name></package>")
        self.write("talks/scripts/talker.py", TALKER)
        self.write("talks/nodes/listener", TALKER.replace("talker", "listener"))
        self.write("talks/scripts/keys.py", f"{TALKER}import sys, termios\n")
        self.write("talks/src/fast.cpp", "int main() {}\n")

    def write(self, name: str, text: str) -> Path:
        path = self.source / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
        return path

    def launch_file(self, text: str, name: str = "talks/launch/test.launch") -> Path:
        return self.write(name, f"<launch>\n{text}\n</launch>\n")

    def packages(self) -> LaunchPackages:
        return LaunchPackages(workspace_of(self.source, {}))

    def read(self, text: str, arguments: Mapping[str, str] | None = None) -> Launch:
        return read_launch(self.launch_file(text), arguments or {}, self.packages())

    def fleet(self, text: str, arguments: Mapping[str, str] | None = None) -> FleetOfLaunch:
        return fleet_of_launch(self.read(text, arguments), self.packages())

    def table(self, text: str) -> dict[str, Any]:
        return self.fleet(text).table

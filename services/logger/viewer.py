"""The viewer of the person at the screen."""

from __future__ import annotations

import subprocess
from collections.abc import Mapping
from pathlib import Path
from typing import Literal

import rerun_cli  # type: ignore[import-untyped]

PROGRAM = Path(rerun_cli.__file__).with_name("rerun")
"""The viewer itself; the command of the same name in the environment is a Python script that starts it."""

QUIET = {"RERUN_APP_ONLY": "true"}
"""Environment in which the viewer asks nothing and collects nothing about its use."""


def wanted(view: Literal["auto", "never", "always"], environment: Mapping[str, str]) -> bool:
    """Whether to open a window: ``auto`` does where the environment names a display."""
    shown = bool(environment.get("DISPLAY") or environment.get("WAYLAND_DISPLAY"))
    return view == "always" or (view == "auto" and shown)


def open_viewer(url: str, environment: Mapping[str, str], log: Path) -> None:
    """Start a viewer on a live recording; it belongs to the person who looks on, so it outlives this process.

    What it prints goes to ``log``. Raises OSError when it cannot be started.
    """
    _start(["--connect", url], environment, log)


def open_recording(file: Path, environment: Mapping[str, str], log: Path) -> None:
    """Start a viewer on a file, as ``open_viewer`` does."""
    _start(["--port", "0", str(file)], environment, log)


def _start(arguments: list[str], environment: Mapping[str, str], log: Path) -> None:
    with log.open("ab") as out:
        subprocess.Popen(
            [PROGRAM, "--hide-welcome-screen", "--bind", "127.0.0.1", *arguments],
            env={**environment, **QUIET},
            stdin=subprocess.DEVNULL,
            stdout=out,
            stderr=out,
            start_new_session=True,
        )

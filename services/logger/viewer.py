"""The rerun program: opens the viewer on a recording and converts bags."""

from __future__ import annotations

import subprocess
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Literal

import rerun_cli  # type: ignore[import-untyped]

from services.runtime.errors import BadInput

RERUN = Path(rerun_cli.__file__).with_name("rerun")
"""The viewer's binary; the command of the same name in the environment is a Python script that starts it."""

VIEWER_ENVIRONMENT = {"RERUN_APP_ONLY": "true"}
"""Environment in which the viewer asks no questions and collects no usage data."""


def should_open(view: Literal["auto", "never", "always"], environment: Mapping[str, str]) -> bool:
    """Whether to open a window; with ``auto`` if the environment has a display."""
    shown = bool(environment.get("DISPLAY") or environment.get("WAYLAND_DISPLAY"))
    return view == "always" or (view == "auto" and shown)


def open_viewer(url: str, environment: Mapping[str, str], log: Path) -> None:
    """Start a viewer on a live recording; it outlives this process.

    Its output goes to ``log``. Raises OSError if it cannot be started.
    """
    _start(["--connect", url], environment, log)


def open_recording(file: Path, environment: Mapping[str, str], log: Path) -> None:
    """Start a viewer on a file, as ``open_viewer`` does."""
    _start(["--port", "0", str(file)], environment, log)


def _start(arguments: list[str], environment: Mapping[str, str], log: Path) -> None:
    with log.open("ab") as out:
        subprocess.Popen(
            [RERUN, "--hide-welcome-screen", "--bind", "127.0.0.1", *arguments],
            env={**environment, **VIEWER_ENVIRONMENT},
            stdin=subprocess.DEVNULL,
            stdout=out,
            stderr=out,
            start_new_session=True,
        )


CONVERT_TIMEOUT_S = 300.0
"""Maximum wall time of the conversion [s]."""


def convert_bag(files: Sequence[Path], rrd: Path) -> None:
    """Write the MCAP ``files`` as one recording; raises BadInput if the viewer cannot read them."""
    with tempfile.TemporaryDirectory() as folder:
        parts = []
        for number, file in enumerate(files):
            parts.append(Path(folder) / f"{number}.rrd")
            _run_rerun("mcap", "convert", str(file), "-o", str(parts[-1]))
        if len(parts) > 1:
            _run_rerun("rrd", "merge", *map(str, parts), "-o", str(rrd))
        else:
            try:
                rrd.write_bytes(parts[0].read_bytes())
            except OSError as error:
                raise BadInput(f"{rrd} cannot be written: {error.strerror}") from None


def _run_rerun(*arguments: str) -> None:
    try:
        done = subprocess.run(
            [RERUN, *arguments], capture_output=True, text=True, timeout=CONVERT_TIMEOUT_S, check=False
        )
    except (OSError, subprocess.TimeoutExpired) as error:
        raise BadInput(f"the viewer's converter failed: {error}") from None
    if done.returncode:
        lines = done.stderr.strip().splitlines()
        raise BadInput(f"the viewer cannot read {arguments[2]}: {lines[-1] if lines else f'status {done.returncode}'}")

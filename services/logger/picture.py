"""Pictures of a recording, made without a screen."""

from __future__ import annotations

import io
import os
import socket
import subprocess
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

from PIL import Image
from rerun.experimental import ViewerClient

from models.palette import COLOURS
from services.logger.closeup import closeup, place_of, robots_of
from services.logger.mend import readable
from services.logger.paths import TIMELINE
from services.logger.viewer import PROGRAM, QUIET
from services.runtime.errors import BadInput, unknown

SIZE = (1920, 1080)
"""Pixels."""
MENU = 37
"""Height of the viewer's own menu, which is cut off."""
SHADES = 256
"""In a picture, those of the robots among them: a third of the size in bytes, and no difference that is seen."""
LOADING_S = 60.0
"""Wall time given to the viewer to start and to load the recording; a lap of four robots takes about 2 s."""
SETTLING_S = 30.0
"""Wall time given to the picture to come to rest."""
PAUSE_S = 0.7
"""Wall time between two looks that decide whether the picture has come to rest."""


class Shot(NamedTuple):
    """A picture to be made: its file, the simulation time [s], and the robot to look at closely.

    Without a time it is the end of the recording; without a robot, the recording as it opens.
    """

    png: Path
    at: float | None = None
    close: str = ""


def picture(rrd: Path, png: Path, at: float | None = None) -> None:
    """Write one picture of the recording as it opens; see ``pictures``."""
    pictures(rrd, [Shot(png, at)])


def pictures(rrd: Path, shots: Sequence[Shot], size: tuple[int, int] = SIZE) -> None:
    """Write pictures of ``size`` in pixels.

    Raises BadInput when the recording cannot be shown or has no such robot, or when this machine cannot draw: the text
    says what to install.
    """
    with tempfile.TemporaryDirectory() as folder:
        file = readable(rrd, Path(folder))
        robots = robots_of(file) if any(shot.close for shot in shots) else {}
        for shot in shots:
            if shot.close and shot.close not in robots:
                raise unknown("robot", shot.close, robots, str(rrd))
        _take(rrd, file, shots, size, robots)


def _take(rrd: Path, file: Path, shots: Sequence[Shot], size: tuple[int, int], robots: dict[str, float]) -> None:
    """Take the pictures of ``file``, which is the recording ``rrd`` without its torn end."""
    with headless(file, size) as viewer:
        timeline, end = _timeline(viewer)
        whole = viewer.get_blueprint(of="recording").blueprint
        for shot in shots:
            now = end if shot.at is None else shot.at
            layout = whole
            if shot.close:
                place = place_of(file, shot.close, timeline, now)
                layout = closeup(whole, robots[shot.close], shot.close, place)
            viewer.set_blueprint(layout, of="recording")
            viewer.set_time(timeline, duration=now, play_state="paused")
            _write(shot.png, _framed(_at_rest(viewer)))
            _check(viewer, rrd)


@contextmanager
def headless(rrd: Path, size: tuple[int, int] = SIZE) -> Iterator[ViewerClient]:
    """A viewer without a window that shows the recording; it listens on 127.0.0.1 only and ends with the block.

    A recording whose writer was killed is shown up to its torn end.
    Raises BadInput when it cannot start or does not show the recording within LOADING_S.
    """
    port = _free_port()
    command = [str(PROGRAM), "--headless", "--bind", "127.0.0.1", "--port", str(port), "--hide-welcome-screen"]
    command += ["--window-size", f"{size[0]}x{size[1] + MENU}"]
    with tempfile.TemporaryDirectory() as folder, tempfile.TemporaryFile() as said:
        command.append(str(readable(rrd, Path(folder)).absolute()))
        try:
            process = subprocess.Popen(
                command, env={**os.environ, **QUIET}, stdin=subprocess.DEVNULL, stdout=said, stderr=said
            )
        except OSError as error:
            raise BadInput(f"the viewer cannot be started: {error}") from None
        try:
            yield _loaded(process, f"rerun+http://127.0.0.1:{port}/proxy", rrd)
        except (RuntimeError, ConnectionError) as error:
            said.seek(0)
            raise BadInput(_reason(said.read().decode(errors="replace"), str(error))) from None
        finally:
            process.terminate()
            try:
                process.wait(5.0)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()


def _loaded(process: subprocess.Popen[bytes], url: str, rrd: Path) -> ViewerClient:
    """The viewer, once all of the recording has arrived; raises ConnectionError when it has ended."""
    deadline = time.monotonic() + LOADING_S
    viewer: ViewerClient | None = None
    while time.monotonic() < deadline:
        if process.poll() is not None:
            raise ConnectionError(f"the viewer ended with status {process.returncode}")
        try:
            viewer = viewer or ViewerClient.connect(url)
            state = viewer.get_state()
        except (RuntimeError, ConnectionError):
            viewer = None
        else:
            if state.recordings and not state.loading and state.recordings[0].timelines:
                return viewer
            if refused := [each.message for each in viewer.get_logs() if each.level == "ERROR"]:
                raise BadInput(f"{rrd} cannot be shown: {refused[-1]}")
        time.sleep(0.1)
    raise BadInput(f"the viewer did not show {rrd} within {LOADING_S:.0f} s of wall time")


def _timeline(viewer: ViewerClient) -> tuple[str, float]:
    """The timeline that the recording opens on, and its end [s]."""
    recording = viewer.get_state().recordings[0]
    name = recording.current_timeline or TIMELINE
    ends = [each.end for each in recording.timelines if each.name == name and each.end is not None]
    return name, (ends[0] if ends else 0) / 1e9


def _at_rest(viewer: ViewerClient) -> bytes:
    """The PNG of a picture that no longer changes and misses nothing; the last one, if it never rests."""
    deadline = time.monotonic() + SETTLING_S
    before, now = b"", viewer.take_screenshot()
    while time.monotonic() < deadline:
        if now == before and not viewer.get_transform_graph()["missing_chunks"]:
            break
        time.sleep(PAUSE_S)
        before, now = now, viewer.take_screenshot()
    return now


def _check(viewer: ViewerClient, rrd: Path) -> None:
    """Raise BadInput for a view that reports an error."""
    for view in viewer.get_state().views:
        for report in view.reports:
            if report.severity == "error":
                raise BadInput(f"{rrd}: the view {view.name!r} cannot be drawn: {report.summary}")


def _write(png: Path, taken: bytes) -> None:
    try:
        png.write_bytes(taken)
    except OSError as error:
        raise BadInput(f"the picture cannot be written: {error}") from None


def _framed(taken: bytes) -> bytes:
    """The picture without the viewer's menu, small enough to be kept beside text."""
    with Image.open(io.BytesIO(taken)) as whole, io.BytesIO() as out:
        below = whole.convert("RGB").crop((0, MENU, whole.width, whole.height))
        palette = below.quantize(SHADES - len(COLOURS), Image.Quantize.MEDIANCUT)
        palette.putpalette(bytes([*(palette.getpalette() or []), *(part for each in COLOURS for part in each)]))
        below.quantize(palette=palette, dither=Image.Dither.NONE).save(out, "PNG", optimize=True)
        return out.getvalue()


def _reason(said: str, error: str) -> str:
    """Why the viewer failed, from what it printed."""
    if "render context" in said or "graphics adapter" in said or "No suitable" in said:
        return (
            "no picture: this machine has no Vulkan driver to draw with; "
            "on Debian: apt-get install --no-install-recommends libvulkan1 mesa-vulkan-drivers"
        )
    last = next((line for line in reversed(said.splitlines()) if "panicked" in line or "ERROR" in line), "")
    return f"no picture: the viewer failed: {last or error}"


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
    return port

"""Screenshots of a recording by a headless viewer: repair of a truncated file, close views, PNG files."""

from __future__ import annotations

import copy
import io
import os
import subprocess
import tempfile
import time
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import numpy as np
from PIL import Image
from rerun.chunk import RrdReader
from rerun.experimental import ViewerClient

from models.palette import COLOURS
from services.logger import entity_paths
from services.logger.entity_paths import TIMELINE
from services.logger.scene import ARM_LABEL_HEIGHT, DISC_MARGIN
from services.logger.viewer import RERUN, VIEWER_ENVIRONMENT
from services.runtime.errors import BadInput, unknown_name
from services.runtime.ports import free_port

T = TypeVar("T")

REPAIR_TIMEOUT_S = 120.0
"""Maximum wall time of the repair [s]."""


def repaired(rrd: Path, folder: Path) -> Path:
    """Return the recording itself, or a copy in ``folder`` without its truncated end.

    Raises BadInput if neither can be read, or if nothing in it has a time, since the viewer would wait for it.
    """
    if not rrd.is_file():
        raise BadInput(f"no recording {rrd}")
    problem = _read_error(rrd)
    if not problem:
        if not _has_times(rrd):
            raise BadInput(f"{rrd} contains only static shapes: did its logger end before the run began?")
        return rrd
    repaired_file = folder / f"repaired-{rrd.name}"
    try:
        subprocess.run(
            [RERUN, "rrd", "optimize", rrd, "-o", repaired_file], capture_output=True, timeout=REPAIR_TIMEOUT_S
        )
    except subprocess.TimeoutExpired:
        raise BadInput(f"{rrd} could not be repaired within {REPAIR_TIMEOUT_S:.0f} s of wall time") from None
    if not repaired_file.is_file() or _read_error(repaired_file):
        raise BadInput(f"{rrd} is not a recording that can be shown: {problem}")
    if not _has_times(repaired_file):
        raise BadInput(
            f"{rrd} is cut off after {rrd.stat().st_size} bytes, before anything that moves was recorded, so there is "
            f"nothing to show: was it copied completely? ({problem})"
        )
    return repaired_file


def _read_error(rrd: Path) -> str:
    """Explain why rerun cannot read the file; empty if it can."""
    try:
        recordings = _reader(rrd).recordings()
    except RuntimeError as error:
        return str(error)
    return "" if recordings else "it holds no recording"


def _has_times(rrd: Path) -> bool:
    """Whether anything in a recording has a time; raises BadInput for a damaged one."""
    try:
        return any(chunk.timeline_names for chunk in _reader(rrd).stream())
    except RuntimeError as error:
        raise BadInput(f"{rrd} is damaged: {error}") from None


def _reader(rrd: Path) -> RrdReader:
    """Open a recording without rerun's warning about a missing footer: a run is written as it goes, and has none."""
    with warnings.catch_warnings(action="ignore"):
        return RrdReader(rrd)


Layout = dict[str, Any]
Point = tuple[float, float, float]

EYE_DIRECTION = (-0.45, -0.75, 0.55)
"""Direction from a robot to the eye, scaled by its distance: south-west and above."""

EYE_DISTANCE, EYE_DISTANCE_RADII = 0.7, 5.0
"""Distance of the eye: a constant [m] plus a multiple of the robot's radius."""


def robot_radii(rrd: Path) -> dict[str, float]:
    """Return the robots of a recording with the radius [m] of their footprint; 0 for an arm."""
    found: dict[str, float] = {}
    for chunk in _reader(rrd).stream():
        name, _, rest = chunk.entity_path.removeprefix("/").partition("/")
        if rest == "marker/name":
            found.setdefault(name, 0.0)
        elif rest == "marker":
            radii = chunk.to_record_batch().column("Cylinders3D:radii").to_pylist()
            found[name] = float(radii[0][0]) - DISC_MARGIN
    return found


def robot_position(rrd: Path, robot: str, timeline: str, at: float) -> Point:
    """Return the true position of a robot's base [m] at a time [s]; raises BadInput if it is not in the recording."""
    latest, place = -1, None
    for chunk in _reader(rrd).stream():
        if chunk.entity_path != entity_paths.transforms(robot) or timeline not in chunk.timeline_names:
            continue
        batch = chunk.to_record_batch()
        times = np.array(batch.column(timeline).cast("int64").to_pylist(), np.int64)
        parents = batch.column("Transform3D:parent_frame").to_pylist()
        spots = batch.column("Transform3D:translation").to_pylist()
        for stamp, parent, spot in zip(times, parents, spots, strict=True):
            if parent == ["world"] and latest < stamp <= round(at * 1e9):
                latest, place = int(stamp), spot[0]
    if place is None:
        raise BadInput(f"{rrd}: the position of {robot} is not known at {at:g} s of simulation time")
    return float(place[0]), float(place[1]), float(place[2])


def close_view(layout: Layout, radius: float, robot: str, place: Point) -> Layout:
    """Return the layout with the eye next to ``robot`` at ``place``, its plots in front, and plots up to the cursor."""
    made = copy.deepcopy(layout)
    for path, parts in layout.items():
        name = parts.get("ViewBlueprint", {}).get("display_name")
        if name == "World":
            made[f"{path}/EyeControls3D"] = {"EyeControls3D": _eye(place, radius)}
        if "TimeAxis" in parts:
            made[path]["TimeAxis"]["view_range"] = {"start": "Infinite", "end": {"CursorRelative": 0}}
        own = parts.get("ContainerBlueprint", {})
        if own.get("display_name") == "plots":
            for each in own["contents"]:
                if layout.get(f"/{each}", {}).get("ContainerBlueprint", {}).get("display_name") == robot:
                    made[path]["ContainerBlueprint"]["active_tab"] = each
    return made


def _eye(place: Point, radius: float) -> dict[str, list[float]]:
    is_arm = radius <= 0
    away = EYE_DISTANCE + EYE_DISTANCE_RADII * (ARM_LABEL_HEIGHT / 3 if is_arm else radius)
    height = ARM_LABEL_HEIGHT / 2 if is_arm else radius / 2
    target = [place[0], place[1], place[2] + height]
    # An arm swings in its x-z plane and is best viewed along y.
    side = (-0.25, -0.9, 0.3) if is_arm else EYE_DIRECTION
    return {
        "position": [each + away * part for each, part in zip(target, side, strict=True)],
        "look_target": target,
        "eye_up": [0.0, 0.0, 1.0],
    }


SIZE = (1920, 1080)
"""Default size of a screenshot [pixels]."""
MENU_HEIGHT = 37
"""Height of the viewer's menu [pixels], which is cropped."""
PALETTE_SIZE = 256
"""Number of colours in an image, including those of the robots: a third of the size, without a visible difference."""
LOAD_TIMEOUT_S = 180.0
"""Maximum wall time [s] for the viewer to start and load the recording; a lap of four robots takes about 2 s."""
DRAW_TIMEOUT_S = 180.0
"""Maximum wall time [s] of one request to the viewer, which may have to draw first, in software on a busy machine."""
SETTLE_TIMEOUT_S = 30.0
"""Maximum wall time [s] for the image to settle."""
SETTLE_PERIOD_S = 0.7
"""Wall time [s] between two images that are compared to decide whether it has settled."""


class Screenshot(NamedTuple):
    """A screenshot to take: its file, the simulation time [s], and the robot to view closely.

    By default, the time is the end of the recording, and the view its initial one.
    """

    png: Path
    at: float | None = None
    robot: str = ""


def screenshots(rrd: Path, shots: Sequence[Screenshot], size: tuple[int, int] = SIZE) -> None:
    """Write screenshots of ``size`` in pixels.

    Raises BadInput if the recording cannot be displayed, has no such robot, or this machine cannot render; the error
    then says what to install.
    """
    with tempfile.TemporaryDirectory() as folder:
        file = repaired(rrd, Path(folder))
        robots = robot_radii(file) if any(shot.robot for shot in shots) else {}
        for shot in shots:
            if shot.robot and shot.robot not in robots:
                raise unknown_name("robot", shot.robot, robots, str(rrd))
        _capture(rrd, file, shots, size, robots)


def _capture(
    rrd: Path, file: Path, shots: Sequence[Screenshot], size: tuple[int, int], robots: dict[str, float]
) -> None:
    """Take screenshots of ``file``, the recording ``rrd`` or its repaired copy."""
    with headless_viewer(file, size) as viewer:
        timeline, end = _timeline(viewer)
        initial_layout = wait_for_reply(partial(viewer.get_blueprint, of="recording")).blueprint
        for shot in shots:
            now = end if shot.at is None else shot.at
            layout = initial_layout
            if shot.robot:
                place = robot_position(file, shot.robot, timeline, now)
                layout = close_view(initial_layout, robots[shot.robot], shot.robot, place)
            wait_for_reply(partial(viewer.set_blueprint, layout, of="recording"))
            wait_for_reply(partial(viewer.set_time, timeline, duration=now, play_state="paused"))
            _write(shot.png, _cropped(_settled_image(viewer)))
            _check(viewer, rrd)


@contextmanager
def headless_viewer(rrd: Path, size: tuple[int, int] = SIZE) -> Iterator[ViewerClient]:
    """Run a headless viewer of the recording, which listens on 127.0.0.1 only and ends with the block.

    A recording whose logger was killed is displayed up to its truncated end. Raises BadInput if the viewer cannot start
    or does not display the recording within LOAD_TIMEOUT_S.
    """
    port = free_port()
    command = [str(RERUN), "--headless", "--bind", "127.0.0.1", "--port", str(port), "--hide-welcome-screen"]
    command += ["--window-size", f"{size[0]}x{size[1] + MENU_HEIGHT}"]
    with tempfile.TemporaryDirectory() as folder, tempfile.TemporaryFile() as output:
        command.append(str(repaired(rrd, Path(folder)).absolute()))
        try:
            process = subprocess.Popen(
                command,
                env={**os.environ, **VIEWER_ENVIRONMENT},
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=output,
            )
        except OSError as error:
            raise BadInput(f"the viewer cannot be started: {error}") from None
        try:
            yield _loaded(process, f"rerun+http://127.0.0.1:{port}/proxy", rrd)
        except TimeoutError:
            raise BadInput(f"no screenshot: the viewer of {rrd} did not answer in time: is the machine busy?") from None
        except (RuntimeError, ConnectionError) as error:
            output.seek(0)
            raise BadInput(_failure_reason(output.read().decode(errors="replace"), str(error))) from None
        finally:
            process.terminate()
            try:
                process.wait(5.0)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()


def _loaded(process: subprocess.Popen[bytes], url: str, rrd: Path) -> ViewerClient:
    """Return the viewer once the whole recording has arrived; raises ConnectionError if it has ended."""
    deadline = time.monotonic() + LOAD_TIMEOUT_S
    viewer: ViewerClient | None = None
    while time.monotonic() < deadline:
        if process.poll() is not None:
            raise ConnectionError(f"the viewer ended with status {process.returncode}")
        try:
            viewer = viewer or ViewerClient.connect(url)
            state = viewer.get_state()
            errors = [each.message for each in viewer.get_logs() if each.level == "ERROR"]
        except (RuntimeError, ConnectionError, TimeoutError):
            viewer = None
        else:
            if state.recordings and not state.loading and state.recordings[0].timelines:
                return viewer
            if errors:
                raise BadInput(f"{rrd} cannot be shown: {errors[-1]}")
        time.sleep(0.1)
    raise BadInput(f"the viewer did not show {rrd} within {LOAD_TIMEOUT_S:.0f} s of wall time")


def _timeline(viewer: ViewerClient) -> tuple[str, float]:
    """Return the initial timeline of the recording, and its end [s]."""
    recording = wait_for_reply(viewer.get_state).recordings[0]
    name = recording.current_timeline or TIMELINE
    ends = [each.end for each in recording.timelines if each.name == name and each.end is not None]
    return name, (ends[0] if ends else 0) / 1e9


def _settled_image(viewer: ViewerClient) -> bytes:
    """Return a PNG of the view once it no longer changes and is complete; the last one if it never settles."""
    deadline = time.monotonic() + SETTLE_TIMEOUT_S
    before, now = b"", wait_for_reply(viewer.take_screenshot)
    while time.monotonic() < deadline:
        if now == before and not wait_for_reply(viewer.get_transform_graph)["missing_chunks"]:
            break
        time.sleep(SETTLE_PERIOD_S)
        before, now = now, wait_for_reply(viewer.take_screenshot)
    return now


def wait_for_reply(ask: Callable[[], T]) -> T:
    """Repeat a request to the viewer until it replies; raises TimeoutError after DRAW_TIMEOUT_S.

    Its client waits for 15 s at most, and a viewer that draws does not reply.
    """
    deadline = time.monotonic() + DRAW_TIMEOUT_S
    while True:
        try:
            return ask()
        except TimeoutError:
            if time.monotonic() > deadline:
                raise


def _check(viewer: ViewerClient, rrd: Path) -> None:
    """Raise BadInput for a view that reports an error."""
    for view in wait_for_reply(viewer.get_state).views:
        for report in view.reports:
            if report.severity == "error":
                raise BadInput(f"{rrd}: the view {view.name!r} cannot be drawn: {report.summary}")


def _write(png: Path, taken: bytes) -> None:
    try:
        png.write_bytes(taken)
    except OSError as error:
        raise BadInput(f"the picture cannot be written: {error}") from None


def _cropped(taken: bytes) -> bytes:
    """Return the image without the viewer's menu, reduced to a palette."""
    with Image.open(io.BytesIO(taken)) as image, io.BytesIO() as out:
        below = image.convert("RGB").crop((0, MENU_HEIGHT, image.width, image.height))
        palette = below.quantize(PALETTE_SIZE - len(COLOURS), Image.Quantize.MEDIANCUT)
        palette.putpalette(bytes([*(palette.getpalette() or []), *(part for each in COLOURS for part in each)]))
        below.quantize(palette=palette, dither=Image.Dither.NONE).save(out, "PNG", optimize=True)
        return out.getvalue()


def _failure_reason(output: str, error: str) -> str:
    """Return the reason why the viewer failed, from its output."""
    if "render context" in output or "graphics adapter" in output or "No suitable" in output:
        return (
            "no picture: this machine has no Vulkan driver to draw with; "
            "on Debian: apt-get install --no-install-recommends libvulkan1 mesa-vulkan-drivers"
        )
    last = next((line for line in reversed(output.splitlines()) if "panicked" in line or "ERROR" in line), "")
    return f"no picture: the viewer failed: {last or error}"

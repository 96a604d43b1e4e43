"""``elea view``: open a run in the viewer, or render it to pictures without a display."""

from __future__ import annotations

import os
import re
import sys
from pathlib import Path

import click

from deploy.commands.options import json_option
from services.runtime.errors import BadInput

MAX_TIME_S = 1e9
MIN_PIXELS, MAX_PIXELS = 320, 4096
"""Limits of a picture's width and height in pixels."""


@click.command("view")
@click.argument("run", required=False, type=click.Path(path_type=Path))
@click.option("--picture", is_flag=True, help="Render pictures even if there is a display.")
@click.option(
    "--at", "times", multiple=True, type=float, metavar="S", help="Simulation time of a picture; the end by default."
)
@click.option("--close", multiple=True, metavar="ROBOT", help="Also render a close-up of this robot.")
@click.option("--size", default="1920x1080", metavar="WxH", show_default=True, help="Size of the pictures, in pixels.")
@click.option("-o", "--output", default="", help="Folder for the pictures; next to the recording by default.")
@json_option
def command(
    run: Path | None,
    picture: bool,
    times: tuple[float, ...],
    close: tuple[str, ...],
    size: str,
    output: str,
    as_json: bool,
) -> None:
    """Open RUN in the viewer: a run folder, an .rrd file or a bag; the latest run by default.

    Without a display, or with --picture, render pictures and print where they are.
    """
    import json

    from services.logger.viewer import open_recording, should_open

    pixels = _parse_size(size)
    for at in times:
        if not 0 <= at < MAX_TIME_S:
            raise BadInput(f"--at {at:g}: expected seconds of simulation time, from 0 on")
    recording = _recording(_latest_run() if run is None else run)
    if should_open("auto", os.environ) and not picture:
        try:
            open_recording(recording, os.environ, recording.with_suffix(".viewer.log"))
        except OSError as error:
            raise BadInput(f"the viewer cannot be started: {error}") from None
        made = []
        sys.stderr.write(f"the viewer opens {recording}\n")
    else:
        made = _pictures(recording, times, close, pixels, Path(output).absolute() if output else recording.parent)
    if as_json:
        sys.stdout.write(json.dumps({"recording": str(recording), "pictures": [str(each) for each in made]}) + "\n")
    else:
        sys.stdout.write("".join(f"{each}\n" for each in made))


def _recording(run: Path) -> Path:
    """Return the recording to show; that of a bag is created next to it, again if the bag is newer."""
    from deploy.run_folder import BAG_FOLDER, RECORDING_FILE, STATE_FILE
    from services.logger.file_rotation import rotated

    if not run.exists():
        raise BadInput(f"there is no run {run}: give the folder of a run, an .rrd, or a bag")
    if run.suffix == ".rrd":
        return run.absolute()
    if (recording := (run / RECORDING_FILE).absolute()).is_file():
        if before := rotated(recording):
            names = " and ".join(each.name for each in before)
            sys.stderr.write(f"elea: the logger was restarted; its earlier recordings are {names} in the same folder\n")
        return recording
    if (run / BAG_FOLDER).is_dir():
        return _convert_bag(run / BAG_FOLDER)
    if (run / STATE_FILE).is_file():
        raise BadInput(
            f"the run {run} has no recording: give its fleet a [[service]] of kind logger, or start it with --record"
        )
    return _convert_bag(run)


def _convert_bag(path: Path) -> Path:
    from deploy.bag_export import export_bag
    from services.bag.reader import open_bag

    bag, resolved = open_bag(path), path.resolve()
    made = resolved.with_name(f"{resolved.stem if resolved.is_file() else resolved.name}.rrd")
    newest = max(each.stat().st_mtime for each in bag.files)
    if not made.is_file() or made.stat().st_mtime < newest:
        part = made.with_name(f".{made.name}")  # an unfinished file must not be mistaken for the bag's recording
        result = export_bag(path, "rrd", str(part))
        try:
            part.replace(made)
        except OSError as error:
            raise BadInput(f"{made} cannot be written: {error.strerror}") from None
        for problem in result.problems:
            sys.stderr.write(f"elea: {problem}\n")
    return made


def _parse_size(size: str) -> tuple[int, int]:
    match = re.fullmatch(r"(\d{3,4})x(\d{3,4})", size)
    if match is None or not all(MIN_PIXELS <= int(each) <= MAX_PIXELS for each in match.groups()):
        raise BadInput(f"--size {size!r}: expected WIDTHxHEIGHT, each from {MIN_PIXELS} to {MAX_PIXELS} pixels")
    return int(match[1]), int(match[2])


def _pictures(
    recording: Path, times: tuple[float, ...], close: tuple[str, ...], size: tuple[int, int], folder: Path
) -> list[Path]:
    from services.logger.screenshots import Screenshot, screenshots

    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise BadInput(f"{folder} cannot be written: {error.strerror}") from None
    shots = []
    for at in times or (None,):
        for robot in ("", *close):
            name = "-".join(filter(None, (recording.stem, robot, "" if at is None else f"{at:g}s")))
            shots.append(Screenshot(folder / f"{name}.png", at, robot))
    screenshots(recording, shots, size)
    return [each.png for each in shots]


def _latest_run() -> Path:
    from deploy.run_folder import latest_run_folder

    if (folder := latest_run_folder()) is None:
        raise BadInput("there is no run yet: start one with ./elea up, or name a recording")
    return folder

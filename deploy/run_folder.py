"""The folder of a run: logs, state, recording, measurements and report."""

from __future__ import annotations

import tempfile
from contextlib import suppress
from datetime import datetime
from pathlib import Path

import msgspec

from deploy.report.record import PICTURE_FILE, REPORT_FILE
from messages.base import DECODE_ERRORS
from messages.elea import FleetState
from services.grader.records import MEASUREMENTS_FILE, TRAJECTORIES_FILE
from services.logger.file_rotation import rotated
from services.panel.address import ADDRESS_FILE as PANEL_FILE
from services.runtime.atomic_file import write_atomic
from services.runtime.errors import BadInput
from services.runtime.fleet_instances import latest, running_fleets
from services.runtime.user_folders import runs_folder
from services.square import LOG_FILE

RECORDING_FILE = "run.rrd"
BAG_FOLDER = "bag"
"""The recorder's folder within that of the run."""
METADATA_FILE = "metadata.yaml"
STATE_FILE = "processes.json"
STOPS_FILE = "stops.json"
"""The simulation's file of emergency stops, so that they survive its restart. A new run begins without any."""
SCHEDULE_FILE = "schedule.json"
"""The scheduled parameter changes that were made, for a restart of the run's parameter service."""
ROSPARAM_FILE = "rosparam.json"
"""The initial tree of ROS 1 parameters of the run."""
CONTAINERS_FOLDER = "containers"
"""A file with the command lines of its nodes for each process that several nodes share."""
SUPERVISOR_LOG = "supervisor.log"
"""The log of a supervisor in the background, in the run's folder."""

MIN_FREE_BYTES = 1 << 20
"""Disk space [bytes] that a run needs at least: logs, figures, report and picture."""

_FILES = (
    MEASUREMENTS_FILE,
    TRAJECTORIES_FILE,
    REPORT_FILE,
    PICTURE_FILE,
    STATE_FILE,
    STOPS_FILE,
    SCHEDULE_FILE,
    ROSPARAM_FILE,
    LOG_FILE,
    PANEL_FILE,
)


def make_run_folder(fleet: str, report: str = "", runs: str = "", now: datetime | None = None) -> Path:
    """Create the folder of a new run; raises BadInput if it cannot be written, or if a running fleet uses it.

    It is ``report`` if given, else ``<time>-<fleet>`` in ``runs``, by default in the user's folder of runs. Files of an
    earlier run in ``report`` are removed, so that they are not mistaken for this run's. Links are not followed: other
    users may be able to write in that folder.
    """
    moment = f"{now or datetime.now():%Y%m%d-%H%M%S}-{fleet}"
    path = Path(report).absolute() if report else _unused((Path(runs).absolute() if runs else runs_folder()) / moment)
    if report:
        _check_no_fleet_uses(path)
    try:
        path.mkdir(parents=True, exist_ok=True)
        for name in ("logs", BAG_FOLDER):
            if (path / name).is_symlink():
                raise BadInput(f"{path / name} is a symbolic link: remove it, or choose another folder with --report")
        (path / "logs").mkdir(exist_ok=True)
        check_free_space(path)
        for name in _FILES:
            (path / name).unlink(missing_ok=True)
        for part in (path / BAG_FOLDER).glob("*"):
            if part.name == METADATA_FILE or part.suffix == ".mcap":
                part.unlink()
        for each in (path / RECORDING_FILE, *rotated(path / RECORDING_FILE), *(path / "logs").glob("*.log*")):
            each.unlink(missing_ok=True)
    except OSError as error:
        raise BadInput(
            f"the folder {path} cannot be written: {error.strerror}; choose one with --report or --runs"
        ) from None
    return path


def _check_no_fleet_uses(path: Path) -> None:
    """Raise BadInput if a running fleet of this user writes its results to the folder."""
    for each in running_fleets():
        try:
            used = path.samefile(each.folder)
        except OSError:  # one of them does not exist
            continue
        if used:
            raise BadInput(
                f"the running fleet {each.fleet} (supervisor {each.pid}, since {each.started}) writes its results to "
                f"{path}: stop it with ./elea down --port {each.port}, or choose another folder with --report"
            )


def check_free_space(path: Path) -> None:
    """Raise OSError if MIN_FREE_BYTES cannot be written, as on a full disk, which still allows
    creating an empty file.
    """
    with tempfile.TemporaryFile(dir=path, buffering=0) as file:
        written = 0
        while written < MIN_FREE_BYTES:
            written += file.write(bytes(MIN_FREE_BYTES - written))


def latest_run_folder() -> Path | None:
    """Return the folder of the run that this user started last; None if there is none."""
    entry = latest()
    claimed = [Path(entry.folder)] if entry is not None else []
    folders = [each for each in (*claimed, *runs_folder().glob("*")) if (each / "logs").is_dir()]
    return max(folders, key=lambda each: (each / "logs").stat().st_mtime_ns, default=None)


def write_state(path: Path, state: FleetState) -> None:
    """Write the fleet's state next to the logs, atomically; on a full disk the old state stays.

    It is not synced to the disk: after a power failure no fleet runs.
    """
    with suppress(OSError):
        write_atomic(path / STATE_FILE, msgspec.json.encode(state))


def read_state(path: Path) -> FleetState | None:
    """Return the state that a supervisor wrote to a run's folder; None if it is missing or unreadable."""
    try:
        return msgspec.json.decode((path / STATE_FILE).read_bytes(), type=FleetState)
    except (OSError, *DECODE_ERRORS):
        return None


def _unused(path: Path) -> Path:
    """Return the path, with a number appended if it exists: runs of the same second get different folders."""
    number, candidate = 1, path
    while candidate.exists():
        number += 1
        candidate = path.with_name(f"{path.name}-{number}")
    return candidate
